"""The program of a child process: calls one function again and again, once for each line it reads.

    python -m drake_polygrasp.batch.child MODULE:FUNCTION PARENT_PID MEMORY

Requests and replies are lines of JSON on its standard input and output. Both are moved to
descriptors of their own before anything is imported, so that a library that prints or reads cannot
disturb them: what it prints goes to standard error.
"""

from __future__ import annotations

import ctypes
import json
import os
import resource
import signal
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import IO, Any

_SET_PARENT_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of Linux's prctl."""


def serve_requests() -> None:
    """Serves requests until there are no more or memory has run out once.

    A request is a dictionary of keyword arguments. A reply has `value`, what the function returned,
    or `error`, and `seconds` and `peak_bytes`, what the call took. The first line that is sent says
    that the function is imported.
    """
    function, parent, memory = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    requests, replies = _own_streams()
    _die_with_parent(parent)
    _limit_resources(memory)
    module, _, name = function.partition(":")
    callee = getattr(import_module(module), name)
    _send(replies, {"ready": True})
    for line in requests:
        _reset_peak()
        reply: dict[str, Any] = {}
        start = perf_counter()
        try:
            reply["value"] = callee(**json.loads(line))
        except MemoryError:
            reply["error"] = "memory"
        except BaseException as error:
            reply["error"] = f"{type(error).__name__}: {error}"
        took = {"seconds": perf_counter() - start, "peak_bytes": _peak_bytes()}
        try:
            _send(replies, reply | took)
        except TypeError as error:
            _send(replies, {"error": f"{type(error).__name__}: {error}"} | took)
        if reply.get("error") == "memory":
            return  # What is left of the heap may be too little for the next.


def _own_streams() -> tuple[IO[bytes], IO[bytes]]:
    """Moves the pipes away from descriptors 0 and 1, which libraries use."""
    requests, replies = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    return requests, replies


def _die_with_parent(parent: int) -> None:
    """Has Linux kill this process when its parent dies; others end when their pipe closes."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:  # It died before that.
        sys.exit()


def _limit_resources(memory: int) -> None:
    """Bounds writable memory, and leaves no core dumps."""
    for limit, wanted in ((resource.RLIMIT_DATA, memory), (resource.RLIMIT_CORE, 0)):
        soft, hard = resource.getrlimit(limit)
        finite = [value for value in (soft, hard, wanted) if value != resource.RLIM_INFINITY]
        with suppress(ValueError, OSError):
            resource.setrlimit(limit, (min(finite), hard))


def _send(replies: IO[bytes], reply: dict[str, Any]) -> None:
    replies.write(json.dumps(reply).encode() + b"\n")
    replies.flush()


def _reset_peak() -> None:
    """Starts the measurement of peak memory anew, where Linux allows it."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak_bytes() -> int:
    """Returns the greatest resident memory since the last reset."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


if __name__ == "__main__":
    serve_requests()
