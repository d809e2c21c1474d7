"""What a hand reaches, as plain arrays: postures, where its tips are then and where they look.

Three tips can be at three contacts if the triangle of their centres is congruent to that of the
contacts' and the tips look along the inward normals, whatever the palm's pose. Both triangles are
described by twelve numbers that no motion changes, so the nearest postures are found by comparing
numbers. Differences are added one feature at a time, so no result depends on a BLAS library.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array, Batch, Ints
from drake_polygrasp.vectors import cross, dot, unit

TipTriple = tuple[int, int, int]
"""Three tips of a hand, by their indices."""
Features = npt.NDArray[np.float32]
LENGTH_SCALE = 0.008
"""Our choice [m]: distances that differ by this count as one in a score."""
DIRECTION_WEIGHT = 2.4
"""Our choice: unit vectors that differ by 1 count as this in the root of a score. With half of it,
one in eight triples that can be reached had no good start among its matches."""
OUT_OF_REACH = 30.0
"""Our choice: triples whose least score is above this are out of reach."""
_AT_ONCE = 1 << 17
"""Our choice: scores computed together, so that they stay in the processor's cache."""
_ASSIGNMENTS = tuple(permutations(range(3)))
_COLUMNS: WeakKeyDictionary[Reach, dict[TipTriple, Features]] = WeakKeyDictionary()
"""Features of the postures of a library by triples of tips, kept as long as the library."""


@dataclass(frozen=True, eq=False)
class Reach(Batch):
    """Postures of a hand without self-collision, and where its T tips are in each.

    Attributes:
        q: positions of the n joints [rad or m], shape (L, n).
        p_PT: centres of the tips in the palm's frame P [m], shape (L, T, 3).
        axis_P: unit vectors in which the tips look, shape (L, T, 3).
    """

    q: Array
    p_PT: Array
    axis_P: Array


@dataclass(frozen=True, eq=False)
class Matches(Batch):
    """Postures of a library that nearly reach one triple of contacts, best first.

    Attributes:
        row: row of each in the library, shape (m,).
        fingers: the tips at contacts 1, 2 and 3, shape (m, 3).
        score: squared distance of the features, 0 for a posture that reaches exactly, shape (m,).
    """

    row: Ints
    fingers: Ints
    score: Array


def triangle_features(p: Array, direction: Array) -> Features:
    """Describes labelled triangles with a direction at each corner, independently of their pose.

    Args:
        p: corners [m], shape (..., 3, 3).
        direction: unit vectors at the corners, shape (..., 3, 3).

    Returns:
        Three side lengths over `LENGTH_SCALE`, then the directions in the triangle's own frame,
        times `DIRECTION_WEIGHT`, shape (..., 12).
    """
    side = p[..., [1, 2, 0], :] - p
    lengths = np.sqrt(dot(side, side)) / LENGTH_SCALE
    x = unit(side[..., 0, :])
    z = unit(cross(side[..., 0, :], -side[..., 2, :]))
    axes = np.stack([x, cross(z, x), z], axis=-2)
    turned = dot(direction[..., :, None, :], axes[..., None, :, :]) * DIRECTION_WEIGHT
    flat = turned.reshape(*turned.shape[:-2], 9)
    return np.concatenate([lengths, flat], axis=-1).astype(np.float32)


def reach_scores(
    reach: Reach, fingers: Sequence[TipTriple], p_BT: Array, nhat_TB_B: Array
) -> Array:
    """Computes how well a hand reaches triples of contacts, with the fingers that suit best.

    Args:
        reach: the hand's postures.
        fingers: the triples of tips that may grasp.
        p_BT: centres of the tips' spheres at the contacts [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).

    Returns:
        The least score of each triple, shape (M,); infinite for a hand without postures.
    """
    least = np.full(len(p_BT), np.inf, dtype=np.float32)
    if not len(reach.q):
        return least.astype(float)
    asked = [triangle_features(p_BT[:, order], nhat_TB_B[:, order]) for order in _ASSIGNMENTS]
    for tips in fingers:
        columns = _columns(reach, tips)
        step = max(1, _AT_ONCE // len(reach.q))
        for features in asked:
            for start in range(0, len(features), step):
                some = slice(start, start + step)
                scores = _squared_distances(features[some], columns)
                np.minimum(least[some], scores.min(axis=1), out=least[some])
    return least.astype(float)


def best_matches(
    reach: Reach,
    fingers: Sequence[TipTriple],
    p_BT: Array,
    nhat_TB_B: Array,
    num: int = 80,
    each: int = 12,
) -> Matches:
    """Finds the postures that come nearest to one triple of contacts.

    Args:
        reach: the hand's postures.
        fingers: the triples of tips that may grasp.
        p_BT: centres of the tips' spheres at the contacts [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        num: greatest number of matches.
        each: greatest number with the same tips at the same contacts.

    Returns:
        The matches, best first; of a tie, those of earlier fingers and rows first.
    """
    found: list[tuple[Ints, Ints, Any]] = []
    orders = np.array(_ASSIGNMENTS)
    features = triangle_features(p_BT[orders], nhat_TB_B[orders])
    for tips in fingers if len(reach.q) else ():
        scores = _squared_distances(features, _columns(reach, tips))
        for order, of_order in zip(_ASSIGNMENTS, scores, strict=True):
            rows = _least(of_order, min(each, num))
            # Tip tips[k] is at contact order[k].
            at_contact = np.empty(3, dtype=np.int64)
            at_contact[list(order)] = tips
            found.append((rows, np.broadcast_to(at_contact, (len(rows), 3)), of_order[rows]))
    if not found:
        return Matches(np.empty(0, np.int64), np.empty((0, 3), np.int64), np.empty(0))
    row, tips_at, score = (np.concatenate(parts) for parts in zip(*found, strict=True))
    best = np.argsort(score, kind="stable")[:num]
    return Matches(row[best], tips_at[best], score[best].astype(float))


def _least(scores: Features, num: int) -> Ints:
    """Returns the rows of the least scores, ascending; of a tie the first rows."""
    if num == 1:
        return np.array([np.argmin(scores)])
    return np.argsort(scores, kind="stable")[:num]


def tip_distances(reach: Reach, fingers: Sequence[TipTriple], share: float = 0.001) -> Array:
    """Returns the range of distances between two tips that may grasp together.

    Args:
        reach: the hand's postures, at least one.
        fingers: the triples of tips that may grasp.
        share: share of postures that is left out at each end.

    Returns:
        Least and greatest distance [m], shape (2,).
    """
    pairs = sorted({pair for i, j, k in fingers for pair in ((i, j), (i, k), (j, k))})
    first, second = np.array(pairs).T
    side = reach.p_PT[:, first] - reach.p_PT[:, second]
    return np.quantile(np.sqrt(dot(side, side)), [share, 1 - share])


def _columns(reach: Reach, tips: TipTriple) -> Features:
    """Returns the features of all postures, one row a feature, shape (12, L); computed once."""
    known = _COLUMNS.setdefault(reach, {})
    if tips not in known:
        chosen = list(tips)
        features = triangle_features(reach.p_PT[:, chosen], reach.axis_P[:, chosen])
        known[tips] = np.ascontiguousarray(features.T)
    return known[tips]


def _squared_distances(features: Features, columns: Features) -> Features:
    """Returns squared distances of some rows of features from those of all postures, (M, L)."""
    total = np.zeros((len(features), columns.shape[1]), dtype=np.float32)
    for k, column in enumerate(columns):
        difference = features[:, k, None] - column
        difference *= difference
        total += difference
    return total
