"""Keys of results: SHA-256 of a model's contents, the options and the versions that planned it."""

from __future__ import annotations

import hashlib
from collections.abc import Generator, Iterable
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from drake_polygrasp.batch.options import BatchOptions
from drake_polygrasp.batch.supervisor import ChildTask, Supervisor, TaskLimits
from drake_polygrasp.errors import BatchError

_BATCH = 32
"""Models that are read at once: few enough that planning starts soon. Our choice."""
_MAX_BYTES = 100_000_000
"""How much of a file that cannot be read as a model counts in its key. Our choice."""


def model_key(contents: str, options: BatchOptions) -> str:
    """Returns the key of a model's result.

    Args:
        contents: digest of the model's files.
        options: what is asked for it.
    """
    return hashlib.sha256(f"{contents}\0{options.identity}".encode()).hexdigest()


def body_key(key: str, body: str) -> str:
    """Returns the key of the result of one body of a model that has several.

    Args:
        key: the model's key.
        body: name of the body.
    """
    return hashlib.sha256(f"{key}\0{body}".encode()).hexdigest()


def in_shard(key: str, index: int, count: int) -> bool:
    """Returns whether a key belongs to a shard; each belongs to one, in any order of the models.

    Args:
        key: the model's key.
        index: number of the shard, from 1.
        count: number of shards.
    """
    return int(key[:15], 16) % count == index - 1


def read_contents(
    models: Iterable[str], options: BatchOptions, limits: TaskLimits
) -> Generator[tuple[str, str]]:
    """Computes the digest of each model's files, in a child process.

    Args:
        models: paths and URIs, consumed lazily.
        options: say where packages are.
        limits: limits of reading one model.

    Yields:
        Each model and its digest. One that cannot be read has a digest of what can be known of it;
        what is wrong with it is found again, and said, where it is planned.
    """
    load = options.request["load"]
    places = {name: load[name] for name in ("package_paths", "packages")}
    remaining = iter(models)
    with Supervisor("drake_polygrasp.batch.reader:digest_models", 1, limits) as supervisor:
        while batch := list(islice(remaining, _BATCH)):
            yield from zip(batch, _digests(supervisor, batch, places), strict=True)


def _digests(supervisor: Supervisor, models: list[str], places: dict[str, Any]) -> list[str]:
    """Returns the digests of some models; one by one where one of them ends the child."""
    tasks = [ChildTask("", {"models": models, **places})]
    (outcome,) = supervisor.run(lambda: tasks.pop() if tasks else None, lambda: False)
    if outcome.ending == "answered":
        digests: list[str] = outcome.value
        return digests
    if len(models) == 1:
        return [unread_digest(models[0], outcome.reason)]
    return [digest for model in models for digest in _digests(supervisor, [model], places)]


def with_hand_read(options: BatchOptions, limits: TaskLimits) -> BatchOptions:
    """Reads the hand of a batch, in a child process, for its digest.

    Args:
        options: what is asked for each object.
        limits: limits of reading the hand.

    Returns:
        The options with the digest; as they are where there is no hand.

    Raises:
        BatchError: when the hand cannot be used.
    """
    if options.hand is None:
        return options
    load = options.request["load"]
    places = {name: load[name] for name in ("package_paths", "packages")}
    tasks = [ChildTask("", {"description": options.hand.description, **places})]
    with Supervisor("drake_polygrasp.batch.reader:digest_hand", 1, limits) as supervisor:
        (outcome,) = supervisor.run(lambda: tasks.pop() if tasks else None, lambda: False)
    if outcome.ending != "answered":
        raise BatchError(f"{options.hand.description}: {outcome.reason}; mend the hand")
    if "error" in outcome.value:
        raise BatchError(outcome.value["error"])
    return replace(options, hand=replace(options.hand, sha256=outcome.value["sha256"]))


def unread_digest(model: str, fault: str) -> str:
    """Returns a digest of a model that cannot be read: of its first file and what is wrong.

    Args:
        model: a path or URI.
        fault: what is wrong with it.
    """
    # A library that is moved is the same library.
    for folder in (str(Path(model).absolute().parent), str(Path(model).parent)):
        fault = fault.replace(f"{folder}/", "")
    digest = hashlib.sha256(fault.encode(errors="surrogateescape"))
    with suppress(OSError, ValueError):
        # Whoever opens a pipe waits for its other end.
        if Path(model).is_file():
            with Path(model).open("rb") as file:
                digest.update(file.read(_MAX_BYTES))
            return digest.hexdigest()
    digest.update(model.encode(errors="surrogateescape"))
    return digest.hexdigest()
