"""What commands say on standard error and print, and their exit codes."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: all that was asked for holds; something does not, or nothing was found; the input or
the usage is wrong; stopped from the keyboard."""
_FILE = re.compile(r"(.+?)(?=(?::\d+[^:]*)?: )")
"""The file that a message begins with, before its line."""


def print_result(code: int, text: str) -> int:
    """Prints the result and passes the code on; who closes the pipe early has read enough."""
    try:
        if text:
            print(text, flush=True)
    except OSError as error:
        # Python flushes once more on leaving.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            return complain(f"standard output: {error.strerror}", BAD_INPUT)
    return code


def complain(message: str, code: int) -> int:
    """Says in one line why the exit code is not 0, and passes the code on."""
    say(f"polygrasp: {message}")
    return code


def warn(warnings: Iterable[str]) -> None:
    """Prints each in a line, with the name of the file it is about but not its folders."""
    for warning in warnings:
        file = _FILE.match(warning)
        if file and Path(file[0]).exists():
            warning = Path(file[0]).name + warning[file.end() :]
        say(f"warning: {warning}")


def say(message: str) -> None:
    """Prints one line on standard error, where there is one."""
    if sys.stderr is not None:
        with suppress(OSError):
            print(" ".join(message.splitlines()), file=sys.stderr, flush=True)


def as_json(document: dict[str, Any]) -> str:
    """Returns a document as text for machines."""
    return json.dumps(document, indent=2, allow_nan=False)
