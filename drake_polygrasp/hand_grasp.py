"""How a hand holds a grasp, as values: where it is, its joints, its torques, and its way there.

P is the palm frame of the hand, B the body frame of the object. Joints are known by their names,
so that no order of joints has to be agreed on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import CertifiedGrasp

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

Loads = Literal["six", "up"]
"""What a hand's torques must hold: the weight along each axis of B, or against one direction."""


@dataclass(frozen=True, eq=False)
class HandSource:
    """The hand that a plan is for, and the files it was loaded from.

    Attributes:
        name: name of the hand.
        description_file: its description, an absolute path; None for one that was made in memory.
        sha256: hex digest over the digests of its description, model and meshes; None likewise.
        palm_frame: name of frame P in its model.
        approach_P: unit vector from the palm to the object, shape (3,).
    """

    name: str
    description_file: Path | None
    sha256: str | None
    palm_frame: str
    approach_P: Array


@dataclass(frozen=True)
class HandRefusal:
    """Why a hand makes no grasp of given contacts.

    Attributes:
        reason: "no_candidate", "out_of_reach", "collision", "ik_failed", "tip_angle", "friction",
            "torque", "no_opening", "no_approach" or "budget".
        sentence: the reason for people, with its numbers.
        numbers: those numbers by name, in SI units.
    """

    reason: str
    sentence: str
    numbers: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Pregrasp:
    """The hand before it closes: fingertips backed off, and a straight way for the palm.

    Attributes:
        q: positions of all joints by name [rad or m].
        direction_B: unit vector along which the palm moves away from the grasp, shape (3,).
        distance: how far it moves [m].
        opening: how far the fingertips are backed off along their normals [m].
    """

    q: Mapping[str, float]
    direction_B: Array
    distance: float
    opening: float


@dataclass(frozen=True, eq=False)
class HandTorque:
    """Joint torques that squeeze the object, and the share of the hand's effort that loads need.

    Attributes:
        share: least share of the efforts with which each load can be held; None where the hand's
            efforts or the object's mass are unknown, so that it was not checked.
        mass: mass of the load [kg]; None where it is unknown.
        loads: "six", the weight along each axis of B; "up", 1.2 times the weight against `up_B`.
        up_B: unit vector against gravity, shape (3,); None for "six".
        friction_share: share of the contacts' friction that the forces use.
        f_Bc_B: forces of the squeeze on B at the contacts [N], shape (3, 3): in balance with the
            weight against `up_B`, or with each other for "six".
        torque: torques of that squeeze by the names of independent joints [N m or N].
    """

    share: float | None
    mass: float | None
    loads: Loads
    up_B: Array | None
    friction_share: float
    f_Bc_B: Array
    torque: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class HandPlacement:
    """A posture in which a hand's fingertips touch the contacts of a grasp.

    Attributes:
        fingers: names of the tips that make contacts 1, 2 and 3.
        p_BPalm: origin of palm frame P [m], shape (3,).
        quaternion_BPalm: orientation of P in B as a unit quaternion (w, x, y, z), shape (4,).
        q: positions of all joints by name [rad or m], coupled ones too.
        pregrasp: the posture before closing, and the way there.
        clearance: least distance of the hand to the object, to what is around it and to itself,
            but for the bodies of these three tips to the object [m].
        tip_error: greatest distance of these tips' centres from where they touch the contacts [m].
        tip_angle: greatest angle between these tips' axes and the inward normals [rad].
        torque: torques that hold the object.
        surroundings: names of what is around the object; empty for nothing.
        hand: the hand.
    """

    fingers: tuple[str, str, str]
    p_BPalm: Array
    quaternion_BPalm: Array
    q: Mapping[str, float]
    pregrasp: Pregrasp
    clearance: float
    tip_error: float
    tip_angle: float
    torque: HandTorque
    surroundings: tuple[str, ...]
    hand: HandSource

    @property
    def X_BPalm(self) -> RigidTransform:
        """Pose of the palm frame in B."""
        return pose_of(self.p_BPalm, self.quaternion_BPalm)


@dataclass(frozen=True, eq=False)
class HandGrasp(HandPlacement):
    """A certified grasp with the posture of a hand that makes it.

        best = plan_hand_grasps(box, hand).grasps[0]
        print(best.X_BPalm, best.q, best.torque.share)

    Attributes:
        certified: the grasp with its proof.
        tip_link_clearance: least distance to the object of the rest of the bodies whose tips touch
            it [m]; infinite where they have no other geometry.
        tip_overlap: how deep geometry that the tips' spheres stand for is in the object, beyond its
            misfit from them [m].
        limit_room: least distance of a joint to its limits [rad or m].
        margin: how far the hand is from its bounds, 0 to 1: the least of what is left of its
            efforts, of half of a joint's range, of the angle that tips may touch at, and of the
            clearance that it had to keep, up to once more of that.
    """

    certified: CertifiedGrasp
    tip_link_clearance: float
    tip_overlap: float
    limit_room: float
    margin: float


def pose_of(p_BPalm: Array, quaternion_BPalm: Array) -> RigidTransform:
    """Returns the pose of a palm frame.

    Args:
        p_BPalm: its origin [m], shape (3,).
        quaternion_BPalm: its orientation (w, x, y, z), of any length above 0, shape (4,).
    """
    from pydrake.math import RigidTransform, RotationMatrix

    w, *axis = quaternion_BPalm / np.sqrt(quaternion_BPalm @ quaternion_BPalm)
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return RigidTransform(RotationMatrix(np.eye(3) + 2 * w * cross + 2 * cross @ cross), p_BPalm)
