"""Finds postures in which fingertips touch contacts, by inverse kinematics, and checks them again.

What is returned is judged by forward kinematics and distance queries from rounded joint positions
and a rounded palm pose alone, whatever the solver says.
"""

from __future__ import annotations

import math

import numpy as np
from pydrake.multibody.inverse_kinematics import DistanceConstraint, InverseKinematics
from pydrake.solvers import SnoptSolver, SolverOptions

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.hand_grasp import HandRefusal
from drake_polygrasp.hands.measured_posture import (
    TIP_OVERLAP,
    Posture,
    measure_posture,
    tip_places,
)
from drake_polygrasp.hands.scene import HandScene, Pairs
from drake_polygrasp.hands.starts import Start

HAND_CLEARANCE = 0.002
"""Clearance that postures are searched with [m]. Our choice."""
LEAST_CLEARANCE = 0.75
"""Clearance with which a posture is accepted, over that. Our choice."""
INFLUENCE = 0.01
"""Distance from which the solver sees geometry approach [m]. Our choice."""
TIP_SLACK_IN_SEARCH = 1e-4
"""How far the solver may leave a tip off its place, along each axis [m]. Our choice."""
MAX_TIP_ERROR = 3e-4
"""Greatest distance of a tip from its place with which a posture is accepted [m]. Our choice."""
LINK_GAP = 3e-4
"""Distance from the object at which the solver keeps the links of used tips [m]. Our choice."""
HOPELESS_OVERLAP = 0.03
"""Where every start overlaps by more than this, no posture is searched [m]. Our choice."""
_LIMIT_SLACK = 1e-4
"""Distance to joint limits that the solver keeps, so that rounding crosses none [rad or m]."""
_ANGLE_COST, _MIDDLE_COST = 0.3, 0.02
"""Costs of the tips' angles, and of joints away from the middle of their range. Our choice: small
beside 1, for they only choose among postures that reach."""
_DECIMALS = 7
"""Decimals of joint positions [rad] and palm positions [m]: a thousandth of the solver's errors."""


def find_posture(
    scene: HandScene, grasp: Grasp, start: Start, clearance: float = HAND_CLEARANCE
) -> Posture | HandRefusal:
    """Searches a posture from one start, and checks what the solver returns.

    Args:
        scene: hand and object.
        grasp: three contacts.
        start: where to start, and which tip makes which contact.
        clearance: distance that the hand keeps from everything else [m].

    Returns:
        The posture; or a refusal, "tip_angle" where only the angles are too great, else
        "ik_failed".
    """
    program = _PostureProgram(scene, grasp, start, clearance)
    try:
        positions = program.solve()
    # FCL may throw while the solver asks it for distances; Drake's assertions raise SystemExit.
    except (RuntimeError, SystemExit) as error:
        return HandRefusal("ik_failed", f"Drake failed on this posture: {error}", {})
    X_BPalm, q = scene.posture(positions)
    p_BPalm = np.round(X_BPalm.translation(), _DECIMALS)
    quaternion = np.round(X_BPalm.rotation().ToQuaternion().wxyz(), _DECIMALS + 2)
    z = np.round(q[scene.independent], _DECIMALS)
    q = np.round(scene.hand.E @ z + scene.hand.e0, _DECIMALS + 3)
    posture = measure_posture(scene, grasp, start.fingers, p_BPalm, quaternion, q)
    return _judged(scene, posture, clearance)


def _judged(scene: HandScene, posture: Posture, clearance: float) -> Posture | HandRefusal:
    """Returns a posture if it keeps all bounds."""
    bounds = {
        "a tip is {:.2g} mm off": (posture.tip_error, MAX_TIP_ERROR),
        "the hand has {:.2g} mm of clearance": (-posture.clearance, -LEAST_CLEARANCE * clearance),
        "a tip's link is {:.2g} mm from the object": (-posture.tip_link_clearance, 0.0),
        "a tip's geometry is {:.2g} mm in the object": (posture.tip_overlap, TIP_OVERLAP),
        "a joint is {:.2g} mrad from its limit": (-posture.limit_room, 0.0),
    }
    for text, (value, bound) in bounds.items():
        if not value <= bound:
            value = abs(value) if bound > 0 else -value
            return HandRefusal("ik_failed", text.format(1000 * value), {"value": value})
    if posture.tip_angle > scene.hand.description.max_angle:
        degrees = math.degrees(posture.tip_angle)
        return HandRefusal(
            "tip_angle",
            f"a tip touches at {degrees:.0f} degrees to its axis",
            {"tip_angle": posture.tip_angle},
        )
    return posture


class _PostureProgram:
    """The nonlinear program of a posture: tips at their places, everything else clear."""

    def __init__(self, scene: HandScene, grasp: Grasp, start: Start, clearance: float) -> None:
        self._scene, self._grasp, self._fingers = scene, grasp, start.fingers
        self._context = scene.context(start.fingers)
        scene.place(self._context, start.X_BPalm, start.q)
        self._start = scene.plant.GetPositions(self._context)
        self._ik = InverseKinematics(scene.plant, self._context, with_joint_limits=False)
        self._add_joints()
        self._add_tips()
        self._ik.AddMinimumDistanceLowerBoundConstraint(clearance, INFLUENCE)
        for k in self._fingers:
            self._keep_apart(scene.link_pairs(k), LINK_GAP)
            self._keep_apart(scene.tip_pairs(k), -(scene.misfits[k] + TIP_OVERLAP))

    def solve(self) -> Array:
        """Returns the plant's positions at the end of the search, whether it succeeded or not."""
        options, solver = SolverOptions(), SnoptSolver()
        for name, value in (
            ("Major feasibility tolerance", 1e-5),
            ("Major optimality tolerance", 1e-3),
            ("Major iterations limit", 150),
        ):
            options.SetOption(solver.id(), name, value)
        result = solver.Solve(self._ik.prog(), self._start, options)
        return np.asarray(result.get_x_val())

    def _add_joints(self) -> None:
        hand, program = self._scene.hand, self._ik.get_mutable_prog()
        q = self._ik.q()[self._scene.q_indices]
        # A joint without room between its limits keeps them.
        slack = np.minimum(_LIMIT_SLACK, (hand.upper - hand.lower) / 4)
        program.AddBoundingBoxConstraint(hand.lower + slack, hand.upper - slack, q)
        z = q[self._scene.independent]
        followers = sorted({*range(len(q))} - {*self._scene.independent})
        for j in followers:
            program.AddLinearEqualityConstraint(
                np.append(1.0, -hand.E[j])[None], hand.e0[[j]], np.append(q[j], z)
            )
        bounded = np.isfinite(hand.lower) & np.isfinite(hand.upper) & (hand.upper > hand.lower)
        half = np.where(bounded, (hand.upper - hand.lower) / 2, 1.0)[bounded]
        middle = ((hand.upper + hand.lower) / 2)[bounded]
        program.AddQuadraticErrorCost(np.diag(_MIDDLE_COST / half**2), middle, q[bounded])

    def _add_tips(self) -> None:
        scene, slack = self._scene, TIP_SLACK_IN_SEARCH
        B = scene.body.body_frame()
        places = tip_places(scene, self._grasp, self._fingers)
        for k, p_BT, nhat_TB_B in zip(self._fingers, places, self._grasp.nhat_TB_B, strict=True):
            tip, F = scene.hand.tips[k], scene.model.tip_frames[k]
            self._ik.AddPositionConstraint(F, tip.p_FT, B, p_BT - slack, p_BT + slack)
            self._ik.AddAngleBetweenVectorsCost(B, nhat_TB_B, F, tip.axis_F, _ANGLE_COST)

    def _keep_apart(self, pairs: Pairs, least: float) -> None:
        for pair in pairs:
            constraint = DistanceConstraint(self._scene.plant, pair, self._context, least, math.inf)
            self._ik.get_mutable_prog().AddConstraint(constraint, self._ik.q())
