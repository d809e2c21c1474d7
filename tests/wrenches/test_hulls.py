"""Hulls built side by side, against Qhull."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from drake_polygrasp.region_bounds.simplex_cycle import encloses, is_closed
from drake_polygrasp.wrenches.hulls import (
    nearest_facets,
    simplex_hulls,
    spanning_points,
    with_points,
)

NUM_POINTS = 24


def sets_of_points():
    """Sets of points in general position, some around the origin and some beside it."""
    rng = np.random.default_rng(5)
    return rng.normal(size=(6, NUM_POINTS, 6)) + np.array([0, 0, 0, 0.3, 1, 4])[:, None, None]


def built(points):
    """The hulls of sets of points, and the points of each in the order in which they were added."""
    seven, spans = spanning_points(points)
    assert spans.all()
    order = np.array([[*s, *(k for k in range(points.shape[1]) if k not in s)] for s in seven])
    ordered = np.take_along_axis(points, order[..., None], 1)
    hulls = simplex_hulls(ordered[:, :7])
    for k in range(7, points.shape[1]):
        hulls = with_points(hulls, ordered[:, k], np.ones(len(points), dtype=bool), k)
    return hulls, ordered


def test_hulls_have_the_facets_that_qhull_finds():
    hulls, points = built(sets_of_points())
    w, offset = hulls.twists()
    for rows, own in zip(hulls.rows(), points, strict=True):
        qhull = ConvexHull(own)
        expected = {tuple(sorted(simplex)) for simplex in qhull.simplices.tolist()}
        assert {tuple(simplex) for simplex in hulls.simplices[rows].tolist()} == expected
        # Planes are combined from those before, so errors add up, by far less than this.
        heights = own @ w[rows].T
        np.testing.assert_allclose(heights.max(axis=0), offset[rows], atol=1e-9)
        assert is_closed(hulls.simplices[rows])
        assert encloses(own, hulls.simplices[rows]) == (offset[rows].min() > 0.0)


def ridge(hulls, facet, number):
    return {*np.delete(hulls.simplices[facet], number).tolist()}


def assert_ridges_are_shared(hulls):
    for facet, beyond in enumerate(hulls.beyond.tolist()):
        for k, (other, number) in enumerate(divmod(each, 8) for each in beyond):
            assert hulls.owner[other] == hulls.owner[facet]
            assert ridge(hulls, other, number) == ridge(hulls, facet, k)
            assert divmod(hulls.beyond[other, number], 8) == (facet, k)


def test_every_ridge_is_shared_with_the_facet_beyond():
    hulls, _ = built(sets_of_points())
    assert_ridges_are_shared(hulls)


def points_of_discs(seed):
    """Points of three discs, many next to others, as in hulls of grasps that barely hold."""
    rng = np.random.default_rng(seed)
    middle, u, v = rng.normal(size=(3, 3, 1, 6))
    quarters = np.append(np.arange(4), rng.integers(0, 4, size=12))
    turns = np.pi / 2 * quarters[:, None]
    turns[4:] += 10.0 ** rng.uniform(-9, -1, size=(12, 1))
    return (middle + np.cos(turns) * u + np.sin(turns) * v).reshape(-1, 6)


@pytest.mark.parametrize("seed", range(40))
def test_hulls_of_points_next_to_each_other_stay_closed(seed):
    points = points_of_discs(seed)
    hulls, _ = built(points[None])
    assert_ridges_are_shared(hulls)
    assert is_closed(hulls.simplices)


def test_a_hull_is_what_it_is_alone():
    points = sets_of_points()
    together, _ = built(points)
    for rows, own in zip(together.rows(), points, strict=True):
        alone, _ = built(own[None])
        np.testing.assert_array_equal(together.simplices[rows], alone.simplices)
        np.testing.assert_array_equal(together.normals[rows], alone.normals)


def test_some_of_several_hulls_are_what_they_were():
    hulls, points = built(sets_of_points())
    kept = np.array([False, True, True, False, False, True])
    some, alone = hulls.take(kept), built(points[kept])[0]
    assert_ridges_are_shared(some)
    for rows, own, expected in zip(
        some.rows(), alone.rows(), np.array(hulls.rows(), dtype=object)[kept], strict=True
    ):
        np.testing.assert_array_equal(some.normals[rows], hulls.normals[expected])
        assert {*map(tuple, some.simplices[rows])} == {*map(tuple, alone.simplices[own])}


def test_points_that_are_not_added_or_are_inside_change_nothing():
    hulls, points = built(sets_of_points())
    some = np.arange(len(points)) % 2 == 0
    outside = 10.0 * points[:, 0]
    same = with_points(hulls, outside, np.zeros(len(points), dtype=bool), NUM_POINTS)
    np.testing.assert_array_equal(same.simplices, hulls.simplices)
    same = with_points(hulls, points.mean(axis=1), ~np.zeros(len(points), dtype=bool), NUM_POINTS)
    np.testing.assert_array_equal(same.simplices, hulls.simplices)
    grown = with_points(hulls, outside, some, NUM_POINTS)
    has_new = [(grown.simplices[rows] == NUM_POINTS).any() for rows in grown.rows()]
    np.testing.assert_array_equal(has_new, some)


def test_the_nearest_facet_of_each_hull_is_found():
    hulls, _ = built(sets_of_points())
    _, offset = hulls.twists()
    nearest = nearest_facets(hulls, offset)
    expected = [offset[rows].min() for rows in hulls.rows()]
    np.testing.assert_allclose(offset[nearest], expected, atol=1e-9)
    np.testing.assert_array_equal(hulls.owner[nearest], np.arange(len(nearest)))


@pytest.mark.parametrize("dimensions", [0, 3, 5])
def test_flat_sets_are_told_from_those_that_span(dimensions):
    points = sets_of_points()
    points[2, :, dimensions:] = points[2, :1, dimensions:]
    seven, spans = spanning_points(points)
    np.testing.assert_array_equal(spans, np.arange(len(points)) != 2)
    assert (np.diff(seven[spans], axis=1) > 0).all()
