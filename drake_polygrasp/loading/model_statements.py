"""What a model's documents state in so many words, and Drake would replace or forget.

After parsing, Drake cannot tell friction or mass that a file states from its own defaults, and
it replaces impossible sizes and masses by others. The documents tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from drake_polygrasp.errors import ModelError

MAX_FRICTION = 100.0
"""Ours: coefficients beyond it are slips of the pen, and strain the arithmetic."""
MAX_SIZE = 1e6
"""Of a collision geometry, ours [m]."""
_FRICTION_TAGS = ("mu", "mu2", "drake_mu_static", "drake_mu_dynamic")
_SIZES = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "ellipsoid": {"radii": 3},
}
"""The sizes of a collision geometry and how many numbers each has, the same in SDF and URDF."""


@dataclass(frozen=True)
class Statements:
    """What the files say of one link."""

    mass: bool
    """Whether they state a mass."""
    friction: tuple[bool, ...]
    """Whether they state friction, of each collision geometry in document order."""

    def state_friction(self, k: int, count: int) -> bool:
        """Of the k-th of `count` geometries; when Drake dropped some, whether all state it."""
        return self.friction[k] if len(self.friction) == count else all(self.friction)


def check_link(link: ElementTree.Element, path: Path, *, urdf: bool) -> None:
    """Raise ModelError for sizes that Drake would replace, and for mass that it cannot compute."""
    inertial = link.find("inertial")
    if _is_automatic(inertial) and link.find("collision/geometry/mesh") is not None:
        raise ModelError(
            f"{path}: Drake cannot compute the inertia of link '{link.get('name')}', which has a "
            "collision mesh; state its mass and inertia instead of auto"
        )
    for collision in link.iter("collision"):
        _check_sizes(collision, path, urdf=urdf)


def _is_automatic(inertial: ElementTree.Element | None) -> bool:
    return inertial is not None and inertial.get("auto", "").strip().lower() in ("true", "1")


def _check_sizes(collision: ElementTree.Element, path: Path, *, urdf: bool) -> None:
    for shape, sizes in _SIZES.items():
        for element in collision.iter(shape):
            for name, count in sizes.items():
                text = element.get(name) if urdf else element.findtext(name)
                numbers = _numbers(text)
                if len(numbers) != count or not all(0 < x <= MAX_SIZE for x in numbers):
                    raise ModelError(
                        f"{path}: the {name} of a collision {shape} is {text!r}; write "
                        f"{'three numbers' if count == 3 else 'a number'} of metres, above 0 "
                        f"and at most {MAX_SIZE:g}"
                    )


def read_statements(
    documents: Mapping[Path, ElementTree.Element | None], link_name: str
) -> Statements:
    """What documents say of the link; where several bear the name, what all of them say.

    Raises ModelError for a mass that Drake would replace by its own.
    """
    found: list[Statements] = []
    for path, root in documents.items():
        if root is not None and root.tag == "mujoco":
            bodies = [body for body in root.iter("body") if body.get("name") == link_name]
            found += [_mjcf_body(body, root) for body in bodies]
        elif root is not None:
            links = [link for link in root.iter("link") if link.get("name") == link_name]
            found += [_sdf_or_urdf_link(link, path) for link in links]
    if len(found) == 1:
        return found[0]
    friction = [stated for one in found for stated in one.friction]
    stated = bool(friction) and all(friction)
    return Statements(bool(found) and all(one.mass for one in found), (stated,))


def _sdf_or_urdf_link(link: ElementTree.Element, path: Path) -> Statements:
    inertial = link.find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    if mass is not None:
        numbers = _numbers(mass.get("value") or mass.text)
        if len(numbers) != 1 or not 0 < numbers[0] < math.inf:
            raise ModelError(
                f"{path}: link '{link.get('name')}' has a mass that is not above 0; state one that "
                "is, or none"
            )
    friction = (
        any(element.tag in _FRICTION_TAGS for element in collision.iter())
        for collision in link.iter("collision")
    )
    return Statements(mass is not None or _is_automatic(inertial), tuple(friction))


def _mjcf_body(body: ElementTree.Element, root: ElementTree.Element) -> Statements:
    """MJCF always means a mass, of its default density; friction may come from its defaults."""
    default = any(_has_friction(geom) for d in root.iter("default") for geom in d.iter("geom"))
    friction = tuple(default or _has_friction(geom) for geom in body.findall("geom"))
    return Statements(True, friction)


def _has_friction(geom: ElementTree.Element) -> bool:
    numbers = _numbers(geom.get("friction"))
    return bool(numbers) and math.isfinite(numbers[0])


def _numbers(text: str | None) -> list[float]:
    """A lone NaN when they are none."""
    try:
        return [float(word) for word in (text or "").split()]
    except ValueError:
        return [math.nan]
