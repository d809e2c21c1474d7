"""A body's collision geometry in a SceneGraph as the object to grasp, whoever put it there."""

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
from drake_polygrasp.loading.scale import doubts_of_units
from drake_polygrasp.loading.shapes import part_of

DEFAULT_MU = 0.3
"""The paper's own coefficient, for models that state none."""
_MOST_NAMES = 8
"""Ours: in one line."""
_FRICTION = f"it must be above 0 and at most {MAX_FRICTION:g}"


class MassProperties(NamedTuple):
    """Of a body.

    Attributes:
        mass: [kg]
        p_BBcm: centre of mass [m], shape (3,).
    """

    mass: float
    p_BBcm: Array


def mass_properties(group: RigidGroup, context: Context) -> MassProperties | None:
    """Of all links together, by the plant's context; None where they have no mass."""
    M_BBo_B = group.spatial_inertia(context)
    if not 0 < M_BBo_B.get_mass() < np.inf:
        return None
    return MassProperties(M_BBo_B.get_mass(), M_BBo_B.get_com())


def check_friction(mu: float | None, where: str) -> None:
    """Raises UsageError for a friction that somebody gave and nobody can have."""
    if mu is not None:
        demand = _FRICTION.removeprefix("it must be ")
        check_number(f"the friction mu given for {where}", mu, demand, above=0.0, most=MAX_FRICTION)


def describe_group(
    group: RigidGroup, where: str, joints_free: bool, beside: Sequence[str] = ()
) -> Iterator[str]:
    """What there is to say of links that are fixed to one another or to the world, or on joints.

    Bodies `beside` it, which the world holds as well, are left out.
    """
    if len(group.links) > 1:
        yield (
            f"{where}: {listed(group.names)} are fixed to one another and make one rigid body, in "
            f"the frame of '{group.body.name()}'"
        )
    if group.tied_by:
        joints = listed(group.tied_by)
        without = f", without what the world holds beside it: {listed(beside)}" if beside else ""
        yield f"{where}: joined to the world ({joints}), it is planned as if it were free{without}"
    names = group.names_on_joints()
    if names:
        done = (
            "are ignored, as asked for"
            if joints_free
            else "stay where they are: they cover faces and block fingertips, and their mass is "
            "not counted; --joints-free (joints_free=True) ignores them"
        )
        yield f"{where}: links on its joints, {listed(names)}, {done}"


def listed(names: Sequence[str]) -> str:
    """Some names, quoted, and how many more there are."""
    quoted = ", ".join(f"'{name}'" for name in names[:_MOST_NAMES])
    more = len(names) - _MOST_NAMES
    return f"{quoted} and {more} more" if more > 0 else quoted


def stated_friction(
    inspector: SceneGraphInspector, geometry: GeometryId
) -> tuple[float, float] | None:
    """Static and dynamic coefficient of a geometry, None where it has none."""
    properties = inspector.GetProximityProperties(geometry)
    if not properties.HasProperty("material", "coulomb_friction"):
        return None
    pair = properties.GetProperty("material", "coulomb_friction")
    return pair.static_friction(), pair.dynamic_friction()


def lesser_friction(
    static: float, dynamic: float, name: str, where: str
) -> tuple[float, tuple[str, ...]]:
    """The coefficient to plan with, and what there is to say of it.

    Raises ModelError when it is none that a grasp could hold with.
    """
    least = min(static, dynamic)
    if not 0 < least <= MAX_FRICTION:
        raise ModelError(f"{where}: the friction of '{name}' is {least}; {_FRICTION}")
    if static == dynamic:
        return least, ()
    return least, (
        f"{where}: the friction of '{name}' is {static} static, {dynamic} dynamic; "
        f"{least} is used, for Drake's discrete contact slides at the latter",
    )


def collision_parts(
    inspector: SceneGraphInspector,
    colliders: Sequence[Collider],
    friction: Sequence[float],
    where: str,
) -> list[Part]:
    """A rigid body's collision geometries, each with its friction.

    Raises ModelError, naming `where`, for one that fingers cannot hold.
    """
    return [
        _part(inspector, collider, mu, where, "fingers cannot hold; remove it or replace it")
        for collider, mu in zip(colliders, friction, strict=True)
    ]


def covering_parts(
    inspector: SceneGraphInspector, colliders: Sequence[Collider], where: str
) -> list[Part]:
    """The collision geometries of links on joints.

    Raises ModelError, naming `where`, for one that cannot be measured.
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
    """What tells a body of such parts from others."""
    return BodyIdentity(surface_lengths(np.concatenate([p.triangles_B for p in parts])), names)


def _surface(
    parts: Sequence[Part], where: str, patch_angle: float | None, patch_depth: float | None
) -> Polyhedron:
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
    """The object of a body's parts, covered by those of links on its joints.

    Without stated mass, its centre is that of the volume. Raises ModelError, naming `where`, when
    there is nothing to hold, or the centre of mass is beyond measure.
    """
    polyhedron = _surface([*parts, *covers], where, patch_angle, patch_depth)
    said = [*warnings, *(warning for part in (*parts, *covers) for warning in part.warnings)]
    said += doubts_of_units(polyhedron.diameter, where)
    if not polyhedron.watertight:
        said.append(f"{where}: its surface is not closed; what lies inside is a guess")
    if stated is None:
        said.append(f"{where} states no mass; its centre is taken to be that of the volume")
        whole = _surface(parts, where, patch_angle, patch_depth) if covers else polyhedron
    mass, p_BBcm = stated or (None, volume_centroid(whole))
    p_BBcm = on_grid(p_BBcm, polyhedron.diameter)
    with np.errstate(all="ignore"):
        rho = farthest_distance(polyhedron, p_BBcm)
    if not np.isfinite(rho):
        raise ModelError(f"{where}: its centre of mass is beyond measure; state it in metres")
    return GraspObject(
        polyhedron=polyhedron,
        mass=mass,
        p_BBcm=frozen(p_BBcm),
        rho=float(significant(np.array(rho))),
        source=source,
        warnings=tuple(dict.fromkeys(said)),
        body=identity_of(parts),
    )
