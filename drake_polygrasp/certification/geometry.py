"""Whether fingertips touch the object just where and as a grasp says, by SceneGraph and the facets.

SceneGraph measures distances from points to the true surface of every shape that it takes; between
two shapes it would take a Mesh for its convex hull.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from pydrake.geometry import GeometryId, QueryObject, SceneGraphInspector
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CalcContactFrictionFromSurfaceProperties,
    CoulombFriction,
)
from pydrake.systems.framework import Diagram, DiagramBuilder

from drake_polygrasp.certification.scratch_plant import Scene, add_surface, add_tip
from drake_polygrasp.geometry.polyhedron import ON_SURFACE
from drake_polygrasp.geometry.seating import face_of

ROUNDING = 1e-9
"""Ours, relative: what a combination of friction coefficients may be off."""


class Fit(NamedTuple):
    """How well a grasp fits the object."""

    margin: float
    """What the worst distance leaves of its tolerance [m]."""
    faults: tuple[str, ...]
    """What is wrong; nothing where the grasp fits."""


def check_geometry(scene: Scene) -> Fit:
    """Hold contacts, normals, friction and room for the tips against the model.

    Every distance has the tolerance `ON_SURFACE` L.
    """
    diagram, surface, tips = _touching_diagram(scene)
    plant, context = diagram.GetSubsystemByName("plant"), diagram.CreateDefaultContext()
    query = plant.get_geometry_query_input_port().Eval(plant.GetMyContextFromRoot(context))
    faults = [*_facet_faults(scene), *_friction_faults(scene, query.inspector(), surface, tips)]
    tolerance = ON_SURFACE * scene.object_.polyhedron.diameter
    distances = list(_distances(scene, query, set(surface)))
    faults += [fault for distance, fault in distances if distance > tolerance]
    return Fit(tolerance - max(distance for distance, _ in distances), tuple(faults))


def _facet_faults(scene: Scene) -> Iterator[str]:
    """Where the model's facets do not bear out a contact or its friction."""
    grasp, polyhedron = scene.grasp, scene.object_.polyhedron
    faces = face_of(polyhedron, grasp.p_BC, grasp.nhat_TB_B).tolist()
    for i, (face, mu) in enumerate(zip(faces, grasp.mu.tolist(), strict=True), start=1):
        if face < 0:
            yield f"contact {i} is on no facet with its normal"
        elif not mu <= polyhedron.faces[face].mu * (1 + ROUNDING):
            yield f"contact {i} has friction {mu:.6g}, its face {polyhedron.faces[face].mu:.6g}"
    if not scene.pad_width > 0:
        yield "a contact is on an edge of its face"


def _touching_diagram(scene: Scene) -> tuple[Diagram, list[GeometryId], list[GeometryId]]:
    """Object and tips where they are; the geometries of its surface and of the tips."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    surface = add_surface(plant, plant.AddRigidBody("object", scene.solid.M_BBo_B), scene)
    tips = [add_tip(plant, plant.world_body(), scene, i, on_pad=False) for i in range(3)]
    plant.Finalize()
    return builder.Build(), surface, tips


def _friction_faults(
    scene: Scene,
    inspector: SceneGraphInspector,
    surface: list[GeometryId],
    tips: list[GeometryId],
) -> Iterator[str]:
    """Where Drake makes another coefficient of the pair than the contact's."""

    def friction(geometry: GeometryId) -> CoulombFriction:
        properties = inspector.GetProximityProperties(geometry)
        return properties.GetProperty("material", "coulomb_friction")

    for i, (tip, mu) in enumerate(zip(tips, scene.grasp.mu.tolist(), strict=True), start=1):
        for part in surface:
            pair = CalcContactFrictionFromSurfaceProperties(friction(tip), friction(part))
            for combined in (pair.static_friction(), pair.dynamic_friction()):
                if not abs(combined - mu) <= ROUNDING * mu:
                    yield f"friction at contact {i} is {combined:.6g} in the plant, not {mu:.6g}"


def _distances(
    scene: Scene, query: QueryObject, surface: set[GeometryId]
) -> Iterator[tuple[float, str]]:
    """By how much SceneGraph finds each thing off [m], and what that would mean.

    Measured from the tips' centres: on the surface the gradient of its distance is no normal.
    """
    inspector, radius, p_BT = query.inspector(), scene.tip_radius, scene.p_BT
    for i, p_BC in enumerate(scene.grasp.p_BC):
        found = query.ComputeSignedDistanceToPoint(p_BT[i])
        near = min((n for n in found if n.id_G in surface), key=lambda n: n.distance)
        p_BN = inspector.GetPoseInFrame(near.id_G).multiply(near.p_GN)
        yield radius - near.distance, f"fingertip {i + 1} penetrates the object"
        yield near.distance - radius, f"fingertip {i + 1} does not touch the object"
        # Where a sphere touches a surface, its radius is the normal.
        yield float(np.linalg.norm(p_BN - p_BC)), f"fingertip {i + 1} touches elsewhere"
    for i, j in itertools.combinations(range(3), 2):
        apart = float(np.linalg.norm(p_BT[i] - p_BT[j]))
        yield 2 * radius - apart, f"fingertips {i + 1} and {j + 1} overlap"
