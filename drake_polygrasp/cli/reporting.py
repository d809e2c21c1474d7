"""Exit codes, results on standard output, messages on standard error, and JSON text."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.child_messages import StderrLine, is_child, send_to_parent

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: all that was asked for holds; something does not, or nothing was found; the input or
the usage is wrong; stopped from the keyboard."""
_FILE = re.compile(r"(.+?)(?=(?::\d+[^:]*)?: )")
"""The file name that opens a message, before ": " or ":LINE: "."""


def print_result(code: int, text: str) -> int:
    """Prints a command's result on standard output.

    A closed pipe is no error: whoever reads it has read enough.

    Args:
        code: the command's exit code.
        text: what to print; nothing where empty.

    Returns:
        The exit code: `code`, or BAD_INPUT where standard output cannot be written.
    """
    try:
        if text:
            print(text, flush=True)
    except OSError as error:
        # On exit Python flushes standard output once more, which would fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            return print_error(f"standard output: {error.strerror}", BAD_INPUT)
    return code


def print_error(message: str, code: int) -> int:
    """Prints on standard error, in one line, why the exit code is not 0.

    Args:
        message: what went wrong.
        code: the exit code.

    Returns:
        `code`.
    """
    print_line(f"polygrasp: {message}")
    return code


def print_warnings(warnings: Iterable[str]) -> None:
    """Prints each warning in a line on standard error.

    Args:
        warnings: the warnings; of a path that opens one, only the file's name is printed.
    """
    for warning in warnings:
        file = _FILE.match(warning)
        if file and Path(file[0]).exists():
            warning = Path(file[0]).name + warning[file.end() :]
        print_line(f"warning: {warning}")


def print_line(message: str) -> None:
    """Prints one line on standard error, if there is one, or has the parent of this child do so.

    Args:
        message: text; line breaks in it become spaces.
    """
    text = " ".join(message.splitlines())
    if is_child():
        send_to_parent(StderrLine(text))
    elif sys.stderr is not None:
        with suppress(OSError):
            print(text, file=sys.stderr, flush=True)


def as_json(document: dict[str, Any]) -> str:
    """Returns a document as JSON text.

    Args:
        document: plain data: dictionaries, lists, text, finite numbers, booleans and None.
    """
    return json.dumps(document, indent=2, allow_nan=False)
