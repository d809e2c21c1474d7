"""Checks the arguments of public functions.

Each wrong argument raises a UsageError whose one line names it, its value and what it must be.
"""

from __future__ import annotations

import errno
import math
import os
import reprlib
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import UsageError

_T = TypeVar("_T")


def refuse(name: str, value: object, demand: str) -> UsageError:
    """Returns the error that says what an argument must be.

    Args:
        name: what the message calls the argument.
        value: the argument as it was given, shortened in the message.
        demand: what it must be, in words: "a length in metres, 0 or more".
    """
    shown = " ".join(reprlib.repr(value).split())
    return UsageError(f"{name} is {shown}; it must be {demand}")


def check_number(
    name: str,
    value: object,
    demand: str,
    *,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
) -> float:
    """Returns a finite number within bounds as a float.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.
        demand: what it must be, in words, with its unit.
        least: the number is at least this.
        above: the number is greater than this.
        most: the number is at most this.

    Raises:
        UsageError: when it is no such number.
    """
    if isinstance(value, np.ndarray) and value.shape == ():
        value = value.item()
    if isinstance(value, bool | np.bool_) or not isinstance(value, Real):
        raise refuse(name, value, demand)
    try:
        number = float(value)
    except OverflowError:  # a whole number beyond all floats
        raise refuse(name, value, demand) from None
    if not (math.isfinite(number) and least <= number <= most and number > above):
        raise refuse(name, value, demand)
    return number


def check_length(name: str, value: object) -> float:
    """Returns a length [m], 0 or more.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Raises:
        UsageError: when it is no such number.
    """
    return check_number(name, value, "a length in metres, 0 or more", least=0.0)


def check_count(name: str, value: object) -> int:
    """Returns a whole number, at least 1 and at most sys.maxsize.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Raises:
        UsageError: when it is no whole number or less than 1.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral):
        raise refuse(name, value, "a whole number and at least 1")
    if int(value) < 1:
        raise UsageError(f"{name} is {int(value)}; it must be at least 1")
    return min(int(value), sys.maxsize)


def check_seed(name: str, value: object) -> int:
    """Returns a seed of random numbers: a whole number, 0 or more.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Raises:
        UsageError: when it is no such number.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral) or int(value) < 0:
        raise refuse(name, value, "a whole number, 0 or more")
    return int(value)


def check_choice(name: str, value: object, choices: Sequence[str]) -> str:
    """Returns one of a few words.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.
        choices: the words, two or more.

    Raises:
        UsageError: when it is none of them.
    """
    if not isinstance(value, str) or value not in choices:
        quoted = [repr(choice) for choice in choices]
        raise refuse(name, value, f"{', '.join(quoted[:-1])} or {quoted[-1]}")
    return value


def check_instance(name: str, value: object, kind: type[_T], source: str = "") -> _T:
    """Returns an instance of a class.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.
        kind: the class.
        source: where one comes from, added to the message: "as load_object returns it".

    Raises:
        UsageError: when it is no instance of it.
    """
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        hint = f", {source}" if source else ""
        raise UsageError(
            f"{name} is a {type(value).__name__}; it must be {article} {kind.__name__}{hint}"
        )
    return value


def check_path(name: str, value: object) -> str | Path:
    """Returns a path as text or pathlib.Path; bytes are refused.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Raises:
        UsageError: when it is no path, has a null character or is too long for the system.
    """
    if isinstance(value, os.PathLike):
        value = value if isinstance(value, Path) else os.fspath(value)
    if not isinstance(value, str | Path):
        raise refuse(name, value, "a path, as text or pathlib.Path")
    if "\0" in str(value):
        raise refuse(name, value, "a path, in which there are no null characters")
    try:
        Path(value).stat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise refuse(name, str(value), "a path no longer than the system takes") from error
    return value


def check_paths(name: str, values: object) -> tuple[str | Path, ...]:
    """Returns several paths; a path that is not in a list is refused.

    Args:
        name: what messages call the argument.
        values: the argument as it was given.

    Raises:
        UsageError: when it is no list, or an item is no path.
    """
    if isinstance(values, str | bytes | os.PathLike):
        raise refuse(name, values, "a list of paths: put it in brackets")
    return tuple(check_path(f"{name}[{i}]", v) for i, v in enumerate(check_items(name, values)))


def check_packages(name: str, value: object) -> dict[str, str | Path]:
    """Returns the folders of packages by name, empty for None.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Raises:
        UsageError: when it is no mapping, or a name or a folder is wrong.
    """
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise refuse(name, value, "a dict of folders by the names of packages")
    return {
        check_text(f"a key of {name}", key): check_path(f"{name}[{key!r}]", folder)
        for key, folder in value.items()
    }


def check_text(name: str, value: object) -> str:
    """Returns text that is not empty.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Raises:
        UsageError: when it is not text, or empty.
    """
    if not isinstance(value, str) or not value:
        raise refuse(name, value, "text")
    return value


def check_items(name: str, values: object) -> list[Any]:
    """Returns the items of a list or another iterable, except text and bytes.

    Args:
        name: what messages call the argument.
        values: the argument as it was given.

    Raises:
        UsageError: when it is none.
    """
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise refuse(name, values, "a list")
    try:
        return list(values)
    except TypeError as error:  # an array without dimensions
        raise refuse(name, values, "a list") from error


def check_array(name: str, value: object, shape: tuple[int, ...]) -> Array:
    """Returns an array of finite numbers, read-only.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.
        shape: shape that it must have.

    Raises:
        UsageError: when it is no array of that shape, or a number is not finite.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "fiu" or array.shape != shape or not np.isfinite(array).all():
        raise refuse(name, value, f"finite numbers, an array of shape {shape}")
    return frozen(array)


def check_flag(name: str, value: object) -> bool:
    """Returns a truth value.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Raises:
        UsageError: when it is neither True nor False.
    """
    if not isinstance(value, bool | np.bool_):
        raise refuse(name, value, "True or False")
    return bool(value)


Progress: TypeAlias = Callable[[int, int], None]
"""A function that is called with the number of steps done and the greatest number of steps."""


def check_progress(name: str, value: Progress | None) -> Progress:
    """Returns a progress callback.

    Args:
        name: what messages call the argument.
        value: the argument as it was given.

    Returns:
        The callback, or `no_progress` for None.

    Raises:
        UsageError: when it is neither None nor callable.
    """
    if value is not None and not callable(value):
        raise refuse(name, value, "a function, or None")
    return value or no_progress


def no_progress(done: int, total: int) -> None:
    """Ignores the progress, for callers that pass no callback.

    Args:
        done: number of steps done.
        total: greatest number of steps.
    """
