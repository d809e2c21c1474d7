"""The pipe by which a command, which runs in a child process, tells its parent what goes on."""

from __future__ import annotations

from multiprocessing.connection import Connection
from typing import NamedTuple

_to_parent: Connection | None = None
"""The pipe; None in a process that is no child."""


class StderrLine(NamedTuple):
    """A message to the parent: a line for its standard error.

    Attributes:
        text: the line.
    """

    text: str


def connect_to_parent(pipe: Connection) -> None:
    """Makes this process a child that tells its parent what goes on.

    Args:
        pipe: where messages are written.
    """
    global _to_parent
    _to_parent = pipe


def is_child() -> bool:
    """Returns whether this process is a child that has a parent to tell."""
    return _to_parent is not None


def send_to_parent(message: object) -> None:
    """Sends a message to the parent process.

    Args:
        message: any value that can be pickled.

    Raises:
        RuntimeError: when this process is no child.
    """
    if _to_parent is None:
        raise RuntimeError("this process has no parent to tell")
    _to_parent.send(message)
