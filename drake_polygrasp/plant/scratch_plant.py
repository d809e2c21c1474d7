"""Plants of our own with the object and three fingertips, for checks that must not touch others'.

The body frame B starts at the world frame W, so what is expressed in B may be read in W.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydrake.geometry import Box, GeometryId, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import ModelError
from drake_polygrasp.geometry.surface_contact import edge_distance, effective_tip_radius, face_at
from drake_polygrasp.grasp import Grasp, GraspObject
from drake_polygrasp.loading.object_model import Solid, load_solid
from drake_polygrasp.plant.fingertips import (
    FingertipSpheres,
    contact_material,
    fingertip_friction,
    fingertip_spheres,
)


@dataclass(frozen=True, eq=False)
class ScratchScene:
    """What scratch plants are made of.

    Attributes:
        object_: what is grasped.
        solid: its collision geometry and inertia.
        grasp: its friction is that of the pairs.
        tip_radius: [m]
        pad_width: [m], of the largest squares about all contacts that keep within their faces.
    """

    object_: GraspObject
    solid: Solid
    grasp: Grasp
    tip_radius: float
    pad_width: float

    @property
    def p_BT(self) -> Array:
        """Centres of fingertips that touch the contacts from outside [m], shape (3, 3)."""
        return self.grasp.p_BC - self.tip_radius * self.grasp.nhat_TB_B

    @property
    def mu_object(self) -> float:
        """The friction of the object's own surface."""
        return float(self.grasp.mu.max())


def make_scene(
    object_: GraspObject,
    grasp: Grasp,
    tip_radius: float,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> ScratchScene:
    """The object from its own file, and fingertips of `effective_tip_radius` [m].

    Raises ModelError when the object came from no file or the file cannot be read again.
    """
    if object_.source is None:
        raise ModelError(
            "a grasp is checked in a plant with the object's own file, and it has none; give "
            "object_from_plant the body's model_file"
        )
    face = face_at(object_.polyhedron, grasp.p_BC, grasp.nhat_TB_B)
    distance = edge_distance(object_.polyhedron, grasp.p_BC, face).min()
    return ScratchScene(
        object_,
        load_solid(object_.source, package_paths, packages),
        grasp,
        effective_tip_radius(object_.polyhedron, tip_radius),
        math.sqrt(2.0) * float(distance),
    )


def add_surface(
    plant: MultibodyPlant, body: RigidBody, scene: ScratchScene, stiffness: float | None = None
) -> list[GeometryId]:
    """The model's own collision geometry, its point contact of `stiffness` [N/m]."""
    material = contact_material(scene.mu_object, point_stiffness=stiffness)
    return [
        plant.RegisterCollisionGeometry(body, X_BG, shape, f"surface_{k}", material)
        for k, (shape, X_BG) in enumerate(scene.solid.parts)
    ]


def add_covers(
    plant: MultibodyPlant, body: RigidBody, scene: ScratchScene, stiffness: float | None = None
) -> list[GeometryId]:
    """The collision geometry of links on the object's joints, locked where they are by default."""
    material = contact_material(scene.mu_object, point_stiffness=stiffness)
    return [
        plant.RegisterCollisionGeometry(body, X_BG, shape, f"cover_{k}", material)
        for k, (_, shape, X_BG) in enumerate(scene.solid.covers)
    ]


def add_pads(
    plant: MultibodyPlant, body: RigidBody, scene: ScratchScene, stiffness: float | None = None
) -> list[GeometryId]:
    """A cube under each contact, flush with its face, of the contact's friction."""
    w, grasp = scene.pad_width, scene.grasp
    ids = []
    for i, (p_BC, nhat_TB_B, mu) in enumerate(
        zip(grasp.p_BC, grasp.nhat_TB_B, grasp.mu, strict=True)
    ):
        R_BP = RotationMatrix.MakeFromOneVector(nhat_TB_B, 2)
        X_BP = RigidTransform(R_BP, p_BC + w / 2 * nhat_TB_B)
        material = contact_material(mu, point_stiffness=stiffness)
        ids.append(plant.RegisterCollisionGeometry(body, X_BP, Box(w, w, w), f"pad_{i}", material))
    return ids


def add_tip(
    plant: MultibodyPlant, body: RigidBody, scene: ScratchScene, i: int, *, on_pad: bool
) -> GeometryId:
    """The sphere that touches contact i, on a body whose frame is at W."""
    spheres = tip_spheres(scene, on_pad=on_pad)
    material = contact_material(float(spheres.mu[i]))
    X_TS, shape = RigidTransform(spheres.p_HT[i]), Sphere(spheres.radius)
    return plant.RegisterCollisionGeometry(body, X_TS, shape, f"tip_{i}", material)


def tip_spheres(scene: ScratchScene, *, on_pad: bool) -> FingertipSpheres:
    """The fingertips, whose friction makes the contacts' of the pairs with the object or pads."""
    mu = scene.grasp.mu
    mu_T = mu if on_pad else fingertip_friction(mu, scene.mu_object)
    return fingertip_spheres(scene.grasp, scene.tip_radius, mu_T)
