"""Which facets fingertips may touch, and where these end above others."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.geometry.surface_pieces import regular_directions, tangent_polygon
from drake_polygrasp.geometry.visible_facets import visible_facets

SQUARE = 0.01 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def roof(slope: float = 0.3, raised: float = 0.0, half: float = 0.02):
    """Four facets of a roof with the contact just left of its ridge; the right half is raised."""
    low = -slope * half
    left, right = -half, half
    corners = [
        [(left, -half, low), (0, -half, 0), (0, half, 0)],
        [(left, -half, low), (0, half, 0), (left, half, low)],
        [(0, -half, raised), (right, -half, low + raised), (right, half, low + raised)],
        [(0, -half, raised), (right, half, low + raised), (0, half, raised)],
    ]
    return np.array(corners, dtype=float) + np.array([0.002, 0.0, 0.0006])


def plate(height: float):
    """Two facets of a level plate beside the contact."""
    x, y = 0.004, 0.02
    a, b, c, d = (x, 0, height), (y, 0, height), (y, y, height), (x, y, height)
    return np.array([[a, b, c], [a, c, d]], dtype=float)


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.0])
def test_facets_that_meet_at_their_sides_have_no_step(turn):
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    seen = visible_facets(roof() @ R.T, SQUARE, 0.1)
    assert not seen.has_step and not seen.is_blocked and seen.hole == np.inf
    assert len(seen.triangle) >= 3


def test_a_half_that_is_raised_is_a_step():
    assert visible_facets(roof(raised=1e-3), SQUARE, 0.1).has_step
    assert visible_facets(roof(raised=-1e-3), SQUARE, 0.1).has_step


def test_a_plate_beside_the_contact_ends_in_a_step_and_one_over_it_is_no_floor():
    seen = visible_facets(np.concatenate([roof(), plate(1e-3)]), SQUARE, 0.1)
    assert seen.has_step
    assert sorted(seen.triangle.tolist()) == [0, 1, 2, 3, 4, 5]
    over = visible_facets(
        np.concatenate([roof(), plate(2e-3) - np.array([0.004, 0.0, 0.0])]), SQUARE, 0.1
    )
    # The contact is under a corner of this plate, so fingertips start below it.
    assert not over.has_step and sorted(over.triangle.tolist()) == [0, 1, 2, 3]


def test_plates_below_are_not_seen():
    seen = visible_facets(np.concatenate([roof(), plate(-0.02)]), SQUARE, 0.1)
    assert not seen.has_step and sorted(seen.triangle.tolist()) == [0, 1, 2, 3]


def test_a_gap_is_a_hole():
    seen = visible_facets(roof()[:3], SQUARE, 0.1)
    # The missing facet begins at the ridge.
    assert seen.hole == pytest.approx(0.002, abs=1e-9)


@pytest.mark.parametrize(
    ("left", "low", "high", "right", "turn"),
    [
        (
            (-0.01784, -0.009348),
            (-0.004664, -0.017465),
            (0.00098, 0.005862),
            (0.016143, -0.016353),
            0.224,
        ),
        (
            (-0.028229, -0.014784),
            (-0.003656, -0.013769),
            (0.000856, 0.004859),
            (0.013082, -0.013236),
            0.064,
        ),
        (
            (-0.021246, -0.011144),
            (-0.003485, -0.013059),
            (0.000782, 0.004666),
            (0.013766, -0.013942),
            0.195,
        ),
    ],
)
def test_two_facets_hide_what_is_below_them(left, low, high, right, turn):
    """Their common side is cut twice, with other rounding errors; without a grid GEOS unites the
    two polygons to one of them."""
    facets = np.zeros((3, 3, 3))
    facets[:, :, :2] = [[(-1, -1), (1, -1), (0, 2)], (left, low, high), (right, high, low)]
    facets[0, :, 2] = -0.005
    first = np.array([np.cos(turn), np.sin(turn)])
    window = tangent_polygon(regular_directions(first), np.array(0.003))
    seen = visible_facets(facets, window, 0.1)
    assert seen.triangle.tolist() == [1, 2] and not seen.has_step and seen.hole == np.inf
