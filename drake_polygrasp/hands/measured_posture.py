"""Measures a posture by forward kinematics and distance queries alone, whoever found it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.geometry.surface_contact import fingertip_fits
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.hand_grasp import pose_of
from drake_polygrasp.hands.scene import FAR, Fingers, HandScene

TIP_OVERLAP = 5e-4
"""How deep a tip's geometry may be in the object, beyond its misfit [m]. Our choice."""


@dataclass(frozen=True, eq=False)
class Posture:
    """A posture whose tips touch the contacts, with everything that was measured of it.

    Attributes:
        fingers: indices of the tips for contacts 1, 2 and 3.
        p_BPalm: origin of the palm frame [m], shape (3,).
        quaternion_BPalm: orientation of the palm frame (w, x, y, z), shape (4,).
        q: joint positions [rad or m], shape (n,).
        tip_error: greatest distance of a tip's centre from its place [m].
        tip_angle: greatest angle between a tip's axis and its inward normal [rad].
        clearance: least distance of the hand to everything but the object at these tips' bodies
            [m], at most `FAR`.
        tip_link_clearance: least distance of the rest of these bodies to the object [m].
        tip_overlap: how deep these tips' geometry is in the object beyond its misfit [m].
        limit_room: least distance of a joint to its limits [rad or m].
    """

    fingers: Fingers
    p_BPalm: Array
    quaternion_BPalm: Array
    q: Array
    tip_error: float
    tip_angle: float
    clearance: float
    tip_link_clearance: float
    tip_overlap: float
    limit_room: float

    @property
    def X_BPalm(self) -> RigidTransform:
        """Pose of the palm frame in B."""
        return pose_of(self.p_BPalm, self.quaternion_BPalm)


def measure_posture(
    scene: HandScene,
    grasp: Grasp,
    fingers: Fingers,
    p_BPalm: Array,
    quaternion_BPalm: Array,
    q: Array,
) -> Posture:
    """Measures a posture by forward kinematics and distance queries.

    Args:
        scene: hand and object.
        grasp: three contacts.
        fingers: indices of the tips for contacts 1, 2 and 3.
        p_BPalm: origin of the palm frame [m], shape (3,).
        quaternion_BPalm: orientation of the palm frame (w, x, y, z), shape (4,).
        q: joint positions [rad or m], shape (n,).

    Returns:
        The posture, good or bad.
    """
    hand, context = scene.hand, scene.context(fingers)
    scene.place(context, pose_of(p_BPalm, quaternion_BPalm), q)
    p_BT, axis_B = scene.tips(context, fingers)
    cosines = (axis_B * grasp.nhat_TB_B).sum(axis=1)
    links = [pair for k in fingers for pair in scene.link_pairs(k)]
    overlaps = [
        -distance - scene.misfits[k]
        for k in fingers
        for distance in scene.distances(context, scene.tip_pairs(k))
    ]
    room = np.minimum(q - hand.lower, hand.upper - q)
    return Posture(
        fingers=fingers,
        p_BPalm=frozen(p_BPalm),
        quaternion_BPalm=frozen(quaternion_BPalm),
        q=frozen(q),
        tip_error=float(np.linalg.norm(p_BT - tip_places(scene, grasp, fingers), axis=1).max()),
        tip_angle=float(np.arccos(np.clip(cosines, -1.0, 1.0)).max()),
        clearance=scene.clearance(context),
        tip_link_clearance=min((*scene.distances(context, links), FAR)),
        tip_overlap=max((*overlaps, 0.0)),
        limit_room=float(room.min()),
    )


def tip_places(scene: HandScene, grasp: Grasp, fingers: Fingers) -> Array:
    """Returns where the centres of tips are that touch the contacts [m], shape (3, 3).

    Args:
        scene: hand and object.
        grasp: three contacts.
        fingers: indices of the tips for contacts 1, 2 and 3.
    """
    radii = np.array([scene.hand.tips[k].radius for k in fingers])
    return np.asarray(grasp.p_BC - radii[:, None] * grasp.nhat_TB_B)


def tips_fit(scene: HandScene, grasp: Grasp, fingers: Fingers) -> bool:
    """Returns whether the spheres of tips at the contacts penetrate the true surface nowhere.

    Args:
        scene: hand and object.
        grasp: three contacts.
        fingers: indices of the tips for contacts 1, 2 and 3.
    """
    polyhedron = scene.object_.polyhedron
    return all(
        fingertip_fits(
            polyhedron, grasp.p_BC[[i]], grasp.nhat_TB_B[[i]], scene.hand.tips[k].radius
        )[0]
        for i, k in enumerate(fingers)
    )
