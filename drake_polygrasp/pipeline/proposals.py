"""Proposes candidate grasps by the paper's stages and by the search, before any is proved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.geometry.face_sets import (
    first_of_each_set,
    in_order_of_sets,
    set_numbers,
    sets_of,
    with_sets,
)
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.paper.orientation import sets_oppose
from drake_polygrasp.paper.reasons import SetPlan, has_contacts, unplanned
from drake_polygrasp.pipeline.candidates import (
    ProjectedCandidates,
    clear_of_obstacles,
    has_fingertip_room,
    project_candidates,
)
from drake_polygrasp.pipeline.request import PlanRequest
from drake_polygrasp.search.effort import FULL, QUICK
from drake_polygrasp.search.face_support import points_on
from drake_polygrasp.search.fingertip_room import with_tip_room
from drake_polygrasp.search.local_improvement import improved
from drake_polygrasp.search.sample_points import num_points, sample_points
from drake_polygrasp.search.selection import (
    PLACES,
    best_first,
    best_places,
    estimates,
    improved_triples,
    usable,
)
from drake_polygrasp.search.set_bounds import promising_sets
from drake_polygrasp.search.triples import NO_TRIPLES, Triples, best_triples

MANY_REGIONS = 24
"""Number of regions above which the paper's stages evaluate only sets that the search chooses. Our
choice."""
CHOSEN_SETS = 100
"""Greatest number of sets that the search then chooses. Our choice."""
PROMISING_SETS = 4000
"""Greatest number of sets that are added if the search finds triples on fewer than `CHOSEN_SETS`:
those whose bound of epsilon is above the best estimate. Our choice: they take a tenth of a second.
This happens if friction is low or faces are slender, so that sample points are too coarse."""
RESERVE = 3
"""Number of triples that stay as they were found, over one more than the grasps wanted. Our
choice."""


def constructed(request: PlanRequest) -> ProjectedCandidates:
    """Returns the candidates of the paper's stages on every set, projected onto the surface.

    Args:
        request: the request.

    Raises:
        UsageError: when there are more than `request.MOST_SETS` sets.
    """
    return project_candidates(request, request.plan(), None)


def enriched(request: PlanRequest) -> ProjectedCandidates:
    """Returns the paper's candidates, triples of sample points, and the best of both improved.

    On more than `MANY_REGIONS` regions, the search chooses the sets.

    Args:
        request: the request, whose `steps` say which of these are taken.

    Raises:
        UsageError: when every set is to be evaluated, and there are more than `request.MOST_SETS`.
    """
    regions, scale = request.regions, (request.object_.p_BBcm, request.object_.rho)
    steps = request.steps
    if not (steps.search or steps.improve):
        return constructed(request)
    clear = with_tip_room(
        regions, request.object_.polyhedron, request.tip_radius, request.obstacles
    )
    found, chosen = NO_TRIPLES, None
    if steps.search:
        points = sample_points(clear, num_points(len(regions.face), FULL), may_exceed=True)
        found = best_triples(clear, points, *scale)
        if len(regions.face) > MANY_REGIONS:
            found, chosen = _chosen(found)
            if len(chosen) < CHOSEN_SETS:
                chosen = with_sets(chosen, _promising(request, found))
    plan = request.plan(chosen)
    triples = join_rows(_known(clear, plan), found)
    better = improved_triples(clear, triples, *scale) if steps.improve else found
    return project_candidates(request, plan, better)


def _chosen(found: Triples) -> tuple[Triples, Ints]:
    """Returns the triples on the first `CHOSEN_SETS` sets found, and these sets."""
    first = first_of_each_set(found.region)[:CHOSEN_SETS]
    number = set_numbers(found.region)
    return found.take(np.isin(number, number[first])), sets_of(found.region[first])


def _promising(request: PlanRequest, found: Triples) -> Ints:
    """Returns sets that may have a better grasp than those found, greatest bound first."""
    regions, scale = request.regions, (request.object_.p_BBcm, request.object_.rho)
    estimate = estimates(regions, found, *scale)
    best = found.take(best_first(estimate)[: FULL.sources])
    return promising_sets(
        regions,
        best,
        *scale,
        above=estimate.max(initial=-1.0),
        most=PROMISING_SETS,
        opposing=sets_oppose,
    )


def quick(request: PlanRequest, wanted: int) -> tuple[ProjectedCandidates, Array]:
    """Proposes triples of few sample points, with the best improved in a few rounds.

    The unimproved triples are kept too, in case an improved one leaves no room for a fingertip.

    Args:
        request: the request.
        wanted: number of grasps that are asked for.

    Returns:
        The candidates, and estimates of their epsilon, shape (M,), for contacts on the planes of
        faces, before their projection onto the true surface.
    """
    regions, scale = request.regions, (request.object_.p_BBcm, request.object_.rho)
    points = quick_points(request)
    # More grasps need triples on more sets.
    times = 1 + wanted // 2
    rounds = tuple(times * num for num in QUICK.rounds)
    effort = replace(QUICK, kept=times * QUICK.kept, rounds=rounds)
    found = best_triples(regions, points, *scale, effort)
    estimate = estimates(regions, found, *scale)
    rows = best_places(found.region, estimate, RESERVE * (wanted + 1), PLACES)
    best, estimate = found.take(rows), estimate[rows]
    starts = best.take(slice(effort.starts))
    p_BC, risen = improved(regions, starts.region, starts.p_BC, *scale, effort.rounds)
    triples = join_rows(Triples(starts.region, p_BC), best)
    sets = sets_of(triples.region[in_order_of_sets(triples.region)])
    return project_candidates(request, unplanned(sets), triples), np.concatenate([risen, estimate])


def quick_points(request: PlanRequest) -> tuple[Ints, Array]:
    """Samples few points at which fingertips have room.

    Points on flat faces are tested one by one, which takes less time than cutting regions.

    Args:
        request: the request.

    Returns:
        Indices of the points' regions, shape (N,), and their coordinates in the frames F of these
        regions [m], shape (N, 2).
    """
    regions = request.regions
    region, p_FC = sample_points(regions, num_points(len(regions.face), QUICK))
    # Points of a patch are on its plane, not on the surface, so room cannot be tested here.
    flat = np.flatnonzero(~request.object_.polyhedron.is_patch[regions.face[region]])
    contacts = points_on(regions, region[flat], p_FC[flat]), regions.nhat_TB_B[region[flat]]
    has_room = np.ones(len(region), dtype=bool)
    has_room[flat] = has_fingertip_room(request, *contacts) & clear_of_obstacles(request, *contacts)
    return region[has_room], p_FC[has_room]


def _known(regions: Regions, plan: SetPlan) -> Triples:
    """Returns the paper's contacts that are usable for search, greatest Q first."""
    rows = plan.candidates
    rows = rows.take(has_contacts(rows.p_BC))
    known = Triples(rows.region, rows.p_BC).take(best_first(rows.Q))
    return known.take(usable(regions, known))
