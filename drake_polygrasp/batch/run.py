"""Plans grasps of many objects: `plan_batch`, and `iter_batch`, which yields rows."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drake_polygrasp.batch.engines import ChunkContext, default_workers, run_here, run_on_executor
from drake_polygrasp.batch.keys import body_key, in_shard, model_key, read_contents, with_hand_read
from drake_polygrasp.batch.outputs import is_remote, open_output, remove_scratch, state_folder
from drake_polygrasp.batch.request import BatchRequest, make_batch_request
from drake_polygrasp.batch.rows import BatchRow
from drake_polygrasp.batch.sources import Sources, find_models
from drake_polygrasp.batch.store import Store
from drake_polygrasp.batch.supervisor import ChildTask, TaskOutcome


@dataclass(frozen=True)
class BatchReport:
    """What a run of a batch did.

    Attributes:
        out: the output as it was named.
        num_sources: number of models that the sources name.
        num_objects: number of objects that this run met; in a shard, those that are its own.
        counts: number of these objects by the status of their results.
        num_planned: number of results that were committed in this run.
        seconds: time of the run [s].
        complete: whether all objects that the sources name, or the shard's, have a result.
    """

    out: str
    num_sources: int
    num_objects: int
    counts: dict[str, int]
    num_planned: int
    seconds: float
    complete: bool


def plan_batch(
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
    **plan_options: Any,
) -> BatchReport:
    """Plans grasps of many objects, each in a child process of bounded time and memory.

        report = plan_batch("parts", "grasps_of_parts", timeout=30, top=5)
        print(report.counts)

    Each object has one result: a grasp file `grasps/KEY.grasp.yaml` in `out`, or a row that says
    why there is none. The same call again plans only what has no result yet, so a run may be
    stopped, or killed, at any time.

    Args:
        sources: a model file, a folder of them, a pattern such as "parts/**/*.urdf", a text file
            (.txt) with a path in each line, a package:// URI, or a list of these.
        out: folder of the results; or the address of a bucket, s3:// or gs://, for the grasp files
            (extras [s3] and [gcs]), whose rows are in the folder of its last name.
        executor: any `concurrent.futures.Executor`, Dask's `Client.get_executor()` among them; its
            workers have to see the models and `out` (default: children of this process).
        workers: number of children, or of chunks that `executor` runs at once (default: number of
            processors).
        timeout: time for an object [s].
        memory: memory of a child process, libraries included [bytes].
        shard: (i, n) plans the i-th of n parts of the objects; n drivers, each with its own i, may
            share `out`.
        retry: statuses of results that are made again: "crash", "timeout".
        limit: how many objects are planned at most (default: all).
        plan_options: arguments of `load_object` and `plan_grasps`, for every object; `plant=True`
            also checks grasps as `rank_in_plant` does; `hand`, the path of a hand's description,
            plans grasps that it can make, with arguments of `plan_hand_grasps`. Without
            `body_name`, each body of a model is an object.

    Returns:
        How many objects have which result.

    Raises:
        UsageError: when an argument has the wrong type or value, or a source is not there.
        BatchError: when results cannot be written, another driver writes to `out`, or the executor
            is lost.
    """
    request = make_batch_request(
        sources,
        out,
        executor=executor,
        workers=workers,
        timeout=timeout,
        memory=memory,
        shard=shard,
        retry=retry,
        limit=limit,
        **plan_options,
    )
    run = BatchRun(request)
    for _ in run.rows():
        pass
    return run.report()


def iter_batch(sources: Sources, out: str | Path, **arguments: Any) -> Generator[BatchRow]:
    """Plans grasps of many objects and yields the row of each result as it is committed.

        for row in iter_batch("parts", "grasps_of_parts"):
            print(row.source, row.status, row.epsilon)

    Closing the generator stops the run; results that were there before are not
    yielded.

    Args:
        sources: as for `plan_batch`.
        out: as for `plan_batch`.
        arguments: the other arguments of `plan_batch`.

    Returns:
        A generator of rows, in the order in which objects end.

    Raises:
        UsageError: when an argument has the wrong type or value, or a source is not there.
    """
    return BatchRun(make_batch_request(sources, out, **arguments)).rows()


@dataclass(eq=False)
class _Object:
    """An object that has no result yet, and how many sources are the same."""

    source: str
    body: str
    model_key: str
    key: str
    num_sources: int = 1
    attempts: int = 0
    """Attempts of earlier runs, where it is tried again."""


class BatchRun:
    """One run of a batch: finds objects without a result, has them planned, commits results.

    Args:
        request: what is asked for.
        is_stopped: returns whether to stop; those in flight are committed if they end soon.
        warn: called with a sentence about sources that are left out.
        check: called now and then; raises an error where the executor is lost.
    """

    def __init__(
        self,
        request: BatchRequest,
        is_stopped: Callable[[], bool] = lambda: False,
        warn: Callable[[str], None] = lambda _: None,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self.request = request
        self._is_stopped, self._warn, self._check = is_stopped, warn, check
        self.counts: Counter[str] = Counter()
        """Number of objects by the status of their result, as far as they are known."""
        self.num_sources, self.num_objects, self.num_planned, self._num_asked = 0, 0, 0, 0
        self.is_complete = self.is_limited = self._is_exhausted = False
        self._in_flight: dict[str, _Object] = {}
        self._more: deque[_Object] = deque()
        self._start, self._seconds = time.monotonic(), 0.0

    @property
    def num_expected(self) -> int:
        """How many objects there are: as many as models, or a shard's part, until more are met."""
        return max(self.num_objects, self.num_sources // self.request.shard[1])

    def report(self) -> BatchReport:
        """Returns what the run has done."""
        return BatchReport(
            out=self.request.out,
            num_sources=self.num_sources,
            num_objects=self.num_objects,
            counts=dict(self.counts),
            num_planned=self.num_planned,
            seconds=self._seconds,
            complete=self.is_complete,
        )

    def rows(self) -> Generator[BatchRow]:
        """Runs the batch.

        Yields:
            The row of each result as it is committed.

        Raises:
            UsageError: when a source has no models.
            BatchError: when results cannot be written, another driver writes there, or children or
                an executor are lost.
        """
        request, self._start = self.request, time.monotonic()
        index, count = request.shard
        folder = state_folder(request.out)
        try:
            self.num_sources = sum(1 for _ in find_models(request.sources, self._warn))
            models = find_models(request.sources, lambda _: None)
            self._options = with_hand_read(request.options, request.limits)
            contents = read_contents(models, self._options, request.limits)
            shard = f"{index}-of-{count}" if count > 1 else ""
            with Store(folder, shard) as self._store, closing(contents) as self._contents:
                self._output = open_output(request.out)
                self._remove_scratch(folder)  # Of drivers that died.
                self._store.keep_fact("sources", self.num_sources)
                with closing(self._outcomes()) as outcomes:
                    for outcome in outcomes:
                        row = self._settle(outcome)
                        if row is not None:
                            yield row
                self._remove_scratch(folder)  # Of an executor's workers that died.
                self.is_complete = self._is_exhausted and not self._in_flight
        finally:
            self._seconds = time.monotonic() - self._start

    def _remove_scratch(self, folder: Path) -> None:
        if not is_remote(self.request.out):
            remove_scratch(folder / "grasps")

    def _outcomes(self) -> Generator[TaskOutcome]:
        request = self.request
        context = ChunkContext(request.function, request.limits, self._output)
        workers = request.workers or default_workers()
        if request.executor is None:
            return run_here(context, workers, self._next_task, self._is_stopped)
        return run_on_executor(
            request.executor, workers, context, self._next_task, self._is_stopped, self._check
        )

    def _next_task(self) -> ChildTask | None:
        """Returns the next object without a result, as a task; None where there is none now."""
        while not (self._is_stopped() or self.is_limited):
            object_ = self._next_object()
            if object_ is None:
                return None
            self.num_objects += 1
            self._store.keep_object(object_.source, object_.body, object_.key)
            if object_.key in self._in_flight:
                self._in_flight[object_.key].num_sources += 1
                continue
            status = self._store.status_of(object_.key)
            if status is not None and self._stays(object_.key, status):
                self.counts[status] += 1
                continue
            object_.attempts = 0 if status is None else self._store.attempts_of(object_.key)
            self._in_flight[object_.key] = object_
            self._num_asked += 1
            self.is_limited = self._num_asked == self.request.limit
            return ChildTask(object_.key, self._request(object_))
        return None

    def _stays(self, key: str, status: str) -> bool:
        """Returns whether a result is not made again."""
        if status in self.request.retry:
            return False
        # Someone may have deleted the file; to ask a bucket for each would take long.
        return status != "ok" or is_remote(self.request.out) or self._output.has(key)

    def _next_object(self) -> _Object | None:
        """Returns the next object that the sources name and that is of this shard."""
        if self._more:
            return self._more.popleft()
        options = self._options
        for source, digest in self._contents:
            key = model_key(digest, options)
            if not in_shard(key, *self.request.shard):
                continue
            if bodies := self._store.bodies_of(key):
                self._expand(source, key, bodies)
                return self._more.popleft()
            return _Object(source, "", key, key)
        self._is_exhausted = True
        return None

    def _expand(self, source: str, key: str, bodies: Sequence[str]) -> None:
        """Has each body of a model planned."""
        self._more += [_Object(source, body, key, body_key(key, body)) for body in bodies]

    def _request(self, object_: _Object) -> dict[str, Any]:
        """Returns what a worker is asked for an object."""
        request = self._options.request
        if object_.body:
            request["load"]["body_name"] = object_.body
        return {
            "model": object_.source,
            "current_folder": str(Path.cwd()),
            "folder": str(self._output.folder),
            **request,
        }

    def _settle(self, outcome: TaskOutcome) -> BatchRow | None:
        """Commits what became of an object; a model of several bodies becomes several objects."""
        object_ = self._in_flight.pop(outcome.task.name)
        if outcome.ending == "answered" and "bodies" in outcome.value:
            bodies = outcome.value["bodies"]
            self._store.keep_bodies(object_.model_key, bodies, object_.source)
            self._expand(object_.source, object_.model_key, bodies)
            self.num_objects -= object_.num_sources
            self._num_asked -= 1
            self.is_limited = False
            return None
        row = _row(object_, outcome)
        self._store.keep_row(row)
        self.counts[row.status] += object_.num_sources
        self.num_planned += 1
        return row


def _row(object_: _Object, outcome: TaskOutcome) -> BatchRow:
    columns: dict[str, Any] = {"status": outcome.ending, "reason": outcome.reason}
    if outcome.ending == "answered":
        columns = {name: value for name, value in outcome.value.items() if value is not None}
    elif outcome.ending == "error":
        reason = f"internal error ({outcome.reason}); please report it"
        columns = {"status": "crash", "reason": reason}
    columns["reason"] = " ".join(columns.get("reason", "").splitlines())
    return BatchRow(
        **{"body": object_.body or None} | columns,
        key=object_.key,
        source=object_.source,
        return_code=outcome.return_code,
        attempts=object_.attempts + outcome.attempts,
        seconds=outcome.seconds,
        peak_bytes=outcome.peak_bytes,
        finished=time.time(),
    )
