"""Adds three force-controlled spherical fingertips at the contacts of a grasp to any plant.

Each fingertip T slides on a prismatic joint along the normal of its contact. The parent of the
joints is a body H, the hand: the world, a carriage or the palm of a gripper. Drake's PD control
pulls T to a commanded position like a spring and a damper; a commanded force is added to it. Across
the normal the joint is rigid, so friction has to hold the tangential part of the load.
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
"""Hunt-Crossley dissipation of each surface [s/m]. Our choice."""
_COLOUR = np.array([0.9, 0.4, 0.1, 1.0])


@dataclass(frozen=True, eq=False)
class FingertipSpheres:
    """Three spheres that touch an object at the contacts of a grasp.

    Attributes:
        p_HT: centres in the hand's frame H [m], shape (3, 3).
        nhat_H: unit normals into the object, shape (3, 3).
        radius: radius of each sphere [m].
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
    """Returns the friction of a fingertip's surface that gives its pair with the object mu.

    Drake combines the coefficients of two surfaces to 2 mu_T mu_B / (mu_T + mu_B).

    Args:
        mu: friction coefficient of the pair at each contact, shape (3,).
        mu_object: friction coefficient of the object's surface there, above mu / 2; shape (3,) or
            ().

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
    """Makes the properties of a surface for point contact or compliant hydroelastic contact.

    Static and dynamic friction are equal, because Drake's discrete contact uses only the latter.

    Args:
        mu: friction coefficient.
        point_stiffness: stiffness of point contact [N/m] (default: the plant's).
        modulus: hydroelastic modulus [Pa] (default: the surface is not hydroelastic).
        resolution: length of edges of the hydroelastic mesh [m]; required with `modulus`.
        dissipation: Hunt-Crossley dissipation [s/m].

    Returns:
        The properties, for `MultibodyPlant.RegisterCollisionGeometry`.
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
    """Returns the hydroelastic modulus at which a normal force gives a sphere a penetration.

    With penetration d and radius r [m], the pressure is modulus d / r at the centre and on average
    half of that, over a disc of area 2 pi r d.

    Args:
        normal_force: force on the fingertip [N].
        radius: radius of the fingertip [m].
        penetration: penetration over radius.

    Returns:
        The modulus [Pa].
    """
    return float(normal_force / (np.pi * (penetration * radius) ** 2))


@dataclass(frozen=True, eq=False)
class Fingertips:
    """Three fingertips of a plant, and the object that they hold.

    Attributes:
        plant: plant that they are part of.
        body: body B of the object.
        hand: body H on which they slide.
        instance: their model instance, whose ports take commanded positions, speeds and forces.
        geometries: collision geometries of the spheres, one per contact.
        nhat_H: unit directions in which they slide, into the object, shape (3, 3).
    """

    plant: MultibodyPlant
    body: RigidBody
    hand: RigidBody
    instance: ModelInstanceIndex
    geometries: tuple[GeometryId, ...]
    nhat_H: Array

    def X_HB(self, context: Context) -> RigidTransform:
        """Returns the pose of the object in the hand.

        Args:
            context: context of the plant.
        """
        X_WH = self.plant.EvalBodyPoseInWorld(context, self.hand)
        return X_WH.InvertAndCompose(self.plant.EvalBodyPoseInWorld(context, self.body))

    def normal_forces(self, context: Context) -> Array:
        """Computes the normal forces of the fingertips on the object.

        They are of point contact and of hydroelastic contact.

        Args:
            context: context of the plant.

        Returns:
            Forces along `nhat_H` [N], shape (3,); 0 for a fingertip that does not touch the object.
        """
        plant = self.plant
        parts = plant.GetBodiesWeldedTo(self.body)
        surface = {g for part in parts for g in plant.GetCollisionGeometriesForBody(part)}
        f_Bc_W = np.zeros((3, 3))
        for source, target, force in contact_forces(
            plant.get_contact_results_output_port().Eval(context)
        ):
            if target in surface and source in self.geometries:
                f_Bc_W[self.geometries.index(source)] += force
            elif source in surface and target in self.geometries:
                f_Bc_W[self.geometries.index(target)] -= force
        R_WH = plant.EvalBodyPoseInWorld(context, self.hand).rotation().matrix()
        return np.asarray(np.einsum("ij,ij->i", f_Bc_W, self.nhat_H @ R_WH.T))


def contact_forces(results: ContactResults) -> Iterator[tuple[GeometryId, GeometryId, Array]]:
    """Yields each contact: a geometry, the geometry on which it pushes, and the force on that [N].

    Forces are expressed in W.

    Args:
        results: the contact results of a plant.
    """
    for k in range(results.num_point_pair_contacts()):
        point = results.point_pair_contact_info(k)
        # For point contact, Drake reports the force on the second body of the pair.
        pair = point.point_pair()
        yield pair.id_A, pair.id_B, point.contact_force()
    for k in range(results.num_hydroelastic_contacts()):
        patch = results.hydroelastic_contact_info(k)
        # For hydroelastic contact, Drake reports the force on the first body.
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

    Gravity does not act on the fingertips. At joint position 0 they touch the object.

    Args:
        plant: plant to add them to.
        body: body B of the object, or a body welded to it.
        spheres: the fingertips at joint position 0.
        mass: mass of each fingertip [kg].
        stiffness: proportional gain of the PD control [N/m]; its damping is critical.
        material: function that makes contact properties from the friction of the surface.
        hand: body H, in whose frame `spheres` are and on which they slide (default: the world).
        name: name of their model instance.
        colours: red, green, blue and opacity of each fingertip, in [0, 1].

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
        name: name of body, joint and actuator.
        parent: body on which it slides; the frames coincide at joint position 0.
        axis: direction in which it slides, in the parent's frame, shape (3,).
        mass: mass of the body [kg].
        stiffness: proportional gain of the PD control [N/m]; its damping is critical for this mass.

    Returns:
        The body.
    """
    # It cannot rotate relative to its parent, so the radius of its inertia hardly matters.
    body = plant.AddRigidBody(name, instance, SpatialInertia.SolidSphereWithMass(mass, 0.01))
    joint = plant.AddJoint(PrismaticJoint(name, parent.body_frame(), body.body_frame(), axis))
    gains = PdControllerGains(p=stiffness, d=2.0 * np.sqrt(stiffness * mass))
    plant.AddJointActuator(name, joint).set_controller_gains(gains)
    return body
