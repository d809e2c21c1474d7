"""Calls a function in a child process: bounded in time and memory, and free to crash.

A parser in C++ can end the process it runs in, and a hostile file can make it run or grow for ever.
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

from drake_polygrasp.cli.progress_line import TICK, ProgressLine
from drake_polygrasp.errors import ModelError

if TYPE_CHECKING:
    from drake_polygrasp.arguments import Progress

READ_SECONDS = 120.0
"""Ours: several times what the largest mesh takes that `mesh_file` lets pass."""
WORK_SECONDS = 600.0
"""Ours: far more than planning takes, or checking a file of ordinary length."""
MAX_GIGABYTES = 4
"""Ours: of memory that the child may write to, libraries included."""
_PAUSE = 0.1
"""[s], ours: between a child's words on its progress."""


@dataclass(frozen=True)
class ChildLimits:
    """What the child does, for people, and how long it may take [s].

    Attributes:
        name: what the child does, for messages.
        seconds: between two words on progress, where the function gives any.
        unit: what the function counts in its `progress` callback ("grasps"); none where it has
            none.
        quiet: whether nothing is said of progress, not even on a terminal.
    """

    name: str
    seconds: float = WORK_SECONDS
    unit: str = ""
    quiet: bool = False


def call_in_child(
    function: str, /, *args: Any, limits: ChildLimits | None = None, **kwargs: Any
) -> tuple[Any, float]:
    """What `function` ("package.module:name") returns, and the seconds the call took.

    Its module is imported in the child only; what comes back is pickled. What the child prints on
    standard error is of use only when it crashes. `limits` are, by default, those of reading the
    first argument in `READ_SECONDS`. On a terminal, progress is shown on standard error after a
    second; a function whose limits name a unit is given a callback `progress` that comes this way
    too.

    Raises:
        ModelError: when the child crashes, or needs more time or memory than it may.
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
            value, seconds, error = _answer(receiver, limits)
        except EOFError:
            child.join()
            raise _refusal(limits, _death(child.exitcode, stderr)) from None
        finally:
            child.kill()
            child.join()
            receiver.close()
    if isinstance(error, MemoryError):
        raise _refusal(limits, f"runs out of memory ({MAX_GIGABYTES} GB at most)")
    if error is not None:
        raise error
    return value, seconds


def _refusal(limits: ChildLimits, fault: str) -> ModelError:
    return ModelError(f"{limits.name}: {fault}; repair or simplify the file")


def _answer(receiver: Connection, limits: ChildLimits) -> Any:
    """What the child sends last, its words on progress shown; EOFError where it just ends.

    Raises ModelError when it takes too long.
    """
    with ProgressLine(limits.name, limits.unit, quiet=limits.quiet) as line:
        last_word = 0.0
        while True:
            left = last_word + limits.seconds - line.elapsed
            if not receiver.poll(max(0.0, min(TICK, left))):
                line.tick()
                if left <= TICK:
                    raise _refusal(limits, f"stopped after {limits.seconds:g} s")
                continue
            message = receiver.recv()
            if len(message) == 3:
                return message
            line.tell(*message)
            last_word = line.elapsed


def _run(
    sender: Connection,
    stderr: IO[bytes],
    function: str,
    args: Any,
    kwargs: Any,
    gives_progress: bool,
) -> None:
    module, _, name = function.partition(":")
    value, seconds, error = None, 0.0, None
    try:
        _confine()
        callee = getattr(import_module(module), name)
        # Of a process without standard streams, the pipe may bear one of these numbers.
        for stream in {1, 2} - {sender.fileno()}:
            os.dup2(stderr.fileno(), stream)
        if gives_progress:
            kwargs["progress"] = _telling(sender)
        start = perf_counter()
        value = callee(*args, **kwargs)
        seconds = perf_counter() - start
    except BaseException as raised:
        error = raised
    try:
        sender.send((value, seconds, error))
    except Exception as unsent:
        sender.send((None, 0.0, RuntimeError(str(error or unsent))))


def _telling(sender: Connection) -> Progress:
    """A callback that sends word to the parent, now and then."""
    told = -_PAUSE

    def progress(done: int, total: int) -> None:
        nonlocal told
        now = perf_counter()
        if now - told >= _PAUSE:
            told = now
            sender.send((done, total))

    return progress


def _confine() -> None:
    # The parent answers an interrupt for both.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for limit, wanted in ((resource.RLIMIT_DATA, MAX_GIGABYTES << 30), (resource.RLIMIT_CORE, 0)):
        soft, hard = resource.getrlimit(limit)
        known = [value for value in (soft, hard, wanted) if value != resource.RLIM_INFINITY]
        resource.setrlimit(limit, (min(known), hard))


def _death(exit_code: int | None, stderr: IO[bytes]) -> str:
    if exit_code is None or exit_code >= 0:
        return "the process ended"
    stderr.seek(0)
    last_words = stderr.read().decode(errors="replace").split("\n")
    cause = next((f": {line}" for line in reversed(last_words) if line.strip()), "")
    return f"Drake crashed ({signal.Signals(-exit_code).name}){cause[:200]}"
