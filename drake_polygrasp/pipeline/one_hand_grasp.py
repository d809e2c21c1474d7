"""Finds how a hand makes a grasp that is there already."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy.typing as npt

from drake_polygrasp.arguments import (
    check_instance,
    check_number,
    check_packages,
    check_paths,
    check_seed,
)
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.hand_grasp import HandGrasp, HandRefusal
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.hand_search import HandSearch, hand_grasp
from drake_polygrasp.hands.library import hand_reach
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.loading.surroundings import Surroundings
from drake_polygrasp.pipeline.hand_options import hold_options, obstacles_around, with_fingers


def hand_grasp_for(
    object_: GraspObject,
    grasp: CertifiedGrasp,
    hand: Hand,
    *,
    surroundings: Surroundings | None = None,
    up_B: npt.ArrayLike | None = None,
    load_mass: float | None = None,
    friction_share: float = 0.8,
    clearance: float = 0.002,
    approach: float = 0.1,
    fingers: Iterable[Iterable[str]] | None = None,
    budget: float = 10.0,
    seed: int = 0,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> HandGrasp | HandRefusal:
    """Finds how a hand makes a planned grasp, or says why it cannot.

        grasp = plan_grasps(box, tip_radius=0.01).grasps[0]
        print(hand_grasp_for(box, grasp, hand))

    Args:
        object_: the object, loaded from a file.
        grasp: a grasp of `plan_grasps`, with the tips' radius best.
        hand: the hand, as load_hand returns it.
        surroundings: other bodies of the scene at their poses in B, which the hand avoids.
        up_B: direction against gravity, shape (3,), any length but 0 (default: torques hold the
            weight in every orientation).
        load_mass: mass that the torques must hold [kg] (default: the object's).
        friction_share: share of the contacts' friction that the torques' forces may use, above 0
            and at most 1.
        clearance: distance that the hand keeps from all but its contacts [m].
        approach: length of the palm's straight way to the grasp [m].
        fingers: triples of names of tips that may grasp (default: those of the description).
        budget: time after which no more postures are tried [s].
        seed: seed of the random postures, 0 or more.
        package_paths: folders searched for the packages of URIs in the object's model.
        packages: folders of packages by name.

    Returns:
        The grasp with the hand's posture; or the refusal, with the reason in words.

    Raises:
        UsageError: when an argument has the wrong type or value.
        ModelError: when the object came from no file, or the file cannot be read again.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    check_instance("grasp", grasp, CertifiedGrasp, "as plan.grasps holds them")
    hand = with_fingers(check_instance("hand", hand, Hand, "as load_hand returns it"), fingers)
    budget = check_number("budget", budget, "a time in seconds, above 0", above=0.0)
    hold = hold_options(up_B, load_mass, friction_share, clearance, approach)
    obstacles_around(object_, surroundings, max(tip.radius for tip in hand.tips))
    scene = HandScene(
        hand,
        object_,
        surroundings=surroundings,
        package_paths=check_paths("package_paths", package_paths),
        packages=check_packages("packages", packages),
    )
    search = HandSearch(scene, hand_reach(hand, check_seed("seed", seed)), [grasp], hold)
    for _, held in search.run(budget):
        return hand_grasp(scene, grasp, held, hold.clearance)
    return search.refusals[0]
