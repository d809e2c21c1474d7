"""Makes the object to grasp from a rigid body's collision geometry in a SceneGraph.

Objects from model files and from a user's plant are both made here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydrake.geometry import GeometryId, SceneGraphInspector
from pydrake.systems.framework import Context

from drake_polygrasp.arguments import check_number
from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.digits import on_grid, significant
from drake_polygrasp.errors import ModelError
from drake_polygrasp.geometry.body_identity import BodyIdentity, surface_lengths
from drake_polygrasp.geometry.polyhedron import Polyhedron, farthest_distance, volume_centroid
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.geometry.tolerances import FLATNESS
from drake_polygrasp.grasp import GraspObject, ModelSource
from drake_polygrasp.loading.model_checks import MAX_FRICTION
from drake_polygrasp.loading.parsed_model import drake_errors_as_model_errors
from drake_polygrasp.loading.rigid_group import Collider, RigidGroup
from drake_polygrasp.loading.scale import unit_warnings
from drake_polygrasp.loading.shapes import part_of

DEFAULT_MU = 0.3
"""Friction coefficient of a model that states none: the one in the paper's examples."""
_MAX_NAMES = 8
"""How many links or geometries a message names. Our choice."""
_FRICTION_RANGE = f"above 0 and at most {MAX_FRICTION:g}"


class MassProperties(NamedTuple):
    """Mass and centre of mass of a rigid body.

    Attributes:
        mass: mass [kg], above 0.
        p_BBcm: centre of mass, measured from Bo and expressed in B [m], shape (3,).
    """

    mass: float
    p_BBcm: Array


def mass_properties(group: RigidGroup, context: Context) -> MassProperties | None:
    """Returns mass and centre of mass of all links together, None if their mass is not positive.

    Args:
        group: the rigid body.
        context: the plant's context, whose parameters state the links' masses.
    """
    M_BBo_B = group.spatial_inertia(context)
    if not 0 < M_BBo_B.get_mass() < np.inf:
        return None
    return MassProperties(M_BBo_B.get_mass(), M_BBo_B.get_com())


def check_friction(mu: float | None, where: str) -> None:
    """Checks the friction coefficient given by the user.

    Args:
        mu: the coefficient; None if none is given.
        where: what it is given for, for the message.

    Raises:
        UsageError: when it is no number above 0 and at most MAX_FRICTION.
    """
    if mu is not None:
        name = f"the friction mu given for {where}"
        check_number(name, mu, _FRICTION_RANGE, above=0.0, most=MAX_FRICTION)


def describe_group(
    group: RigidGroup, where: str, joints_free: bool, beside: Sequence[str] = ()
) -> Iterator[str]:
    """Yields warnings about links that are fixed together, joined to the world or on joints.

    Args:
        group: the rigid body.
        where: what messages call it.
        joints_free: whether links on its joints are ignored.
        beside: names of other bodies that the world holds, which are left out of the object.
    """
    if len(group.links) > 1:
        yield (
            f"{where}: {quote_names(group.names)} are fixed to one another and make one rigid "
            f"body, in the frame of '{group.body.name()}'"
        )
    if group.tied_by:
        joints = quote_names(group.tied_by)
        left_out = f", without the world's other bodies: {quote_names(beside)}" if beside else ""
        yield f"{where}: joined to the world ({joints}), it is planned as if it were free{left_out}"
    names = group.names_on_joints()
    if names:
        treatment = (
            "are ignored, as asked for"
            if joints_free
            else "stay where they are: they cover faces and block fingertips, and their mass is "
            "not counted; --joints-free (joints_free=True) ignores them"
        )
        yield f"{where}: links on its joints, {quote_names(names)}, {treatment}"


def quote_names(names: Sequence[str]) -> str:
    """Returns the first names, quoted, and how many more there are.

    Args:
        names: names of links, joints or geometries.
    """
    quoted = ", ".join(f"'{name}'" for name in names[:_MAX_NAMES])
    more = len(names) - _MAX_NAMES
    return f"{quoted} and {more} more" if more > 0 else quoted


def stated_friction(
    inspector: SceneGraphInspector, geometry: GeometryId
) -> tuple[float, float] | None:
    """Returns a geometry's static and dynamic coefficients of friction, None if it has none.

    Args:
        inspector: the SceneGraph's inspector.
        geometry: a collision geometry.
    """
    properties = inspector.GetProximityProperties(geometry)
    if not properties.HasProperty("material", "coulomb_friction"):
        return None
    pair = properties.GetProperty("material", "coulomb_friction")
    return pair.static_friction(), pair.dynamic_friction()


def lesser_friction(static: float, dynamic: float, name: str, where: str) -> float:
    """Returns the friction coefficient to plan with: the lesser of static and dynamic.

    Args:
        static: static coefficient.
        dynamic: dynamic coefficient, at which bodies slide in Drake's discrete contact.
        name: the collision geometry's name.
        where: what messages call its body.

    Raises:
        ModelError: when it is not above 0 or is above MAX_FRICTION.
    """
    least = min(static, dynamic)
    if not 0 < least <= MAX_FRICTION:
        raise ModelError(
            f"{where}: the friction of '{name}' is {least}; it must be {_FRICTION_RANGE}"
        )
    return least


def friction_warnings(
    stated: Sequence[tuple[str, tuple[float, float]]], where: str
) -> Iterator[str]:
    """Yields a warning for each two unlike coefficients, static and dynamic, that geometries state.

    Args:
        stated: name of each collision geometry, with its static and dynamic coefficient.
        where: what messages call their body.
    """
    for pair in dict.fromkeys(pair for _, pair in stated):
        static, dynamic = pair
        if static != dynamic:
            names = quote_names(list(dict.fromkeys(name for name, same in stated if same == pair)))
            yield (
                f"{where}: the friction of {names} is {static} static, {dynamic} dynamic; "
                f"{min(pair)} is used, because Drake's discrete contact slides at the dynamic "
                "coefficient"
            )


def collision_parts(
    inspector: SceneGraphInspector,
    colliders: Sequence[Collider],
    friction: Sequence[float],
    where: str,
) -> list[Part]:
    """Returns a rigid body's collision geometries as parts of its surface.

    Args:
        inspector: the SceneGraph's inspector.
        colliders: the collision geometries.
        friction: the friction coefficient of each.
        where: what messages call the body.

    Raises:
        ModelError: for a geometry that cannot be grasped, such as a half space.
    """
    return [
        _part(inspector, collider, mu, where, "fingers cannot hold; remove it or replace it")
        for collider, mu in zip(colliders, friction, strict=True)
    ]


def covering_parts(
    inspector: SceneGraphInspector, colliders: Sequence[Collider], where: str
) -> list[Part]:
    """Returns the collision geometries of links on joints, as parts that cover faces.

    Args:
        inspector: the SceneGraph's inspector.
        colliders: the collision geometries.
        where: what messages call the body that they cover.

    Raises:
        ModelError: for a geometry without a surface, such as a half space.
    """
    remedy = "has no surface to measure; remove it, or ignore links on joints (joints_free)"
    parts = [_part(inspector, collider, 0.0, where, remedy) for collider in colliders]
    return [replace(part, own=False) for part in parts]


def _part(
    inspector: SceneGraphInspector, collider: Collider, mu: float, where: str, remedy: str
) -> Part:
    shape = inspector.GetShape(collider.geometry)
    with drake_errors_as_model_errors(where):
        part = part_of(shape, collider.X_BG, mu)
    if part is None:
        name, kind = inspector.GetName(collider.geometry), type(shape).__name__
        raise ModelError(f"{where}: collision geometry '{name}' is a {kind}, which {remedy}")
    return part


def identity_of(parts: Iterable[Part], names: tuple[str, ...] = ()) -> BodyIdentity:
    """Returns the identity by which later calls recognise a body.

    Args:
        parts: its collision geometries.
        names: the names it is known by.
    """
    return BodyIdentity(surface_lengths(np.concatenate([p.triangles_B for p in parts])), names)


def _surface(
    parts: Sequence[Part], where: str, patch_angle: float | None, patch_depth: float | None
) -> Polyhedron:
    """Builds the exposed surface, and refuses a flat one."""
    try:
        polyhedron = build_polyhedron(parts, patch_angle, patch_depth)
    except ModelError as error:
        raise ModelError(f"{where}: {error}") from error
    if _is_flat(polyhedron):
        raise ModelError(f"{where}: its surface is flat; a grasp needs a solid")
    return polyhedron


def _is_flat(polyhedron: Polyhedron) -> bool:
    vertices = polyhedron.own_triangles_B.reshape(-1, 3)
    about = vertices - vertices.mean(axis=0)
    _, axes = np.linalg.eigh(about.T @ about)
    return bool(np.ptp(about @ axes[:, 0]) <= FLATNESS * polyhedron.diameter)


def _volume_centroid(polyhedron: Polyhedron, where: str) -> Array:
    """Returns the centre of a body's volume, and refuses a body without any."""
    try:
        return volume_centroid(polyhedron)
    except ModelError as error:
        raise ModelError(f"{where}: {error}") from error


def object_of(
    parts: Sequence[Part],
    covers: Sequence[Part],
    stated: MassProperties | None,
    where: str,
    warnings: Iterable[str],
    source: ModelSource | None,
    patch_angle: float | None,
    patch_depth: float | None,
) -> GraspObject:
    """Makes the object to grasp from a rigid body's parts.

    Args:
        parts: the body's collision geometries.
        covers: those of links on its joints.
        stated: its mass and centre of mass; None where the model states none, and then the centre
            is that of the volume.
        where: what messages call the body.
        warnings: what the user should know of how it was loaded.
        source: the model file it came from, if any.
        patch_angle: greatest angle between a patch's normal and its facets' [rad]; None for the
            default.
        patch_depth: greatest distance of facets from the plane of their patch [m]; None for the
            default.

    Returns:
        The object, with these warnings and those of its geometry.

    Raises:
        ModelError: when the geometry has no surface to grasp, or the centre of mass is not finite,
            or it is not stated and the surface encloses no volume.
    """
    polyhedron = _surface([*parts, *covers], where, patch_angle, patch_depth)
    messages = [*warnings, *(warning for part in (*parts, *covers) for warning in part.warnings)]
    messages += unit_warnings(polyhedron.diameter, where)
    if not polyhedron.watertight:
        messages.append(f"{where}: its surface is not closed; what lies inside is a guess")
    if stated is None:
        messages.append(f"{where} states no mass; its centre is taken to be that of the volume")
        whole = _surface(parts, where, patch_angle, patch_depth) if covers else polyhedron
    mass, p_BBcm = stated or (None, _volume_centroid(whole, where))
    p_BBcm = on_grid(p_BBcm, polyhedron.diameter)
    with np.errstate(all="ignore"):
        rho = farthest_distance(polyhedron, p_BBcm)
    if not np.isfinite(rho):
        raise ModelError(f"{where}: its centre of mass is too far away; state it in metres")
    return GraspObject(
        polyhedron=polyhedron,
        mass=mass,
        p_BBcm=frozen(p_BBcm),
        rho=float(significant(np.array(rho))),
        source=source,
        warnings=tuple(dict.fromkeys(messages)),
        body=identity_of(parts),
    )
