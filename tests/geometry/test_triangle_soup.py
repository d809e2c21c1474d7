"""What is near to points among many triangles: as by comparing all of them, asked once or twice."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry import triangle_soup
from drake_polygrasp.geometry.needles import bounding_boxes
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import point_triangle_distance
from tests.support.convex_polyhedra import boxes

BODY = boxes(3, 4)
POINTS = np.random.default_rng(3).uniform(BODY.min() - 0.01, BODY.max() + 0.01, (200, 3))
REACH = 0.012


def all_distances() -> Array:
    return point_triangle_distance(POINTS[:, None], BODY[None])


def test_pairs_within_reach_are_those_that_comparing_all_finds() -> None:
    soup, distance = TriangleSoup(BODY), all_distances()
    for _ in range(2):
        i, t, found = soup.closer_than(POINTS, REACH)
        assert sorted(zip(i, t, strict=True)) == sorted(
            zip(*np.nonzero(distance <= REACH), strict=True)
        )
        np.testing.assert_array_equal(found, distance[i, t])


def needles(num: int = 60) -> Array:
    """Two fans of long thin triangles across all axes, and one that is a line."""
    turn = np.linspace(0, 2 * np.pi, num + 1)
    rim = 0.05 * np.c_[np.cos(turn), np.sin(turn), np.sin(3 * turn)]
    fans = [np.stack([rim[:-1], rim[1:], np.full((num, 3), z)], axis=1) for z in (-0.05, 0.06)]
    return np.concatenate([*fans, [[[0, 0, 0], [0.02, 0.02, 0.02], [0.05, 0.05, 0.05]]]])


@pytest.mark.parametrize("body", [BODY, needles()], ids=["boxes", "needles"])
def test_what_is_within_reach_is_what_comparing_all_finds(body: Array) -> None:
    found = TriangleSoup(body).near(POINTS, REACH)
    pairs = set(zip(*(np.concatenate(x).tolist() for x in zip(*found, strict=True)), strict=True))
    distance = point_triangle_distance(POINTS[:, None], body[None])
    assert pairs >= set(zip(*np.nonzero(distance <= REACH), strict=True))
    assert len(pairs) < distance.size / 2
    i, t, _ = TriangleSoup(body).closer_than(POINTS, REACH)
    assert sorted(zip(i, t, strict=True)) == sorted(
        zip(*np.nonzero(distance <= REACH), strict=True)
    )
    np.testing.assert_array_equal(
        TriangleSoup(body).within(POINTS, REACH), (distance <= REACH).any(axis=1)
    )


def test_needles_are_inside_the_boxes_of_their_pieces_which_are_small() -> None:
    body = needles()
    low, high, owner = bounding_boxes(body)
    weight = np.random.default_rng(1).dirichlet(np.ones(3), size=500)
    points = np.concatenate([weight, np.eye(3)]) @ body
    inside = (points[:, :, None] >= low) & (points[:, :, None] <= high)
    for t, hits in enumerate(inside.all(axis=3)):
        assert hits[:, owner == t].any(axis=1).all()
    whole = np.ptp(body, axis=1)[:, :2].prod(axis=1)
    pieces = (high - low)[:, :2].prod(axis=1)
    assert pieces.sum() < 0.5 * whole.sum()


def test_points_far_beyond_what_is_compared_at_once_wind_as_one_by_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    soup = TriangleSoup(BODY)
    whole = soup.winding_numbers(POINTS)
    assert whole.any()
    monkeypatch.setattr(triangle_soup, "_POINTS_AT_ONCE", 7)
    monkeypatch.setattr(triangle_soup, "_PAIRS_AT_ONCE", 5)
    np.testing.assert_array_equal(soup.winding_numbers(POINTS), whole)
    np.testing.assert_array_equal([soup.winding_numbers(p[None])[0] for p in POINTS], whole)


def test_nothing_is_near_to_nothing() -> None:
    for soup, points in ((TriangleSoup(BODY[:0]), POINTS), (TriangleSoup(BODY), POINTS[:0])):
        assert [len(found) for found in soup.closer_than(points, REACH)] == [0, 0, 0]
        assert not any(len(i) for i, _ in soup.near(points, REACH))
        assert soup.winding_numbers(points).tolist() == [0] * len(points)


def test_a_soup_is_pickled_without_its_trees_and_answers_alike() -> None:
    fresh, used = TriangleSoup(BODY), TriangleSoup(BODY)
    expected = used.winding_numbers(POINTS), used.closer_than(POINTS, REACH)
    assert pickle.dumps(used) == pickle.dumps(fresh)
    again: TriangleSoup = pickle.loads(pickle.dumps(used))
    np.testing.assert_array_equal(again.winding_numbers(POINTS), expected[0])
    for one, other in zip(again.closer_than(POINTS, REACH), expected[1], strict=True):
        np.testing.assert_array_equal(one, other)
