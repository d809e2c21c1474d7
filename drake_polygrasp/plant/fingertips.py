"""Three force-controlled spherical fingertips at the contacts of a grasp, in any plant.

Each fingertip T slides on a prismatic joint along the normal of its contact. The joints start from
a body H, the hand: the world, a carriage, the palm of a gripper. Drake's PD control of the joint
holds T to a commanded position as a spring and a damper would, and a commanded force adds to it.
Sideways the joint is rigid: friction has to bear what the normal forces leave.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    GeometryId,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactResults, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
)
from pydrake.systems.framework import Context

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.grasp import Grasp

DISSIPATION = 1.0
"""[s/m], our choice: Hunt and Crossley's dissipation of each surface."""
_COLOUR = np.array([0.9, 0.4, 0.1, 1.0])


@dataclass(frozen=True, eq=False)
class FingertipSpheres:
    """Three spheres that touch an object at the contacts of a grasp.

    Attributes:
        p_HT: centres in the hand's frame H [m], shape (3, 3).
        nhat_H: unit normals into the object, shape (3, 3).
        radius: of each sphere [m].
        mu: friction coefficients of their surfaces, shape (3,); see `fingertip_friction`.
    """

    p_HT: Array
    nhat_H: Array
    radius: float
    mu: Array


def fingertip_spheres(
    grasp: Grasp, tip_radius: float, mu: Array, X_HB: RigidTransform | None = None
) -> FingertipSpheres:
    """Places spheres outside an object so that they touch it at the contacts of a grasp.

    Args:
        grasp: three contacts.
        tip_radius: radius of the fingertips [m].
        mu: friction coefficients of their surfaces, shape (3,); see `fingertip_friction`.
        X_HB: pose of the object in the hand's frame H (default: the frames coincide).

    Returns:
        The spheres in H.
    """
    X_HB = RigidTransform() if X_HB is None else X_HB
    nhat_H = grasp.nhat_TB_B @ X_HB.rotation().matrix().T
    p_HT = X_HB.multiply(grasp.p_BC.T).T - tip_radius * nhat_H
    return FingertipSpheres(frozen(p_HT), frozen(nhat_H), tip_radius, frozen(mu))


def fingertip_friction(mu: Array, mu_object: Array | float) -> Array:
    """Returns the friction of a fingertip's surface that makes the pair's what a grasp counts on.

    Drake combines the coefficients of two surfaces to 2 mu_T mu_B / (mu_T + mu_B).

    Args:
        mu: friction wanted between fingertip and object at each contact, shape (3,).
        mu_object: friction of the object's own surface there, at least mu / 2; shape (3,) or ().

    Returns:
        mu_T, shape (3,).
    """
    return np.asarray(1.0 / (2.0 / np.asarray(mu) - 1.0 / np.asarray(mu_object)))


def contact_material(
    mu: float,
    *,
    point_stiffness: float | None = None,
    modulus: float | None = None,
    resolution: float | None = None,
    dissipation: float = DISSIPATION,
) -> ProximityProperties:
    """Makes the contact properties of a surface: for point contact, or compliant hydroelastic.

    Static and dynamic friction are alike, for Drake's discrete contact knows the latter only.

    Args:
        mu: friction coefficient.
        point_stiffness: of point contact [N/m] (default: the plant's own).
        modulus: hydroelastic modulus [Pa] (default: the surface is not made hydroelastic).
        resolution: length of the hydroelastic mesh's edges [m]; needed with `modulus`.
        dissipation: Hunt and Crossley's [s/m].
    """
    properties = ProximityProperties()
    if modulus is not None:
        AddCompliantHydroelasticProperties(resolution, modulus, properties)
    AddContactMaterial(
        dissipation=dissipation,
        point_stiffness=point_stiffness,
        friction=CoulombFriction(mu, mu),
        properties=properties,
    )
    return properties


def fingertip_modulus(normal_force: float, radius: float, penetration: float = 0.02) -> float:
    """Returns the hydroelastic modulus of a sphere that a normal force presses in only so far.

    The pressure is modulus times penetration over radius in the middle, and half of that on
    average over a disc of area 2 pi radius times penetration.

    Args:
        normal_force: force on the fingertip [N].
        radius: of the fingertip [m].
        penetration: how far it is pressed in, times its radius.

    Returns:
        The modulus [Pa].
    """
    return float(normal_force / (np.pi * (penetration * radius) ** 2))


@dataclass(frozen=True, eq=False)
class Fingertips:
    """Fingertips of a plant, and the object that they hold.

    Attributes:
        plant: the plant that they are part of.
        body: the object B.
        hand: the body H on which they slide.
        instance: their model instance: its ports take commanded positions, speeds and forces.
        geometries: the spheres, one a contact.
        nhat_H: directions in which they slide, into the object, shape (3, 3).
    """

    plant: MultibodyPlant
    body: RigidBody
    hand: RigidBody
    instance: ModelInstanceIndex
    geometries: tuple[GeometryId, ...]
    nhat_H: Array

    def X_HB(self, context: Context) -> RigidTransform:
        """Returns the pose of the object in the hand, from the plant's context."""
        X_WH = self.plant.EvalBodyPoseInWorld(context, self.hand)
        return X_WH.InvertAndCompose(self.plant.EvalBodyPoseInWorld(context, self.body))

    def normal_forces(self, context: Context) -> Array:
        """Computes the normal forces of the fingertips on the object, of point and surface contact.

        Args:
            context: the plant's.

        Returns:
            Forces along `nhat_H` [N], shape (3,); 0 where a fingertip does not touch the object.
        """
        plant = self.plant
        parts = plant.GetBodiesWeldedTo(self.body)
        surface = {g for part in parts for g in plant.GetCollisionGeometriesForBody(part)}
        f_Bc_W = np.zeros((3, 3))
        for source, target, force in _contact_forces(
            plant.get_contact_results_output_port().Eval(context)
        ):
            if target in surface and source in self.geometries:
                f_Bc_W[self.geometries.index(source)] += force
            elif source in surface and target in self.geometries:
                f_Bc_W[self.geometries.index(target)] -= force
        R_WH = plant.EvalBodyPoseInWorld(context, self.hand).rotation().matrix()
        return np.asarray(np.einsum("ij,ij->i", f_Bc_W, self.nhat_H @ R_WH.T))


def _contact_forces(results: ContactResults) -> Iterator[tuple[GeometryId, GeometryId, Array]]:
    """Every contact: the geometry that pushes, the one that is pushed, and the force on it [N]."""
    for k in range(results.num_point_pair_contacts()):
        point = results.point_pair_contact_info(k)
        # Drake reports the force on the second body of a pair of points,
        pair = point.point_pair()
        yield pair.id_A, pair.id_B, point.contact_force()
    for k in range(results.num_hydroelastic_contacts()):
        patch = results.hydroelastic_contact_info(k)
        # and on the first of two compliant volumes.
        surface = patch.contact_surface()
        yield surface.id_N(), surface.id_M(), patch.F_Ac_W().translational()


def add_fingertips(
    plant: MultibodyPlant,
    body: RigidBody,
    spheres: FingertipSpheres,
    *,
    mass: float,
    stiffness: float,
    material: Callable[[float], ProximityProperties] = contact_material,
    hand: RigidBody | None = None,
    name: str = "fingertips",
    colours: Sequence[Any] = (_COLOUR, _COLOUR, _COLOUR),
) -> Fingertips:
    """Adds three fingertips on actuated joints to a plant that is not finalized yet.

        mu_T = fingertip_friction(grasp.mu, mu_object=0.5)
        spheres = fingertip_spheres(grasp, 0.01, mu_T, X_WB)
        tips = add_fingertips(plant, body, spheres, mass=0.05, stiffness=1000.0)

    They have no weight. At joint position 0 they touch the object; gravity, contact model and time
    step are the plant's.

    Args:
        plant: the plant.
        body: the object B, or a body welded to it.
        spheres: where the fingertips are at joint position 0.
        mass: of each [kg].
        stiffness: of the springs that hold them to commanded positions [N/m]; dampers are critical.
        material: their contact properties, from the friction of their surface.
        hand: the body H whose frame `spheres` are in, and on which they slide (default: the world).
        name: name of their model instance.
        colours: red, green, blue and opacity of each, in [0, 1].

    Returns:
        The fingertips.
    """
    hand = plant.world_body() if hand is None else hand
    instance = plant.AddModelInstance(name)
    geometries = []
    for i, (p_HT, nhat_H, mu) in enumerate(
        zip(spheres.p_HT, spheres.nhat_H, spheres.mu.tolist(), strict=True)
    ):
        label, shape, X_TS = f"tip_{i + 1}", Sphere(spheres.radius), RigidTransform(p_HT)
        tip = add_slider(plant, instance, label, hand, nhat_H, mass, stiffness)
        geometries.append(plant.RegisterCollisionGeometry(tip, X_TS, shape, label, material(mu)))
        plant.RegisterVisualGeometry(tip, X_TS, shape, label, np.asarray(colours[i]))
    plant.set_gravity_enabled(instance, False)
    return Fingertips(plant, body, hand, instance, tuple(geometries), frozen(spheres.nhat_H))


def add_slider(
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    name: str,
    parent: RigidBody,
    axis: Array,
    mass: float,
    stiffness: float,
) -> RigidBody:
    """Adds a body on an actuated prismatic joint, held to a commanded position by PD control.

    Args:
        plant: a plant that is not finalized yet.
        instance: model instance of body, joint and actuator.
        name: name of all three.
        parent: the body on which it slides; the frames coincide at joint position 0.
        axis: direction in which it slides, in the parent's frame, shape (3,).
        mass: of the body [kg].
        stiffness: of the PD control [N/m]; its damping is critical for this mass.

    Returns:
        The body.
    """
    # It does not turn against its parent, so that how large it is does not matter.
    body = plant.AddRigidBody(name, instance, SpatialInertia.SolidSphereWithMass(mass, 0.01))
    joint = plant.AddJoint(PrismaticJoint(name, parent.body_frame(), body.body_frame(), axis))
    gains = PdControllerGains(p=stiffness, d=2.0 * np.sqrt(stiffness * mass))
    plant.AddJointActuator(name, joint).set_controller_gains(gains)
    return body
