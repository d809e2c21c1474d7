"""What is near to points among many triangles: as by comparing all of them, asked once or twice."""

from __future__ import annotations

import pickle

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import point_triangle_distance
from tests.convex_polyhedra import boxes

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


def test_boxes_within_reach_are_those_that_comparing_all_finds() -> None:
    i, t = TriangleSoup(BODY).near(POINTS, REACH)
    above = POINTS[:, None] >= BODY.min(axis=1) - REACH
    below = POINTS[:, None] <= BODY.max(axis=1) + REACH
    pairs = np.nonzero((above & below).all(axis=2))
    assert sorted(zip(i, t, strict=True)) == sorted(zip(*pairs, strict=True))


def test_nothing_is_near_to_nothing() -> None:
    for soup, points in ((TriangleSoup(BODY[:0]), POINTS), (TriangleSoup(BODY), POINTS[:0])):
        assert [len(found) for found in soup.closer_than(points, REACH)] == [0, 0, 0]
        assert [len(found) for found in soup.near(points, REACH)] == [0, 0]
        assert soup.winding_numbers(points).tolist() == [0] * len(points)


def test_a_soup_is_pickled_without_its_trees_and_answers_alike() -> None:
    fresh, used = TriangleSoup(BODY), TriangleSoup(BODY)
    expected = used.winding_numbers(POINTS), used.closer_than(POINTS, REACH)
    assert pickle.dumps(used) == pickle.dumps(fresh)
    again: TriangleSoup = pickle.loads(pickle.dumps(used))
    np.testing.assert_array_equal(again.winding_numbers(POINTS), expected[0])
    for one, other in zip(again.closer_than(POINTS, REACH), expected[1], strict=True):
        np.testing.assert_array_equal(one, other)
