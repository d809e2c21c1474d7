"""The plan of a hand: its grasps, and why other candidates have no posture, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.hand_grasp import HandGrasp, HandRefusal
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.pipeline.hand_candidates import HandCandidates
from drake_polygrasp.settings import PlanSettings


@dataclass(frozen=True, eq=False)
class HandPlan:
    """Certified grasps that a hand can make, best first, and why others cannot be made.

        plan = plan_hand_grasps(box, hand)
        print(plan.sentences or plan.grasps[0].X_BPalm)

    Attributes:
        grasps: the grasps, each with the hand's posture, at most one for each set of faces.
        refusals: number of candidates without a posture, by reason.
        sentences: one refusal of each reason in words.
        candidates: number of proved candidates within the hand's reach.
        tried: number of these that were tried: those refused and those with a posture.
        seconds: time taken [s]: "load", "library", "candidates", "postures".
        settings: settings of the contacts, for `save_grasps`.
        warnings: what was assumed or left unchecked, one sentence each.
    """

    grasps: tuple[HandGrasp, ...]
    refusals: dict[str, int]
    sentences: dict[str, str]
    candidates: int
    tried: int
    seconds: dict[str, float]
    settings: PlanSettings
    warnings: tuple[str, ...] = ()


def count_refusals(refusals: Iterable[HandRefusal]) -> tuple[dict[str, int], dict[str, str]]:
    """Counts refusals by reason, and returns one sentence of each.

    Args:
        refusals: the refusals, of the best candidate first.

    Returns:
        The numbers, most frequent reason first but the budget last, and the first sentence of each
        reason.
    """
    refusals = list(refusals)
    common = Counter(refusal.reason for refusal in refusals).most_common()
    counts = dict(sorted(common, key=lambda item: item[0] == "budget"))
    first = {refusal.reason: refusal.sentence for refusal in reversed(refusals)}
    return counts, {reason: first[reason] for reason in counts}


def no_candidates(
    object_: GraspObject, hand: Hand, span: Array, found: HandCandidates
) -> HandRefusal:
    """Returns why there is no candidate within a hand's reach.

    Args:
        object_: the object.
        hand: the hand.
        span: least and greatest distance of two tips that grasp [m], shape (2,).
        found: the candidates, none of which is within reach.
    """
    corners = object_.polyhedron.triangles_B.reshape(-1, 3)
    sides = np.ptp(corners, axis=0)
    widths = " x ".join(f"{1e3 * side:.0f}" for side in sides)
    reach = f"the tips of '{hand.name}' are {1e3 * span[0]:.0f} to {1e3 * span[1]:.0f} mm apart"
    if found.num_out_of_reach:
        low, high = 1e3 * found.widths
        return HandRefusal(
            "out_of_reach",
            f"{found.num_out_of_reach} grasps that are force closure need tips {low:.0f} to "
            f"{high:.0f} mm apart in directions that no posture comes near; {reach}, and the "
            f"object's sides are {widths} mm",
            {"least_width": float(found.widths[0]), "greatest_width": float(found.widths[1])},
        )
    return HandRefusal(
        "no_candidate",
        f"no three contacts with room for the tips are force closure within reach: {reach}, and "
        f"the object's sides are {widths} mm",
        {"least_span": float(span[0]), "greatest_span": float(span[1])},
    )


def unchecked(hand: Hand, grasps: Sequence[HandGrasp]) -> tuple[str, ...]:
    """Returns sentences on what was not checked because the models do not state it.

    Args:
        hand: the hand.
        grasps: its grasps.
    """
    if not grasps or all(grasp.torque.share is not None for grasp in grasps):
        return ()
    if np.isnan(hand.effort).any():
        return (
            f"{hand.description.where}: the model states no effort limits of some joints, so "
            "torques are not checked against any; state `effort` in the description",
        )
    return (
        "the object's mass is unknown, so torques are not checked against its weight; give "
        "load_mass (--mass)",
    )
