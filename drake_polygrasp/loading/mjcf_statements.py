"""Finds the bodies, geoms and defaults of an MJCF file that Drake's parser makes of it.

Names are those that Drake gives: an unnamed body is `bodyN`, where N is its index in the plant; an
unnamed geom is `geomN`, where N counts the body's geoms before it that Drake keeps.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath
from typing import NamedTuple
from xml.etree.ElementTree import Element

_MAIN = "main"
"""The class of geoms that name none."""


class MjcfBody(NamedTuple):
    """A <body> of an MJCF file.

    Attributes:
        element: the <body>.
        childclass: the class of defaults for its geoms that name none; empty for the main class.
    """

    element: Element
    childclass: str


@dataclass(frozen=True)
class MjcfGeom:
    """A <geom> with collision geometry.

    Attributes:
        name: its name in Drake, without surrounding spaces.
        attributes: its own attributes and those that its class of defaults adds.
    """

    name: str
    attributes: dict[str, str]


def find_bodies(root: Element, first_index: int) -> dict[str, MjcfBody]:
    """Returns the bodies of a model by the names that Drake gives them.

    Args:
        root: the <mujoco> element, with what it includes.
        first_index: index, in the plant, of the first body that Drake made of the model.
    """
    found: dict[str, MjcfBody] = {}
    index = first_index
    parents = (*root.findall("worldbody"), root)
    open_bodies = [MjcfBody(body, "") for parent in parents for body in parent.findall("body")]
    open_bodies.reverse()
    while open_bodies:
        element, parent_class = open_bodies.pop()
        body = MjcfBody(element, element.get("childclass", parent_class))
        found.setdefault(element.get("name", f"body{index}"), body)
        # Drake adds massless bodies between a body's joints if it has several, indexed after it.
        index += max(1, len(element.findall("joint")))
        children = element.findall("body")
        open_bodies += [MjcfBody(child, body.childclass) for child in reversed(children)]
    return found


def collision_geoms(root: Element, body: MjcfBody) -> list[MjcfGeom]:
    """Returns the geoms of a body that Drake keeps as collision geometry, in document order.

    Args:
        root: the <mujoco> element, with what it includes.
        body: one of its bodies.
    """
    defaults = _defaults(root)
    meshes = {
        mesh.get("name", PurePath(mesh.get("file", "")).stem)
        for mesh in root.findall("asset/mesh")
        if mesh.get("file") is not None
    }
    geoms: list[MjcfGeom] = []
    num_kept = 0
    for geom in body.element.findall("geom"):
        attributes = defaults.get(geom.get("class", body.childclass or _MAIN), {}) | geom.attrib
        if not _is_kept(attributes, meshes):
            continue
        name = geom.get("name", f"geom{num_kept}")
        num_kept += 1
        if _integer(attributes, "contype") or _integer(attributes, "conaffinity"):
            geoms.append(MjcfGeom(name.strip(), attributes))
    return geoms


def _defaults(root: Element) -> dict[str, dict[str, str]]:
    """Returns the attributes that each class gives to geoms; the last statement of a class wins."""
    known: dict[str, dict[str, str]] = {}
    # As in Drake, a class inherits from the class around it only if that one states geoms itself.
    pending = [(default, "") for default in reversed(root.findall("default"))]
    while pending:
        default, parent = pending.pop()
        name = default.get("class", "" if parent else _MAIN)
        for geom in default.findall("geom"):
            known[name] = known.get(parent, {}) | geom.attrib
        pending += [(child, name) for child in reversed(default.findall("default"))]
    return known


def _is_kept(attributes: dict[str, str], meshes: set[str]) -> bool:
    """Returns whether Drake makes a shape of a geom; it drops some with a warning."""
    kind = attributes.get("type", "sphere")
    if kind == "mesh":
        return attributes.get("mesh") in meshes
    return kind != "hfield" and not (kind in ("box", "ellipsoid") and "fromto" in attributes)


def _integer(attributes: dict[str, str], name: str) -> int:
    """Returns a contact bit mask, 1 where none is stated."""
    try:
        return int(attributes.get(name, "1"))
    except ValueError:
        return 1
