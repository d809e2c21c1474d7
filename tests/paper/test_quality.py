"""Section 6: equations 5 to 10 by hand, and Q of a cube and of triangular prisms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.quality import q_directions, q_orientation, q_positions
from drake_polygrasp.paper.reasons import Candidates, SetPlan
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.settings import Method
from tests.support.convex_polyhedra import prism
from tests.support.solids import X, Y, Z, cube, regular_polygon, scale_of, solid


def spokes(*degrees: float) -> Array:
    """Directions orthogonal to z."""
    turn = np.deg2rad(degrees)
    return np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])


def q_5(nhat: Array, *, parallel: bool = False) -> float:
    return float(q_directions(nhat[None], Z[None], parallel=parallel)[0])


def test_q4_falls_from_1_at_phi_0_to_0_at_alpha() -> None:
    found = q_orientation(np.array([0.0, 0.1, 0.3]), np.array([0.3, 0.4, 0.3]))
    np.testing.assert_allclose(found, [1, 0.75, 0])


def test_q5_of_even_normals_is_1() -> None:
    assert q_5(spokes(0, 120, 240)) == pytest.approx(1)


def test_q5_is_the_shortest_side_over_the_longest_where_the_triangle_holds_the_origin() -> None:
    # Chords of 2 sin(half the angle between): 100, 110 and 150 degrees.
    expected = np.sin(np.deg2rad(50)) / np.sin(np.deg2rad(75))
    assert q_5(spokes(0, 100, 210)) == pytest.approx(expected)
    assert q_5(spokes(0, 100, 150)) == 0.0


def test_q5_counts_the_origin_on_the_border() -> None:
    # On a cube every triple has an opposed pair.
    assert q_5(np.stack([X, -X, Y])) == pytest.approx(1 / np.sqrt(2))
    assert q_5(np.stack([Y, -X, X])) == pytest.approx(1 / np.sqrt(2))


def test_q5_of_exactly_opposed_parallel_faces_is_1() -> None:
    assert q_5(np.stack([-X, X, X]), parallel=True) == pytest.approx(1)


def test_q5_of_parallel_faces_on_both_sides_of_the_opposing_normal() -> None:
    # The projections are not normalised: those of A_2, A_3 are 0.2 sin apart, d_max is to A_1.
    nhat = spokes(180, 10, -10)
    expected = 1 - np.sin(np.deg2rad(10)) / np.sin(np.deg2rad(85))
    assert q_5(nhat, parallel=True) == pytest.approx(expected)
    assert q_5(spokes(180, 10, 20), parallel=True) == 0.0


def test_q5_projects_normals_that_are_oblique_to_the_plane() -> None:
    # Three normals 0.2 rad above the plane project to even spokes of one length.
    oblique = np.cos(0.2) * spokes(0, 120, 240) + np.sin(0.2) * Z
    assert q_5(oblique) == pytest.approx(1)


@given(st.integers(0, 2**32 - 1))
def test_q5_depends_on_neither_frame_nor_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nhat = spokes(*rng.uniform(0, 360, 3))[None]
    R = Rotation.random(random_state=rng).as_matrix()
    order = rng.permutation(3)
    for parallel in (False, True):
        np.testing.assert_allclose(
            q_directions((nhat @ R.T)[:, order], -R[None, :, 2], parallel=parallel),
            q_directions(nhat, Z[None], parallel=parallel),
            atol=1e-9,
        )


def test_q1_to_q3_on_both_scales_by_hand() -> None:
    lengths = np.array([0.0, 1.0, 4.0])
    d_2 = np.array([2.0, 2.0, 0.0])
    areas = np.array([1.0, 2.0, 4.0])
    on_paper = q_positions(lengths, d_2, areas, areas / 2, 2.0, "paper")
    np.testing.assert_allclose(on_paper, [[1, 0, 0.25], [0.75, 0, 0.5], [0, 1, 1]])
    on_object = q_positions(lengths, d_2, areas, 2 * areas, 2.0, "object")
    np.testing.assert_allclose(on_object, [[1, 0, 0.375], [0.5, 0, 0.75], [0, 1, 1]])


def test_nothing_over_nothing_counts_as_1() -> None:
    zero, one = np.zeros(2), np.ones(2)
    np.testing.assert_allclose(q_positions(zero, zero, one, one, 1.0, "paper"), 1)
    rounding = np.array([0.0, 1e-17])
    np.testing.assert_allclose(q_positions(rounding, rounding, one, one, 1.0, "paper"), 1)


def test_a_lone_set_off_the_centre_has_quality_0_as_the_text_gives_it() -> None:
    one = np.ones(1)
    np.testing.assert_allclose(q_positions(one, one, one, one, 2.0, "paper"), [[0, 0, 1]])
    np.testing.assert_allclose(q_positions(one, one, one, one, 2.0, "object"), [[0.5, 0.5, 0.25]])


def test_no_rows_are_no_rows() -> None:
    none = np.empty(0)
    assert q_orientation(none, none).shape == (0,)
    assert q_directions(np.empty((0, 3, 3)), np.empty((0, 3)), parallel=True).shape == (0,)
    for scale in ("paper", "object"):
        assert q_positions(none, none, none, none, 1.0, scale).shape == (0, 3)


def planned(object_: GraspObject, method: Method) -> tuple[Regions, SetPlan, Candidates]:
    regions, scale = erode(object_.polyhedron), scale_of(object_)
    plan = plan_sets(regions, scale.p_BBcm, scale.diameter, scale.rho, method)
    return regions, plan, plan.candidates


def test_every_set_of_a_cube_has_the_quality_known_by_hand() -> None:
    # Side a, eroded side b. Pairs: I^s = b b and I^p = a b; corners of three faces, with Pi_s
    # across the opposed two: I^s = a b and I^p = b b. All are centred on the centre of mass.
    a = 0.06
    _, plan, rows = planned(cube(a), "paper")
    b = a - 2 * 0.01 * np.sqrt(3) * a
    of_pair = plan.sets[rows.set_index, 2] < 0
    assert of_pair.sum() == 3
    assert (~of_pair).sum() == 12
    q_3 = (1 + b / a) / 2
    np.testing.assert_allclose(rows.q[of_pair], [[1, 1, q_3, 1, 1]] * 3, atol=1e-9)
    np.testing.assert_allclose(rows.q[~of_pair], [[1, 1, q_3, 1, 1 / np.sqrt(2)]] * 12, atol=1e-9)
    np.testing.assert_allclose(rows.Q[of_pair], q_3)


def test_the_walls_of_a_triangular_prism_have_the_quality_known_by_hand() -> None:
    # Circumradius R, height h, side s; c is eroded everywhere. R^s is h - 2 c high, and across a
    # wall's normal the hull of all three is s - c wide; P is the hexagon of inradius s/2 - c.
    R, h = 0.04, 0.02
    regions, plan, rows = planned(solid(prism(regular_polygon(3, R), h)), "enriched")
    s = R * np.sqrt(3)
    rho, L = np.hypot(R, h / 2), np.hypot(s, h)
    c = 0.01 * L
    I_s, I_p = (s - c) * (h - 2 * c), 2 * np.sqrt(3) * (s / 2 - c) ** 2
    assert I_s < rho**2 < I_p
    walls = np.flatnonzero(np.abs(regions.nhat_TB_B[:, 2]) < 0.5)
    (row,) = np.flatnonzero((plan.sets[rows.set_index] == walls).all(axis=1))
    np.testing.assert_allclose(np.abs(rows.nhat_B[row]), Z, atol=1e-12)
    expected = [1, 1, (I_s / rho**2 + 1) / 2, 1, 1]
    np.testing.assert_allclose(rows.q[row], expected, atol=1e-9)
