"""The generated solids of tests and benchmarks are closed, outward and have the faces promised."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from tests.support.convex_polyhedra import (
    boxes,
    ellipsoid_hull,
    holed_prism,
    prism,
    shells,
    tangent_polyhedron,
)

SEEDS = range(5)


def volume(triangles: Array) -> float:
    return float(np.linalg.det(triangles).sum() / 6)


def planes(triangles: Array) -> Array:
    """Distinct planes, as outward normal and offset relative to the size."""
    a, b, c = np.moveaxis(triangles / np.abs(triangles).max(), 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    offset = np.einsum("ti,ti->t", normal, a)
    return np.unique(np.round(np.c_[normal, offset], 6) + 0.0, axis=0)


def assert_closed(triangles: Array) -> None:
    """Every edge is run through as often in one sense as in the other."""
    _, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    tail = index.reshape(-1, 3)
    edges = np.stack([tail, np.roll(tail, -1, axis=1)], axis=-1).reshape(-1, 2)
    np.testing.assert_array_equal(
        np.unique(edges, axis=0, return_counts=True)[1],
        np.unique(edges[:, ::-1], axis=0, return_counts=True)[1],
    )
    assert {tuple(edge) for edge in edges} == {tuple(edge) for edge in edges[:, ::-1]}


@pytest.mark.parametrize("num_faces", [4, 7, 10, 30, 100])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_tangent_polyhedron_is_convex_with_exactly_its_faces(num_faces: int, seed: int) -> None:
    triangles = tangent_polyhedron(num_faces, seed, size=1.0)
    assert_closed(triangles)
    faces = planes(triangles)
    assert len(faces) == num_faces
    scale = np.abs(triangles).max()
    np.testing.assert_allclose(faces[:, 3] * scale, 1.0, atol=1e-4)
    assert (triangles.reshape(-1, 3) @ faces[:, :3].T <= 1 + 1e-4).all()


@pytest.mark.parametrize("num_faces", [10, 30, 100])
@pytest.mark.parametrize("seed", SEEDS)
def test_its_fans_of_triangles_merge_into_its_faces(num_faces: int, seed: int) -> None:
    polyhedron = build_polyhedron([Part(tangent_polyhedron(num_faces, seed), 0.3)])
    assert len(polyhedron.faces) == num_faces


@pytest.mark.parametrize("num_faces", [4, 10, 30, 100])
@pytest.mark.parametrize("seed", SEEDS)
def test_an_ellipsoid_hull_has_exactly_its_triangles(num_faces: int, seed: int) -> None:
    triangles = ellipsoid_hull(num_faces, seed)
    assert_closed(triangles)
    assert len(planes(triangles)) == len(triangles) == num_faces
    assert 0 < volume(triangles) < 4 / 3 * np.pi * 0.07 * 0.05 * 0.04
    on_ellipsoid = np.square(triangles / [0.07, 0.05, 0.04]).sum(axis=-1)
    np.testing.assert_allclose(on_ellipsoid, 1)


def test_an_odd_number_of_triangles_closes_nothing() -> None:
    with pytest.raises(ValueError, match="11 faces"):
        ellipsoid_hull(11, seed=0)


def test_a_prisms_volume_is_its_profile_times_its_height() -> None:
    profile = shapely.box(0, 0, 4, 3) - shapely.box(1, 1, 2, 2) - shapely.box(3, 2, 5, 5)
    triangles = prism(profile, 2.0)
    assert_closed(triangles)
    assert volume(triangles) == pytest.approx((12 - 1 - 1) * 2)
    assert len(planes(triangles)) == 2 + 6 + 4


@pytest.mark.parametrize("num_holes", [0, 1, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_holed_prism_has_four_walls_for_each_hole(num_holes: int, seed: int) -> None:
    triangles = holed_prism(9, num_holes, seed)
    assert_closed(triangles)
    assert volume(triangles) > 0
    assert len(planes(triangles)) == 9 + 2 + 4 * num_holes


@pytest.mark.parametrize("aligned", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_each_box_is_a_shell_around_the_common_point(aligned: bool, seed: int) -> None:
    triangles = boxes(4, seed, aligned=aligned)
    for box in triangles.reshape(4, 12, 3, 3):
        assert_closed(box)
        assert len(planes(box)) == 6
        assert (planes(box)[:, 3] > 0).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_each_shell_is_closed_and_the_next_begins_in_it(seed: int) -> None:
    triangles = shells(4, 40, seed).reshape(4, 40, 3, 3)
    centres = triangles.reshape(4, -1, 3).mean(axis=1)
    for shell, next_centre in zip(triangles, [*centres[1:], centres[3]], strict=True):
        assert_closed(shell)
        about = shell - next_centre
        assert (np.linalg.det(about) > 0).all()
