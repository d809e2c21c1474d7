"""Runs tasks in warm child processes, each within its time and memory, whatever becomes of them.

Drake's parsers are C++: a model can abort the process that reads it, or make it run or allocate
without end. Here that ends one child, and its task has an outcome that says so.
"""

from __future__ import annotations

import selectors
import signal
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import monotonic
from typing import Any, Literal, Self

from drake_polygrasp.batch.warm_child import WarmChild
from drake_polygrasp.errors import BatchError

GRACE_SECONDS = 5.0
"""Time that tasks in flight have when a run is stopped [s]. Our choice."""
MAX_ATTEMPTS = 3
"""How often a task is started whose child is killed from outside. Our choice."""
_START_SECONDS = 120.0
"""Time for a child to import its function [s]. Our choice: a hundred times what it takes."""
_POLL_SECONDS = 0.05
"""Time between two looks at deadlines and memory [s]. Our choice."""
_AWAY_SECONDS = 1.0
"""A caller that takes longer than this with an outcome is not counted in deadlines [s]."""
_OUTSIDE = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGQUIT)
"""Signals that come from outside a process, and not from what it does."""

Ending = Literal["answered", "error", "crash", "timeout", "out_of_memory"]


@dataclass(frozen=True)
class TaskLimits:
    """Limits of a task in a child process.

    Attributes:
        seconds: time, without that for starting the child [s].
        memory: memory of the child, libraries included [bytes].
    """

    seconds: float = 60.0
    memory: int = 4 << 30


@dataclass(frozen=True, eq=False)
class ChildTask:
    """A call of the children's function.

    Attributes:
        name: what the caller knows the task by.
        request: keyword arguments of the function, as plain data.
    """

    name: str
    request: dict[str, Any]


@dataclass(frozen=True, eq=False)
class TaskOutcome:
    """What became of a task.

    Attributes:
        task: the task.
        ending: "answered" when the function returned, "error" when it raised an exception, or how
            its child ended.
        value: what the function returned.
        reason: why there is no value, in one line.
        return_code: return code of the child; minus the signal's number where a signal ended it;
            None where it goes on.
        attempts: how often the task was started.
        seconds: time that the last attempt took [s].
        peak_bytes: greatest resident memory during the last attempt, as far as it was seen.
    """

    task: ChildTask
    ending: Ending
    value: Any = None
    reason: str = ""
    return_code: int | None = None
    attempts: int = 1
    seconds: float = 0.0
    peak_bytes: int = 0


@dataclass(eq=False)
class _Slot:
    """A place for one child, and the task that it has."""

    child: WarmChild | None = None
    is_ready: bool = False
    failed_starts: int = 0
    task: ChildTask | None = None
    attempts: int = 0
    since: float = 0.0
    """When the task was sent, or the child started."""
    peak_bytes: int = 0


class Supervisor:
    """Runs tasks in a fixed number of warm children; a context manager that kills them at its end.

    A task whose child is killed from outside is started again, up to `MAX_ATTEMPTS` times.

    Args:
        function: what a child calls for each task, as "package.module:name"; keyword arguments and
            results are plain data.
        slots: greatest number of children.
        limits: limits of each task.
    """

    def __init__(self, function: str, slots: int, limits: TaskLimits) -> None:
        self._function, self._limits = function, limits
        self._slots: list[_Slot] = []
        self._num_slots = slots
        self._again: deque[tuple[ChildTask, int]] = deque()
        self._selector = selectors.DefaultSelector()
        self._looked = monotonic()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for slot in self._slots:
            self._end_child(slot)
        self._selector.close()

    def run(
        self, next_task: Callable[[], ChildTask | None], is_stopped: Callable[[], bool]
    ) -> Iterator[TaskOutcome]:
        """Runs tasks until there are no more.

        Args:
            next_task: called where a child is free; returns a task, or None where there is none
                now. It is called again after every outcome.
            is_stopped: returns whether no more tasks are to be started. Those in flight have
                `GRACE_SECONDS` then.

        Yields:
            The outcome of each task, in the order in which they end.

        Raises:
            BatchError: when children cannot be started.
        """
        stop_time = None
        while True:
            if stop_time is None and is_stopped():
                stop_time = monotonic()
            if stop_time is None:
                self._assign(next_task)
            busy = [slot for slot in self._slots if slot.task is not None]
            if not busy or (stop_time is not None and monotonic() - stop_time > GRACE_SECONDS):
                return
            self._forgive_absence(busy)
            self._selector.select(_POLL_SECONDS)
            self._looked = monotonic()
            for slot in busy:
                outcome = self._look_at(slot)
                if outcome is not None:
                    yield outcome

    def _assign(self, next_task: Callable[[], ChildTask | None]) -> None:
        """Gives each free slot a task, as far as there are any."""
        while (slot := self._free_slot()) is not None:
            if self._again:
                slot.task, slot.attempts = self._again.popleft()
            else:
                slot.task, slot.attempts = next_task(), 0
            if slot.task is None:
                return
            self._send(slot)

    def _free_slot(self) -> _Slot | None:
        """Returns a slot without a task; a new one where there may be more."""
        for slot in self._slots:
            if slot.task is None:
                return slot
        if len(self._slots) == self._num_slots:
            return None
        self._slots.append(_Slot())
        return self._slots[-1]

    def _send(self, slot: _Slot) -> None:
        """Sends a slot's task to its child; to a new one when that has imported its function."""
        assert slot.task is not None
        if slot.child is not None and not slot.is_ready:
            return
        if slot.child is None or slot.child.has_ended() or not slot.child.send(slot.task.request):
            self._end_child(slot)
            self._start_child(slot)
            return
        slot.attempts += 1
        slot.since, slot.peak_bytes = monotonic(), 0

    def _start_child(self, slot: _Slot) -> None:
        try:
            slot.child = child = WarmChild(self._function, self._limits.memory)
        except OSError as error:
            raise BatchError(
                f"a child process cannot be started: {error.strerror}; use fewer workers (-j)"
            ) from error
        slot.is_ready, slot.since = False, monotonic()
        for stream in (child.replies, child.messages):
            self._selector.register(stream, selectors.EVENT_READ)

    def _end_child(self, slot: _Slot) -> int:
        """Kills a slot's child, if there is one, and returns its return code."""
        if slot.child is None:
            return 0
        child, slot.child = slot.child, None
        for stream in (child.replies, child.messages):
            self._selector.unregister(stream)
        return child.end()

    def _forgive_absence(self, busy: list[_Slot]) -> None:
        """Moves deadlines by the time in which nobody looked: replies may wait in the pipes."""
        away = monotonic() - self._looked
        if away > _AWAY_SECONDS:
            for slot in busy:
                slot.since += away

    def _look_at(self, slot: _Slot) -> TaskOutcome | None:
        """Reads what a busy slot's child says, and holds it to its limits."""
        child = slot.child
        assert child is not None
        has_ended = child.has_ended()  # Asked before reading, so that a last reply is not lost.
        reply = child.receive()
        if reply is not None:
            return self._take(slot, reply)
        if has_ended:
            return self._bury(slot)
        seconds = monotonic() - slot.since
        if not slot.is_ready:
            if seconds > _START_SECONDS:
                raise self._cannot_start(f"it does not import its function in {_START_SECONDS:g} s")
            return None
        slot.peak_bytes = max(slot.peak_bytes, child.resident_bytes())
        if slot.peak_bytes > self._limits.memory:
            code = self._end_child(slot)
            return self._outcome(slot, "out_of_memory", self._memory_reason(), return_code=code)
        if seconds > self._limits.seconds:
            code = self._end_child(slot)
            reason = f"stopped after {self._limits.seconds:g} s"
            return self._outcome(slot, "timeout", reason, return_code=code)
        return None

    def _take(self, slot: _Slot, reply: dict[str, Any]) -> TaskOutcome | None:
        """Takes a reply: that the child is ready, or a task's result."""
        assert slot.child is not None
        if not slot.is_ready:
            slot.is_ready, slot.failed_starts = True, 0
            self._send(slot)
            return None
        slot.peak_bytes = max(slot.peak_bytes, reply["peak_bytes"])
        error, seconds = reply.get("error"), reply["seconds"]
        if error == "memory" or slot.child.resident_bytes() > self._limits.memory // 2:
            self._end_child(slot)  # The next task has all of its memory.
        if error == "memory":
            return self._outcome(slot, "out_of_memory", self._memory_reason(), seconds=seconds)
        if error is not None:
            return self._outcome(slot, "error", error, seconds=seconds)
        return self._outcome(slot, "answered", "", value=reply["value"], seconds=seconds)

    def _bury(self, slot: _Slot) -> TaskOutcome | None:
        """Says what it means that a child has ended by itself."""
        assert slot.child is not None
        line = slot.child.last_line()
        code = self._end_child(slot)
        assert slot.task is not None
        if not slot.is_ready:
            slot.failed_starts += 1
            if slot.failed_starts == MAX_ATTEMPTS or -code not in _OUTSIDE:
                raise self._cannot_start(line or describe_code(code))
            self._start_child(slot)
            return None
        if -code in _OUTSIDE:
            if slot.attempts < MAX_ATTEMPTS:
                self._again.append((slot.task, slot.attempts))
                slot.task = None
                return None
            reason = (
                f"its process was killed from outside {slot.attempts} times "
                f"({describe_code(code)}); if memory was short, use fewer workers (-j)"
            )
            return self._outcome(slot, "crash", reason, return_code=code)
        near = 10 * slot.peak_bytes > 9 * self._limits.memory
        if near or "bad_alloc" in line or "MemoryError" in line:
            return self._outcome(slot, "out_of_memory", self._memory_reason(), return_code=code)
        reason = "the process ended without a result"
        if code < 0:
            reason = f"Drake crashed ({describe_code(code)})"
        return self._outcome(
            slot, "crash", f"{reason}: {line}" if line else reason, return_code=code
        )

    def _outcome(
        self,
        slot: _Slot,
        ending: Ending,
        reason: str,
        *,
        value: Any = None,
        return_code: int | None = None,
        seconds: float | None = None,
    ) -> TaskOutcome:
        """Returns the outcome of a slot's task, and frees the slot."""
        assert slot.task is not None
        task, slot.task = slot.task, None
        return TaskOutcome(
            task,
            ending,
            value,
            " ".join(reason.split())[:400],
            return_code,
            slot.attempts,
            monotonic() - slot.since if seconds is None else seconds,
            slot.peak_bytes,
        )

    def _memory_reason(self) -> str:
        return f"runs out of memory ({self._limits.memory / 2**30:.3g} GiB at most)"

    @staticmethod
    def _cannot_start(reason: str) -> BatchError:
        return BatchError(
            f"child processes cannot start: {reason}; give them more memory (--memory) or mend the "
            "installation"
        )


def describe_code(code: int) -> str:
    """Returns the name of the signal that ended a process, or its return code in words.

    Args:
        code: return code; minus the signal's number where a signal ended it.
    """
    if code >= 0:
        return f"return code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
