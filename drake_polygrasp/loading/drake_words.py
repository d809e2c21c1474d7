"""What Drake says of a file, as warnings it logs and as errors, in words for people."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import shorten

MAX_WORDS = 400
"""Ours: Drake may quote a whole file."""
_PLACE = re.compile(r"(.*?):(\d+): (?:(?:warning|error): )*(.*)", re.DOTALL | re.IGNORECASE)
_LABEL = re.compile(
    r"^(?:SDFormat (?:Error|Warning) \[.*?\] (?:Error Code \d+: )?(?:Msg: )?|(?:warning|error): )*",
    re.IGNORECASE,
)
"""What stands before the words: a file and a line, or a label."""


@dataclass
class Heard:
    """What Drake logged while it read a file."""

    warnings: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def merged(self) -> list[str]:
        """Returns all of it, what differs only in the line of the file together."""
        lines: dict[tuple[str, str], dict[str, None]] = {}
        for said in (*self.errors, *self.warnings):
            file, line, words = _parts(said)
            lines.setdefault((file, words), {})[line] = None
        merged = []
        for (file, words), numbers in lines.items():
            more = f" (and {len(numbers) - 1} more)" if len(numbers) > 1 else ""
            merged.append(f"{file}:{next(iter(numbers))}{more}: {words}" if file else words)
        return merged


@contextmanager
def hearing() -> Iterator[Heard]:
    """Collects what Drake would log."""

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said = heard.errors if record.levelno >= logging.ERROR else heard.warnings
            said.append(shorten(record.getMessage(), MAX_WORDS))

    heard = Heard()
    logger, collector = logging.getLogger("drake"), Collector(logging.WARNING)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(collector)
    try:
        yield heard
    finally:
        logger.removeHandler(collector)
        logger.propagate = propagate


def reason_of(words: str, where: Path | str, logged: Sequence[str] = ()) -> str:
    """Returns Drake's reason not to load a file, without the file's name and labels.

    Args:
        words: of the error.
        where: the file.
        logged: errors that Drake logged before; the last has what the error may lack.
    """
    file, line, reason = _parts(words)
    if file:
        same = Path(file) == Path(where).absolute()
        reason = f"line {line}: {reason}" if same else f"{file}:{line}: {reason}"
    more = f" ({_parts(logged[-1])[2]})" if logged else ""
    return shorten(f"{reason}{more}", MAX_WORDS)


def _parts(said: str) -> tuple[str, str, str]:
    """The file, its line, and the words without a label."""
    place = _PLACE.match(said.strip())
    if place is None:
        return "", "", _LABEL.sub("", said.strip())
    # SDFormat writes two slashes before absolute paths.
    return re.sub(r"^//+", "/", place[1]), place[2], place[3]
