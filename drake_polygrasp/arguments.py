"""Checks the arguments of public functions, so that a wrong one is one clear line.

Each refusal is a UsageError that names the argument, its value and what it must be. Nothing here
looks at more than a few numbers: results of hot loops are not arguments.
"""

from __future__ import annotations

import errno
import math
import os
import reprlib
import sys
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import UsageError

T = TypeVar("T")


def refuse(name: str, value: object, demand: str) -> UsageError:
    """Returns the error that an argument is not what it must be."""
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
    """Returns a finite number within bounds as a float; `demand` says in words what it must be."""
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
    """Returns a length [m], 0 or more."""
    return check_number(name, value, "a length in metres, 0 or more", least=0.0)


def check_count(name: str, value: object) -> int:
    """Returns a whole number, at least 1."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, Integral):
        raise refuse(name, value, "a whole number and at least 1")
    if int(value) < 1:
        raise UsageError(f"{name} is {int(value)}; it must be at least 1")
    return min(int(value), sys.maxsize)


def check_choice(name: str, value: object, choices: Sequence[str]) -> str:
    """Returns one of a few words."""
    if not isinstance(value, str) or value not in choices:
        quoted = [repr(choice) for choice in choices]
        raise refuse(name, value, f"{', '.join(quoted[:-1])} or {quoted[-1]}")
    return value


def check_instance(name: str, value: object, kind: type[T], source: str = "") -> T:
    """Returns an instance of `kind`; `source` says where one comes from."""
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        hint = f", {source}" if source else ""
        raise UsageError(
            f"{name} is a {type(value).__name__}; it must be {article} {kind.__name__}{hint}"
        )
    return value


def check_path(name: str, value: object) -> str | Path:
    """Returns a path as text or Path: a str or a path object, not bytes."""
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
    """Returns several paths; one alone is taken for a mistake."""
    if isinstance(values, str | bytes | os.PathLike):
        raise refuse(name, values, "a list of paths: put it in brackets")
    return tuple(check_path(f"{name}[{i}]", v) for i, v in enumerate(check_items(name, values)))


def check_packages(name: str, value: object) -> dict[str, str | Path]:
    """Returns folders of packages by name; none for None."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise refuse(name, value, "a dict of folders by the names of packages")
    return {
        check_text(f"a key of {name}", key): check_path(f"{name}[{key!r}]", folder)
        for key, folder in value.items()
    }


def check_text(name: str, value: object) -> str:
    """Returns text that is not empty."""
    if not isinstance(value, str) or not value:
        raise refuse(name, value, "text")
    return value


def check_items(name: str, values: object) -> list[Any]:
    """Returns the items of a list or of another collection, which text and bytes are not."""
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise refuse(name, values, "a list")
    try:
        return list(values)
    except TypeError as error:  # an array without dimensions
        raise refuse(name, values, "a list") from error


def check_array(name: str, value: object, shape: tuple[int, ...]) -> Array:
    """Returns finite numbers of a shape as a read-only array."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        array = np.empty(0, dtype=object)
    if array.dtype.kind not in "fiu" or array.shape != shape or not np.isfinite(array).all():
        raise refuse(name, value, f"finite numbers, an array of shape {shape}")
    return frozen(array)


def check_flag(name: str, value: object) -> bool:
    """Returns True or False."""
    if not isinstance(value, bool | np.bool_):
        raise refuse(name, value, "True or False")
    return bool(value)


def check_callback(name: str, value: object) -> None:
    """Refuses what cannot be called; None is no callback."""
    if value is not None and not callable(value):
        raise refuse(name, value, "a function, or None")
