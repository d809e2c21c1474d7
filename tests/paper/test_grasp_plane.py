"""Section 5: every choice of the grasp plane, on faces for which it is known by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Face
from drake_polygrasp.geometry.regions import Regions, boundary
from drake_polygrasp.paper.grasp_plane import (
    FAN,
    Planes,
    fan_directions,
    inset,
    nonparallel_planes,
    opposed_planes,
    parallel_directions,
    ring_edges,
)
from drake_polygrasp.paper.planar import Scale
from drake_polygrasp.paper.position import Opposed, opposed, plane_directions
from drake_polygrasp.paper.two_faces import FIRST, OVERLAP, SECOND, choices, two_face_planes
from tests.support.solids import UNIT, X, Y, Z, bottom, face, regions_of, top

box = shapely.box


def centred_at(*p_BBcm: float) -> Scale:
    return Scale(np.array(p_BBcm), rho=10.0, diameter=10.0)


def upright(*faces: Face) -> tuple[Regions, Opposed]:
    """The set A_1, A_2, A_3 (or A_1, A_2) with n_bs = z."""
    regions = regions_of(faces)
    region = np.arange(3)[None] if len(faces) == 3 else np.array([[0, 1, 1]])
    return regions, opposed(regions, region, Z[None])


def in_body(sets: Opposed, direction: Array) -> Array:
    """Directions (u, v) of Pi_s as unit vectors of B, in the upper half of the plane."""
    vectors = direction[:, :1] * sets.u + direction[:, 1:] * sets.v
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    downward = (vectors[:, 1] < -1e-9) | ((np.abs(vectors[:, 1]) < 1e-9) & (vectors[:, 0] < 0))
    return np.where(downward[:, None], -vectors, vectors)


def s_e(*faces: Face) -> Array:
    """The tied directions of s_e for A_1, A_2, A_3, one row for each distinct one."""
    _, sets = upright(*faces)
    owner, direction = parallel_directions(sets, UNIT)
    assert (owner == 0).all()
    return np.unique(np.round(in_body(sets, direction), 9), axis=0)


# Parallel sets: s_e.


def test_se_joins_the_centroids_of_faces_side_by_side() -> None:
    left, right = bottom(box(-3, 0, -2, 1), 0), bottom(box(2, 0, 3, 1), 0)
    np.testing.assert_allclose(s_e(top(box(-0.5, 0, 0.5, 1), 1), left, right), [X])


def test_se_is_the_longest_line_through_both_faces() -> None:
    # g = (0, 1.5): l_e1 is level and meets neither face; l_e2 and l_e3 pass through one face each
    # and g; only the left face is reached by both, for the right one is tall.
    left, right = bottom(box(-3, 0, -2, 1), 0), bottom(box(2, -4, 3, 5), 0)
    A_1 = top(box(-0.1, 1.4, 0.1, 1.6), 1)
    l_e2 = np.array([2.5, 1.0, 0.0])
    np.testing.assert_allclose(s_e(A_1, left, right), [l_e2 / np.linalg.norm(l_e2)], atol=1e-8)


def test_se_is_the_hull_edge_between_both_faces_nearest_to_the_overlap() -> None:
    # Close to the upper edge of the hull, from (-3, 0.2) to (2, 4), no line of the three meets
    # both faces.
    small, large = bottom(box(-3, 0, -2.8, 0.2), 0), bottom(box(2, -4, 6, 4), 0)
    A_1 = top(box(-0.52, 2.03, -0.48, 2.07), 1)
    edge = np.array([5.0, 3.8, 0.0])
    np.testing.assert_allclose(s_e(A_1, small, large), [edge / np.linalg.norm(edge)], atol=1e-8)
    A_1 = top(box(-0.52, -1.97, -0.48, -1.93), 1)
    edge = np.array([-5.0, 4.0, 0.0])
    np.testing.assert_allclose(s_e(A_1, small, large), [edge / np.linalg.norm(edge)], atol=1e-8)


def test_concentric_faces_have_a_fan_for_se_and_its_longest_lines_win() -> None:
    # All three centroids coincide and no hull edge joins both faces: the diagonals of the outer
    # wall are the longest of the fan.
    ring, core = bottom(box(-3, -3, 3, 3) - box(-2, -2, 2, 2), 0), bottom(box(-1, -1, 1, 1), 0)
    diagonals = np.array([[-1, 1, 0], [1, 1, 0]]) / np.sqrt(2)
    np.testing.assert_allclose(s_e(top(box(-3, -3, 3, 3), 1), ring, core), diagonals, atol=1e-8)


def test_the_fan_has_eight_directions_from_the_longest_edge() -> None:
    directions = fan_directions(np.array([box(0, 0, 1, 3)]))[0]
    assert directions.shape == (FAN, 2)
    np.testing.assert_allclose(np.abs(directions[0]), [0, 1], atol=1e-12)
    turned = np.arccos(np.clip(directions @ directions[0], -1, 1))
    np.testing.assert_allclose(np.degrees(turned), 22.5 * np.arange(8), atol=1e-6)


# Pairs: R_maxT and l_u.


def l_u(first: Face, second: Face) -> tuple[int, Array]:
    _, sets = upright(first, second)
    rows = choices(sets, UNIT)
    assert len(set(rows.widest.tolist())) == 1
    return int(rows.widest[0]), np.unique(np.round(in_body(sets, rows.direction), 9), axis=0)


U = box(0, 0, 5, 6) - box(1.2, 1, 3.5, 6)
DEEP_U = box(0, 0, 5, 6) - box(0.5, 0.5, 4.5, 6)
PLATE = box(-1, -1, 6, 7)


def test_lu_is_the_longest_edge_of_the_overlap() -> None:
    shifted = box(1, 0, 5, 2)
    widest, direction = l_u(top(box(0, 0, 3, 2), 1), bottom(shifted, 0))
    assert widest == OVERLAP
    np.testing.assert_allclose(direction, [X, Y][::-1])  # the overlap is square: a tie
    widest, direction = l_u(top(box(0, 0, 4, 2), 1), bottom(shifted, 0))
    assert widest == OVERLAP
    np.testing.assert_allclose(direction, [X])
    widest, direction = l_u(top(U, 1), bottom(PLATE, 0))
    assert widest == OVERLAP
    np.testing.assert_allclose(direction, [Y])


def test_lu_of_a_triangle_may_have_vertices_in_its_middle() -> None:
    # The longest edge of the overlap is the hypotenuse, though one face has a vertex on it.
    triangle = shapely.Polygon([(0, 0), (4, 0), (0, 4)])
    divided = shapely.Polygon([(0, 0), (4, 0), (2, 2), (0, 4)])
    for first, second in ((triangle, divided), (divided, divided)):
        _, direction = l_u(top(first, 1), bottom(second, 0))
        np.testing.assert_allclose(direction, [(Y - X) / np.sqrt(2)], atol=1e-9)


def test_lu_of_a_deep_pocket_is_its_lid() -> None:
    assert l_u(top(DEEP_U, 1), bottom(PLATE, 0))[0] == FIRST
    widest, direction = l_u(bottom(PLATE, 0), top(DEEP_U, 1))
    assert widest == SECOND
    np.testing.assert_allclose(direction, [X])


def test_one_lid_of_the_hull_closes_both_pockets_of_a_comb() -> None:
    # The hull's edge spans both pockets, and its middle is on the tooth between them.
    comb = box(0, 0, 9, 1) | box(0, 0, 1, 6) | box(4, 0, 5, 6) | box(8, 0, 9, 6)
    widest, direction = l_u(top(box(5.5, 2, 7.5, 5), 1), bottom(comb, 0))
    assert widest == SECOND
    np.testing.assert_allclose(direction, [X])


def test_a_slanted_lid_is_found_in_any_frame() -> None:
    notch = shapely.Polygon([(0, 0), (8, 0), (8, 6), (6, 1), (1, 1), (0, 3)])
    plug = shapely.Polygon([(1.5, 1.5), (5.5, 1.5), (5.5, 3.5), (1.5, 2)])
    lid = np.array([8.0, 3.0, 0.0])
    for seed in range(10):
        R = Rotation.random(random_state=seed).as_matrix()
        faces = [
            face(plug, R[:, 0], R[:, 1], 5 * R[:, 2]),
            face(shapely.affinity.scale(notch, 1, -1, origin=(0, 0)), R[:, 0], -R[:, 1]),
        ]
        sets = opposed(regions_of(faces), np.array([[0, 1, 1]]), R[None, :, 2])
        rows = choices(sets, UNIT)
        assert rows.widest.tolist() == [SECOND]
        found = rows.direction[0, 0] * sets.u[0] + rows.direction[0, 1] * sets.v[0]
        np.testing.assert_allclose(np.cross(found, R @ lid), 0, atol=1e-9)


def test_a_hole_has_no_lid_but_a_fan() -> None:
    ring = box(0, 0, 8, 5) - box(1, 1, 7, 4)
    widest, direction = l_u(top(box(2, 2, 6, 3), 1), bottom(ring, 0))
    assert widest == SECOND
    angle = np.degrees(np.arctan2(direction[:, 1], direction[:, 0]))
    np.testing.assert_allclose(np.sort(angle), 22.5 * np.arange(8), atol=1e-6)


def test_the_overlap_wins_a_tie_of_areas() -> None:
    # The arms and the pocket between them are 3 x 2 each, and all of them are opposed.
    arms = box(0, 0, 9, 0.01) | box(0, 0, 3, 2) | box(6, 0, 9, 2)
    assert l_u(top(arms, 1), bottom(box(1, 0.5, 8, 2), 0))[0] == OVERLAP
    assert l_u(top(arms, 1), bottom(box(2, 0.5, 7, 2), 0))[0] == FIRST
    assert l_u(top(arms, 1), bottom(box(1.5, 0.5, 7.5, 2), 0))[0] == OVERLAP


def test_faces_beside_each_other_have_no_direction() -> None:
    _, sets = upright(top(box(0, 0, 1, 1), 1), bottom(box(5, 5, 6, 6), 0))
    assert not len(choices(sets, UNIT).owner)


# Position of the plane.


def heights(first: Face, second: Face, scale: Scale) -> set[tuple[float, float, float]]:
    """N and height of the planes of a pair, with N in the upper half of the plane."""
    regions, sets = upright(first, second)
    rows = choices(sets, scale)
    planes, _ = two_face_planes(boundary(regions), sets, rows, scale)
    sign = np.where(planes.nhat_B @ (3 * X + 2 * Y) > 0, 1, -1)
    values = np.column_stack([planes.nhat_B[:, :2] * sign[:, None], planes.height * sign])
    return {tuple(row) for row in np.round(values, 9).tolist()}


def test_a_plane_of_two_faces_passes_through_the_centre_of_mass_over_their_overlap() -> None:
    assert heights(top(U, 1), bottom(PLATE, 0), centred_at(0.6, 3, 0)) == {(1, 0, 0.6)}


def test_else_through_the_centroid_of_their_overlap() -> None:
    faces = top(box(0, 0, 2, 4), 1), bottom(PLATE, 0)
    assert heights(*faces, centred_at(3, 3, 0)) == {(1, 0, 1.0)}


def test_else_through_the_middle_of_the_longest_piece_of_lc() -> None:
    # The centroid of the U is in its notch, at y = 3; across l_u = y, L_c crosses the arms over
    # x in [0, 1.2] and [3.5, 5].
    assert heights(top(U, 1), bottom(PLATE, 0), centred_at(2, 3, 0)) == {(1, 0, 4.25)}


def test_where_lc_runs_between_two_parts_the_rule_for_three_faces_stands_in() -> None:
    # The overlap is two bars in line; across their length L_c passes between them.
    slotted = bottom(box(0, 0, 10, 3) - box(4, -1, 6, 2.5), 0)
    bar = top(box(0, 0, 10, 1), 1)
    assert heights(bar, slotted, centred_at(5, 0.4, 0)) == {(0, 1, 0.4)}
    F = box(0, 0, 10, 1)
    assert heights(bar, slotted, centred_at(5, 7, 0)) == {(0, 1, F.centroid.y)}


def test_a_plane_over_a_pocket_passes_through_the_centre_of_mass_or_the_centroid_of_f() -> None:
    # R^s along the lid spans y in [0, 6]; F is as wide as the hull of both faces.
    faces = top(DEEP_U, 1), bottom(PLATE, 0)
    assert heights(*faces, centred_at(2, 4, 0)) == {(0, 1, 4.0)}
    assert heights(*faces, centred_at(2, 9, 0)) == {(0, 1, 3.0)}


def test_a_plane_keeps_two_percent_from_the_ends_of_rs() -> None:
    assert heights(top(box(0, 0, 2, 4), 1), bottom(PLATE, 0), centred_at(0, 3, 0)) == {(1, 0, 0.04)}
    np.testing.assert_allclose(
        inset(np.array([0.0, 0.5, 9.0]), np.zeros(3), np.ones(3)), [0.02, 0.5, 0.98]
    )


def parallel_plane(direction: Array, scale: Scale, *faces: Face) -> Planes:
    regions, sets = upright(*faces)
    e = np.array([[direction @ sets.u[0], direction @ sets.v[0]]])
    return opposed_planes(boundary(regions), sets, np.array([0]), e, scale)[0]


def test_f_of_parallel_faces_by_hand() -> None:
    # Across s_e = x the faces share y in [1, 2]; the hull of all three is there x in [-3, 4].
    faces = top(box(0, 0, 1, 3), 1), bottom(box(-3, 1, -2, 4), 0), bottom(box(3, 0, 4, 2), 0)
    hull = shapely.union_all([box(0, 0, 1, 3), box(-3, 1, -2, 4), box(3, 0, 4, 2)]).convex_hull
    F = hull & box(-9, 1, 9, 2)
    planes = parallel_plane(X, centred_at(0, 1.3, 0), *faces)
    sign = planes.nhat_B[0] @ Y
    np.testing.assert_allclose(planes.nhat_B[0], sign * Y, atol=1e-12)
    assert sorted([sign * planes.low[0], sign * planes.high[0]]) == pytest.approx([1, 2])
    assert sign * planes.height[0] == pytest.approx(1.3)
    assert planes.area_s[0] == pytest.approx(F.area)
    assert planes.d_1[0] == pytest.approx(np.hypot(F.centroid.x, F.centroid.y - 1.3))
    # A centre of mass outside F: the plane holds its centroid.
    planes = parallel_plane(X, centred_at(0, 7, 0), *faces)
    assert sign * planes.height[0] == pytest.approx(F.centroid.y)


def test_faces_that_share_no_offset_have_no_plane() -> None:
    faces = top(box(0, 0, 1, 3), 1), bottom(box(-3, 3, -2, 4), 0), bottom(box(3, 0, 4, 2), 0)
    assert not len(parallel_plane(X, UNIT, *faces).owner)


# Non-parallel sets: Pi_s.


def prism_walls(*widths: float) -> Regions:
    """Walls two units high around the z axis, a third of a turn apart, of some widths."""
    turn = 2 * np.pi / 3 * np.arange(3)
    outward = np.c_[np.cos(turn), np.sin(turn), np.zeros(3)]
    return regions_of(
        [
            face(box(-w / 2, 0, w / 2, 2), np.cross(Z, n), Z, n)
            for n, w in zip(outward, widths, strict=True)
        ]
    )


def nonparallel(regions: Regions, scale: Scale) -> Planes:
    region = np.arange(3)[None]
    on = plane_directions(Z[None], regions.nhat_TB_B[None])
    low, high = np.array([0.0]), np.array([2.0])
    return nonparallel_planes(regions, boundary(regions), region, on, low, high, scale)


def test_the_largest_face_defines_pis_and_equal_ones_each() -> None:
    scale = centred_at(0, 0, 1.5)
    widest_first = nonparallel(prism_walls(1.2, 1, 1), scale)
    np.testing.assert_allclose(widest_first.along_B, [-X], atol=1e-12)
    assert widest_first.height.tolist() == [1.5]
    # Across the first wall's normal: itself, and the others' ends at sqrt(3)/2 + 1/4.
    half = np.sqrt(3) / 2 + 0.25
    assert widest_first.area_s[0] == pytest.approx(4 * half)
    assert widest_first.d_1[0] == pytest.approx(0.5)
    equal = nonparallel(prism_walls(1, 1, 1), scale)
    assert equal.owner.tolist() == [0, 0, 0]
    np.testing.assert_allclose(equal.area_s, 4 * half)


def test_edges_of_shapes_are_those_of_all_their_rings() -> None:
    ring = box(0, 0, 4, 4) - box(1, 1, 2, 2)
    both = shapely.MultiPolygon([ring, box(5, 5, 6, 7)])
    tail, head, owner = ring_edges(np.array([box(0, 0, 1, 1), both], dtype=object))
    assert np.bincount(owner).tolist() == [4, 12]
    length = np.bincount(owner, np.linalg.norm(head - tail, axis=1))
    np.testing.assert_allclose(length, [4, 16 + 4 + 6])


def test_no_rows_are_no_rows() -> None:
    regions, _ = upright(top(box(0, 0, 1, 1), 1), bottom(box(0, 0, 1, 1), 0))
    none = np.empty((0, 3), dtype=np.int64)
    sets = opposed(regions, none, np.empty((0, 3)))
    owner, direction = parallel_directions(sets, UNIT)
    assert owner.shape == (0,)
    assert direction.shape == (0, 2)
    on = plane_directions(np.empty((0, 3)), np.empty((0, 3, 3)))
    empty = np.empty(0)
    planes = nonparallel_planes(regions, boundary(regions), none, on, empty, empty, UNIT)
    assert planes.along_B.shape == (0, 3)
