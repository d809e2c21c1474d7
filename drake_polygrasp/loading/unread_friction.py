"""Finds friction that a model states in elements that Drake does not read."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from xml.etree.ElementTree import Element

from drake_polygrasp.loading.model_instances import StatedModel
from drake_polygrasp.loading.xml_reader import elements_at

_TAGS = frozenset(
    (
        "mu",
        "mu1",
        "mu2",
        "lateral_friction",
        "coefficient",
        "static_friction",
        "dynamic_friction",
        "drake:mu_static",
        "drake:mu_dynamic",
        "mu_static",
        "mu_dynamic",
    )
)
"""Elements that state a friction coefficient in SDF, or in Gazebo's or PyBullet's URDF."""

_LEAVES = ("friction", "friction2")
"""Elements that state one if they have no child elements."""


def unread_in_link(
    model: StatedModel, link: Element, read: Collection[Sequence[str]]
) -> Iterator[str]:
    """Yields the elements of a link with friction that Drake does not read.

    Args:
        model: a model of SDF or URDF.
        link: one of its links.
        read: tags, from a <collision> down, of the elements from which Drake reads friction.

    Yields:
        The path to each, as <contact><lateral_friction>.
    """
    for child in link:
        if child.tag == "collision":
            own = {element for place in read for element in elements_at(child, place)}
            yield from _places(child, "", own)
        elif child.tag != "visual":
            yield from _places(child, f"<{child.tag}>", ())
    for gazebo in model.element.findall("gazebo"):
        if gazebo.get("reference") == link.get("name"):
            yield from _places(gazebo, "<gazebo>", ())


def _places(element: Element, place: str, read: Collection[Element]) -> Iterator[str]:
    """Yields the paths below `place` of elements that state friction, but for those in `read`."""
    for child in element:
        states = child.tag in _TAGS or (child.tag in _LEAVES and _has_value(child))
        if child not in read and states:
            yield f"{place}<{child.tag}>"
        yield from _places(child, f"{place}<{child.tag}>", read)


def _has_value(element: Element) -> bool:
    """Returns whether an element has a value, and no child elements."""
    return not len(element) and bool(element.attrib or (element.text or "").strip())


def unread_in_pairs(root: Element, geoms: Collection[str]) -> Iterator[str]:
    """Yields the elements with friction of pairs of geoms in MJCF, which Drake does not read.

    Args:
        root: the <mujoco> element.
        geoms: names of the geoms of a body.
    """
    for pair in root.findall("contact/pair"):
        if "friction" in pair.attrib and {pair.get("geom1"), pair.get("geom2")} & set(geoms):
            yield '<contact><pair friction="...">'
