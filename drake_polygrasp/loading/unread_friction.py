"""Finds where a model states friction that Drake does not read."""

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
"""Elements that state a coefficient of friction: of SDF, of Gazebo's and of PyBullet's URDF."""

_LEAVES = ("friction", "friction2")
"""Elements that state one where they hold no others."""


def unread_in_link(
    model: StatedModel, link: Element, read: Collection[Sequence[str]]
) -> Iterator[str]:
    """Yields the places, as <contact><lateral_friction>, of friction that Drake does not read.

    Args:
        model: of SDF or URDF.
        link: one of its links.
        read: the tags below <collision> where Drake does read friction.
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
    for child in element:
        if child not in read and (child.tag in _TAGS or (child.tag in _LEAVES and _says(child))):
            yield f"{place}<{child.tag}>"
        yield from _places(child, f"{place}<{child.tag}>", read)


def _says(element: Element) -> bool:
    """Whether an element holds a value, and no other elements."""
    return not len(element) and bool(element.attrib or (element.text or "").strip())


def unread_in_pairs(root: Element, geoms: Collection[str]) -> Iterator[str]:
    """Yields the place of friction that MJCF states of pairs of geoms."""
    for pair in root.findall("contact/pair"):
        if "friction" in pair.attrib and {pair.get("geom1"), pair.get("geom2")} & set(geoms):
            yield '<contact><pair friction="...">'
