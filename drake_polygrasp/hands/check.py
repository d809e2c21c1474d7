"""Reports what a hand can do, and what in its files may keep it from grasping: `check_hand`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from drake_polygrasp.arguments import check_instance
from drake_polygrasp.arrays import Array
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.in_plant import listed
from drake_polygrasp.hands.library import NUM_DRAWS, Draws, draw_postures
from drake_polygrasp.hands.tip_fit import TipFit
from drake_polygrasp.search.reach import Reach, tip_distances

_NUM_RANKS = 50
"""Postures at which ranks of Jacobians are computed. Our choice."""
_SINGULAR = 1e-3
"""Singular values below this times a metre per radian count as zero. Our choice: a joint that moves
a tip by less than 1 mm per radian is no help."""
_ALWAYS = 0.9
"""Share of draws in which a pair that collides is probably no fault of the posture. Our choice."""
_MANY_PAIRS = 500
"""Pairs of geometries above which distances take long. Our choice."""
_LITTLE_KEPT = 0.05
"""Share of draws without self-collision below which the library is poor. Our choice."""
_MISFIT = 0.1
"""Distance between sphere and geometry that is worth a warning, over the tip's radius. Our choice,
and 1 mm at least."""
_STRONG = 20.0
"""Effort above which a finger joint's limit is probably not its own [N m]. Our choice."""


@dataclass(frozen=True, eq=False)
class HandReport:
    """What a hand can do, and what may keep it from grasping.

    Attributes:
        name: name of the hand.
        joints: names of all joints.
        independent: names of the independent ones.
        couplings: each other joint as a function of them, in words.
        root: name of the body that carries the hand.
        floats: whether the model leaves it free.
        effort: greatest effort by independent joint [N m or N]; None if unknown.
        effort_from: where each is stated: "description", "model" or "unknown".
        tip_ranks: greatest rank of each tip's Jacobian by the independent joints; 3 is full.
        tip_fits: signed distances from each tip's sphere to its geometry [m].
        kept_share: share of random postures without self-collision.
        collisions: pairs of bodies that collide in more than 90 percent of them, and the share.
        num_pairs: number of pairs of geometries that may collide.
        span: least and greatest distance of two tips that may grasp [m]; NaN without postures.
        sample: some postures of the library [rad or m], shape (N, n).
        errors: what keeps the hand from grasping at all, one sentence each.
        warnings: what may be wrong, one sentence each.
    """

    name: str
    joints: tuple[str, ...]
    independent: tuple[str, ...]
    couplings: tuple[str, ...]
    root: str
    floats: bool
    effort: dict[str, float | None]
    effort_from: dict[str, str]
    tip_ranks: dict[str, int]
    tip_fits: dict[str, TipFit]
    kept_share: float
    collisions: dict[tuple[str, str], float]
    num_pairs: int
    span: tuple[float, float]
    sample: Array
    errors: tuple[str, ...]
    warnings: tuple[str, ...]


def check_hand(hand: Hand, *, num: int = NUM_DRAWS, seed: int = 0) -> HandReport:
    """Reports what a hand can do, from random postures.

        report = check_hand(load_hand("models/hands/three_finger/three_finger.hand.yaml"))
        print(report.span, report.warnings)

    Args:
        hand: the hand, as load_hand returns it.
        num: number of random postures.
        seed: seed of the random numbers.

    Returns:
        The report; its `errors` are empty for a hand that can grasp.

    Raises:
        UsageError: when an argument has the wrong type or value.
    """
    check_instance("hand", hand, Hand, "as load_hand returns it")
    draws = draw_postures(hand, num, seed)
    q = draws.q[draws.free]
    span = (math.nan, math.nan)
    if len(q):
        p_PT = np.array([hand.tip_points(posture)[0] for posture in q])
        low, high = tip_distances(Reach(q, p_PT, np.zeros_like(p_PT)), hand.fingers).tolist()
        span = low, high
    ranks = _tip_ranks(hand, draws.q[:_NUM_RANKS])
    pairs = sorted(draws.pairs.items(), key=lambda item: (-item[1], item[0]))
    tested = max(1, int(draws.within.sum()))
    often = {pair: count / tested for pair, count in pairs if count > _ALWAYS * tested}
    inspector = hand.query(draws.q[0]).inspector()
    report = HandReport(
        name=hand.name,
        joints=hand.joints,
        independent=hand.independent,
        couplings=tuple(_couplings(hand)),
        root=hand.root,
        floats=hand.floats,
        effort={
            name: None if math.isnan(effort) else effort
            for name, effort in zip(hand.independent, hand.effort.tolist(), strict=True)
        },
        effort_from=dict(zip(hand.independent, hand.effort_from, strict=True)),
        tip_ranks=dict(zip((tip.name for tip in hand.tips), ranks, strict=True)),
        tip_fits={tip.name: tip.fit for tip in hand.tips},
        kept_share=float(draws.free.mean()),
        collisions=often,
        num_pairs=len(inspector.GetCollisionCandidates()),
        span=span,
        sample=q[:: max(1, len(q) // 6)][:6],
        errors=tuple(_errors(draws)),
        warnings=(),
    )
    return replace(report, warnings=tuple(_warnings(hand, report)))


def _couplings(hand: Hand) -> Iterator[str]:
    """Yields each coupled joint as a function of the independent ones: "b = 0.5 a + 0.1"."""
    for name, row, offset in zip(hand.joints, hand.E, hand.e0.tolist(), strict=True):
        if name in hand.independent:
            continue
        terms = [
            f"{gear:g} {other}"
            for other, gear in zip(hand.independent, row.tolist(), strict=True)
            if gear
        ]
        if offset or not terms:
            terms.append(f"{offset:g}")
        yield f"{name} = {' + '.join(terms)}"


def _tip_ranks(hand: Hand, q: Array) -> list[int]:
    """Returns the greatest rank of each tip's Jacobian over some postures."""
    ranks = np.zeros(len(hand.tips), dtype=int)
    for posture in q:
        singular = np.linalg.svd(hand.tip_jacobians(posture) @ hand.E, compute_uv=False)
        ranks = np.maximum(ranks, (singular > _SINGULAR).sum(axis=1))
    return [int(rank) for rank in ranks]


def _errors(draws: Draws) -> Iterator[str]:
    if not draws.free.any():
        common = ", ".join(
            f"'{a}' and '{b}' ({100 * count / draws.within.sum():.0f} percent)"
            for (a, b), count in draws.pairs.most_common(3)
        )
        reason = f"most often {common}" if common else "coupled joints leave their limits"
        yield (
            f"none of {len(draws.q)} random postures is free of self-collision, {reason}; put "
            "pairs that always touch into `ignore_collisions`, or mend the model"
        )


def _warnings(hand: Hand, report: HandReport) -> Iterator[str]:
    unknown = [name for name, source in report.effort_from.items() if source == "unknown"]
    if unknown:
        yield (
            f"the model states no effort limit of {listed(unknown)}, so torques are not checked "
            "against any; state `effort` in the description"
        )
    strong = [name for name, effort in report.effort.items() if effort and effort > _STRONG]
    if strong and hand.description.effort is None:
        yield (
            f"the model states efforts above {_STRONG:g} N m of {listed(strong)}, which is more "
            "than fingers have; state `effort` in the description if it is wrong"
        )
    if hand.model_suffix == ".xml" and "model" in report.effort_from.values():
        yield (
            "Drake takes MJCF's ctrlrange for an effort limit, also where it is an angle; state "
            "`effort` in the description unless the model's actuators are motors"
        )
    weak = [name for name, rank in report.tip_ranks.items() if rank < 3]
    if weak:
        ranks = ", ".join(f"'{name}' {report.tip_ranks[name]}" for name in weak)
        yield (
            f"these tips cannot move in all three directions while the palm rests, rank: {ranks}; "
            "many contacts are out of reach, and some forces need no torque"
        )
    for tip in hand.tips:
        worst = max(-tip.fit.least, tip.fit.most)
        if worst > max(_MISFIT * tip.radius, 1e-3):
            yield (
                f"tip '{tip.name}': its geometry is {1e3 * tip.fit.least:.1f} to "
                f"{1e3 * tip.fit.most:.1f} mm from its sphere (median "
                f"{1e3 * tip.fit.median:.1f}); contacts are off by as much: mend p, radius or axis"
            )
    for (a, b), share in report.collisions.items():
        yield (
            f"'{a}' and '{b}' collide in {100 * share:.0f} percent of postures; if they touch by "
            f"design, add [{a}, {b}] to `ignore_collisions`"
        )
    if 0 < report.kept_share < _LITTLE_KEPT:
        yield (
            f"only {100 * report.kept_share:.1f} percent of postures are free of self-collision, "
            "so the library is poor; narrow joint limits, or ignore pairs that touch by design"
        )
    if report.num_pairs > _MANY_PAIRS:
        yield (
            f"{report.num_pairs} pairs of geometries may collide, so postures take long; use fewer "
            "or simpler collision shapes"
        )
