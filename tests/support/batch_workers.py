"""What children run in tests of batches, in place of the planner: some of it ends badly."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any


def misbehave(*, what: str, value: int = 0, log: str = "") -> dict[str, Any]:
    """Does one thing that planning must survive, and returns twice the value where it returns."""
    if log:
        with Path(log).open("a") as file:
            file.write(f"{what} {value} {os.getpid()}\n")
    match what:
        case "abort":
            print("terminate called after throwing an instance of 'int'", file=sys.stderr)
            sys.stderr.flush()
            os.abort()
        case "hang":
            time.sleep(100_000)
        case "wait":
            while not Path(f"{log}.go").exists():
                time.sleep(0.01)
        case "spin":
            while True:
                pass
        case "hog":
            return {"size": len(bytearray(1 << 40))}
        case "grow":
            blocks = []
            while True:
                blocks.append(os.urandom(1 << 20) * 8)
        case "junk":
            os.write(1, b'{"value": 1}\nno reply at all\n' * 20_000)
            print("junk" * 10_000, file=sys.stderr)
            print(sys.stdin.read())
        case "raise":
            raise ValueError("on\ntwo lines")
        case "leave":
            os._exit(0)
        case "exit":
            sys.exit("goodbye")
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "killed_once":
            if not Path(f"{log}.once").exists():
                Path(f"{log}.once").touch()
                os.kill(os.getpid(), signal.SIGKILL)
        case "unprintable":
            return {"value": object()}
    return {"value": 2 * value, "pid": os.getpid(), "threads": os.environ["OPENBLAS_NUM_THREADS"]}
