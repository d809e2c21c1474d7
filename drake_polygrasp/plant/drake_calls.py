"""Returns Drake's errors and failed assertions as values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from textwrap import shorten
from typing import TypeVar

from drake_polygrasp.errors import PolygraspError

_T = TypeVar("_T")
_MAX_REASON = 200
"""Characters of a message of Drake that are kept. Our choice."""


@dataclass(frozen=True)
class Refusal:
    """An error that Drake raised in place of a result.

    Attributes:
        reason: Drake's message, on one line.
    """

    reason: str


def ask_drake(question: Callable[[], _T]) -> _T | Refusal:
    """Calls a function that uses Drake, and returns its result or Drake's error.

    Drake raises RuntimeError, ValueError or IndexError, and SystemExit if an assertion fails.

    Args:
        question: the function to call.

    Returns:
        Its result, or the reason if Drake raised an error.

    Raises:
        PolygraspError: when the function raises one.
    """
    try:
        return question()
    except PolygraspError:
        raise
    except (RuntimeError, ValueError, IndexError, SystemExit) as error:
        return Refusal(refusal_reason(error))


def refusal_reason(error: BaseException) -> str:
    """Returns the message of an error, shortened to one line.

    Args:
        error: the exception that Drake raised.
    """
    return shorten(str(error), _MAX_REASON, placeholder=" ...") or type(error).__name__
