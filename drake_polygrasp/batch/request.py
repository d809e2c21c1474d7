"""A batch as it is asked for, and the checks of its arguments."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drake_polygrasp.arguments import check_count, check_items, check_number, check_path, refuse
from drake_polygrasp.batch.options import BatchOptions, make_batch_options
from drake_polygrasp.batch.rows import STATUSES
from drake_polygrasp.batch.sources import Sources, check_sources
from drake_polygrasp.batch.supervisor import TaskLimits

PLANNER = "drake_polygrasp.batch.worker:plan_model"
"""What children call for each object."""


@dataclass(frozen=True)
class BatchRequest:
    """A batch as it is asked for, with arguments that are valid.

    Attributes:
        sources: models, folders, patterns, lists of paths and URIs.
        out: folder, or address of a bucket, of the results.
        options: what is asked for each object.
        executor: what carries chunks of objects; None for children of this process.
        workers: number of children, or of chunks that the executor runs at once; None for the
            number of processors.
        limits: time and memory of each object.
        shard: number of this shard, from 1, and number of shards.
        retry: statuses of results that are made again.
        limit: how many objects are planned at most; None for all.
        function: what children call, as "package.module:name".
    """

    sources: tuple[str, ...]
    out: str
    options: BatchOptions = field(default_factory=BatchOptions)
    executor: Executor | None = None
    workers: int | None = None
    limits: TaskLimits = field(default_factory=TaskLimits)
    shard: tuple[int, int] = (1, 1)
    retry: tuple[str, ...] = ()
    limit: int | None = None
    function: str = PLANNER


def make_batch_request(
    sources: Sources,
    out: str | Path,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    timeout: float = 60.0,
    memory: int = 4 << 30,
    shard: tuple[int, int] = (1, 1),
    retry: Sequence[str] = (),
    limit: int | None = None,
    function: str = PLANNER,
    **plan_options: Any,
) -> BatchRequest:
    """Checks the arguments of `plan_batch`.

    Args:
        sources: as for `plan_batch`.
        out: as for `plan_batch`.
        executor: as for `plan_batch`.
        workers: as for `plan_batch`.
        timeout: as for `plan_batch`.
        memory: as for `plan_batch`.
        shard: as for `plan_batch`.
        retry: as for `plan_batch`.
        limit: as for `plan_batch`.
        function: what children call, as "package.module:name", in place of the planner.
        plan_options: as for `plan_batch`.

    Returns:
        The batch.

    Raises:
        UsageError: when an argument has the wrong type or value.
    """
    if executor is not None and not isinstance(executor, Executor):
        raise refuse("executor", executor, "a concurrent.futures.Executor, or None")
    out = check_path("out", out)
    if not str(out):
        raise refuse("out", out, "a folder")
    bytes_ = check_number("memory", memory, "a number of bytes, 256 MiB or more", least=256 << 20)
    pair = check_items("shard", shard)
    if len(pair) != 2:
        raise refuse("shard", shard, "two whole numbers, (i, n)")
    index, count = (check_count(f"shard[{k}]", number) for k, number in enumerate(pair))
    if index > count:
        raise refuse("shard", shard, "(i, n) with i at most n")
    statuses = check_items("retry", retry)
    for status in statuses:
        if status not in STATUSES[1:]:
            raise refuse("retry", retry, f"a list of some of {', '.join(STATUSES[1:])}")
    return BatchRequest(
        sources=check_sources(sources),
        out=str(out),
        options=make_batch_options(plan_options),
        executor=executor,
        workers=None if workers is None else check_count("workers", workers),
        limits=TaskLimits(
            check_number("timeout", timeout, "a time above 0 s", above=0.0), int(bytes_)
        ),
        shard=(index, count),
        retry=tuple(statuses),
        limit=None if limit is None else check_count("limit", limit),
        function=function,
    )
