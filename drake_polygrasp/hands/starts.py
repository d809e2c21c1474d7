"""Where inverse kinematics starts: postures of the library, moved onto the contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.hands.scene import Fingers, HandScene
from drake_polygrasp.search.reach import OUT_OF_REACH, Reach, best_matches

MOST_STARTS = 8
"""Starts that are tried for a grasp. Our choice."""
MATCHES = 80
"""Matches of the library whose overlap is measured for a grasp. Our choice."""
AXIS_LENGTH = 0.03
"""A tip's axis counts as a second point this far along it [m]. Our choice."""
AXIS_WEIGHT = 0.3
"""Weight of that point, over the tip's. Our choice."""
OVERLAP_SCALE = 0.004
"""Overlap that counts as much as a score of 1 [m]. Our choice."""


class Start(NamedTuple):
    """A posture near contacts, from which inverse kinematics starts.

    Attributes:
        fingers: indices of the tips for contacts 1, 2 and 3.
        X_BPalm: pose of the palm frame in B.
        q: joint positions [rad or m], shape (n,).
        score: how far tips and axes are from the contacts, see `search.reach`.
        overlap: depth of the deepest overlap there [m].
    """

    fingers: Fingers
    X_BPalm: RigidTransform
    q: Array
    score: float
    overlap: float


def best_starts(scene: HandScene, reach: Reach, grasp: Grasp) -> list[Start]:
    """Returns the postures from which inverse kinematics most likely succeeds, best first.

    Args:
        scene: hand and object.
        reach: the hand's library.
        grasp: three contacts.

    Returns:
        At most `MOST_STARTS`, by how well distances and directions of the tips match, and by how
        deep the hand overlaps.
    """
    found = _matched(scene, reach, grasp, MATCHES)
    cost = [start.score + (start.overlap / OVERLAP_SCALE) ** 2 for start in found]
    return [found[k] for k in np.argsort(cost, kind="stable")[:MOST_STARTS]]


def start_overlaps(scene: HandScene, reach: Reach, grasps: Sequence[Grasp]) -> Array:
    """Returns how deep the hand overlaps where its library matches each grasp best [m].

    Args:
        scene: hand and object.
        reach: the hand's library.
        grasps: N grasps.

    Returns:
        Shape (N,); infinite where no posture of the library matches.
    """
    starts = [_matched(scene, reach, grasp, 1) for grasp in grasps]
    return np.array([found[0].overlap if found else np.inf for found in starts])


def _matched(scene: HandScene, reach: Reach, grasp: Grasp, num: int) -> list[Start]:
    """Returns the best matches of the library that are within reach."""
    hand = scene.hand
    # Tips differ little in radius, and inverse kinematics takes each tip's own.
    radius = max(tip.radius for tip in hand.tips)
    p_BT = grasp.p_BC - radius * grasp.nhat_TB_B
    matches = best_matches(reach, hand.fingers, p_BT, grasp.nhat_TB_B, num)
    matches = matches.take(matches.score <= OUT_OF_REACH)
    if not len(matches.row):
        return []
    radii = np.array([tip.radius for tip in hand.tips])[matches.fingers]
    targets = grasp.p_BC - radii[..., None] * grasp.nhat_TB_B
    row = matches.row[:, None]
    poses = fit_palms(
        reach.p_PT[row, matches.fingers],
        reach.axis_P[row, matches.fingers],
        targets,
        grasp.nhat_TB_B,
    )
    starts = []
    for fingers, row, X_BPalm, score in zip(
        matches.fingers.tolist(), matches.row, poses, matches.score.tolist(), strict=True
    ):
        triple: Fingers = (fingers[0], fingers[1], fingers[2])
        context, q = scene.context(triple), reach.q[row]
        scene.place(context, X_BPalm, q)
        starts.append(Start(triple, X_BPalm, q, score, scene.overlap(context)))
    return starts


def fit_palms(p_PT: Array, axis_P: Array, p_BT: Array, nhat_TB_B: Array) -> list[RigidTransform]:
    """Computes the palm poses that bring tips nearest to contacts, by least squares (Kabsch, 1976).

    Args:
        p_PT: centres of the tips' spheres for M postures [m], shape (M, 3, 3).
        axis_P: unit axes of the tips, shape (M, 3, 3).
        p_BT: where the centres should be [m], shape (M, 3, 3).
        nhat_TB_B: where the axes should look, shape (3, 3).

    Returns:
        M poses X_BPalm.
    """
    weight = np.repeat([1.0, AXIS_WEIGHT], 3)[:, None]
    weight /= weight.sum()
    points_P = np.concatenate([p_PT, p_PT + AXIS_LENGTH * axis_P], axis=1)
    points_B = np.concatenate([p_BT, p_BT + AXIS_LENGTH * nhat_TB_B], axis=1)
    centre_P, centre_B = (
        (weight * points).sum(axis=1, keepdims=True) for points in (points_P, points_B)
    )
    covariance = np.einsum("mki,mkj->mij", weight * (points_B - centre_B), points_P - centre_P)
    U, _, Vt = np.linalg.svd(covariance)
    # A reflection would fit better where this is -1: turn the least certain axis round.
    U[:, :, 2] *= np.sign(np.linalg.det(U) * np.linalg.det(Vt))[:, None]
    R = U @ Vt
    p = centre_B[:, 0] - np.einsum("mij,mj->mi", R, centre_P[:, 0])
    return [
        RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_BP), p_BP)
        for R_BP, p_BP in zip(R, p, strict=True)
    ]
