"""Section 7: contact points by hand, and what holds of all of them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Face
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.orientation import classify
from drake_polygrasp.paper.planar import Scale
from drake_polygrasp.paper.reasons import REASONS, Candidates, SetPlan
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.settings import Method
from tests.support.convex_polyhedra import ellipsoid_hull, holed_prism, prism, tangent_polyhedron
from tests.support.solids import (
    X,
    Y,
    Z,
    bottom,
    cube,
    face,
    regions_of,
    regular_prism,
    scale_of,
    solid,
    top,
)

box = shapely.box


def construct(
    p_BBcm: tuple[float, float, float], *faces: Face, method: Method = "paper"
) -> tuple[str, Array, Array]:
    """The outcome of the set of all faces: reason, region of each contact, and contacts."""
    plan = plan_sets(regions_of(faces, 10.0), np.array(p_BBcm), 10.0, 10.0, method)
    k = 0 if len(faces) == 3 else len(plan.sets) - 1
    rows = np.flatnonzero(plan.candidates.set_index == k)
    row = rows[-1] if len(rows) else slice(0, 0)
    return REASONS[plan.code[k]], plan.candidates.region[row], plan.candidates.p_BC[row]


def assert_contacts(found: tuple[str, Array, Array], regions: list[int], p_BC: list[Array]) -> None:
    reason, region, points = found
    assert reason == "not_evaluated"
    assert region.tolist() == regions
    np.testing.assert_allclose(points, p_BC, atol=1e-8)


# 7.3: two faces.


def test_two_faces_of_a_brick_have_two_contacts_at_the_quarters_of_the_longer() -> None:
    short, long = top(box(1, 0, 7, 2), 1), bottom(box(0, 0, 8, 2), 0)
    expected = [[4, 1, 1], [6, 1, 0], [2, 1, 0]]
    reason, region, p_BC = construct((4, 1, 0.5), short, long)
    assert reason == "not_evaluated"
    assert region.tolist() == [0, 1, 1]
    # P_2 and P_3 are equally far: either may come first.
    assert sorted(p_BC.tolist()) == pytest.approx(np.array(sorted(expected)))


def test_a_short_face_near_the_end_has_the_contact_nearest_to_the_centroid() -> None:
    # c_a of the trapezoid is at x = 37/6, left of A_1. P_2 is the middle of the longer part
    # of a_2; as far on the other side a_2 has ended.
    found = construct((5, 0.5, 0.5), top(box(7, 0, 9, 1), 1), bottom(box(0, 0, 10, 1), 0))
    assert_contacts(found, [0, 1, 1], [[7, 0.5, 1], [3.5, 0.5, 0], [10, 0.5, 0]])


def test_roles_follow_the_longer_segment_whichever_face_comes_first() -> None:
    found = construct((5, 0.5, 0.5), top(box(0, 0, 10, 1), 1), bottom(box(7, 0, 9, 1), 0))
    assert_contacts(found, [1, 0, 0], [[7, 0.5, 0], [3.5, 0.5, 1], [10, 0.5, 1]])


def test_a_line_of_force_may_run_through_a_hole_of_the_longer_face() -> None:
    # x_1 = 36.5 / 8.5 is over the hole, whose sides hold P_2 and P_3 at one distance from it.
    holed = box(0, 0, 10, 1) - box(4, 0.2, 6, 0.8)
    found = construct((5, 0.5, 0.5), top(box(0, 0, 7, 1), 1), bottom(holed, 0))
    x_1 = 36.5 / 8.5
    assert_contacts(found, [0, 1, 1], [[x_1, 0.5, 1], [8, 0.5, 0], [2 * x_1 - 8, 0.5, 0]])


def test_a_contact_needs_room_on_both_sides() -> None:
    # 2 percent of the longer face, 0.2, on either side of P_1.
    long = bottom(box(0, 0, 10, 0.1), 0)
    found = construct((5, 0.05, 0.5), top(box(9.75, 0, 12, 0.1), 1), long)
    assert_contacts(found, [0, 1, 1], [[9.75, 0.05, 1], [4.875, 0.05, 0], [10, 0.05, 0]])
    reason = construct((5, 0.05, 0.5), top(box(9.85, 0, 12, 0.1), 1), long)[0]
    assert reason == "wrong_order"


def test_opposite_faces_of_a_cube_hold_their_contacts_in_the_middle_and_at_the_quarters() -> None:
    object_ = cube(0.06)
    regions, scale = erode(object_.polyhedron), scale_of(object_)
    plan = plan_sets(regions, scale.p_BBcm, scale.diameter, scale.rho)
    quarter = (0.06 - 2 * 0.01 * scale.diameter) / 4
    pairs = np.flatnonzero(plan.sets[plan.candidates.set_index, 2] < 0)
    assert len(pairs) == 3
    for p_BC in plan.candidates.p_BC[pairs] - scale.p_BBcm:
        np.testing.assert_allclose(np.linalg.norm(p_BC[0]), 0.03)
        np.testing.assert_allclose((p_BC[1] + p_BC[2]) / 2, -p_BC[0], atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(p_BC[1] - p_BC[2]), 2 * quarter)


# 7.2: parallel faces, and two faces around a pocket.

STEP = (top(box(0, 0, 6, 1), 2), bottom(box(0, 0, 2, 1), 0), bottom(box(3, 0, 6, 1), 1))


def test_a_stepped_brick_is_held_on_both_steps() -> None:
    # c_a of the hull (0,0) (2,0) (6,1) (6,2) (0,2) is at x = 8/3. The middles of the steps' parts
    # are 5/3 and 11/6 from it: the farther is P_2, and the other moves as far.
    found = construct((3, 0.4, 1), *STEP)
    x_1 = 8 / 3
    assert_contacts(
        found, [0, 1, 2], [[x_1, 0.4, 2], [x_1 - 11 / 6, 0.4, 0], [x_1 + 11 / 6, 0.4, 1]]
    )


def test_a_spread_moves_the_contacts_toward_the_ends() -> None:
    # 0.9 of the way: 2/3 + 1.8 and 1/3 + 2.7 from x_1; the other step ends at 8/3.
    found = construct((3, 0.4, 1), *STEP, method="enriched")
    assert_contacts(found, [0, 1, 2], [[8 / 3, 0.4, 2], [0, 0.4, 0], [8 / 3 + 91 / 30, 0.4, 1]])


def test_a_face_that_opposes_beyond_both_others_is_out_of_order() -> None:
    # A_1 lies over the left one's far end only: all of the two others is on one side of it.
    left, right = bottom(box(0, 0, 3, 1), 0), bottom(box(4, 0, 9, 1), 0)
    assert construct((5, 0.5, 1), top(box(-5, 0, 0.1, 1), 1), left, right)[0] == "not_evaluated"
    reason = construct((5, 0.5, 1), top(box(-5, 0, -0.1, 1), 1), left, right)[0]
    assert reason in ("not_opposed", "wrong_order", "p_empty")


def test_a_pocket_is_held_from_both_of_its_sides() -> None:
    deep = box(0, 0, 10, 4) - box(1, 1, 8, 4)
    found = construct((5, 2, 0.5), top(box(0, 0, 10, 4), 1), bottom(deep, 0))
    # a_2 = [0, 1], a_3 = [8, 10]; c_a is at 5; the middles are 4.5 and 4 from it.
    assert_contacts(found, [0, 1, 1], [[5, 2, 1], [0.5, 2, 0], [9.5, 2, 0]])


# 7.1: non-parallel faces.


def walls(*widths: float) -> list[Face]:
    turn = 2 * np.pi / 3 * np.arange(3)
    outward = np.c_[np.cos(turn), np.sin(turn), np.zeros(3)]
    return [
        face(box(-w, 0, w, 1), np.cross(Z, n), Z, n) for n, w in zip(outward, widths, strict=True)
    ]


def test_the_walls_of_a_triangular_prism_are_held_in_their_middles() -> None:
    found = construct((0, 0, 0.4), *walls(1, 1, 1))
    expected = [f.p_BF + 0.4 * Z for f in walls(1, 1, 1)]
    assert_contacts(found, [0, 1, 2], expected)


def test_a_displaced_wall_moves_the_point_where_the_forces_meet() -> None:
    # The first wall spans y in [0.1, 0.3]: P is a trapezoid of centroid (0, 47/240), and of the
    # lines through it that along the third normal is nearest to c_a.
    n = np.array([[1, 0], [-0.5, np.sqrt(3) / 2], [-0.5, -np.sqrt(3) / 2]])
    t = np.column_stack([-n[:, 1], n[:, 0]])
    faces = walls(1, 0.5, 0.5)
    faces[0] = face(box(0.1, 0, 0.3, 1), Y, Z, X)
    ends = [[1, 0.1], [1, 0.3], *(n[1:] - t[1:] / 2), *(n[1:] + t[1:] / 2)]
    c_a = shapely.get_coordinates(shapely.MultiPoint(ends).convex_hull.centroid)[0]
    c_I = np.array([0, 47 / 240])
    assert np.abs(t @ (c_a - c_I)).argmin() == 2
    P_I = c_I + (c_a - c_I) @ n[2] / 2 * n[2]
    expected = n + (t @ P_I)[:, None] * t
    found = construct((0, 0, 0.4), *faces)
    assert_contacts(found, [0, 1, 2], np.c_[expected, np.full(3, 0.4)])


# What holds of all contacts.

SOLIDS = {
    "tangent polyhedron": (tangent_polyhedron(9, 1), 0.5),
    "ellipsoid": (ellipsoid_hull(10, 2), 0.4),
    "holed prism": (holed_prism(6, 2, 0), 0.5),
    "U": (prism(box(0, 0, 0.1, 0.08) - box(0.03, 0.03, 0.07, 0.09), 0.04), 0.3),
}


@cache
def planned(name: str, method: Method) -> tuple[GraspObject, Regions, SetPlan]:
    triangles, mu = SOLIDS[name]
    object_ = solid(triangles, mu=mu)
    regions, scale = erode(object_.polyhedron), scale_of(object_)
    return object_, regions, plan_sets(regions, scale.p_BBcm, scale.diameter, scale.rho, method)


def built(plan: SetPlan, *, parallel: bool) -> Candidates:
    rows = plan.candidates
    has_contacts = ~np.isnan(rows.p_BC).any(axis=(1, 2))
    chosen = rows.take(has_contacts & (rows.is_parallel == parallel))
    assert len(chosen.set_index)
    return chosen


@pytest.mark.parametrize("method", ["paper", "enriched"])
@pytest.mark.parametrize("name", SOLIDS)
def test_contacts_are_on_their_regions_and_on_one_plane(name: str, method: Method) -> None:
    object_, regions, plan = planned(name, method)
    slack = 10 * scale_of(object_).length_slack
    rows = plan.candidates.take(~np.isnan(plan.candidates.p_BC).any(axis=(1, 2)))
    for region, p_BC, N, p_BP in zip(rows.region, rows.p_BC, rows.nhat_B, rows.p_BP, strict=True):
        assert np.abs((p_BC - p_BP) @ N).max() < slack
        for r, p in zip(region, p_BC, strict=True):
            p_FC = regions.R_BF[r].T @ (p - regions.p_BF[r])
            assert abs(p_FC[2]) < slack
            assert regions.polygon_F[r].distance(shapely.Point(p_FC[:2])) < slack


@pytest.mark.parametrize("name", SOLIDS)
def test_forces_along_projected_normals_of_non_parallel_faces_meet_in_one_point(name: str) -> None:
    object_, regions, plan = planned(name, "paper")
    rows = built(plan, parallel=False)
    for region, p_BC, N in zip(rows.region, rows.p_BC, rows.nhat_B, strict=True):
        nhat = regions.nhat_TB_B[region]
        across = np.cross(N, nhat - (nhat @ N)[:, None] * N)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        # across_i . p = across_i . p_i for all three, and N . p = N . p_1
        A = np.vstack([across, N])
        b = np.append((across * p_BC).sum(axis=1), N @ p_BC[0])
        meeting = np.linalg.lstsq(A, b, rcond=None)[0]
        assert np.abs(A @ meeting - b).max() < 1e-7 * object_.polyhedron.diameter


def axis_of(nhat: Array) -> Array:
    """n_bs of parallel triples, shape (M, 3, 3) to (M, 3)."""
    return classify(nhat, np.full(len(nhat), np.pi / 2)).nhat_bs


@pytest.mark.parametrize("method", ["paper", "enriched"])
@pytest.mark.parametrize("name", SOLIDS)
def test_the_first_contact_of_parallel_faces_is_strictly_between_the_others(
    name: str, method: Method
) -> None:
    object_, regions, plan = planned(name, method)
    rows = built(plan, parallel=True)
    nhat = regions.nhat_TB_B[rows.region]
    of_pair = plan.sets[rows.set_index, 2] < 0
    n_bs = np.where(of_pair[:, None], nhat[:, 1] - nhat[:, 0], axis_of(nhat))
    across = np.cross(n_bs, rows.nhat_B)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    x = np.einsum("mik,mk->mi", rows.p_BC, across)
    slack = scale_of(object_).length_slack
    assert ((x[:, 1] - x[:, 0]) * (x[:, 2] - x[:, 0]) < -(slack**2)).all()
    if method == "paper":  # of two contacts on one face the farther comes first
        reach = np.abs(x[of_pair, 1:] - x[of_pair, :1])
        assert (reach[:, 0] >= reach[:, 1] - 10 * slack).all()


def test_a_prism_is_held_alike_in_every_third_of_a_turn() -> None:
    object_ = regular_prism(3)
    regions, scale = erode(object_.polyhedron), scale_of(object_)
    plan = plan_sets(regions, scale.p_BBcm, scale.diameter, scale.rho)
    upright = np.abs(regions.nhat_TB_B[:, 2]) < 0.5
    rows = upright[plan.candidates.region].all(axis=1)
    (p_BC,) = plan.candidates.p_BC[rows] - scale.p_BBcm
    np.testing.assert_allclose(np.linalg.norm(p_BC, axis=1), 0.02)
    np.testing.assert_allclose(p_BC.sum(axis=0), 0, atol=1e-12)


@pytest.mark.parametrize("size", [0.001, 5.0])
def test_tolerances_grow_with_the_object(size: float) -> None:
    object_ = cube(size)
    regions = erode(object_.polyhedron)
    scale = Scale(object_.p_BBcm, object_.rho, object_.polyhedron.diameter)
    plan = plan_sets(regions, scale.p_BBcm, scale.diameter, scale.rho)
    assert len(built(plan, parallel=True).Q) == 3
    assert len(built(plan, parallel=False).Q) == 12
