"""Parses and validates option values; argparse turns a refusal into a usage error."""

from __future__ import annotations

import argparse
import math
import re

from drake_polygrasp.batch.rows import STATUSES
from drake_polygrasp.loading.model_checks import MAX_FRICTION, MAX_SCALE

_MAX_SECONDS = 7 * 86_400.0
"""Greatest time for an object [s]. Our choice: beyond a week, it is a typing error."""
_UNITS = {"MB": 10**6, "MiB": 2**20, "GB": 10**9, "GiB": 2**30}
_MAX_MASS = 10_000.0
"""Greatest mass accepted [kg]. Our choice: beyond it, a value is a typing error."""
_MAX_LENGTH = 1000.0
"""Greatest clearance or radius accepted [m]. Our choice: beyond it, a value is a typing error."""


def read_package(text: str) -> tuple[str, str]:
    """Returns the name and folder of NAME=DIR.

    Args:
        text: the option's value.

    Raises:
        ArgumentTypeError: when it has another form.
    """
    name, equals, folder = text.partition("=")
    if not (name and equals and folder):
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=DIR")
    return name, folder


def read_friction(text: str) -> float:
    """Returns a friction coefficient, above 0 and at most MAX_FRICTION.

    Args:
        text: the option's value.

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    return _above_zero(_read_number(text, MAX_FRICTION), "without friction there is no grasp")


def read_scale(text: str) -> float:
    """Returns a scale factor, from 1 / MAX_SCALE to MAX_SCALE.

    Args:
        text: the option's value.
    """
    return _read_number(text, MAX_SCALE, least=1 / MAX_SCALE)


def read_length(text: str) -> float:
    """Returns a length of 0 to 1,000 m.

    Args:
        text: the option's value [m].
    """
    return _read_number(text, _MAX_LENGTH)


def read_depth(text: str) -> float:
    """Returns a patch depth, above 0 and at most 1,000 m.

    Args:
        text: the option's value [m].

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    why = "facets of a curved surface lie off the plane of their patch"
    return _above_zero(read_length(text), why)


def read_angle(text: str) -> float:
    """Returns an angle strictly between 0 and pi/2.

    Args:
        text: the option's value [rad].

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    angle = _read_number(text, math.pi / 2)
    if not 0 < angle < math.pi / 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0 and below pi/2")
    return angle


def read_tilt(text: str) -> float:
    """Returns an angle from 0 to pi/2, of which plans allow less.

    Args:
        text: the option's value [rad].
    """
    return _read_number(text, math.pi / 2)


def read_share(text: str) -> float:
    """Returns a share, from 0 to below 1.

    Args:
        text: the option's value.

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    share = _read_number(text, 1.0)
    if share == 1:
        raise argparse.ArgumentTypeError("all of the friction leaves none; give less than 1")
    return share


def read_count(text: str) -> int:
    """Returns a positive whole number.

    Args:
        text: the option's value.

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    if not text.isascii() or not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive whole number")
    return int(text)


def read_mass(text: str) -> float:
    """Returns a mass above 0, at most 10,000 kg.

    Args:
        text: the option's value [kg].

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    return _above_zero(_read_number(text, _MAX_MASS), "what weighs nothing needs no torques")


def read_seed(text: str) -> int:
    """Returns a whole number, 0 or more.

    Args:
        text: the option's value.

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    if not text.isascii() or not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, 0 or more")
    return int(text)


def read_seconds(text: str) -> float:
    """Returns a time above 0, at most a week.

    Args:
        text: the option's value [s].

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    return _above_zero(_read_number(text, _MAX_SECONDS), "nothing is done in no time")


def read_memory(text: str) -> int:
    """Returns a number of bytes, 256 MiB or more.

    Args:
        text: the option's value: a number with MB, MiB, GB or GiB.

    Raises:
        ArgumentTypeError: when it has another form or is less.
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?) *(MB|MiB|GB|GiB)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 4GiB or 500MB")
    size = int(float(match[1]) * _UNITS[match[2]])
    if size < 256 << 20:
        raise argparse.ArgumentTypeError(f"{text!r} is less than Drake needs; give 256MiB or more")
    return size


def read_shard(text: str) -> tuple[int, int]:
    """Returns the number of a shard, from 1, and the number of shards.

    Args:
        text: the option's value: I/N.

    Raises:
        ArgumentTypeError: when it has another form.
    """
    match = re.fullmatch(r"([0-9]+)/([0-9]+)", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise argparse.ArgumentTypeError(f"{text!r} is not I/N, with I from 1 to N")
    return int(match[1]), int(match[2])


def read_statuses(text: str) -> tuple[str, ...]:
    """Returns statuses of results without grasps.

    Args:
        text: the option's value: statuses separated by commas.

    Raises:
        ArgumentTypeError: when one is no such status.
    """
    statuses = tuple(text.split(","))
    for status in statuses:
        if status not in STATUSES[1:]:
            raise argparse.ArgumentTypeError(f"{status!r} is none of {', '.join(STATUSES[1:])}")
    return statuses


def read_component(text: str) -> float:
    """Returns a finite number, as one component of a vector.

    Args:
        text: the option's value.

    Raises:
        ArgumentTypeError: when it is no such number.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


def read_faces(text: str) -> tuple[int, ...]:
    """Returns face indices, ascending.

    Args:
        text: the option's value: whole numbers separated by commas.

    Raises:
        ArgumentTypeError: when it has another form.
    """
    indices = text.split(",")
    if not all(i.isascii() and i.isdigit() for i in indices):
        raise argparse.ArgumentTypeError(f"{text!r} is not I,J,K, indices of faces")
    return tuple(sorted(int(i) for i in indices))


def read_face_set(text: str) -> tuple[int, ...]:
    """Returns the two or three face indices of a set, ascending.

    Args:
        text: the option's value: whole numbers separated by commas.

    Raises:
        ArgumentTypeError: when it has another form.
    """
    faces = read_faces(text)
    if len(faces) not in (2, 3):
        raise argparse.ArgumentTypeError(f"{text!r} is not I,J or I,J,K, indices of faces")
    return faces


def _read_number(text: str, most: float, least: float = 0.0) -> float:
    """Returns a number from `least` to `most`."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not least <= number <= most:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from {least:g} to {most:g}")
    return number


def _above_zero(number: float, why: str) -> float:
    """Returns a number, 0 or more, that must not be 0."""
    if number == 0:
        raise argparse.ArgumentTypeError(f"{why}; give more than 0")
    return number
