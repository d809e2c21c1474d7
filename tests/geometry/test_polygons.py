"""Polygons as arrays of corners."""

from __future__ import annotations

import numpy as np
import shapely

from drake_polygrasp.geometry.polygons import polygon_corners


def test_corners_are_those_of_shapely_s_ragged_array() -> None:
    square = shapely.box(0, 0, 3, 3)
    holed = square - shapely.box(1, 1, 2, 2) - shapely.Point(2.5, 2.5).buffer(0.2)
    polygons = np.array([holed, square, shapely.Polygon([(0, 0), (1, 0), (0, 1)])])
    xy, ring_offsets, polygon_offsets = polygon_corners(polygons)
    _, expected_xy, (expected_rings, expected_polygons) = shapely.to_ragged_array(polygons)
    np.testing.assert_array_equal(xy, expected_xy)
    np.testing.assert_array_equal(ring_offsets, expected_rings)
    np.testing.assert_array_equal(polygon_offsets, expected_polygons)
    assert polygon_offsets.tolist() == [0, 3, 4, 5]
