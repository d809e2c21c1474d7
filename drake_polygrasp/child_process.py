"""Calls a function in a child process, because a parser in C++ can end the process it runs in."""

from __future__ import annotations

import signal
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from time import perf_counter
from typing import Any

from drake_polygrasp.errors import ModelError


def call_in_child(function: str, /, *args: Any, **kwargs: Any) -> tuple[Any, float]:
    """What `function` ("package.module:name") returns, and the seconds the call took.

    Its module is imported in the child only; what goes in and out is pickled.

    Raises:
        ModelError: when the child is ended by a signal.
        Exception: whatever the function raises.
    """
    # Forked, the child starts at once: a spawned one would import everything again.
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_run, args=(sender, function, args, kwargs), daemon=True)
    child.start()
    sender.close()
    try:
        value, seconds, error = receiver.recv()
    except EOFError:
        child.join()
        raise ModelError(f"{args[0]}: {_death(child.exitcode)} while reading it") from None
    child.join()
    if error is not None:
        raise error
    return value, seconds


def _run(sender: Connection, function: str, args: Any, kwargs: Any) -> None:
    module, _, name = function.partition(":")
    value, seconds, error = None, 0.0, None
    try:
        callee = getattr(import_module(module), name)
        start = perf_counter()
        value = callee(*args, **kwargs)
        seconds = perf_counter() - start
    except BaseException as raised:
        error = raised
    sender.send((value, seconds, error))


def _death(exit_code: int | None) -> str:
    if exit_code is None or exit_code >= 0:
        return "the reading process ended"
    return f"Drake crashed ({signal.Signals(-exit_code).name})"
