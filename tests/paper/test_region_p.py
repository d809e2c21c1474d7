"""Section 6: the segments a_i against lines cut by shapely, and the region P by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.geometry.polyhedron import Face
from drake_polygrasp.geometry.regions import Regions, boundary
from drake_polygrasp.paper.grasp_plane import Planes, opposed_planes, other_heights
from drake_polygrasp.paper.planar import clip_intervals, nearest, outer_ends, section, within
from drake_polygrasp.paper.position import opposed, plane_directions
from drake_polygrasp.paper.region_p import Cut, cut_nonparallel, cut_parallel, cut_two_faces
from drake_polygrasp.paper.two_faces import choices, two_face_planes
from tests.support.solids import UNIT, X, Y, Z, bottom, face, regions_of, star, top

box = shapely.box
seeds = st.integers(0, 2**32 - 1)
nan = np.nan


def random_unit(rng: np.random.Generator, *shape: int) -> Array:
    vectors = rng.normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def cut_by_shapely(regions: Regions, r: int, nhat: Array, height: float, axis: Array) -> Array:
    """The segments of region r as sorted values of axis . p, by cutting its polygon with a line."""
    axes, p_BF = regions.R_BF[r, :, :2], regions.p_BF[r]
    g = nhat @ axes
    on_line = g * (height - nhat @ p_BF) / (g @ g)
    along = np.array([-g[1], g[0]]) / np.linalg.norm(g)
    line = shapely.LineString([on_line - 100 * along, on_line + 100 * along])
    pieces = [piece for piece in shapely.get_parts(regions.polygon_F[r] & line) if piece.length]
    ends = [shapely.get_coordinates(piece) @ (axes.T @ axis) + p_BF @ axis for piece in pieces]
    return np.sort(np.array([[e.min(), e.max()] for e in ends]).reshape(-1, 2), axis=0)


def test_segments_are_what_a_line_cuts_from_the_face() -> None:
    rng = np.random.default_rng(1)
    num = 200
    faces = []
    for _ in range(num):
        R = Rotation.random(random_state=rng).as_matrix()
        faces.append(face(star(rng, 9, 2), R[:, 0], R[:, 1], rng.normal(size=3)))
    regions = regions_of(faces)
    nhat = random_unit(rng, num)
    height = np.array([n @ f.p_BF for n, f in zip(nhat, faces, strict=True)])
    height += rng.uniform(-0.5, 0.5, num)
    axis = np.cross(nhat, random_unit(rng, num))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    found = section(regions, boundary(regions), np.arange(num), nhat, height, axis, 1e-9)
    numbers = []
    for k in range(num):
        expected = cut_by_shapely(regions, k, nhat[k], height[k], axis[k])
        intervals = found.intervals[k][~np.isnan(found.intervals[k, :, 0])]
        assert intervals.shape == expected.shape
        np.testing.assert_allclose(intervals, expected, atol=1e-8)
        numbers.append(len(intervals))
    assert {0, 1, 2, 3} <= set(numbers)
    # Points of the cut are on both planes, and s is their coordinate along the axis.
    s = rng.uniform(-1, 1, (num, 5))
    p = found.points(s)
    np.testing.assert_allclose(found.points(s[:, 0]), p[:, 0])
    np.testing.assert_allclose(np.einsum("kjc,kc->kj", p, nhat), height[:, None] + 0 * s, atol=1e-8)
    np.testing.assert_allclose(np.einsum("kjc,kc->kj", p, axis), s, atol=1e-7)
    off_face = np.einsum("kjc,kc->kj", p - regions.p_BF[:, None], regions.nhat_TB_B)
    np.testing.assert_allclose(off_face, 0, atol=1e-7)


def segments(polygon: shapely.Polygon, y: float) -> list[list[float]]:
    """The segments of a level face at one y, along x."""
    regions = regions_of([top(polygon, 0.0)])
    found = section(
        regions, boundary(regions), np.array([0]), Y[None], np.array([y]), X[None], 1e-9
    ).intervals[0]
    return found[~np.isnan(found[:, 0])].tolist()


def test_a_cut_through_vertices_counts_each_once() -> None:
    diamond = shapely.Polygon([(0, -1), (1, 0), (0, 1), (-1, 0)])
    assert segments(diamond, 0.0) == [[-1.0, 1.0]]
    comb = box(0, 0, 5, 1) | box(0, 0, 1, 5) | box(4, 0, 5, 5)
    assert segments(comb, 0.5) == [[0.0, 5.0]]
    assert segments(comb, 3.0) == [[0.0, 1.0], [4.0, 5.0]]
    # On the line of the notch's ground one of the two neighbouring cuts is taken.
    assert segments(comb, 1.0) in ([[0.0, 5.0]], [[0.0, 1.0], [4.0, 5.0]])
    assert segments(comb, 0.0) in ([[0.0, 5.0]], [])
    assert segments(comb, 5.0) in ([], [[0.0, 1.0], [4.0, 5.0]])
    assert segments(comb, 7.0) == []


def test_gaps_and_segments_that_rounding_makes_are_none() -> None:
    slit = box(0, 0, 5, 5) - box(2, 1, 2 + 1e-10, 4)
    assert segments(slit, 2.0) == [[0.0, 5.0]]
    tips = box(0, 0, 5, 1) | shapely.Polygon([(0, 1), (1, 1), (0, 2)])
    assert segments(tips, 2 - 1e-10) == []
    assert segments(tips, 1.5) == [[0.0, 0.5]]


def test_a_plane_parallel_to_the_face_or_constant_along_the_axis_cuts_nothing() -> None:
    regions = regions_of([top(box(0, 0, 1, 1), 0.0)])
    none = section(
        regions,
        boundary(regions),
        np.array([0, 0]),
        np.array([Z, Y]),
        np.array([0.0, 0.5]),
        np.array([X, Z]),
        1e-9,
    )
    assert np.isnan(none.intervals).all()


def test_intervals_by_hand() -> None:
    gaps = np.array([[[0.0, 1.0], [3.0, 4.0]], [[nan, nan], [nan, nan]]])
    np.testing.assert_array_equal(within(gaps, np.array([3.5, 3.5]), 0.0), [True, False])
    assert within(gaps[:1], np.array([1.0 + 1e-10]), 1e-9)[0]
    np.testing.assert_array_equal(outer_ends(gaps), [[0, 4], [nan, nan]])
    clipped = clip_intervals(gaps, np.array([0.5, 0.0]), np.array([2.0, 9.0]), 1e-9)
    np.testing.assert_array_equal(clipped[0], [[0.5, 1.0], [nan, nan]])
    # 2 is as near to either: the greater counts.
    np.testing.assert_array_equal(nearest(gaps, np.array([2.0, 2.0]), 1e-9), [3.0, nan])
    np.testing.assert_array_equal(nearest(gaps, np.array([1.9, 0.0]), 1e-9), [1.0, nan])


@given(seeds)
def test_the_nearest_point_of_intervals_is_in_them_and_none_is_nearer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    intervals = np.sort(rng.uniform(-1, 1, (20, 6)), axis=1).reshape(20, 3, 2)
    s = rng.uniform(-1.5, 1.5, 20)
    found = nearest(intervals, s, 1e-9)
    assert within(intervals, found, 0.0).all()
    grid = intervals[..., :1] + np.linspace(0, 1, 50) * np.diff(intervals)
    nearest_of_grid = np.abs(grid - s[:, None, None]).min(axis=(1, 2))
    assert (np.abs(found - s) <= nearest_of_grid + 2e-9).all()


WALL = box(-0.5, 0, 0.5, 1)


def planes(region: Ints, N: Array, along: Array, heights: tuple[float, float, float]) -> Planes:
    low, high, height = (np.array([h]) for h in heights)
    zero = np.zeros(1)
    return Planes(np.array([0]), region[None], N[None], along[None], low, high, height, zero, zero)


def walls(*polygons: shapely.Polygon) -> tuple[list[Face], Regions]:
    """Walls one unit away from the z axis, a third of a turn apart; polygons along t_i and z."""
    turn = 2 * np.pi / 3 * np.arange(3)
    outward = np.c_[np.cos(turn), np.sin(turn), np.zeros(3)]
    faces = [
        face(polygon, np.cross(Z, n), Z, n) for polygon, n in zip(polygons, outward, strict=True)
    ]
    return faces, regions_of(faces)


def three_walls(*polygons: shapely.Polygon, first_height: float) -> Cut:
    regions = walls(*polygons)[1]
    on = plane_directions(Z[None], regions.nhat_TB_B[None])
    chosen = planes(np.arange(3), Z, on.nprime[0, 0], (0.0, 1.0, first_height))
    return cut_nonparallel(regions, boundary(regions), chosen, on, UNIT)


def test_three_equal_strips_a_third_of_a_turn_apart_leave_a_hexagon() -> None:
    cut = three_walls(WALL, WALL, WALL, first_height=0.4)
    # Its inradius is 0.5, its area 2 sqrt(3) / 4.
    assert cut.area_p[0] == pytest.approx(np.sqrt(3) / 2)
    np.testing.assert_allclose(cut.p_Bc[0], [0, 0, 0.4], atol=1e-12)
    assert cut.d_2[0] == pytest.approx(0, abs=1e-12)
    assert cut.height[0] == 0.4


def test_when_p_is_empty_other_offsets_are_tried_nearest_first() -> None:
    # Below 0.7 the first wall is only beside the others' strips.
    gallows = box(-0.5, 0.7, 5, 1) | box(4, 0, 5, 1)
    cut = three_walls(gallows, WALL, WALL, first_height=0.3)
    np.testing.assert_allclose(cut.height, [0.02 + 0.96 * 0.75])
    cut = three_walls(box(4, 0, 5, 1), WALL, WALL, first_height=0.3)
    assert not len(cut.owner)


def test_other_offsets_by_hand() -> None:
    region = np.arange(3)
    for height, expected in (
        (0.3, [0.26, 0.5, 0.74]),
        (0.9, [0.74, 0.5, 0.26]),
        (0.5, [0.5, 0.26, 0.74]),
    ):
        found = other_heights(planes(region, Z, X, (0.0, 1.0, height)))
        np.testing.assert_allclose(found[0], expected)


def test_p_of_parallel_faces_is_their_hull_beside_the_opposing_one() -> None:
    regions = regions_of(
        [top(box(0, 0, 1, 1), 1.0), bottom(box(-3, 0, -2, 1), 0.0), bottom(box(3, 0, 4, 1), 0.0)]
    )
    chosen = planes(np.arange(3), Y, Z, (0.0, 1.0, 0.5))
    cut = cut_parallel(regions, boundary(regions), chosen, UNIT)
    assert cut.area_p[0] == pytest.approx(1.0)
    np.testing.assert_allclose(cut.p_Bc[0], [0.5, 0.5, 0.5], atol=1e-12)
    assert cut.d_2[0] == pytest.approx(np.sqrt(0.5))
    # The cut runs along X or against it.
    x = np.cross(Z, Y) @ X
    ends = np.sort(x * outer_ends(cut.segments.intervals)[0], axis=1)
    np.testing.assert_allclose(ends, [[0, 1], [-3, -2], [3, 4]])


def two_faces(first: Face, second: Face) -> Cut:
    regions = regions_of([first, second])
    edges = boundary(regions)
    sets = opposed(regions, np.array([[0, 1, 1]]), Z[None])
    rows = choices(sets, UNIT)
    chosen, kept = two_face_planes(edges, sets, rows, UNIT)
    return cut_two_faces(regions, edges, chosen, sets, rows.widest[kept], rows.pocket[kept], UNIT)


def finite(intervals: Array) -> list[list[float]]:
    return np.round(intervals[~np.isnan(intervals[:, 0])], 9).tolist()


def spread_along(direction: Array, cut: Cut, row: int = 0) -> list[list[list[float]]]:
    """a_1, a_2, a_3 of a row as intervals along a direction that the plane holds."""
    sign = np.sign(np.cross(cut.along_B[row], cut.nhat_B[row]) @ direction)
    return [
        sorted(sorted((sign * np.array(ends)).tolist()) for ends in finite(a))
        for a in cut.segments.intervals[row]
    ]


def test_the_longer_of_two_segments_holds_two_contacts() -> None:
    short, long = box(-0.3, -0.1, 0.3, 0.1), box(-0.5, -0.1, 0.5, 0.1)
    for faces, roles in (
        ((top(short, 1), bottom(long, 0)), [0, 1, 1]),
        ((top(long, 1), bottom(short, 0)), [1, 0, 0]),
    ):
        cut = two_faces(*faces)
        assert cut.region.tolist() == [roles]
        assert spread_along(X, cut) == [[[-0.3, 0.3]], [[-0.5, 0.5]], [[-0.5, 0.5]]]


def test_of_equal_segments_either_holds_two_contacts() -> None:
    plate = box(-0.5, -0.1, 0.5, 0.1)
    cut = two_faces(top(plate, 1), bottom(plate, 0))
    assert sorted(cut.region.tolist()) == [[0, 1, 1], [1, 0, 0]]


COMB = box(0, 0, 9, 1) | box(0, 0, 1, 6) | box(4, 0, 5, 6) | box(8, 0, 9, 6)


@pytest.mark.parametrize(
    ("tooth", "beside"),
    [((1.5, 2, 3.5, 5), ([0, 1], [4, 5])), ((5.5, 2, 7.5, 5), ([4, 5], [8, 9]))],
)
def test_the_two_contacts_of_a_comb_are_beside_the_pocket_that_is_opposed(
    tooth: tuple[float, ...], beside: tuple[list[float], list[float]]
) -> None:
    comb, opposing = bottom(COMB, 0), top(box(*tooth), 1)
    for faces, roles in (((opposing, comb), [0, 1, 1]), ((comb, opposing), [1, 0, 0])):
        cut = two_faces(*faces)
        assert cut.region.tolist() == [roles]
        # The lid runs along x: so does the plane.
        np.testing.assert_allclose(np.abs(cut.nhat_B[0]), Y, atol=1e-12)
        a_1, a_2, a_3 = spread_along(X, cut)
        assert a_1 == [[tooth[0], tooth[2]]]
        assert sorted([a_2, a_3]) == [[beside[0]], [beside[1]]]


def test_the_two_contacts_around_a_hole_are_on_its_two_sides() -> None:
    ring = box(-0.5, -0.5, 0.5, 0.5) - box(-0.2, -0.2, 0.2, 0.2)
    cut = two_faces(top(box(-0.1, -0.1, 0.1, 0.1), 0), bottom(ring, -1))
    assert set(map(tuple, cut.region.tolist())) == {(0, 1, 1)}
    assert len(cut.owner) == 8
    straight = np.flatnonzero(np.abs(cut.nhat_B @ Y) > 1 - 1e-9)
    assert len(straight) == 1
    a_1, a_2, a_3 = spread_along(X, cut, int(straight[0]))
    assert a_1 == [[-0.1, 0.1]]
    assert sorted([a_2, a_3]) == [[[-0.5, -0.2]], [[0.2, 0.5]]]


def test_a_plane_that_passes_below_the_pocket_takes_all_of_the_segment() -> None:
    # The opposing face reaches below the notch, and the lowest part of it holds c_m.
    notched = box(-0.5, -0.2, 0.5, 0.6) - box(-0.4, 0.1, 0.4, 0.6)
    cut = two_faces(top(box(-0.35, -0.2, 0.35, 0.6), 1), bottom(notched, 0))
    assert cut.region.tolist() == [[0, 1, 1]]
    a_1, a_2, a_3 = spread_along(X, cut)
    assert a_1 == [[-0.35, 0.35]]
    assert a_2 == a_3 == [[-0.5, 0.5]]


def test_no_rows_are_no_rows() -> None:
    regions = regions_of([top(box(0, 0, 1, 1), 1), bottom(box(0, 0, 1, 1), 0)])
    edges = boundary(regions)
    none = np.empty(0, dtype=np.int64)
    sets = opposed(regions, np.empty((0, 3), dtype=np.int64), np.empty((0, 3)))
    rows = choices(sets, UNIT)
    assert rows.owner.shape == (0,)
    chosen, kept = two_face_planes(edges, sets, rows, UNIT)
    assert cut_two_faces(
        regions, edges, chosen, sets, rows.widest[kept], rows.pocket[kept], UNIT
    ).p_Bc.shape == (0, 3)
    chosen, _ = opposed_planes(edges, sets, none, np.empty((0, 2)), UNIT)
    assert cut_parallel(regions, edges, chosen, UNIT).region.shape == (0, 3)
    on = plane_directions(np.empty((0, 3)), np.empty((0, 3, 3)))
    assert cut_nonparallel(regions, edges, chosen, on, UNIT).area_p.shape == (0,)
