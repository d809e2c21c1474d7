"""Checks by SceneGraph and the facets that fingertips touch the object at the grasp's contacts.

Distances are measured from points, to the true surface of each shape. Between two shapes,
SceneGraph would replace a Mesh by its convex hull.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from pydrake.geometry import GeometryId, SceneGraphInspector
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CalcContactFrictionFromSurfaceProperties,
    CoulombFriction,
)
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.surface_contact import CRACK, face_at
from drake_polygrasp.geometry.tolerances import ON_SURFACE
from drake_polygrasp.plant.scratch_plant import ScratchScene, add_surface, add_tip
from drake_polygrasp.plant.surface_distance import Nearest, SurfaceDistance

_ROUNDING = 1e-9
"""Relative tolerance of a pair's combined friction coefficient. Our choice."""


class Fit(NamedTuple):
    """Agreement of a grasp's contacts with the object's collision geometry.

    Attributes:
        margin: tolerance minus the greatest deviation [m].
        faults: a message for each disagreement, distances last and the greatest first; empty if
            the grasp agrees.
        refusal: why Drake could not measure a distance, which was then measured on triangles;
            empty if Drake measured all.
    """

    margin: float
    faults: tuple[str, ...]
    refusal: str = ""


def check_geometry(scene: ScratchScene) -> Fit:
    """Compares contacts, normals, friction and fingertip clearance with the model.

    The tolerance of every distance is `ON_SURFACE` L.

    Args:
        scene: object and grasp.

    Returns:
        The agreement, with one message for each fault.

    Raises:
        RuntimeError: when Drake rejects a shape; SystemExit when one of its assertions fails.
    """
    surface = SurfaceDistance(scene.solid.parts)
    tolerance = ON_SURFACE * scene.object_.polyhedron.diameter
    distances = sorted(_distances(scene, surface), key=lambda distance: -distance[0])
    faults = [*_facet_faults(scene), *_friction_faults(scene)]
    faults += [f"{fault} by {off:.2g} m" for off, fault in distances if off > tolerance]
    return Fit(tolerance - distances[0][0], tuple(faults), surface.refusal)


def _facet_faults(scene: ScratchScene) -> Iterator[str]:
    """Yields a message for each contact that the model's facets contradict."""
    grasp, polyhedron = scene.grasp, scene.object_.polyhedron
    faces = face_at(polyhedron, grasp.p_BC, grasp.nhat_TB_B).tolist()
    for i, (face, mu) in enumerate(zip(faces, grasp.mu.tolist(), strict=True), start=1):
        if face < 0:
            yield f"contact {i} is on no facet with its normal"
        elif not mu <= polyhedron.faces[face].mu * (1 + _ROUNDING):
            yield f"contact {i} has friction {mu:.6g}, its face {polyhedron.faces[face].mu:.6g}"
    if not scene.pad_width > 0:
        yield "a contact is on an edge of its face"


def _friction_faults(scene: ScratchScene) -> Iterator[str]:
    """Yields a message for each pair whose friction in Drake is not the contact's."""
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    surface = add_surface(plant, plant.AddRigidBody("object", scene.solid.M_BBo_B), scene)
    tips = [add_tip(plant, plant.world_body(), scene, i, on_pad=False) for i in range(3)]
    inspector: SceneGraphInspector = scene_graph.model_inspector()

    def friction(geometry: GeometryId) -> CoulombFriction:
        properties = inspector.GetProximityProperties(geometry)
        return properties.GetProperty("material", "coulomb_friction")

    for i, (tip, mu) in enumerate(zip(tips, scene.grasp.mu.tolist(), strict=True), start=1):
        for part in surface:
            pair = CalcContactFrictionFromSurfaceProperties(friction(tip), friction(part))
            for combined in (pair.static_friction(), pair.dynamic_friction()):
                if not abs(combined - mu) <= _ROUNDING * mu:
                    yield f"friction at contact {i} is {combined:.6g} in the plant, not {mu:.6g}"


def _distances(scene: ScratchScene, surface: SurfaceDistance) -> Iterator[tuple[float, str]]:
    """Yields deviations [m], each with the message for one beyond the tolerance."""
    radius, p_BT = scene.tip_radius, scene.p_BT
    for i in range(3):
        tip = surface.nearest(p_BT[i])
        yield radius - tip.distance, f"fingertip {i + 1} penetrates the object"
        yield tip.distance - radius, f"fingertip {i + 1} does not touch the object"
        yield _off_contact(scene, surface, i, tip), f"fingertip {i + 1} touches elsewhere"
    for i, j in itertools.combinations(range(3), 2):
        apart = float(np.linalg.norm(p_BT[i] - p_BT[j]))
        yield 2 * radius - apart, f"fingertips {i + 1} and {j + 1} overlap"


def _off_contact(scene: ScratchScene, surface: SurfaceDistance, i: int, tip: Nearest) -> float:
    """Returns how far from contact i, across its normal, the fingertip touches the surface [m].

    This compares the normal too, since a sphere touches where its radius is normal to the surface.
    On a noisy surface a fingertip may also touch a second facet, as near to its centre within the
    tolerance; a smaller sphere touches only the facet of the contact. Its deviation is scaled by
    the ratio of the radii, since a wrong normal moves the point in proportion to the radius. We do
    not compare normals at the contact itself: on the surface, Drake's gradient of the distance may
    not be a normal.
    """
    p_BC, nhat_TB_B = scene.grasp.p_BC[i], scene.grasp.nhat_TB_B[i]
    tolerance = ON_SURFACE * scene.object_.polyhedron.diameter
    least = CRACK / 2 * scene.object_.polyhedron.diameter
    radius, off = scene.tip_radius, _sideways(tip.p_BN - p_BC, nhat_TB_B)
    while off > tolerance and radius / 2 >= least:
        radius /= 2
        near = surface.nearest(p_BC - radius * nhat_TB_B)
        off = min(off, _sideways(near.p_BN - p_BC, nhat_TB_B) * scene.tip_radius / radius)
    return off


def _sideways(vector: Array, nhat: Array) -> float:
    return float(np.linalg.norm(vector - (vector @ nhat) * nhat))
