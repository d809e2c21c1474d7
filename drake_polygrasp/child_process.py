"""Calls a function in a child process: bounded in time and memory, and free to crash.

A parser in C++ can end the process it runs in, and a hostile file can make it run or grow for ever.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from time import perf_counter
from typing import IO, Any

from drake_polygrasp.errors import ModelError

READ_SECONDS = 120.0
"""Ours: several times what the largest mesh takes that `mesh_file` lets pass."""
WORK_SECONDS = 600.0
"""Ours: far more than planning takes, or checking a file of ordinary length."""
MAX_GIGABYTES = 4
"""Ours: of memory that the child may write to, libraries included."""
_PATIENCE, _TICK = 1.0, 0.5
"""[s] before the first word on progress, and between the next."""


@dataclass(frozen=True)
class Task:
    """What the child does, for people, and how long it may take [s]."""

    name: str
    seconds: float = WORK_SECONDS


def call_in_child(
    function: str, /, *args: Any, task: Task | None = None, **kwargs: Any
) -> tuple[Any, float]:
    """What `function` ("package.module:name") returns, and the seconds the call took.

    Its module is imported in the child only; what comes back is pickled. What the child prints on
    standard error is of use only when it crashes. `task` is, by default, to read the first argument
    in `READ_SECONDS`. On a terminal, progress is shown on standard error after a second.

    Raises:
        ModelError: when the child crashes, or needs more time or memory than it may.
        Exception: whatever the function raises.
    """
    task = task or Task(f"reading {args[0]}", READ_SECONDS)
    # Forked, the child starts at once: a spawned one would import everything again.
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    with tempfile.TemporaryFile() as stderr:
        call = (sender, stderr, function, args, kwargs)
        child = context.Process(target=_run, args=call, daemon=True)
        child.start()
        sender.close()
        try:
            if not _wait(receiver, task):
                raise _refusal(task, f"stopped after {task.seconds:g} s")
            value, seconds, error = receiver.recv()
        except EOFError:
            child.join()
            raise _refusal(task, _death(child.exitcode, stderr)) from None
        finally:
            child.kill()
            child.join()
            receiver.close()
    if isinstance(error, MemoryError):
        raise _refusal(task, f"runs out of memory ({MAX_GIGABYTES} GB at most)")
    if error is not None:
        raise error
    return value, seconds


def _refusal(task: Task, fault: str) -> ModelError:
    return ModelError(f"{task.name}: {fault}; repair or simplify the file")


def _wait(receiver: Connection, task: Task) -> bool:
    """Whether the child answers, or ends, in time."""
    start, elapsed = perf_counter(), 0.0
    while not receiver.poll(min(_TICK if elapsed else _PATIENCE, task.seconds - elapsed)):
        elapsed = perf_counter() - start
        if elapsed >= task.seconds:
            break
        _show_progress(f"{task.name} ... {elapsed:.0f} s")
    if elapsed:
        _show_progress("")
    return receiver.poll()


def _show_progress(text: str) -> None:
    """Writes over the line that was there before, on terminals only."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"\r{text}\x1b[K", end="", file=sys.stderr, flush=True)


def _run(sender: Connection, stderr: IO[bytes], function: str, args: Any, kwargs: Any) -> None:
    module, _, name = function.partition(":")
    value, seconds, error = None, 0.0, None
    try:
        _confine()
        callee = getattr(import_module(module), name)
        # Of a process without standard streams, the pipe may bear one of these numbers.
        for stream in {1, 2} - {sender.fileno()}:
            os.dup2(stderr.fileno(), stream)
        start = perf_counter()
        value = callee(*args, **kwargs)
        seconds = perf_counter() - start
    except BaseException as raised:
        error = raised
    try:
        sender.send((value, seconds, error))
    except Exception as unsent:
        sender.send((None, 0.0, RuntimeError(str(error or unsent))))


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
