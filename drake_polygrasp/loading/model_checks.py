"""Refuses impossible sizes and masses of a model, which Drake would replace by its own."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree.ElementTree import Element

from drake_polygrasp.errors import ModelError

MAX_FRICTION = 100.0
"""Ours: coefficients beyond it are slips of the pen, and strain the arithmetic."""
MAX_SCALE = 1e6
"""Of an OBJ model, ours: larger ones, and ones below 1 over this, are slips of the pen."""
MAX_SIZE = 1e6
"""Of a collision geometry, ours [m]."""
_SIZES = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "ellipsoid": {"radii": 3},
}
"""The sizes of a collision geometry and how many numbers each has, the same in SDF and URDF."""

_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NAMED = frozenset(
    ("robot", "mujoco", "model", "include", "link", "body", "collision", "geom", "joint")
)
"""Elements whose names are asked of Drake's plant."""
_FIRST_STRAY_BYTE, _LAST_STRAY_BYTE = "\udc80", "\udcff"
"""Bytes that are not UTF-8, as `xml_reader` keeps them."""


def check_names(root: Element, path: Path) -> None:
    """Raises ModelError for names that Drake reads, but Python cannot ask it for."""
    for element in root.iter():
        names = [element.get("model" if element.tag == "mujoco" else "name", "")]
        if element.tag == "include":
            names.append(element.findtext("name") or "")
        for name in names if element.tag in _NAMED else ():
            if any(_FIRST_STRAY_BYTE <= character <= _LAST_STRAY_BYTE for character in name):
                raise ModelError(
                    f"{path}: the name {name!a} of a {element.tag} is not UTF-8 text; save "
                    "the file as UTF-8"
                )


def check_link(link: Element, path: Path, *, urdf: bool) -> None:
    """Raise ModelError for sizes that Drake would replace, and for mass that it cannot compute."""
    inertial = link.find("inertial")
    if is_automatic(inertial) and link.find("collision/geometry/mesh") is not None:
        raise ModelError(
            f"{path}: Drake cannot compute the inertia of link '{link.get('name')}', which has a "
            "collision mesh; state its mass and inertia instead of auto"
        )
    for collision in link.findall("collision"):
        _check_sizes(collision, path, urdf=urdf)


def is_automatic(inertial: Element | None) -> bool:
    """Returns whether an <inertial> of SDF asks for mass properties of the collision geometry."""
    return inertial is not None and inertial.get("auto", "").strip().lower() in ("true", "1")


def _check_sizes(collision: Element, path: Path, *, urdf: bool) -> None:
    for shape, sizes in _SIZES.items():
        for element in collision.iter(shape):
            for name, count in sizes.items():
                text = element.get(name) if urdf else element.findtext(name)
                values = _numbers(text)
                if len(values) != count or not all(0 < x <= MAX_SIZE for x in values):
                    raise ModelError(
                        f"{path}: the {name} of a collision {shape} is {text!r}; write "
                        f"{'three numbers' if count == 3 else 'a number'} of metres, above 0 "
                        f"and at most {MAX_SIZE:g}"
                    )


def check_mass(link: Element, path: Path, *, urdf: bool) -> None:
    """Raises ModelError for a mass of an SDF or URDF link that Drake would replace by its own."""
    mass = link.find("inertial/mass")
    if mass is None:
        return
    value = first_number(mass.get("value") if urdf else mass.text)
    if value is None or not 0 < value < math.inf:
        raise ModelError(
            f"{path}: link '{link.get('name')}' has a mass that is not above 0; state one that "
            "is, or none"
        )


def first_number(text: str | None) -> float | None:
    """Returns the number that a text begins with, as Drake reads it; what follows is no matter."""
    number = _NUMBER.match(text or "")
    return None if number is None else float(number[0])


def _numbers(text: str | None) -> list[float]:
    """Returns the numbers of a text, a lone NaN when they are none."""
    try:
        return [float(word) for word in (text or "").split()]
    except ValueError:
        return [math.nan]
