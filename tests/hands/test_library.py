"""The library of a hand holds postures within limits, uncollided, with its tips where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from drake_polygrasp import load_hand
from drake_polygrasp.hands.library import draw_postures, make_reach
from tests.hands.test_model import THREE_FINGER, coupled


def test_a_library_is_of_postures_that_the_hand_can_take() -> None:
    hand = load_hand(THREE_FINGER)
    reach = make_reach(hand, 300)
    assert 100 < len(reach.q) < 300
    assert (reach.q >= hand.lower + 0.03).all()
    assert (reach.q <= hand.upper - 0.03).all()
    for i in range(0, len(reach.q), 20):
        assert not hand.query(reach.q[i]).HasCollisions()
        p_PT, axis_P = hand.tip_points(reach.q[i])
        np.testing.assert_allclose(reach.p_PT[i], p_PT, atol=1e-9)
        np.testing.assert_allclose(reach.axis_P[i], axis_P, atol=1e-9)


def test_a_library_depends_on_its_seed_alone() -> None:
    hand = load_hand(THREE_FINGER)
    one, same, other = (make_reach(hand, 100, seed) for seed in (0, 0, 1))
    for name in ("q", "p_PT", "axis_P"):
        assert (getattr(one, name) == getattr(same, name)).all()
    assert not np.array_equal(one.q[:5], other.q[:5])


def test_coupled_joints_follow_and_keep_their_limits(tmp_path: Path) -> None:
    hand = load_hand(coupled(tmp_path))
    draws = draw_postures(hand, 400, 0)
    q = draws.q[draws.free]
    np.testing.assert_allclose(q[:, 1], 0.5 * q[:, 0] + 0.1, atol=1e-12)
    np.testing.assert_allclose(q[:, 3], 2 * q[:, 2], atol=1e-12)
    # Twice the near joint's range, -1 to 1.2, does not fit into -0.5 to 1.5.
    assert q[:, 3].min() >= -0.5
    assert q[:, 3].max() <= 1.5
    assert draws.q[:, 3].max() > 1.5
