"""A hand reaches contacts that are congruent to its tips in some posture, and no mirror image."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from drake_polygrasp.arrays import Array
from drake_polygrasp.search.reach import (
    DIRECTION_WEIGHT,
    LENGTH_SCALE,
    Reach,
    best_matches,
    reach_scores,
    tip_distances,
    triangle_features,
)
from drake_polygrasp.vectors import unit

FINGERS = ((0, 1, 2), (0, 2, 3))


def a_reach(num: int = 50) -> Reach:
    """Four tips anywhere in a cube of 10 cm, looking anywhere."""
    rng = np.random.default_rng(3)
    shape = (num, 4, 3)
    return Reach(
        rng.normal(size=(num, 7)), rng.uniform(0, 0.1, shape), unit(rng.normal(size=shape))
    )


def a_rotation() -> Array:
    R, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    return np.asarray(R * np.sign(np.linalg.det(R)))


@pytest.mark.parametrize("tips", FINGERS)
@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_a_posture_moved_as_a_whole_is_found_again(
    tips: tuple[int, int, int], order: tuple[int, int, int]
) -> None:
    reach, R, shift = a_reach(), a_rotation(), np.array([0.3, -0.2, 0.1])
    chosen = np.array(tips)[list(order)]
    p_BT = reach.p_PT[17, chosen] @ R.T + shift
    nhat = reach.axis_P[17, chosen] @ R.T
    matches = best_matches(reach, FINGERS, p_BT, nhat)
    assert matches.row[0] == 17
    assert matches.fingers[0].tolist() == chosen.tolist()
    # Features are floats of 24 bits and below 20, so their squares differ by less than this.
    assert matches.score[0] < 1e-9
    assert matches.score[1] > 1e-3
    assert reach_scores(reach, FINGERS, p_BT[None], nhat[None])[0] == matches.score[0]


def test_a_mirror_image_is_not_reached() -> None:
    reach = a_reach(1)
    mirrored = np.diag([1.0, 1.0, -1.0])
    p_BT, nhat = reach.p_PT[0, :3] @ mirrored, reach.axis_P[0, :3] @ mirrored
    assert best_matches(reach, ((0, 1, 2),), p_BT, nhat).score[0] > 1


def test_a_score_is_the_squared_difference_of_sides_and_directions() -> None:
    # A right triangle whose tips look along its normal; the contact's hypotenuse is no longer, but
    # the third corner is 8 mm farther out, and its normal is turned by 60 degrees.
    p = np.array([[0.0, 0.0, 0.0], [0.04, 0.0, 0.0], [0.0, 0.03, 0.0]])
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    reach = Reach(np.zeros((1, 1)), p[None], up[None])
    moved, turned = p.copy(), up.copy()
    moved[2, 1] += LENGTH_SCALE
    turned[2] = [np.sin(np.pi / 3), 0.0, 0.5]
    hypotenuse = np.hypot(0.04, 0.038) - 0.05
    expected = 1 + (hypotenuse / LENGTH_SCALE) ** 2 + DIRECTION_WEIGHT**2
    score = reach_scores(reach, ((0, 1, 2),), moved[None], turned[None])[0]
    assert score == pytest.approx(expected, rel=1e-5)  # single precision


def test_features_of_degenerate_triangles_are_finite() -> None:
    p = np.array([[0.0, 0, 0], [0, 0, 0], [0.1, 0, 0]])
    assert np.isfinite(triangle_features(p, np.eye(3))).all()


def test_distances_are_of_tips_that_may_grasp_together() -> None:
    p = np.zeros((1, 4, 3))
    p[0, :, 0] = [0, 1, 3, 10]
    reach = Reach(np.zeros((1, 1)), p, np.zeros((1, 4, 3)))
    assert tip_distances(reach, [(0, 1, 2)], 0.0).tolist() == [1, 3]
    assert tip_distances(reach, [(0, 2, 3)], 0.0).tolist() == [3, 10]


def test_a_hand_without_postures_reaches_nothing() -> None:
    none = a_reach().take(slice(0))
    assert reach_scores(none, FINGERS, np.zeros((2, 3, 3)), np.zeros((2, 3, 3))).tolist() == [
        np.inf,
        np.inf,
    ]
    assert not len(best_matches(none, FINGERS, np.zeros((3, 3)), np.zeros((3, 3))).row)
