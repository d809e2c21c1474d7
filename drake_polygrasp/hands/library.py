"""Draws postures of a hand and keeps what its tips reach in them."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from pydrake.geometry import GeometryId, SceneGraphInspector

from drake_polygrasp.arguments import check_count, check_instance, check_seed, refuse
from drake_polygrasp.arrays import Array, Bools, frozen
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.in_plant import short_name
from drake_polygrasp.search.reach import Reach
from drake_polygrasp.vectors import times

NUM_DRAWS = 6000
"""Our choice: with 3000 the same objects were graspable, with fewer good starts for each."""
_MOST_DRAWS = 1_000_000
"""Our choice: more would take minutes and a gigabyte."""
_DECIMALS = 9
"""Decimals to which lengths and axes are rounded: the last bits of forward kinematics depend on the
processor."""

_LIBRARIES: WeakKeyDictionary[Hand, dict[int, Reach]] = WeakKeyDictionary()


class Draws(NamedTuple):
    """Postures drawn at random, and which of them collide.

    Attributes:
        q: postures within limits, shape (N, n).
        within: whether coupled joints keep their limits in each, shape (N,).
        free: whether each of these is without self-collision, shape (N,).
        pairs: how often each pair of bodies collides in these, by their names.
    """

    q: Array
    within: Bools
    free: Bools
    pairs: Counter[tuple[str, str]]


def make_reach(hand: Hand, num: int = NUM_DRAWS, seed: int = 0) -> Reach:
    """Draws postures of a hand, uniform in its independent joints, and keeps those it can take.

    Args:
        hand: the hand, as load_hand returns it.
        num: number of postures drawn; about half are without self-collision.
        seed: seed of the random numbers.

    Returns:
        What the hand reaches.

    Raises:
        UsageError: when an argument has the wrong type or value.
    """
    check_instance("hand", hand, Hand, "as load_hand returns it")
    draws = draw_postures(hand, num, seed)
    q = draws.q[draws.free]
    p_PT = np.empty((len(q), len(hand.tips), 3))
    axis_P = np.empty_like(p_PT)
    for i, posture in enumerate(q):
        p_PT[i], axis_P[i] = hand.tip_points(posture)
    return Reach(frozen(q), frozen(np.round(p_PT, _DECIMALS)), frozen(np.round(axis_P, _DECIMALS)))


def hand_reach(hand: Hand, seed: int = 0) -> Reach:
    """Returns what a hand reaches, drawn once for each seed and kept as long as the hand.

    Args:
        hand: the hand.
        seed: seed of the random numbers.
    """
    known = _LIBRARIES.setdefault(hand, {})
    if seed not in known:
        known[seed] = make_reach(hand, seed=seed)
    return known[seed]


def draw_postures(hand: Hand, num: int, seed: int) -> Draws:
    """Draws postures within the joint limits less the hand's margin.

    Coupled joints follow the independent ones; a posture in which one of them leaves its limits
    does not count as free.

    Args:
        hand: the hand.
        num: number of postures.
        seed: seed of the random numbers.

    Returns:
        The postures, and which collide.

    Raises:
        UsageError: when a number is wrong.
    """
    num, seed = check_count("num", num), check_seed("seed", seed)
    if num > _MOST_DRAWS:
        raise refuse("num", num, f"at most {_MOST_DRAWS}")
    rng = np.random.default_rng(seed)
    chosen = [hand.joints.index(name) for name in hand.independent]
    lower, upper = hand.lower[chosen], hand.upper[chosen]
    # A joint of little range keeps the middle half of it.
    margin = np.minimum(hand.description.limit_margin * hand.joint_units, 0.25 * (upper - lower))
    z = rng.uniform(lower + margin, upper - margin, (num, len(chosen)))
    q = times(z, hand.E.T) + hand.e0
    within: Bools = np.logical_and.reduce((q >= hand.lower) & (q <= hand.upper), axis=1)
    free, pairs = np.zeros(num, dtype=bool), Counter[tuple[str, str]]()
    for i in np.flatnonzero(within):
        query = hand.query(q[i])
        inspector = query.inspector()
        overlaps = query.ComputePointPairPenetration()
        free[i] = not overlaps
        pairs.update({_bodies(inspector, overlap.id_A, overlap.id_B) for overlap in overlaps})
    return Draws(q, within, free, pairs)


def _bodies(
    inspector: SceneGraphInspector, first: GeometryId, second: GeometryId
) -> tuple[str, str]:
    """Returns the names of the bodies of two geometries, in alphabetic order."""
    one, other = sorted(
        short_name(inspector.GetName(inspector.GetFrameId(g))) for g in (first, second)
    )
    return one, other
