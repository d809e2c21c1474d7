"""Plans with less of the default errors, where too few grasps are found that may bear them all.

The default errors must cost no grasp: a set of faces that only holds with the friction of the
model, on narrow faces or close to an edge, keeps its grasp, and the plan says what that bears.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drake_polygrasp.arrays import Bools, Ints, distinct_values
from drake_polygrasp.geometry.face_sets import find_rows, rows_in_all_sets, sets_of, with_sets
from drake_polygrasp.geometry.regions import Regions, regions_at
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.reasons import CODE, Codes
from drake_polygrasp.pipeline.judge import Judge
from drake_polygrasp.pipeline.judging import prove_candidates
from drake_polygrasp.pipeline.region_certificates import Errors
from drake_polygrasp.pipeline.request import PlanRequest, make_request
from drake_polygrasp.settings import PlanOptions

_LESS_OF_DEFAULTS = (0.5, 0.25)
"""Our choice: shares of default errors that a grasp is tried for where it does not bear them."""


def make_requests(object_: GraspObject, options: PlanOptions) -> tuple[PlanRequest, ...]:
    """Returns the request, then those with less of the default errors.

    First contacts keep the default placement error from edges, on faces that have room for that;
    then on narrow faces half of the inradius; then there are no default errors. The regions of each
    request contain those of the one before.

    Args:
        object_: what to grasp.
        options: what is asked.

    Raises:
        UsageError: when an option is not what it may be for this object.
    """
    requests = [make_request(object_, options)]
    if "placement_error" in options.default_errors:
        requests.append(make_request(object_, options, on_narrow_faces=True))
    if {"placement_error", "tilt_error", "friction_error"} & {*options.default_errors}:
        # Contacts do not depend on the error of the centre of mass.
        requests.append(make_request(object_, options.without_default_errors))
    return tuple(requests)


def prove_in_turn(requests: Sequence[PlanRequest]) -> tuple[Judge, ...]:
    """Proves candidates of the first request, and of the next while there are too few grasps.

    Effort "complete" proves those of all requests.

    Args:
        requests: those of `make_requests`.

    Returns:
        The judges, one for each request that was needed.
    """
    judges: list[Judge] = []
    for request in requests:
        enough = len(sets_held(judges, request.regions)) >= request.settings.top
        if enough and request.settings.effort != "complete":
            break
        another = request is not requests[-1]
        judges.append(prove_candidates(request, another_follows=another))
    return tuple(judges)


def errors_in_turn(requests: Sequence[PlanRequest]) -> tuple[Errors, ...]:
    """Returns the errors that a grasp is tried for, greatest first; only defaults become less.

    Args:
        requests: those of `make_requests`.

    Returns:
        The errors of the requests, with half and a quarter of the defaults before those of the
        last; empty without errors.
    """
    names = requests[0].options.default_errors
    with_defaults = [r.errors for r in requests if r.errors and r.options.default_errors]
    given = [r.errors for r in requests if r.errors and not r.options.default_errors]
    less = [errors.with_less(names, s) for errors in with_defaults[-1:] for s in _LESS_OF_DEFAULTS]
    return *with_defaults, *less, *given


def sets_held(judges: Sequence[Judge], regions: Regions) -> Ints:
    """Returns the sets on which candidates hold, as sets of regions of a later request.

    Args:
        judges: the candidates and their proofs.
        regions: regions that contain those of the judges' requests.

    Returns:
        Shape (K, 3), ascending, -1 for a pair's third, each set once.
    """
    sets = [np.empty((0, 3), dtype=np.int64)]
    for judge in judges:
        rows = np.array(sorted(judge.proofs), dtype=np.int64)
        p_BC, face = judge.work.candidates.p_BC[rows], judge.work.face[rows]
        region = regions_at(regions, face.ravel(), p_BC.reshape(-1, 3)).reshape(-1, 3)
        sets.append(sets_of(region))
    held: Ints = distinct_values(np.concatenate(sets), axis=0)
    return held


def sets_inside(request: PlanRequest, last: PlanRequest, asked: Bools) -> Bools:
    """Returns which sets of a request lie in some sets of the last request.

    Args:
        request: a request of `make_requests`.
        last: the last of them, whose regions contain those of the others.
        asked: which of `last.every_set`, shape (S,).

    Returns:
        Which of `request.every_set`, shape (M,).
    """
    regions, every = request.regions, request.every_set
    corner = regions.p_BV[regions.ring_offsets[regions.region_offsets[:-1]]]
    container = regions_at(last.regions, regions.face, corner)
    inside = sets_of(container[np.where(every < 0, every[:, 1:2], every)])
    found = asked[rows_in_all_sets(len(last.regions.face), inside)]
    # Regions of one region are no set of the last request; nor do they oppose each other.
    return found & (inside[:, 0] < inside[:, 1])


def sets_and_codes(requests: Sequence[PlanRequest], judges: Sequence[Judge]) -> tuple[Ints, Codes]:
    """Returns the last request's sets of regions that were evaluated, and how they ended.

    Where it was not needed these are the sets on which earlier requests have a grasp.

    Args:
        requests: those of `make_requests`.
        judges: those of `prove_in_turn`.

    Returns:
        The sets, shape (M, 3), -1 for a pair's third, and their positions in REASONS.
    """
    sets, code = np.empty((0, 3), dtype=np.int64), np.empty(0, dtype=np.int8)
    if len(judges) == len(requests):
        sets, code = judges[-1].work.plan.sets, judges[-1].set_codes()
    held = sets_held(judges[: len(requests) - 1], requests[-1].regions)
    every = with_sets(sets, held)
    codes = np.append(code, np.full(len(every) - len(sets), CODE["certified"], dtype=code.dtype))
    codes[find_rows(every, held)] = CODE["certified"]
    return every, codes
