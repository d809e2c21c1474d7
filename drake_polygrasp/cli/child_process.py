"""Calls a function in a child process of bounded time and memory.

Drake's parsers are C++: a malformed file can abort the process that reads it, and a hostile one can
make it run or allocate without end. In a child process, either becomes an error message.

A command is one such call, forked before anything slow is imported. What it calls in turn is a
stage of the same child, with its own time limit, so that libraries are imported once.
"""

from __future__ import annotations

import gc
import os
import resource
import signal
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from time import perf_counter
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from drake_polygrasp.cli.child_messages import (
    StderrLine,
    connect_to_parent,
    is_child,
    send_to_parent,
)
from drake_polygrasp.cli.progress_line import REFRESH_SECONDS, ProgressLine
from drake_polygrasp.cli.reporting import print_line
from drake_polygrasp.errors import ModelError, PolygraspError

if TYPE_CHECKING:
    from drake_polygrasp.arguments import Progress

READ_SECONDS = 120.0
"""Time to read a model [s]. Our choice: several times what the largest mesh takes that `mesh_file`
accepts."""
WORK_SECONDS = 600.0
"""Time for any other call [s]. Our choice: far more than planning takes, or verifying a file of
ordinary length."""
_MAX_GIGABYTES = 4
"""Writable memory of the child [GiB], libraries included. Our choice."""
_REPORT_SECONDS = 0.1
"""Least time between two progress messages of the child [s]. Our choice."""


@dataclass(frozen=True)
class ChildLimits:
    """Limits of a call in a child process, and how its progress is shown.

    Attributes:
        name: what the call does, for messages: "planning grasps of cube.sdf".
        seconds: time limit [s], counted anew from each report of progress, without the time in
            which the command is stopped by Ctrl-Z.
        unit: plural of what the function's `progress` callback counts ("grasps"); empty if it takes
            none.
        quiet: whether progress is hidden even on a terminal.
    """

    name: str
    seconds: float = WORK_SECONDS
    unit: str = ""
    quiet: bool = False


class _ProgressReport(NamedTuple):
    """How many units are done, and how many there are."""

    done: int
    total: int


class _CallResult(NamedTuple):
    """What the function returned, the time that it took [s], and what it raised instead."""

    value: Any
    seconds: float
    error: BaseException | None


def call_in_child(
    function: str, /, *args: Any, limits: ChildLimits | None = None, **kwargs: Any
) -> tuple[Any, float]:
    """Calls a function in a child process and returns its result.

    In a process that is such a child, the function is called here and its limits replace those of
    the stage before.

    Modules are imported in the child only. What the child prints is discarded, but its last line on
    standard error is quoted if it crashes. Progress is shown on standard error where that is a
    terminal.

    Args:
        function: the function, as "package.module:name". If `limits` name a unit, it is also given
            a keyword argument `progress`, a callback of how much is done and of how much.
        args: its positional arguments.
        limits: limits of the call; by default those of reading the file named by the first argument
            in `READ_SECONDS`.
        kwargs: its keyword arguments.

    Returns:
        What the function returns, pickled on the way, and the time the call took [s].

    Raises:
        ModelError: when the child crashes or exceeds its time or memory.
        Exception: whatever the function raises.
    """
    limits = limits or ChildLimits(f"reading {args[0]}", READ_SECONDS)
    if is_child():
        send_to_parent(limits)
        return _call(function, args, kwargs, bool(limits.unit))
    # Forked, the child starts at once: a spawned one would import everything again.
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    with tempfile.TemporaryFile() as stderr:
        call = (sender, stderr, function, args, kwargs, bool(limits.unit))
        child = context.Process(target=_run, args=call, daemon=True)
        child.start()
        sender.close()
        conversation = _Conversation(receiver, limits)
        try:
            value, seconds, error = conversation.wait_for_result()
        except EOFError:
            child.join()
            fault = _crash_message(child.exitcode, stderr)
            raise _model_error(conversation.limits, fault) from None
        finally:
            child.kill()
            child.join()
            receiver.close()
    if isinstance(error, MemoryError):
        fault = f"runs out of memory ({_MAX_GIGABYTES} GB at most)"
        raise _model_error(conversation.limits, fault)
    if error is not None:
        raise error
    return value, seconds


def _model_error(limits: ChildLimits, fault: str) -> ModelError:
    return ModelError(f"{limits.name}: {fault}; repair or simplify the file")


class _Conversation:
    """What a parent hears from its child; `limits` are those of the child's present stage."""

    def __init__(self, receiver: Connection, limits: ChildLimits) -> None:
        self._receiver, self._quiet = receiver, limits.quiet
        self.limits = limits

    def wait_for_result(self) -> _CallResult:
        """Shows the child's progress and lines until its result arrives, and returns that.

        Raises ModelError after a time limit, EOFError when the child ends without a result.
        """
        while (result := self._wait_for_stage()) is None:
            pass
        return result

    def _wait_for_stage(self) -> _CallResult | None:
        """Returns the result, or None when a new stage begins."""
        limits = self.limits
        with ProgressLine(limits.name, limits.unit, quiet=limits.quiet) as line:
            waited = 0.0
            while True:
                start, seconds = line.elapsed, min(REFRESH_SECONDS, limits.seconds - waited)
                has_word = self._receiver.poll(seconds)
                # More time passes only while Ctrl-Z stops this process, and the child with it.
                waited += min(line.elapsed - start, seconds)
                if not has_word:
                    line.refresh()
                    if waited >= limits.seconds:
                        raise _model_error(limits, f"stopped after {limits.seconds:g} s")
                    continue
                match self._receiver.recv():
                    case _ProgressReport() as report:
                        line.update(*report)
                        waited = 0.0
                    case StderrLine(text):
                        line.erase()
                        print_line(text)
                    case ChildLimits() as stage:
                        # The child cannot tell whether our standard output is a terminal.
                        self.limits = replace(stage, quiet=self._quiet)
                        return None
                    case _CallResult() as result:
                        return result


def _run(
    sender: Connection,
    stderr: IO[bytes],
    function: str,
    args: Any,
    kwargs: Any,
    reports_progress: bool,
) -> None:
    """Runs in the child: calls the function and sends its value, its time [s] and its error."""
    value, seconds = None, 0.0
    error: BaseException | None = None
    try:
        _limit_resources()
        # Where the parent has no standard streams, the pipe itself may be descriptor 1 or 2.
        for stream in {1, 2} - {sender.fileno()}:
            os.dup2(stderr.fileno(), stream)
        connect_to_parent(sender)
        value, seconds = _call(function, args, kwargs, reports_progress)
    except MemoryError:
        error = MemoryError()  # Without the frames, which hold what has filled the memory.
    except BaseException as raised:
        error = raised
    try:
        sender.send(_CallResult(value, seconds, error))
    except Exception as unsent:
        # What an error holds may not be sent; its message may, and stays an error of ours.
        kind = type(error) if isinstance(error, PolygraspError) else RuntimeError
        sender.send(_CallResult(None, 0.0, kind(str(error or unsent))))


def _call(function: str, args: Any, kwargs: Any, reports_progress: bool) -> tuple[Any, float]:
    """Imports a function and calls it; returns its value and the time of the call [s]."""
    callee = _import_function(function)
    if reports_progress:
        kwargs = kwargs | {"progress": _progress_sender()}
    start = perf_counter()
    value = callee(*args, **kwargs)
    return value, perf_counter() - start


def _import_function(function: str) -> Callable[..., Any]:
    """Imports a function, "package.module:name".

    Modules live as long as the process, and looking for garbage among what they define takes a
    tenth of the time that a small model does.
    """
    module, _, name = function.partition(":")
    gc.disable()
    try:
        callee: Callable[..., Any] = getattr(import_module(module), name)
        gc.freeze()
    finally:
        gc.enable()
    return callee


def _progress_sender() -> Progress:
    """Returns a progress callback that sends its numbers to the parent, at a bounded rate."""
    last_sent = -_REPORT_SECONDS

    def progress(done: int, total: int) -> None:
        nonlocal last_sent
        now = perf_counter()
        if now - last_sent >= _REPORT_SECONDS:
            last_sent = now
            send_to_parent(_ProgressReport(done, total))

    return progress


def _limit_resources() -> None:
    """Bounds the memory of this process, and leaves Ctrl-C and core dumps to the parent.

    NumPy, not yet imported, is to start no threads: our matrices are too small to share, and idle
    threads take as much of the processor as Drake does to parse a model.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # On Ctrl-C the parent kills this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for limit, wanted in ((resource.RLIMIT_DATA, _MAX_GIGABYTES << 30), (resource.RLIMIT_CORE, 0)):
        soft, hard = resource.getrlimit(limit)
        finite = [value for value in (soft, hard, wanted) if value != resource.RLIM_INFINITY]
        resource.setrlimit(limit, (min(finite), hard))


def _crash_message(exit_code: int | None, stderr: IO[bytes]) -> str:
    """Says how the child ended, with the last line it printed on standard error."""
    if exit_code is None or exit_code >= 0:
        return "the process ended without a result"
    stderr.seek(0)
    lines = stderr.read().decode(errors="replace").split("\n")
    cause = next((f": {line}" for line in reversed(lines) if line.strip()), "")
    return f"Drake crashed ({signal.Signals(-exit_code).name}){cause[:200]}"
