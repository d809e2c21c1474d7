"""Sections 4.1 and 4.2, position: closed forms against polygons clipped by shapely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation
from shapely.affinity import affine_transform

from drake_polygrasp.arrays import Array, Bools, frozen
from drake_polygrasp.geometry.polyhedron import Face
from drake_polygrasp.geometry.regions import Regions, boundary
from drake_polygrasp.paper.orientation import sine_of_tips_plane
from drake_polygrasp.paper.planar import extents, project
from drake_polygrasp.paper.position import (
    Opposed,
    opposed,
    parallel_faces_meet,
    plane_directions,
    region_rl,
    strip_rs,
    two_faces_meet,
)
from drake_polygrasp.paper.strips import (
    area_and_centroid,
    clip_polygon,
    hulls_in_strips,
    strips_meet,
    strips_polygon,
)
from tests.support.solids import UNIT, X, Y, Z, bottom, face, regions_of, star, top

FAR = 1e3
box = shapely.box


def half_plane(normal: Array, offset: float) -> shapely.Polygon:
    """normal . x <= offset, as a large polygon."""
    n = normal / np.linalg.norm(normal)
    m = np.array([-n[1], n[0]])
    edge = n * offset / np.linalg.norm(normal)
    corners = [edge - FAR * m, edge + FAR * m, edge + FAR * (m - n), edge - FAR * (m + n)]
    return shapely.Polygon(corners)


def strip(normal: Array, low: float, high: float) -> shapely.Geometry:
    return half_plane(normal, high) & half_plane(-normal, -low)


def random_normals(rng: np.random.Generator, *shape: int) -> Array:
    vectors = rng.normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def unit_directions(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def turns(that: Array) -> Array:
    """(t_2 x t_3, t_3 x t_1, t_1 x t_2), shape (M, 3)."""
    a, b = np.roll(that, -1, axis=1), np.roll(that, -2, axis=1)
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def random_strips(rng: np.random.Generator, num: int) -> tuple[Array, Array, Array]:
    that = unit_directions(rng.uniform(0, 2 * np.pi, (num, 3)))
    that[::4, 1] = -that[::4, 0]  # a fourth of them have two parallel strips
    middle, half = rng.normal(size=(num, 3)), rng.uniform(0.01, 1.0, (num, 3))
    return that, middle - half, middle + half


def test_three_strips_meet_where_their_clipped_polygon_has_an_area() -> None:
    that, low, high = random_strips(np.random.default_rng(1), 2000)
    turn = turns(that)
    distinct = np.abs(turn).min(axis=1) > 0.02
    meet = strips_meet(turn, low, high, 0.0)
    area, centroid = area_and_centroid(strips_polygon(that, turn, low, high)[meet & distinct])
    polygons = np.array(
        [
            strip(t[0], a[0], b[0]) & strip(t[1], a[1], b[1]) & strip(t[2], a[2], b[2])
            for t, a, b in zip(that[distinct], low[distinct], high[distinct], strict=True)
        ]
    )
    expected = shapely.area(polygons)
    assert 0.2 < (expected > 0).mean() < 0.8
    clear = (expected == 0) | (expected > 1e-9)
    np.testing.assert_array_equal(meet[distinct][clear], expected[clear] > 0)
    large = expected[meet[distinct]] > 1e-6
    np.testing.assert_allclose(area[large], expected[meet[distinct]][large], rtol=1e-6)
    centre = shapely.get_coordinates(shapely.centroid(polygons[meet[distinct]][large]))
    np.testing.assert_allclose(centroid[large], centre, atol=1e-6 * FAR)


def test_two_parallel_strips_meet_in_their_common_strip() -> None:
    that = np.array([[[1.0, 0], [-1.0, 0], [0, 1.0]]])
    low, high = np.array([[0.0, -3.0, 0.0]]), np.array([[2.0, -1.0, 5.0]])
    turn = turns(that)
    assert strips_meet(turn, low, high, 0.0)[0]
    area, centroid = area_and_centroid(strips_polygon(that, turn, low, high))
    assert area[0] == pytest.approx(5.0)
    np.testing.assert_allclose(centroid[0], [1.5, 2.5])
    assert not strips_meet(turn, low, high - [[1.0, 0, 0]], 0.0)[0]  # they touch
    assert not strips_meet(turn, low, high - [[1.5, 0, 0]], 0.0)[0]


def test_clipping_keeps_the_half_plane() -> None:
    square = np.array([[[0, 0], [2, 0], [2, 2], [0, 2]]] * 4, dtype=float)
    normal = np.array([[1, 0], [1, 1], [1, 0], [1, 0]], dtype=float)
    clipped = clip_polygon(square, normal, np.array([0.5, 3.0, 9.0, -1.0]))
    assert np.isnan(clipped[3]).all()
    area, centroid = area_and_centroid(clipped[:3])
    np.testing.assert_allclose(area, [1.0, 3.5, 4.0])
    np.testing.assert_allclose(centroid[[0, 2]], [[0.25, 1], [1, 1]])


def test_a_strip_leaves_of_a_hull_what_an_overlay_leaves() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(500, 7, 2)) + 5 * rng.normal(size=(500, 1, 2))
    hulls = shapely.convex_hull(shapely.multipoints(shapely.points(points)))
    low, high = np.sort(points[..., 1].mean(axis=1) + rng.normal(size=(2, 500)), axis=0)
    area, centroid = hulls_in_strips(hulls, low, high)
    left = shapely.intersection(hulls, shapely.box(-FAR, low, FAR, high))
    np.testing.assert_allclose(area, shapely.area(left), rtol=1e-9, atol=1e-12)
    some = area > 1e-3
    assert 0.5 < some.mean() < 1
    centre = shapely.get_coordinates(shapely.centroid(left[some]))
    np.testing.assert_allclose(centroid[some], centre, rtol=1e-9, atol=1e-9)


def test_a_strip_may_end_on_a_hull_s_edges_and_a_segment_has_no_area() -> None:
    hulls = np.array([shapely.box(1, 2, 3, 4)] * 3 + [shapely.LineString([(0, 2), (1, 4)])])
    low, high = np.array([2.0, 1.0, 4.0, 0.0]), np.array([4.0, 3.0, 5.0, 9.0])
    area, centroid = hulls_in_strips(hulls, low, high)
    np.testing.assert_array_equal(area, [4, 2, 0, 0])
    np.testing.assert_allclose(centroid[:2], [[2, 3], [2, 2.5]])
    assert hulls_in_strips(hulls[:0], low[:0], high[:0])[0].shape == (0,)


def random_faces(
    rng: np.random.Generator, num_sets: int, *, flat: bool, num_holes: int = 1, apart: float = 0.7
) -> tuple[list[Face], Regions, Array]:
    """Sets of three random faces; `flat` sets have coplanar normals, phi = 0."""
    nhat = random_normals(rng, num_sets, 3)
    if flat:
        nhat[..., 2] = 0
        nhat /= np.linalg.norm(nhat, axis=2, keepdims=True)
        nhat = nhat @ Rotation.random(random_state=rng).as_matrix().T
    faces = []
    for n in nhat.reshape(-1, 3):
        Fx = np.cross(n, random_normals(rng))
        Fx /= np.linalg.norm(Fx)
        polygon = star(rng, 6, num_holes)
        faces.append(face(polygon, Fx, np.cross(-n, Fx), rng.uniform(-apart, apart, 3)))
    return faces, regions_of(faces), np.arange(3 * num_sets).reshape(-1, 3)


@pytest.mark.parametrize("flat", [False, True])
def test_extents_and_rl_are_those_of_the_projected_faces(flat: bool) -> None:
    regions, region = random_faces(np.random.default_rng(2), 60, flat=flat, apart=3.0)[1:]
    N, _ = sine_of_tips_plane(regions.nhat_TB_B[region])
    on = plane_directions(N, regions.nhat_TB_B[region])
    meet, low, high = region_rl(boundary(regions), region, on, 0.0)
    area, centre = on.polygon(low, high)
    assert 0.1 < meet.mean() < 0.95
    for m in range(len(region)):
        Px = on.nprime[m, 0]
        Py = np.cross(N[m], Px)
        R_l = box(-FAR, -FAR, FAR, FAR)
        for i in range(3):
            p_BV = _vertices(regions, int(region[m, i]))
            shadow = shapely.MultiPoint(np.c_[p_BV @ Px, p_BV @ Py])
            nprime = np.array([on.nprime[m, i] @ Px, on.nprime[m, i] @ Py])
            across = np.array([-nprime[1], nprime[0]])
            along = shapely.get_coordinates(shadow) @ across
            R_l &= strip(across, along.min(), along.max())
        assert meet[m] == (R_l.area > 1e-12)
        if R_l.area > 1e-6:
            assert area[m] == pytest.approx(R_l.area, rel=1e-6)
            c = shapely.get_coordinates(R_l.centroid)[0]
            np.testing.assert_allclose([centre[m] @ Px, centre[m] @ Py], c, atol=1e-7)
            assert centre[m] @ N[m] == pytest.approx(0, abs=1e-9)


def _vertices(regions: Regions, r: int) -> Array:
    polygon = shapely.get_coordinates(regions.polygon_F[r])
    return regions.p_BF[r] + polygon @ regions.R_BF[r, :, :2].T


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("gamma", [0.02, 0.3, 1.2])
def test_rs_spans_the_portions_that_wedges_cut_from_the_faces(flat: bool, gamma: float) -> None:
    rng = np.random.default_rng(3)
    regions, region = random_faces(rng, 60, flat=flat)[1:]
    N, _ = sine_of_tips_plane(regions.nhat_TB_B[region])
    on = plane_directions(N, regions.nhat_TB_B[region])
    apex = rng.uniform(-0.6, 0.6, (60, 3))
    apex -= np.einsum("mk,mk->m", apex, N)[:, None] * N
    low, high = strip_rs(boundary(regions), region, on, apex, np.full(60, gamma))
    num_empty = 0
    for m in range(60):
        heights = [
            _heights_in_wedges(regions, r, N[m], on.that[m, i], on.nprime[m, i], apex[m], gamma)
            for i, r in enumerate(region[m])
        ]
        if None in heights:
            num_empty += 1
            assert low[m] > high[m]
        else:
            assert low[m] == pytest.approx(max(h[0] for h in heights if h), abs=1e-9)
            assert high[m] == pytest.approx(min(h[1] for h in heights if h), abs=1e-9)
    assert num_empty < 50


def _heights_in_wedges(
    regions: Regions, r: int, N: Array, that: Array, nprime: Array, apex: Array, gamma: float
) -> tuple[float, float] | None:
    """Least and greatest N . p over the face within the double cone, in the face's coordinates."""
    axes, p_BF = regions.R_BF[r, :, :2], regions.p_BF[r]
    portions = []
    for side in (1, -1):
        portion = regions.polygon_F[r]
        for across in (that, -that):
            # across . (p - apex) <= tan(gamma) side nprime . (p - apex)
            g = across - side * np.tan(gamma) * nprime
            portion = portion & half_plane(g @ axes, g @ (apex - p_BF))
        portions.append(portion)
    xy = shapely.get_coordinates(shapely.union_all(portions))
    if not len(xy):
        return None
    heights = (p_BF + xy @ axes.T) @ N
    return float(heights.min()), float(heights.max())


def test_where_a_cone_misses_a_face_rs_is_empty() -> None:
    # Walls of a triangular prism, one of them moved far along itself.
    turn = 2 * np.pi / 3 * np.arange(3)
    outward = np.c_[np.cos(turn), np.sin(turn), np.zeros(3)]
    along = np.cross(Z, outward)
    wall = box(-1, 0, 1, 1)
    for shift, meets in ((0.0, True), (5.0, False)):
        shifts = [shift, 0, 0]
        regions = regions_of(
            [face(wall, t, Z, n + s * t) for n, t, s in zip(outward, along, shifts, strict=True)]
        )
        region = np.array([[0, 1, 2]])
        N, _ = sine_of_tips_plane(regions.nhat_TB_B[region])
        on = plane_directions(N, regions.nhat_TB_B[region])
        low, high = strip_rs(boundary(regions), region, on, np.zeros((1, 3)), np.array([0.3]))
        assert (low[0] < high[0]) == meets
        if meets:
            heights = sorted([N[0] @ Z * 0, N[0] @ Z * 1])
            np.testing.assert_allclose([low[0], high[0]], heights, atol=1e-12)


def test_projections_keep_holes_and_lose_nothing_but_the_slant() -> None:
    rng = np.random.default_rng(4)
    faces, regions, region = random_faces(rng, 20, flat=False, num_holes=2)
    N = random_normals(rng, 60)
    u = np.cross(N, random_normals(rng, 60))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(N, u)
    projected = project(regions, region.ravel(), u, v)
    for k, (shape, f) in enumerate(zip(projected, faces, strict=True)):
        axes = np.array([u[k], v[k]])
        A, o = axes @ f.R_BF[:, :2], axes @ f.p_BF
        expected = affine_transform(f.polygon_F, [*A.ravel(), *o])
        assert len(shape.interiors) == len(f.polygon_F.interiors)
        # Coordinates are rounded to 1e-11 of objects some units large.
        assert shape.symmetric_difference(expected).area < 1e-11 * expected.length
        assert shape.area == pytest.approx(f.polygon_F.area * abs(f.R_BF[:, 2] @ N[k]))


def test_extents_are_taken_over_whole_faces() -> None:
    ring = box(0, 0, 1, 2) - box(0.2, 0.2, 0.8, 0.8)
    regions = regions_of([top(ring, 3.0), bottom(box(5, 5, 6, 6), 0)])
    low, high = extents(boundary(regions), np.array([1, 0, 0]), np.array([X, X + Y, Z]))
    np.testing.assert_allclose(low, [5, 0, 3])
    np.testing.assert_allclose(high, [6, 3, 3])


def upright(*faces: Face) -> Opposed:
    """The set A_1, A_2, A_3 (or A_1, A_2) with n_bs = z."""
    regions = regions_of(faces)
    region = np.arange(3)[None] if len(faces) == 3 else np.array([[0, 1, 1]])
    return opposed(regions, region, Z[None])


def meets(*faces: Face) -> Bools:
    return parallel_faces_meet(upright(*faces), UNIT.length_slack, UNIT.area_slack)


PLATE = box(0, 0, 1, 1)


def test_a_face_that_opposes_either_of_two_is_opposed() -> None:
    near, far = bottom(PLATE, 0), bottom(box(5, 0, 6, 1), 0)
    assert meets(top(PLATE, 1), near, far)[0]
    assert meets(top(PLATE, 1), far, near)[0]
    assert not meets(top(box(0, 5, 1, 6), 1), near, far)[0]


def test_a_face_between_two_others_is_opposed() -> None:
    left, right = bottom(PLATE, 0), bottom(box(5, 0, 6, 1), 0)
    assert meets(top(box(2, 0, 3, 1), 1), left, right)[0]
    assert not meets(top(box(2, 1, 3, 2), 1), left, right)[0]  # it touches their hull
    assert not meets(top(box(7, 0, 8, 1), 1), left, right)[0]  # beyond both


def test_a_notch_of_one_face_is_not_between_two() -> None:
    # The notch of the left one touches that face alone: it is no part of A_aux1.
    left = bottom(PLATE - box(-1, 0.3, 0.5, 0.7), 0)
    right = bottom(box(5, 0, 6, 1), 0)
    assert not meets(top(box(0.1, 0.4, 0.2, 0.6), 1), left, right)[0]


def test_nested_faces_are_opposed_in_the_gap_between_them() -> None:
    ring, core = bottom(box(-3, -3, 3, 3) - box(-2, -2, 2, 2), 0), bottom(box(-1, -1, 1, 1), 0)
    assert meets(top(box(1.2, -0.2, 1.7, 0.2), 1), ring, core)[0]


def test_two_faces_meet_where_their_hulls_do() -> None:
    comb = box(0, 0, 5, 1) | box(0, 0, 1, 5) | box(4, 0, 5, 5)
    for tooth, expected in (((2, 2, 3, 3), True), ((6, 0, 7, 1), False), ((5, 0, 6, 1), False)):
        sets = upright(top(box(*tooth), 1), bottom(comb, 0))
        assert two_faces_meet(sets, UNIT.area_slack)[0] == expected


def test_no_rows_are_no_rows() -> None:
    regions = regions_of([top(PLATE, 1)])
    none, no_normals = np.empty((0, 3), dtype=np.int64), np.empty((0, 3))
    on = plane_directions(no_normals, np.empty((0, 3, 3)))
    edges = boundary(regions)
    met, low, high = region_rl(edges, none, on, 0.0)
    assert met.shape == (0,)
    assert on.polygon(low, high)[1].shape == (0, 3)
    low, high = strip_rs(edges, none, on, no_normals, np.empty(0))
    assert low.shape == high.shape == (0,)
    sets = opposed(regions, none, no_normals)
    assert parallel_faces_meet(sets, 0.0, 0.0).shape == (0,)
    assert two_faces_meet(sets, 0.0).shape == (0,)


def test_faces_that_cover_each_other_but_for_the_last_bit_face_each_other() -> None:
    # Two faces of a turned prism, seen along their normal: GEOS 3.14 says that these rectangles of
    # 0.143 share two points and no area.
    shadows = [
        [
            [0.19377786047321371, -0.334526606398591],
            [-0.30653020045002144, -0.23557832202943438],
            [-0.25194651055393313, 0.040410900260300975],
            [0.24836155036930202, -0.05853738410885567],
        ],
        [
            [0.24836155036930213, -0.05853738410885584],
            [-0.251946510553933, 0.040410900260300836],
            [-0.30653020045002133, -0.23557832202943438],
            [0.19377786047321383, -0.334526606398591],
        ],
    ]
    regions = regions_of([bottom(box(0, 0, 1, 1), 0), top(box(0, 0, 1, 1), 1)])
    corners = [[*point, z] for z, shadow in enumerate(shadows) for point in [*shadow, shadow[0]]]
    regions = replace(regions, p_BV=frozen(corners))
    faces = project(regions, np.arange(2), np.tile(X, (2, 1)), np.tile(Y, (2, 1)))
    sets = Opposed(np.array([[0, 1, 1]]), Z[None], X[None], Y[None], faces[None, [0, 1, 1]])
    assert parallel_faces_meet(sets, UNIT.length_slack, UNIT.area_slack).all()
    assert two_faces_meet(sets, UNIT.area_slack).all()
    assert shapely.intersection(*faces).area == pytest.approx(0.143480595109, abs=1e-11)
