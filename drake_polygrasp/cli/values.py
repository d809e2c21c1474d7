"""Reads the values of the command line's options; what is none is argparse's usage error."""

from __future__ import annotations

import argparse
import math

from drake_polygrasp.loading.model_checks import MAX_FRICTION, MAX_SCALE

MAX_LENGTH = 1000.0
"""Ours [m]: clearances and radii beyond it are slips of the pen."""


def read_package(text: str) -> tuple[str, str]:
    """Returns the name and folder of NAME=DIR."""
    name, equals, folder = text.partition("=")
    if not (name and equals and folder):
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=DIR")
    return name, folder


def read_number(text: str, most: float, least: float = 0.0) -> float:
    """Returns a number from `least` to `most`."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not least <= number <= most:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from {least:g} to {most:g}")
    return number


def read_friction(text: str) -> float:
    """Returns a friction coefficient above 0."""
    number = read_number(text, MAX_FRICTION)
    if number == 0:
        raise argparse.ArgumentTypeError("without friction there is no grasp")
    return number


def read_scale(text: str) -> float:
    """Returns a factor above 0."""
    return read_number(text, MAX_SCALE, least=1 / MAX_SCALE)


def read_length(text: str) -> float:
    """Returns a length [m]."""
    return read_number(text, MAX_LENGTH)


def read_depth(text: str) -> float:
    """Returns a length above 0 [m]."""
    depth = read_length(text)
    if depth == 0:
        raise argparse.ArgumentTypeError("facets of a curve lie off its patch; more than 0")
    return depth


def read_angle(text: str) -> float:
    """Returns an angle above 0 and below pi/2 [rad]."""
    angle = read_number(text, math.pi / 2)
    if not 0 < angle < math.pi / 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not above 0 and below pi/2")
    return angle


def read_count(text: str) -> int:
    """Returns a positive whole number."""
    if not text.isascii() or not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive whole number")
    return int(text)


def read_component(text: str) -> float:
    """Returns a finite number."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


def read_faces(text: str) -> tuple[int, ...]:
    """Returns indices of faces, ascending."""
    indices = text.split(",")
    if not all(i.isascii() and i.isdigit() for i in indices):
        raise argparse.ArgumentTypeError(f"{text!r} is not I,J,K, indices of faces")
    return tuple(sorted(int(i) for i in indices))


def read_face_set(text: str) -> tuple[int, ...]:
    """Returns two or three indices of faces."""
    faces = read_faces(text)
    if len(faces) not in (2, 3):
        raise argparse.ArgumentTypeError(f"{text!r} is not I,J or I,J,K, indices of faces")
    return faces
