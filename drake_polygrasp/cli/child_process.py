"""Calls a function in a child process of bounded time and memory.

Drake's parsers are C++: a malformed file can abort the process that reads it, and a hostile one can
make it run or allocate without end. In a child process, either becomes an error message.
"""

from __future__ import annotations

import os
import resource
import signal
import tempfile
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from time import perf_counter
from typing import IO, TYPE_CHECKING, Any

from drake_polygrasp.cli.progress_line import REFRESH_SECONDS, ProgressLine
from drake_polygrasp.errors import ModelError

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
        seconds: time limit [s], counted anew from each report of progress.
        unit: plural of what the function's `progress` callback counts ("grasps"); empty if it takes
            none.
        quiet: whether progress is hidden even on a terminal.
    """

    name: str
    seconds: float = WORK_SECONDS
    unit: str = ""
    quiet: bool = False


def call_in_child(
    function: str, /, *args: Any, limits: ChildLimits | None = None, **kwargs: Any
) -> tuple[Any, float]:
    """Calls a function in a child process and returns its result.

    The module is imported in the child only. What the child prints is discarded, but its last line
    on standard error is quoted if it crashes. Progress is shown on standard error where that is a
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
    # Forked, the child starts at once: a spawned one would import everything again.
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    with tempfile.TemporaryFile() as stderr:
        call = (sender, stderr, function, args, kwargs, bool(limits.unit))
        child = context.Process(target=_run, args=call, daemon=True)
        child.start()
        sender.close()
        try:
            value, seconds, error = _wait_for_result(receiver, limits)
        except EOFError:
            child.join()
            raise _model_error(limits, _crash_message(child.exitcode, stderr)) from None
        finally:
            child.kill()
            child.join()
            receiver.close()
    if isinstance(error, MemoryError):
        raise _model_error(limits, f"runs out of memory ({_MAX_GIGABYTES} GB at most)")
    if error is not None:
        raise error
    return value, seconds


def _model_error(limits: ChildLimits, fault: str) -> ModelError:
    return ModelError(f"{limits.name}: {fault}; repair or simplify the file")


def _wait_for_result(receiver: Connection, limits: ChildLimits) -> Any:
    """Shows the child's progress until its result arrives, and returns that.

    Raises ModelError after the time limit, EOFError when the child ends without a result.
    """
    with ProgressLine(limits.name, limits.unit, quiet=limits.quiet) as line:
        last_report = 0.0
        while True:
            left = last_report + limits.seconds - line.elapsed
            if not receiver.poll(max(0.0, min(REFRESH_SECONDS, left))):
                line.refresh()
                if left <= REFRESH_SECONDS:
                    raise _model_error(limits, f"stopped after {limits.seconds:g} s")
                continue
            message = receiver.recv()
            if len(message) == 3:  # A result; progress has two numbers.
                return message
            line.update(*message)
            last_report = line.elapsed


def _run(
    sender: Connection,
    stderr: IO[bytes],
    function: str,
    args: Any,
    kwargs: Any,
    reports_progress: bool,
) -> None:
    """Runs in the child: calls the function and sends its value, its time [s] and its error."""
    module, _, name = function.partition(":")
    value, seconds, error = None, 0.0, None
    try:
        _limit_resources()
        callee = getattr(import_module(module), name)
        # Where the parent has no standard streams, the pipe itself may be descriptor 1 or 2.
        for stream in {1, 2} - {sender.fileno()}:
            os.dup2(stderr.fileno(), stream)
        if reports_progress:
            kwargs["progress"] = _progress_sender(sender)
        start = perf_counter()
        value = callee(*args, **kwargs)
        seconds = perf_counter() - start
    except BaseException as raised:
        error = raised
    try:
        sender.send((value, seconds, error))
    except Exception as unsent:
        sender.send((None, 0.0, RuntimeError(str(error or unsent))))


def _progress_sender(sender: Connection) -> Progress:
    """Returns a progress callback that sends its numbers to the parent, at a bounded rate."""
    last_sent = -_REPORT_SECONDS

    def progress(done: int, total: int) -> None:
        nonlocal last_sent
        now = perf_counter()
        if now - last_sent >= _REPORT_SECONDS:
            last_sent = now
            sender.send((done, total))

    return progress


def _limit_resources() -> None:
    """Bounds the memory of this process, and leaves Ctrl-C and core dumps to the parent."""
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
