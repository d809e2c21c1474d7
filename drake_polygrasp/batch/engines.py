"""What tasks run on: warm children of this process, or an executor that carries chunks of them."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from time import monotonic
from uuid import uuid4

from drake_polygrasp.batch.outputs import GraspOutput
from drake_polygrasp.batch.supervisor import (
    GRACE_SECONDS,
    ChildTask,
    Supervisor,
    TaskLimits,
    TaskOutcome,
)
from drake_polygrasp.errors import BatchError, PolygraspError

_FIRST_CHUNK = 4
_CHUNK_SECONDS = 20.0
"""Work in a chunk [s]. Our choice: much more than a child takes to start, and not much to lose."""
_MAX_CHUNK = 256
_CHUNKS_A_WORKER = 2
"""Chunks that are submitted for each worker, so that none waits for work. Our choice."""
_MAX_LOST = 3
"""How often a chunk may be lost with its worker. Our choice."""
_WAIT_SECONDS = 0.25
_stopped_runs: set[str] = set()
"""Runs whose chunks are to end, where these run in threads of the driver's process."""


@dataclass(frozen=True)
class ChunkContext:
    """How chunks of a run are done; it can be sent to other processes.

    Attributes:
        function: what children call, as "package.module:name".
        limits: limits of each task.
        output: where grasp files go.
        run: name of the run.
        lost: how often the chunk was lost with its worker. Dask answers a call that it knows with
            what became of it, so that another attempt has to be another call.
    """

    function: str
    limits: TaskLimits
    output: GraspOutput
    run: str = ""
    lost: int = 0


def run_here(
    context: ChunkContext,
    slots: int,
    next_task: Callable[[], ChildTask | None],
    is_stopped: Callable[[], bool],
) -> Generator[TaskOutcome]:
    """Runs tasks in children of this process, and writes their grasp files.

    Args:
        context: what tasks share.
        slots: number of children.
        next_task: returns the next task, None where there is none now.
        is_stopped: returns whether no more are to be started.

    Yields:
        Outcomes, without the texts that are written.

    Raises:
        BatchError: when children cannot be started or a file cannot be written.
    """
    output = context.output

    def next_or_adopted() -> ChildTask | None:
        task = next_task()
        if task is None or not output.has(task.name):
            return task
        return replace(task, request=task.request | output.adoption(task.name))

    with Supervisor(context.function, slots, context.limits) as supervisor:
        for outcome in supervisor.run(next_or_adopted, is_stopped):
            yield _with_file_written(outcome, output)


def _with_file_written(outcome: TaskOutcome, output: GraspOutput) -> TaskOutcome:
    if outcome.ending != "answered" or "text" not in outcome.value:
        return outcome
    row = dict(outcome.value)
    output.write(outcome.task.name, row.pop("text"))
    return replace(outcome, value=row)


def run_chunk(context: ChunkContext, tasks: Sequence[ChildTask]) -> list[TaskOutcome]:
    """Runs a chunk of tasks, in one child, where an executor calls it.

    Args:
        context: what tasks share.
        tasks: the tasks.

    Returns:
        Their outcomes; fewer where the run was stopped.
    """
    waiting = deque(tasks)
    return list(
        run_here(
            context,
            1,
            lambda: waiting.popleft() if waiting else None,
            lambda: context.run in _stopped_runs,
        )
    )


def default_workers() -> int:
    """Returns the number of processors that this process may use."""
    with suppress(AttributeError):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_on_executor(
    executor: Executor,
    workers: int,
    context: ChunkContext,
    next_task: Callable[[], ChildTask | None],
    is_stopped: Callable[[], bool],
    check: Callable[[], None],
) -> Generator[TaskOutcome]:
    """Runs tasks in chunks on an executor.

    Args:
        executor: any executor whose workers see the models and the output.
        workers: how many chunks it runs at once.
        context: what tasks share.
        next_task: returns the next task, None where there is none now.
        is_stopped: returns whether no more are to be started.
        check: called now and then; raises an error where the executor is lost.

    Yields:
        Outcomes, as chunks end.

    Raises:
        BatchError: when the executor takes no chunks, or loses one again and again.
    """
    context = replace(context, run=uuid4().hex)
    chunks: dict[Future[list[TaskOutcome]], tuple[list[ChildTask], int]] = {}
    size, stop_time = _FIRST_CHUNK, None

    def submit(tasks: list[ChildTask], lost: int) -> None:
        try:
            chunks[executor.submit(run_chunk, replace(context, lost=lost), tasks)] = tasks, lost
        except Exception as error:
            raise _lost(error) from error

    try:
        while True:
            check()
            if stop_time is None and is_stopped():
                stop_time = monotonic()
                _stopped_runs.add(context.run)
                for future in [future for future in chunks if future.cancel()]:
                    del chunks[future]
            while stop_time is None and len(chunks) < _CHUNKS_A_WORKER * workers:
                if not (tasks := _take(next_task, size)):
                    break
                submit(tasks, 0)
            # A chunk that is stopped takes its grace, and a moment to come back.
            if not chunks or (stop_time and monotonic() - stop_time > GRACE_SECONDS + 1):
                return
            done, _ = wait(chunks, timeout=_WAIT_SECONDS, return_when=FIRST_COMPLETED)
            for future in done:
                tasks, lost = chunks.pop(future)
                try:
                    outcomes = future.result()
                except PolygraspError:
                    raise
                except BaseException as error:
                    if isinstance(error, KeyboardInterrupt):
                        raise
                    check()
                    if lost + 1 == _MAX_LOST:
                        raise _lost(error) from error
                    if stop_time is None:
                        submit(tasks, lost + 1)
                    continue
                if outcomes:
                    mean = sum(outcome.seconds for outcome in outcomes) / len(outcomes)
                    size = max(1, min(_MAX_CHUNK, int(_CHUNK_SECONDS / max(mean, 1e-3))))
                yield from outcomes
    finally:
        _stopped_runs.add(context.run)
        for future in chunks:
            future.cancel()


def _take(next_task: Callable[[], ChildTask | None], most: int) -> list[ChildTask]:
    tasks: list[ChildTask] = []
    while len(tasks) < most and (task := next_task()) is not None:
        tasks.append(task)
    return tasks


def _lost(error: BaseException) -> BatchError:
    reason = " ".join(str(error).split())[:300]
    return BatchError(
        f"the executor is lost: {type(error).__name__}{f': {reason}' if reason else ''}; give the "
        "same command again, which goes on from here"
    )
