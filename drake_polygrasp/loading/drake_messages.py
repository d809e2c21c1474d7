"""Collects the warnings and errors that Drake logs about a file, and shortens them for users."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import shorten

_MAX_LENGTH = 400
"""Characters of a message that are kept, since Drake may quote a whole file. Our choice."""
_PLACE = re.compile(r"(.*?):(\d+): (?:(?:warning|error): )*(.*)", re.DOTALL | re.IGNORECASE)
"""A message that opens with a file and a line."""
_LABEL = re.compile(
    r"^(?:SDFormat (?:Error|Warning) \[.*?\] (?:Error Code \d+: )?(?:Msg: )?|(?:warning|error): )*",
    re.IGNORECASE,
)
"""The label that opens another message."""


@dataclass
class DrakeLog:
    """What Drake logged while it read a file.

    Attributes:
        warnings: its warnings, in order.
        errors: its errors, in order.
    """

    warnings: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def merged(self) -> list[str]:
        """Returns errors and warnings, those that differ only in the line number merged."""
        lines: dict[tuple[str, str], dict[str, None]] = {}
        for message in (*self.errors, *self.warnings):
            file, line, text = _split(message)
            lines.setdefault((file, text), {})[line] = None
        merged = []
        for (file, text), numbers in lines.items():
            more = f" (and {len(numbers) - 1} more)" if len(numbers) > 1 else ""
            merged.append(f"{file}:{next(iter(numbers))}{more}: {text}" if file else text)
        return merged


@contextmanager
def collect_drake_log() -> Iterator[DrakeLog]:
    """Yields a log that collects what Drake would otherwise print."""

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            messages = log.errors if record.levelno >= logging.ERROR else log.warnings
            messages.append(shorten(record.getMessage(), _MAX_LENGTH))

    log = DrakeLog()
    logger, collector = logging.getLogger("drake"), Collector(logging.WARNING)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(collector)
    try:
        yield log
    finally:
        logger.removeHandler(collector)
        logger.propagate = propagate


def drake_reason(message: str, where: Path | str, logged: Sequence[str] = ()) -> str:
    """Returns Drake's reason not to load a file, without the file's name and labels.

    Args:
        message: the message of Drake's error.
        where: the file.
        logged: errors that Drake logged before; the last often has details that the error lacks.
    """
    file, line, reason = _split(message)
    if file:
        same = Path(file) == Path(where).absolute()
        reason = f"line {line}: {reason}" if same else f"{file}:{line}: {reason}"
    more = f" ({_split(logged[-1])[2]})" if logged else ""
    return shorten(f"{reason}{more}", _MAX_LENGTH)


def _split(message: str) -> tuple[str, str, str]:
    """Returns the file and line of a message, both empty if it has none, and its text."""
    place = _PLACE.match(message.strip())
    if place is None:
        return "", "", _LABEL.sub("", message.strip())
    # SDFormat writes two slashes before absolute paths.
    return re.sub(r"^//+", "/", place[1]), place[2], place[3]
