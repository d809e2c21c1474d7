"""Drake's refusals, its failed assertions too, as answers and not as errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from textwrap import shorten
from typing import TypeVar

from drake_polygrasp.errors import PolygraspError

_T = TypeVar("_T")
MAX_REASON = 200
"""Of Drake's words, ours."""


@dataclass(frozen=True)
class Refusal:
    """Why Drake did not answer."""

    reason: str


def ask_drake(question: Callable[[], _T]) -> _T | Refusal:
    """Returns what `question` returns, or Drake's reason where Drake refuses to answer.

    Drake raises RuntimeError, ValueError or IndexError, and SystemExit where an assertion fails.

    Raises:
        PolygraspError: as the question does.
    """
    try:
        return question()
    except PolygraspError:
        raise
    except (RuntimeError, ValueError, IndexError, SystemExit) as error:
        return Refusal(refusal_reason(error))


def refusal_reason(error: BaseException) -> str:
    """Drake's words, on one line and shortened."""
    return shorten(str(error), MAX_REASON, placeholder=" ...") or type(error).__name__
