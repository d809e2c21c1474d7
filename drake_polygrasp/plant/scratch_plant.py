"""Adds the object, pads and fingertips to temporary plants, which leave the user's plant unchanged.

The body frame B starts at the world frame W, so quantities in B may be used in W.
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
    """An object and a grasp from which temporary plants are built.

    Attributes:
        object_: object that is grasped.
        solid: collision geometry and inertia of the object.
        grasp: three contacts with the friction coefficients of the pairs.
        tip_radius: radius of the fingertips [m].
        pad_width: side of the largest squares about all contacts that stay within their faces [m].
    """

    object_: GraspObject
    solid: Solid
    grasp: Grasp
    tip_radius: float
    pad_width: float

    @property
    def p_BT(self) -> Array:
        """Centres of fingertips that touch the object at the contacts [m], shape (3, 3)."""
        return self.grasp.p_BC - self.tip_radius * self.grasp.nhat_TB_B

    @property
    def mu_object(self) -> float:
        """Friction coefficient of the object's surface: the greatest of the contacts'."""
        return float(self.grasp.mu.max())


def make_scene(
    object_: GraspObject,
    grasp: Grasp,
    tip_radius: float,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> ScratchScene:
    """Loads the object from its own file, for fingertips of the `effective_tip_radius`.

    Args:
        object_: object that is grasped, loaded from a file.
        grasp: three contacts.
        tip_radius: radius of the fingertips [m]; 0 for points.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.

    Returns:
        The scene.

    Raises:
        ModelError: when the object came from no file, or the file cannot be read again.
    """
    if object_.source is None:
        raise ModelError(
            "to check a grasp in a plant, the object is loaded again from its own file, and it "
            "has none; give object_from_plant the body's model_file"
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
    """Registers the collision geometry of the object.

    Args:
        plant: plant to add it to.
        body: body B of the object.
        scene: object and grasp.
        stiffness: stiffness of point contact [N/m] (default: the plant's).

    Returns:
        The geometries.
    """
    material = contact_material(scene.mu_object, point_stiffness=stiffness)
    return [
        plant.RegisterCollisionGeometry(body, X_BG, shape, f"surface_{k}", material)
        for k, (shape, X_BG) in enumerate(scene.solid.parts)
    ]


def add_covers(
    plant: MultibodyPlant, body: RigidBody, scene: ScratchScene, stiffness: float | None = None
) -> list[GeometryId]:
    """Registers the collision geometry of links on the object's joints, fixed to it.

    Args:
        plant: plant to add it to.
        body: body B of the object.
        scene: object and grasp; the joints are at their default positions.
        stiffness: stiffness of point contact [N/m] (default: the plant's).

    Returns:
        The geometries.
    """
    material = contact_material(scene.mu_object, point_stiffness=stiffness)
    return [
        plant.RegisterCollisionGeometry(body, X_BG, shape, f"cover_{k}", material)
        for k, (_, shape, X_BG) in enumerate(scene.solid.covers)
    ]


def add_pads(
    plant: MultibodyPlant, body: RigidBody, scene: ScratchScene, stiffness: float | None = None
) -> list[GeometryId]:
    """Registers a cube at each contact, flush with its face, with the contact's friction.

    Args:
        plant: plant to add them to.
        body: body B of the object.
        scene: object and grasp.
        stiffness: stiffness of point contact [N/m] (default: the plant's).

    Returns:
        The geometries, one per contact.
    """
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
    """Registers the sphere that touches the object at contact i.

    Args:
        plant: plant to add it to.
        body: body of the fingertip, whose frame coincides with W.
        scene: object and grasp.
        i: index of the contact, from 0.
        on_pad: whether it touches a pad rather than the object's own geometry.

    Returns:
        The geometry.
    """
    spheres = tip_spheres(scene, on_pad=on_pad)
    material = contact_material(float(spheres.mu[i]))
    X_TS, shape = RigidTransform(spheres.p_HT[i]), Sphere(spheres.radius)
    return plant.RegisterCollisionGeometry(body, X_TS, shape, f"tip_{i}", material)


def tip_spheres(scene: ScratchScene, *, on_pad: bool) -> FingertipSpheres:
    """Returns fingertips whose pairs with the object, or with pads, have the contacts' friction.

    Args:
        scene: object and grasp.
        on_pad: whether they touch pads rather than the object's own geometry.
    """
    mu = scene.grasp.mu
    mu_T = mu if on_pad else fingertip_friction(mu, scene.mu_object)
    return fingertip_spheres(scene.grasp, scene.tip_radius, mu_T)
