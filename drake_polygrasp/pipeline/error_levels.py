"""Chooses the errors that grasps are stated to bear: the greatest that leave them enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import Grasp, GraspObject, RegionCertificate
from drake_polygrasp.pipeline.region_certificates import (
    Errors,
    ProvedErrors,
    bound_errors,
    prove_errors,
)
from drake_polygrasp.region_bounds.region_task import BOUNDS_GAP
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound

_LEAST_LEFT = 0.1
"""Our choice: share of epsilon that errors must leave where less of them may be borne instead. With
less left, fingers squeeze more than ten times as hard as for exact contacts."""


@dataclass(frozen=True, eq=False)
class ProvedLevel:
    """A grasp, and the greatest errors that it is proved to bear.

    Attributes:
        grasp: the grasp.
        level: index of the errors among those that it was tried for; their number for none.
        proved: the errors with their proof; None for none.
    """

    grasp: Grasp
    level: int
    proved: ProvedErrors | None


@dataclass(frozen=True, eq=False)
class BoundedLevel:
    """What a grasp withstands under errors.

    Attributes:
        index: of the grasp among those that were given.
        level: index of the errors, greatest first.
        region: the certificate.
    """

    index: int
    level: int
    region: RegionCertificate


def first_levels(
    object_: GraspObject,
    groups: Sequence[Sequence[Grasp]],
    errors: Sequence[Errors],
    levels: range,
) -> list[tuple[int, ProvedLevel] | None]:
    """Finds the greatest errors that one of the grasps of each group is proved to bear.

    Args:
        object_: what is grasped.
        groups: grasps on the same faces, best first.
        errors: what may be borne, greatest first.
        levels: indices of the errors that are tried.

    Returns:
        For each group the index of the first such grasp, and what it bears; None where none bears
        any.
    """
    found: list[tuple[int, ProvedLevel] | None] = [None] * len(groups)
    tries = [_tries(grasps, errors, levels) for grasps in groups]
    waiting = list(range(len(groups)))
    # All groups take their first try together, those where it fails their second, and so on.
    for turn in range(max(map(len, tries), default=0)):
        waiting = [k for k in waiting if found[k] is None and turn < len(tries[k])]
        chosen = [tries[k][turn] for k in waiting]
        pairs = [
            (groups[k][index], errors[level])
            for k, (level, index) in zip(waiting, chosen, strict=True)
        ]
        for k, (level, index), proved in zip(
            waiting, chosen, prove_errors(object_, pairs), strict=True
        ):
            if proved is not None:
                found[k] = index, ProvedLevel(groups[k][index], level, proved)
    return found


def _tries(
    grasps: Sequence[Grasp], errors: Sequence[Errors], levels: range
) -> list[tuple[int, int]]:
    """Returns levels of errors and indices of grasps on the same faces in the order of trying."""
    on_faces = [asked.on(np.array(grasps[0].faces)) for asked in errors]
    # On wide faces errors of narrow ones are the same.
    different = [k for k, each in enumerate(on_faces) if each not in on_faces[:k]]
    return [(k, index) for k in different if k in levels for index in range(len(grasps))]


def bounded_levels(
    object_: GraspObject,
    grasps: Sequence[ProvedLevel],
    errors: Sequence[Errors],
    wanted: int,
    relative_gap: float = BOUNDS_GAP,
) -> list[BoundedLevel]:
    """Bounds epsilon of the best grasps under the greatest errors that leave them enough.

    Errors leave a grasp enough if its epsilon under them is at least a tenth of that for exact
    contacts. Where they do not, less of the errors are tried; and where none does, the greatest
    errors count that are proved.

    Args:
        object_: what is grasped.
        grasps: grasps of it, each with the greatest errors that it is proved to bear.
        errors: what may be borne, greatest first.
        wanted: how many grasps are asked for.
        relative_gap: how far apart the bounds of epsilon may stay, over the upper one.

    Returns:
        At most `wanted`, best first: those that have enough left, by the errors that they bear and
        then by their least epsilon; then the others that bear any, likewise.
    """
    best: list[BoundedLevel] = []
    slight = {k: each for k, each in enumerate(grasps) if each.proved is not None}
    if len(errors) > 1:
        best, slight = _leaving_enough(object_, slight, errors, wanted, relative_gap)
    for level in range(len(errors)):
        tried = [(k, each) for k, each in slight.items() if each.level == level]
        least = np.full(len(tried), -np.inf)
        best += _bounded(object_, tried, least, wanted - len(best), relative_gap)
    return best


def _leaving_enough(
    object_: GraspObject,
    grasps: dict[int, ProvedLevel],
    errors: Sequence[Errors],
    wanted: int,
    relative_gap: float,
) -> tuple[list[BoundedLevel], dict[int, ProvedLevel]]:
    """The best grasps under errors that leave them enough, and those for which none does."""
    best: list[BoundedLevel] = []
    waiting, slight = [*grasps.items()], dict(grasps)
    for level in range(len(errors)):
        tried = [(k, each) for k, each in waiting if each.level == level]
        enough = _LEAST_LEFT * _exact_epsilons(object_, [each.grasp for _, each in tried])
        found = _bounded(object_, tried, enough, wanted - len(best), relative_gap)
        best += found
        if len(best) == wanted:
            break
        held = {bounded.index for bounded in found}
        slight = {k: each for k, each in slight.items() if k not in held}
        rest = [(k, each.grasp) for k, each in tried if k not in held]
        less = first_levels(
            object_, [[grasp] for _, grasp in rest], errors, range(level + 1, len(errors))
        )
        waiting += [(k, each[1]) for (k, _), each in zip(rest, less, strict=True) if each]
    return best, slight


def _exact_epsilons(object_: GraspObject, grasps: Sequence[Grasp]) -> Array:
    """Close upper bounds of epsilon of grasps for exact contacts, (N,)."""
    if not grasps:
        return np.zeros(0)
    p_BC, nhat_TB_B = np.stack([g.p_BC for g in grasps]), np.stack([g.nhat_TB_B for g in grasps])
    mu = np.stack([g.mu for g in grasps])
    return epsilon_upper_bound(p_BC, nhat_TB_B, mu, object_.p_BBcm, object_.rho)


def _bounded(
    object_: GraspObject,
    grasps: Sequence[tuple[int, ProvedLevel]],
    least: Array,
    wanted: int,
    relative_gap: float,
) -> list[BoundedLevel]:
    """Returns the best of those of at least the `least` epsilon, (N,), at most `wanted`."""
    if not grasps or wanted <= 0:
        return []
    asked = [(each.grasp, each.proved) for _, each in grasps if each.proved is not None]
    regions = bound_errors(object_, asked, least.tolist(), wanted, relative_gap)
    bounded = [
        BoundedLevel(k, each.level, region)
        for (k, each), region in zip(grasps, regions, strict=True)
        if region is not None
    ]
    return sorted(bounded, key=lambda each: -(each.region.epsilon_lower or 0.0))[:wanted]
