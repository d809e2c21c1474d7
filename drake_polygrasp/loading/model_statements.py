"""Finds which masses and friction coefficients a model's documents state.

The values themselves are read from Drake's plant. But Drake gives a collision geometry without
friction the coefficient 1, and an SDF link without mass 1 kg, which in the plant look like stated
values; only the documents can tell.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple
from xml.etree.ElementTree import Element

from pydrake.geometry import GeometryId, SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from drake_polygrasp.loading.mjcf_statements import collision_geoms, find_bodies
from drake_polygrasp.loading.model_checks import check_mass, first_number, is_automatic
from drake_polygrasp.loading.model_instances import Dialect, StatedModel, find_instances, sdf_name
from drake_polygrasp.loading.model_source import ModelFiles
from drake_polygrasp.loading.unread_friction import unread_in_link, unread_in_pairs
from drake_polygrasp.loading.xml_reader import elements_at

_READ_FRICTION = {
    Dialect.SDF: (
        ("drake:proximity_properties", "drake:mu_static"),
        ("drake:proximity_properties", "drake:mu_dynamic"),
        ("surface", "friction", "ode", "mu"),
        ("surface", "friction", "ode", "mu2"),
    ),
    Dialect.URDF: (
        ("drake:proximity_properties", "drake:mu_static"),
        ("drake:proximity_properties", "drake:mu_dynamic"),
        ("drake_compliance", "static_friction"),
        ("drake_compliance", "dynamic_friction"),
    ),
}
"""Tags, from a <collision> down, of the elements from which Drake reads friction."""


@dataclass(frozen=True)
class Statements:
    """What the files state of one link.

    Attributes:
        mass: whether they state a mass.
        friction: for each collision geometry, whether they state friction that Drake reads.
        unread: elements with friction that Drake does not read, as <contact><lateral_friction>.
    """

    mass: bool
    friction: Mapping[GeometryId, bool]
    unread: tuple[str, ...] = ()


class _Link(NamedTuple):
    """What one model states of a link."""

    mass: bool
    friction: dict[str, bool] | tuple[bool, ...]
    """Whether friction is stated for each collision geometry, by name or in the plant's order."""
    unread: tuple[str, ...]


def read_statements(
    files: ModelFiles, plant: MultibodyPlant, inspector: SceneGraphInspector, body: RigidBody
) -> Statements:
    """Returns what a model's documents state of a link.

    Args:
        files: the model's files.
        plant: the plant that Drake made of them.
        inspector: the inspector of its SceneGraph.
        body: the link, as a body of the plant.

    Raises:
        ModelError: for a mass that Drake would silently replace.
    """
    links = _links(files, plant, body)
    # SceneGraph strips names of surrounding spaces.
    scope = f"{plant.GetModelInstanceName(body.model_instance())}::".lstrip()
    geometries = plant.GetCollisionGeometriesForBody(body)
    names = [inspector.GetName(geometry).removeprefix(scope).strip() for geometry in geometries]
    return Statements(
        mass=bool(links) and all(link.mass for link in links),
        friction=dict(zip(geometries, _friction(links, names), strict=True)),
        unread=tuple(dict.fromkeys(place for link in links for place in link.unread)),
    )


def _friction(links: Sequence[_Link], names: Sequence[str]) -> tuple[bool, ...]:
    """Returns whether each geometry's friction is stated.

    Where geometries cannot be matched to elements, the answer for each is whether all state it.
    """
    if len(links) == 1:
        (_, stated, _) = links[0]
        if isinstance(stated, tuple):
            if len(stated) == len(names):
                return stated
        elif set(names) <= set(stated):
            return tuple(stated[name] for name in names)
    every = [
        one
        for link in links
        for one in (link.friction if isinstance(link.friction, tuple) else link.friction.values())
    ]
    return (bool(every) and all(every),) * len(names)


def _links(files: ModelFiles, plant: MultibodyPlant, body: RigidBody) -> list[_Link]:
    """Returns what models state of the body: one, unless several are merged."""
    instances = find_instances(files)
    models = instances.get(plant.GetModelInstanceName(body.model_instance()), [])
    links = [link for model in models for link in _links_of(model, plant, body)]
    if links or any(model.dialect is Dialect.OBJ for model in models):
        return links
    # Where Drake's name of the model is not among those found, all links of the body's name count.
    every = chain.from_iterable(instances.values())
    return [link for model in every for link in _links_of(model, plant, body)]


def _links_of(model: StatedModel, plant: MultibodyPlant, body: RigidBody) -> Iterator[_Link]:
    """Yields what a model states of a link that has the body's name."""
    if model.dialect is Dialect.MJCF:
        yield from _mjcf_body(model, plant, body)
        return
    for link in model.element.findall("link"):
        name = sdf_name(link) if model.dialect is Dialect.SDF else link.get("name")
        if name == body.name():
            yield _sdf_or_urdf_link(model, link, body)


def _sdf_or_urdf_link(model: StatedModel, link: Element, body: RigidBody) -> _Link:
    """Returns what a <link> of SDF or URDF states."""
    collisions = link.findall("collision")
    if collisions or body.default_mass() != 0:  # A link that is only a frame may have no mass.
        check_mass(link, model.path, urdf=model.dialect is Dialect.URDF)
    places = _READ_FRICTION[model.dialect]
    friction = [any(elements_at(collision, place) for place in places) for collision in collisions]
    unread = tuple(unread_in_link(model, link, places))
    if model.dialect is Dialect.URDF:
        # In URDF Drake renames geometries of equal names but drops none, and assumes no mass.
        return _Link(body.default_mass() > 0, tuple(friction), unread)
    inertial = link.find("inertial")
    mass = is_automatic(inertial) or link.find("inertial/mass") is not None
    names = [sdf_name(collision) for collision in collisions]
    return _Link(mass, dict(zip(names, friction, strict=True)), unread)


def _mjcf_body(model: StatedModel, plant: MultibodyPlant, body: RigidBody) -> Iterator[_Link]:
    """Yields what MJCF states of a body: always a mass, by a density; friction also by defaults."""
    first = min(int(index) for index in plant.GetBodyIndices(body.model_instance()))
    found = find_bodies(model.element, first).get(body.name())
    if found is None:
        return
    geoms = collision_geoms(model.element, found)
    friction = {
        geom.name: first_number(geom.attributes.get("friction")) is not None for geom in geoms
    }
    unread = tuple(unread_in_pairs(model.element, friction))
    yield _Link(True, friction, unread)
