"""Poses of the frames that exports name: contacts, fingertips and palms."""

from __future__ import annotations

from typing import Any

from pydrake.math import RigidTransform, RotationMatrix

from drake_polygrasp.grasp import AnyGrasp, grasp_of
from drake_polygrasp.wrenches.contacts import contact_frames

Poses = tuple[RigidTransform, RigidTransform, RigidTransform]
"""Poses at contacts 1, 2 and 3."""


def contact_poses(grasp: AnyGrasp) -> Poses:
    """Returns the pose X_BC of each contact frame C in body frame B.

    C's origin is the contact point. Cz is the inward normal, along which the fingertip pushes; Cx
    is normal to the grasp plane, as far as Cz allows.

        X_WC = [X_WB @ X_BC for X_BC in contact_poses(plan.grasps[0])]

    Args:
        grasp: three contacts, alone or with their certificate.

    Returns:
        The poses of contacts 1, 2 and 3.

    Raises:
        UsageError: when it is no grasp.
    """
    grasp = grasp_of(grasp)
    frames = contact_frames(grasp.p_BC[None], grasp.nhat_TB_B[None])[0]
    poses = [
        RigidTransform(RotationMatrix(R_CB[[1, 2, 0]].T), p_BC)
        for R_CB, p_BC in zip(frames, grasp.p_BC, strict=True)
    ]
    return poses[0], poses[1], poses[2]


def tip_poses(grasp: AnyGrasp, radius: float) -> Poses:
    """Returns the pose X_BT of a frame at the centre of each fingertip, parallel to its contact's.

    Args:
        grasp: three contacts, alone or with their certificate.
        radius: radius of the fingertips [m].

    Returns:
        The poses of tips 1, 2 and 3.

    Raises:
        UsageError: when it is no grasp.
    """
    X_CT = RigidTransform([0.0, 0.0, -radius])
    one, two, three = (X_BC.multiply(X_CT) for X_BC in contact_poses(grasp))
    return one, two, three


def pose_document(X_BF: RigidTransform) -> dict[str, Any]:
    """Returns a pose as plain data: `p_BF` [m] and the unit quaternion `quaternion_wxyz`.

    Args:
        X_BF: pose of a frame F in B.
    """
    return {
        "p_BF": (X_BF.translation() + 0.0).tolist(),
        "quaternion_wxyz": (X_BF.rotation().ToQuaternion().wxyz() + 0.0).tolist(),
    }
