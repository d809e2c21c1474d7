"""Searches, for candidate grasps, a posture, torques that hold the object, and a way to get there.

The search goes breadth-first: a few starts for each candidate before more for any, since most
candidates succeed at once and the others may take long.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from drake_polygrasp.arrays import Array
from drake_polygrasp.digits import at_least, at_most
from drake_polygrasp.grasp import AnyGrasp, CertifiedGrasp, Grasp, grasp_of
from drake_polygrasp.hand_grasp import (
    HandGrasp,
    HandRefusal,
    HandSource,
    HandTorque,
    Pregrasp,
)
from drake_polygrasp.hands.approach import DISTANCE, find_pregrasp
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.margin import hand_margin
from drake_polygrasp.hands.measured_posture import Posture, tips_fit
from drake_polygrasp.hands.posture import (
    HAND_CLEARANCE,
    HOPELESS_OVERLAP,
    LEAST_CLEARANCE,
    find_posture,
)
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.hands.squeeze import region_squeeze
from drake_polygrasp.hands.starts import Start, best_starts
from drake_polygrasp.hands.torque import FRICTION_SHARE, Load, friction_refusal, holding_torque
from drake_polygrasp.search.reach import Reach

FIRST_CANDIDATES, FIRST_STARTS = 30, 2
"""Candidates that are tried first, and starts before others have had theirs. Our choice."""
_STAGES = (
    *("budget", "out_of_reach", "collision", "ik_failed", "tip_angle", "friction", "torque"),
    *("no_opening", "no_approach"),
)
"""Reasons in the order in which a candidate may be refused; the last one reached tells most."""


@dataclass(frozen=True, eq=False)
class HoldOptions:
    """What a hand's grasps must do.

    Attributes:
        mass: mass of the load [kg]; None for the object's.
        up_B: unit vector against gravity, shape (3,); None for every orientation.
        friction_share: share of the contacts' friction that forces use.
        clearance: distance that the hand keeps from everything but its contacts [m].
        approach: length of the straight way [m].
    """

    mass: float | None = None
    up_B: Array | None = None
    friction_share: float = FRICTION_SHARE
    clearance: float = HAND_CLEARANCE
    approach: float = DISTANCE


class HeldGrasp(NamedTuple):
    """A posture that touches a grasp's contacts, with its torques and its way there.

    Attributes:
        posture: the posture.
        pregrasp: the way there.
        torque: torques that hold the object.
    """

    posture: Posture
    pregrasp: Pregrasp
    torque: HandTorque


class HandSearch:
    """A breadth-first search of postures for candidate grasps.

        search = HandSearch(scene, reach, grasps, HoldOptions())
        for index, held in search.run(budget=10.0):
            ...

    Attributes:
        scene: hand, object and what is around it.
        refusals: why a candidate has no posture so far, by its index.
    """

    def __init__(
        self,
        scene: HandScene,
        reach: Reach,
        grasps: Sequence[AnyGrasp],
        options: HoldOptions,
    ) -> None:
        """Prepares a search; nothing is tried yet.

        Args:
            scene: hand, object and what is around it.
            reach: the hand's library.
            grasps: N candidates, the best first.
            options: what the grasps must do.
        """
        self.scene, self._reach, self._options = scene, reach, options
        self._grasps = [grasp_of(grasp) for grasp in grasps]
        self._loads = [hand_load(scene, grasp, options) for grasp in grasps]
        self._starts: dict[int, list[Start]] = {}
        budget = HandRefusal("budget", "the time was up before this candidate was tried", {})
        self.refusals: dict[int, HandRefusal] = dict.fromkeys(range(len(grasps)), budget)
        self._done: set[int] = set()

    def skip(self, indices: Iterable[int]) -> None:
        """Leaves out candidates that are not wanted any more, also of `refusals`.

        Args:
            indices: the candidates.
        """
        for index in {*indices} - self._done:
            self._done.add(index)
            del self.refusals[index]

    def run(self, budget: float) -> Iterator[tuple[int, HeldGrasp]]:
        """Yields candidates that the hand can hold, as they are found.

        Args:
            budget: time after which nothing more is tried [s].

        Yields:
            Index of a candidate, and how the hand holds it.
        """
        deadline = time.monotonic() + budget
        waiting = list(range(len(self._grasps)))
        first, later = waiting[:FIRST_CANDIDATES], waiting[FIRST_CANDIDATES:]
        rounds = [
            *((k, slice(0, FIRST_STARTS)) for k in (*first, *later)),
            *((k, slice(FIRST_STARTS, None)) for k in waiting),
        ]
        for index, which in rounds:
            if index in self._done:
                continue
            if time.monotonic() > deadline:
                return
            if index not in self._starts and not self._begin(index):
                self._done.add(index)
                continue
            for start in self._starts[index][which]:
                held = self._try(index, start)
                if held is not None:
                    self._done.add(index)
                    del self.refusals[index]
                    yield index, held
                    break
                if time.monotonic() > deadline:
                    return

    def _begin(self, index: int) -> bool:
        """Finds the starts of a candidate; False if it is hopeless."""
        grasp = self._grasps[index]
        refusal = friction_refusal(grasp, self._loads[index], self._options.friction_share)
        if refusal is None:
            starts = best_starts(self.scene, self._reach, grasp)
            refusal = _hopeless(starts)
            self._starts[index] = starts
        if refusal is not None:
            self.refusals[index] = refusal
        return refusal is None

    def _try(self, index: int, start: Start) -> HeldGrasp | None:
        """Tries one start of a candidate, and notes why it fails."""
        result = hold_from(
            self.scene, self._grasps[index], start, self._loads[index], self._options
        )
        if isinstance(result, HeldGrasp):
            return result
        before = self.refusals[index]
        if _STAGES.index(result.reason) >= _STAGES.index(before.reason):
            self.refusals[index] = result
        return None


def hold_from(
    scene: HandScene, grasp: Grasp, start: Start, load: Load, options: HoldOptions
) -> HeldGrasp | HandRefusal:
    """Finds how a hand holds a grasp, from one start.

    Args:
        scene: hand, object and what is around it.
        grasp: three contacts.
        start: where inverse kinematics starts.
        load: what the hand must hold.
        options: what the grasp must do.

    Returns:
        Posture, torques and way; or the refusal of the first that is not found.
    """
    if not tips_fit(scene, grasp, start.fingers):
        return HandRefusal("collision", "a tip is too large for the surface at its contact", {})
    posture = find_posture(scene, grasp, start, options.clearance)
    if isinstance(posture, HandRefusal):
        return posture
    torque = posture_torque(scene, grasp, posture, load, options.friction_share)
    if isinstance(torque, HandRefusal):
        return torque
    pregrasp = find_pregrasp(scene, grasp, posture, options.approach, options.up_B)
    if isinstance(pregrasp, HandRefusal):
        return pregrasp
    return HeldGrasp(posture, pregrasp, torque)


def posture_torque(
    scene: HandScene, grasp: Grasp, posture: Posture, load: Load, friction_share: float
) -> HandTorque | HandRefusal:
    """Computes the torques with which a posture holds a load.

    Args:
        scene: hand and object.
        grasp: three contacts.
        posture: the posture.
        load: what the hand must hold.
        friction_share: share of the contacts' friction that forces use.

    Returns:
        The torques, or why there are none.
    """
    hand, context = scene.hand, scene.context(posture.fingers)
    scene.place(context, posture.X_BPalm, posture.q)
    J_Bc = scene.jacobians(context, posture.fingers, grasp.p_BC)[:, 3:] @ hand.E
    effort = dict(zip(hand.independent, hand.effort.tolist(), strict=True))
    return holding_torque(grasp, J_Bc, effort, load, friction_share)


def hand_load(scene: HandScene, grasp: AnyGrasp, options: HoldOptions) -> Load:
    """Returns what a hand must hold.

    Args:
        scene: hand and object.
        grasp: a grasp; the squeeze that its region asks for is asked for, if it has one.
        options: what the grasp must do.
    """
    object_ = scene.object_
    region = None if isinstance(grasp, Grasp) else grasp.region
    mass = object_.mass if options.mass is None else options.mass
    squeeze = region_squeeze(region, object_.mass, mass)
    return Load(mass, object_.p_BBcm, object_.rho, options.up_B, squeeze)


def hand_grasp(
    scene: HandScene,
    certified: CertifiedGrasp,
    held: HeldGrasp,
    clearance: float = HAND_CLEARANCE,
) -> HandGrasp:
    """Returns a certified grasp with the posture of a hand.

    Args:
        scene: hand, object and what is around it.
        certified: the grasp.
        held: how the hand holds it.
        clearance: distance that the hand was to keep from everything but its contacts [m].
    """
    posture, tips = held.posture, scene.hand.tips
    first, second, third = (tips[k].name for k in posture.fingers)
    return HandGrasp(
        fingers=(first, second, third),
        p_BPalm=posture.p_BPalm,
        quaternion_BPalm=posture.quaternion_BPalm,
        q=scene.hand.joint_dict(posture.q),
        pregrasp=held.pregrasp,
        clearance=at_most(posture.clearance),
        tip_error=at_least(posture.tip_error),
        tip_angle=at_least(posture.tip_angle),
        torque=held.torque,
        surroundings=scene.surroundings,
        certified=certified,
        hand=hand_source(scene.hand),
        tip_link_clearance=at_most(posture.tip_link_clearance),
        tip_overlap=at_least(posture.tip_overlap),
        limit_room=at_most(posture.limit_room),
        margin=at_most(hand_margin(scene.hand, posture, held.torque, LEAST_CLEARANCE * clearance)),
    )


def hand_source(hand: Hand) -> HandSource:
    """Returns which hand this is, and its files.

    Args:
        hand: the hand.
    """
    path = hand.description.path
    return HandSource(
        hand.name,
        None if path is None else Path(path).absolute(),
        hand.sha256,
        hand.description.palm_frame,
        hand.approach_P,
    )


def _hopeless(starts: Sequence[Start]) -> HandRefusal | None:
    """Returns why inverse kinematics need not be tried, if so."""
    if not starts:
        return HandRefusal(
            "out_of_reach", "no posture of the hand's library comes near these contacts", {}
        )
    least = min(start.overlap for start in starts)
    if least > HOPELESS_OVERLAP:
        return HandRefusal(
            "collision",
            f"every posture near these contacts overlaps by {1000 * least:.0f} mm or more",
            {"overlap": least},
        )
    return None
