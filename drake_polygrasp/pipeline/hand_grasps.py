"""Plans grasps that a hand can make: contacts, proofs, postures, torques and the way there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arguments import (
    Progress,
    check_choice,
    check_count,
    check_instance,
    check_number,
    check_packages,
    check_paths,
    check_progress,
    check_seed,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.hand_search import HandSearch, HeldGrasp
from drake_polygrasp.hands.library import hand_reach
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.loading.surroundings import Surroundings
from drake_polygrasp.pipeline.fallback import errors_in_turn, make_requests
from drake_polygrasp.pipeline.freed_memory import keep_freed_memory
from drake_polygrasp.pipeline.hand_candidates import (
    HandCandidates,
    in_order_of_overlap,
    propose_with_clearance,
)
from drake_polygrasp.pipeline.hand_errors import hand_grasp_under_errors, weak_squeezes
from drake_polygrasp.pipeline.hand_options import hold_options, obstacles_around, with_fingers
from drake_polygrasp.pipeline.hand_plan import HandPlan, count_refusals, no_candidates, unchecked
from drake_polygrasp.pipeline.region_certificates import least_epsilon, prove_errors
from drake_polygrasp.search.reach import Reach, tip_distances
from drake_polygrasp.settings import PlanOptions

HandRank = Literal["epsilon", "torque"]
_SPARE: dict[str, int] = {"epsilon": 1, "torque": 4}
"""Our choice: grasps that are looked for, per grasp wanted."""
_LEAST_SEARCH = 1.0
"""Our choice: time that the search for postures has at least [s], however long the rest took."""


def plan_hand_grasps(
    object_: GraspObject,
    hand: Hand,
    *,
    top: int = 3,
    surroundings: Surroundings | None = None,
    up_B: npt.ArrayLike | None = None,
    load_mass: float | None = None,
    avoid_directions: Iterable[npt.ArrayLike] = (),
    exclude_faces: Iterable[int] = (),
    edge_clearance: float | None = None,
    friction_share: float = 0.8,
    clearance: float = 0.002,
    approach: float = 0.1,
    fingers: Iterable[Iterable[str]] | None = None,
    rank: HandRank = "epsilon",
    placement_error: float | None = None,
    tilt_error: float | None = None,
    friction_error: float | None = None,
    com_error: float | None = None,
    budget: float = 10.0,
    seed: int = 0,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    progress: Progress | None = None,
) -> HandPlan:
    """Plans grasps that a hand can make, each proved, with a posture, torques and a way there.

        hand = load_hand("models/hands/three_finger/three_finger.hand.yaml")
        plan = plan_hand_grasps(load_object("models/cube/cube.sdf"), hand)
        print(plan.grasps[0].X_BPalm, plan.grasps[0].q, plan.grasps[0].torque.share)

    The same input gives the same grasps on one machine, unless `budget` ends the search.

    Each grasp's `region` states and proves the errors of hand and model that it bears, all at once.
    Default errors, in the object's diameter L, are those of `plan_grasps`. They do not change the
    search: a grasp that does not bear them all is tried for half and a quarter, and `region` is
    None where none are proved. Ranking by epsilon, grasps that bear all errors come first, and the
    least epsilon under them counts. The torques squeeze as hard as the errors ask for; if that is
    beyond the hand's efforts, with all of them, and a warning says so.

    Args:
        object_: object to grasp, loaded from a file.
        hand: the hand, as load_hand returns it.
        top: greatest number of grasps to return, one for each set of faces.
        surroundings: other bodies of the scene at their poses in B, which hand and fingertips
            avoid; see `surroundings_from_plant`.
        up_B: direction against gravity, shape (3,), any length but 0; torques then hold 1.2 times
            the weight in this orientation (default: the weight in every orientation).
        load_mass: mass that the torques must hold [kg] (default: the object's).
        avoid_directions: vectors in B, shape (3,) each; no contact has an outward normal within 45
            degrees of one.
        exclude_faces: indices of faces without contacts.
        edge_clearance: least distance of contacts from the edges of their faces [m] (default: 0.3
            tip radii, or less where no candidate is found).
        friction_share: share of the contacts' friction that the torques' forces may use, above 0
            and at most 1.
        clearance: distance that the hand keeps from all but its contacts [m].
        approach: length of the palm's straight way to the grasp [m].
        fingers: triples of names of tips that may grasp (default: those of the description).
        rank: order of the grasps: "epsilon", or "torque", the least share of the hand's effort.
        placement_error: distance by which a contact may miss its place along its face, in any
            direction [m] (default: 0.02 L). If given, contacts keep at least this distance from
            edges.
        tilt_error: angle by which the true normal at a contact may tilt [rad], 0 to 1.5 (default: 5
            degrees).
        friction_error: share by which friction coefficients may be less, 0 to below 1 (default:
            0.2).
        com_error: distance by which the centre of mass may be off, in any direction [m] (default:
            0.02 L).
        budget: time after which no more postures are tried [s]; a second is left for them at
            least.
        seed: seed of the random postures and triples, 0 or more.
        package_paths: folders searched for the packages of URIs in the object's model.
        packages: folders of packages by name.
        progress: called with the number of grasps found and wanted.

    Returns:
        The plan. If it has no grasps, `refusals` and `sentences` say why.

    Raises:
        UsageError: when an argument has the wrong type or value, or does not go with another.
        ModelError: when the object came from no file, or the file cannot be read again.
    """
    start = perf_counter()
    keep_freed_memory()
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    hand = with_fingers(check_instance("hand", hand, Hand, "as load_hand returns it"), fingers)
    wanted = check_count("top", top) * _SPARE[check_choice("rank", rank, get_args(HandRank))]
    seed = check_seed("seed", seed)
    budget = check_number("budget", budget, "a time in seconds, above 0", above=0.0)
    report = check_progress("progress", progress)
    hold = hold_options(up_B, load_mass, friction_share, clearance, approach)
    tip_radius = max(tip.radius for tip in hand.tips)
    options = PlanOptions(
        top=top,
        tip_radius=tip_radius,
        edge_clearance=edge_clearance,
        avoid_directions=avoid_directions,
        exclude_faces=exclude_faces,
        obstacles=obstacles_around(object_, surroundings, tip_radius),
        placement_error=placement_error,
        tilt_error=tilt_error,
        friction_error=friction_error,
        com_error=com_error,
    )
    scene = HandScene(
        hand,
        object_,
        surroundings=surroundings,
        package_paths=check_paths("package_paths", package_paths),
        packages=check_packages("packages", packages),
    )
    loaded = perf_counter()
    reach = hand_reach(hand, seed)
    drawn = perf_counter()
    found, warnings = propose_with_clearance(object_, options, reach, hand, hold.clearance, seed)
    found = in_order_of_overlap(found, scene, reach)
    search = HandSearch(scene, reach, [found.grasp(k) for k in range(len(found.rows))], hold)
    proposed = perf_counter()
    left = max(budget - (proposed - start), _LEAST_SEARCH)
    made, num_held = _make_grasps(search, found, left, wanted, report)
    refused = list(search.refusals.values())
    if len(made) == wanted:  # The others were not asked for.
        refused = [one for one in refused if one.reason != "budget"]
    tried = num_held + len(refused)
    if not len(found.rows):
        refused = [no_candidates(object_, hand, _span(reach, hand), found)]
    counts, sentences = count_refusals(refused)
    if rank == "torque":
        made.sort(key=lambda one: _share(one[1]))
    postured = perf_counter()
    # Postures do not depend on default errors, which are proved of what is returned alone.
    requests = make_requests(
        object_, replace(options, edge_clearance=found.request.options.edge_clearance)
    )
    errors = errors_in_turn(requests)
    graded = [
        hand_grasp_under_errors(
            found.request.object_, scene, found.certified(k), held, errors, hold
        )
        for k, held in made[:top]
    ]
    if rank == "epsilon":
        graded.sort(key=lambda pair: (pair[0], -least_epsilon(pair[1].certified)))
    grasps = tuple(grasp for _, grasp in graded)
    seconds = {
        "load": loaded - start,
        "library": drawn - loaded,
        "candidates": proposed - drawn,
        "postures": postured - proposed,
        "certify": perf_counter() - postured,
    }
    return HandPlan(
        grasps,
        counts,
        sentences,
        len(found.rows),
        tried,
        seconds,
        requests[0].settings,
        (*warnings, *unchecked(hand, grasps), *weak_squeezes(object_, grasps)),
    )


def _make_grasps(
    search: HandSearch, found: HandCandidates, budget: float, wanted: int, report: Progress
) -> tuple[list[tuple[int, HeldGrasp]], int]:
    """Returns candidates with postures, one on each set of faces, and how many can be held.

    Where errors are given, candidates that bear them come before others.
    """
    made: list[tuple[int, HeldGrasp]] = []
    others: list[tuple[int, HeldGrasp]] = []
    num_held = 0
    given, object_ = found.request.errors, found.request.object_
    report(0, wanted)
    for index, held in search.run(budget):
        num_held += 1
        if given is not None and prove_errors(object_, [(found.grasp(index), given)]) == [None]:
            others.append((index, held))
            continue
        made.append((index, held))
        report(len(made), wanted)
        if len(made) == wanted:
            break
        search.skip(np.flatnonzero(found.set_index == found.set_index[index]).tolist())
    sets = {int(found.set_index[index]) for index, _ in made}
    for index, held in others:
        if len(made) < wanted and int(found.set_index[index]) not in sets:
            sets.add(int(found.set_index[index]))
            made.append((index, held))
    return made, num_held


def _span(reach: Reach, hand: Hand) -> Array:
    """Returns the least and greatest distance of two tips that grasp [m], shape (2,)."""
    return tip_distances(reach, hand.fingers) if len(reach.q) else np.zeros(2)


def _share(held: HeldGrasp) -> tuple[bool, float]:
    share = held.torque.share
    return share is None, share or 0.0
