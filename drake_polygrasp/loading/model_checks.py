"""Refuses what Drake silently replaces or ignores: impossible sizes and masses, and xacro."""

from __future__ import annotations

import math
import re
from itertools import chain
from pathlib import Path
from xml.etree.ElementTree import Element

from drake_polygrasp.errors import ModelError

MAX_FRICTION = 100.0
"""Greatest friction coefficient. Our choice: beyond it, a value is a typing error, and arithmetic
loses accuracy."""
MAX_SCALE = 1e6
"""Greatest scale of an OBJ model; the least is its inverse. Our choice: beyond, typing errors."""
_MAX_SIZE = 1e6
"""Greatest size of a collision geometry [m]. Our choice."""
_SIZES = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "ellipsoid": {"radii": 3},
}
"""The sizes of each collision shape, and how many numbers each has, in SDF and URDF alike."""

_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NAMED = frozenset(
    ("robot", "mujoco", "model", "include", "link", "body", "collision", "geom", "joint")
)
"""Elements whose names are looked up in Drake's plant."""
_FIRST_STRAY_BYTE, _LAST_STRAY_BYTE = "\udc80", "\udcff"
"""Bytes that are not UTF-8, as `xml_reader` keeps them."""

_DEFINITIONS = frozenset(f"xacro:{kind}" for kind in ("property", "arg", "macro", "include"))
"""Elements of xacro that add nothing to a model by themselves."""
_EXPRESSIONS = ("${", "$(")


def check_expanded(root: Element, path: Path) -> None:
    """Checks that a URDF document is not the source of one, which xacro has still to expand.

    Drake ignores elements of xacro, so that the links and shapes they stand for would be missing.

    Args:
        root: the <robot>.
        path: the document.

    Raises:
        ModelError: for an element or a value of a link or joint that xacro would replace.
    """
    links = [child for child in root if child.tag in ("link", "joint")]
    for element in chain(root, *(link.iter() for link in links)):
        if element.tag.startswith("xacro:") and element.tag not in _DEFINITIONS:
            raise _unexpanded(f"<{element.tag}>", path)
    for element in chain.from_iterable(link.iter() for link in links):
        for name, value in element.attrib.items():
            if name not in ("name", "link") and any(start in value for start in _EXPRESSIONS):
                raise _unexpanded(f"{name}={value!r} of <{element.tag}>", path)


def _unexpanded(what: str, path: Path) -> ModelError:
    return ModelError(
        f"{path}: {what} is xacro, which Drake does not read; expand it, 'xacro {path.name} -o "
        "NEW.urdf', and name the new file"
    )


def check_names(root: Element, path: Path) -> None:
    """Checks that names are UTF-8 text, as pydrake needs to look them up.

    Args:
        root: the document's element.
        path: the document.

    Raises:
        ModelError: for a name that is not.
    """
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
    """Checks a link's sizes, and that Drake can compute its inertia if it is to.

    Args:
        link: a <link>.
        path: its document.
        urdf: whether that is URDF, not SDF.

    Raises:
        ModelError: for a size that Drake would replace, or inertia that it cannot compute.
    """
    inertial = link.find("inertial")
    if is_automatic(inertial) and link.find("collision/geometry/mesh") is not None:
        raise ModelError(
            f"{path}: Drake cannot compute the inertia of link '{link.get('name')}', which has a "
            "collision mesh; state its mass and inertia instead of auto"
        )
    for collision in link.findall("collision"):
        _check_sizes(collision, path, urdf=urdf)


def is_automatic(inertial: Element | None) -> bool:
    """Returns whether SDF asks for the mass properties of the collision geometry.

    Args:
        inertial: the <inertial> element of a link, if there is one.
    """
    return inertial is not None and inertial.get("auto", "").strip().lower() in ("true", "1")


def _check_sizes(collision: Element, path: Path, *, urdf: bool) -> None:
    for shape, sizes in _SIZES.items():
        for element in collision.iter(shape):
            for name, count in sizes.items():
                text = element.get(name) if urdf else element.findtext(name)
                values = _numbers(text)
                if len(values) != count or not all(0 < x <= _MAX_SIZE for x in values):
                    raise ModelError(
                        f"{path}: the {name} of a collision {shape} is {text!r}; write "
                        f"{'three numbers' if count == 3 else 'a number'} of metres, above 0 "
                        f"and at most {_MAX_SIZE:g}"
                    )


def check_mass(link: Element, path: Path, *, urdf: bool) -> None:
    """Checks that a link's mass, if stated, is positive; Drake replaces others.

    Args:
        link: a <link>.
        path: its document.
        urdf: whether that is URDF, not SDF.

    Raises:
        ModelError: when it is not.
    """
    mass = link.find("inertial/mass")
    if mass is None:
        return
    value = first_number(mass.get("value") if urdf else mass.text)
    if value is None or not 0 < value < math.inf:
        raise ModelError(
            f"{path}: link '{link.get('name')}' has a mass that is not above 0; state one that "
            "is, or leave it out"
        )


def first_number(text: str | None) -> float | None:
    """Returns the number that a text begins with, as Drake reads it, ignoring what follows.

    Args:
        text: the text; None where there is none.

    Returns:
        The number; None where the text does not begin with one.
    """
    number = _NUMBER.match(text or "")
    return None if number is None else float(number[0])


def _numbers(text: str | None) -> list[float]:
    """Returns the numbers of a text, a single NaN if a word is not a number."""
    try:
        return [float(word) for word in (text or "").split()]
    except ValueError:
        return [math.nan]
