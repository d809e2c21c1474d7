"""Sections 4.1 and 4.2, orientation: the cap test is Proposition 2, and what follows from it."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.geometry.face_sets import pairs, triples
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.paper.orientation import (
    classify,
    friction_angle,
    least_ball_centre,
    least_opposing_friction,
    opposes,
    pair_opposes,
    sine_of_pair,
    sine_of_parallel,
    sine_of_tips_plane,
)
from tests.support.solids import X, Z, cube, regular_prism

seeds = st.integers(0, 2**32 - 1)


def random_normals(rng: np.random.Generator, *shape: int) -> Array:
    vectors = rng.normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def proposition_2(nhat: Array, alpha: Array) -> tuple[Bools, Array]:
    """The text's own test, with the interior of the hull, and how far it is from turning.

    0 is interior to the hull of directions of a plane iff no two neighbours are half a turn apart.
    """
    N = np.cross(nhat[:, 1] - nhat[:, 0], nhat[:, 2] - nhat[:, 0])
    N /= np.linalg.norm(N, axis=1, keepdims=True)
    sin_phi = np.einsum("mk,mk->m", N, nhat[:, 0])
    phi = np.abs(np.arcsin(sin_phi))
    Fx = nhat[:, 0] - sin_phi[:, None] * N
    Fx /= np.linalg.norm(Fx, axis=1, keepdims=True)
    Fy = np.cross(N, Fx)
    heading = np.arctan2(np.einsum("mk,mik->mi", Fy, nhat), np.einsum("mk,mik->mi", Fx, nhat))
    half = np.arccos(np.clip(np.cos(alpha) / np.cos(phi), -1, 1))[:, None]
    edges = np.sort(np.concatenate([heading - half, heading + half], axis=1) % (2 * np.pi), axis=1)
    gap = np.diff(np.c_[edges, edges[:, 0] + 2 * np.pi], axis=1).max(axis=1)
    doubt = np.minimum(np.abs(phi - alpha), np.where(phi < alpha, np.abs(gap - np.pi), np.inf))
    return (phi < alpha) & (gap < np.pi), doubt


def test_the_cap_test_is_proposition_2_on_random_normals() -> None:
    rng = np.random.default_rng(1)
    nhat, alpha = random_normals(rng, 60_000, 3), rng.uniform(0.05, 1.5, 60_000)
    # A third of them nearly parallel in two normals, a third nearly opposed.
    nhat[::3, 1] = nhat[::3, 0] + 1e-3 * nhat[::3, 1]
    nhat[1::3, 1] = -nhat[1::3, 0] + 1e-2 * nhat[1::3, 1]
    nhat /= np.linalg.norm(nhat, axis=-1, keepdims=True)
    expected, doubt = proposition_2(nhat, alpha)
    clear = doubt > 1e-6
    assert clear.mean() > 0.999
    assert 0.1 < expected.mean() < 0.9
    np.testing.assert_array_equal(opposes(nhat, alpha)[clear], expected[clear])


def spans(nhat: Array, alpha: float) -> bool:
    """Whether forces on the rims of the three cones add up to any vector, by a linear program."""
    turn = 2 * np.pi * np.arange(200) / 200
    cones = []
    for n in nhat:
        u, v = np.linalg.svd(n[None])[2][1:]
        ring = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
        cones.append(np.cos(alpha) * n + np.sin(alpha) * ring)
    forces = np.concatenate(cones)
    # They do iff some combination of all of them vanishes with positive weights, 1 at least.
    result = linprog(np.zeros(len(forces)), A_eq=forces.T, b_eq=np.zeros(3), bounds=(1, None))
    return bool(result.success)


def test_sets_that_oppose_are_those_whose_cones_span_all_forces() -> None:
    rng = np.random.default_rng(2)
    nhat, alpha = random_normals(rng, 150, 3), rng.uniform(0.1, 1.2, 150)
    _, doubt = proposition_2(nhat, alpha)
    for n, a, expected in zip(
        nhat[doubt > 0.01], alpha[doubt > 0.01], opposes(nhat, alpha)[doubt > 0.01], strict=True
    ):
        assert spans(n, float(a)) == expected


@given(seeds)
def test_no_force_of_a_set_that_does_not_oppose_pushes_back(seed: int) -> None:
    # The centre of the least cap is the direction that all cones lean towards.
    rng = np.random.default_rng(seed)
    nhat, alpha = random_normals(rng, 50, 3), rng.uniform(0.1, 1.5, 50)
    rejected = ~opposes(nhat, alpha)
    towards = least_ball_centre(nhat)[rejected]
    leaning = (
        np.einsum("mk,mik->mi", towards, nhat[rejected]) / np.linalg.norm(towards, axis=1)[:, None]
    )
    assert (leaning >= np.sin(alpha[rejected])[:, None] - 2e-9).all()


@given(seeds, st.sampled_from([0.0, 1e-15, 1e-12]))
def test_the_pair_test_is_the_triple_test_where_two_normals_coincide(
    seed: int, noise: float
) -> None:
    rng = np.random.default_rng(seed)
    pair, alpha = random_normals(rng, 200, 2), rng.uniform(0.05, 1.5, 200)
    triple = pair[:, [0, 0, 1]] + noise * rng.normal(size=(200, 3, 3))
    doubt = np.abs(sine_of_pair(pair) - np.sin(alpha))
    clear = doubt > 1e-8
    for order in permutations(range(3)):
        got = opposes(triple[:, order], alpha)
        np.testing.assert_array_equal(got[clear], pair_opposes(pair, alpha)[clear])


@given(seeds, st.floats(0.05, 1.5), st.floats(0, 0.5))
def test_more_friction_never_loses_a_face_set(seed: int, alpha: float, more: float) -> None:
    nhat = random_normals(np.random.default_rng(seed), 100, 3)
    less, greater = np.full(100, alpha), np.full(100, min(alpha + more, 1.57))
    assert not (opposes(nhat, less) & ~opposes(nhat, greater)).any()
    assert not (pair_opposes(nhat[:, :2], less) & ~pair_opposes(nhat[:, :2], greater)).any()


@given(seeds)
def test_orientation_depends_on_neither_frame_nor_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nhat, alpha = random_normals(rng, 100, 3), rng.uniform(0.05, 1.5, 100)
    R = Rotation.random(random_state=rng).as_matrix()
    clear = proposition_2(nhat, alpha)[1] > 1e-7
    for order in permutations(range(3)):
        there = (nhat @ R.T)[:, order]
        np.testing.assert_array_equal(opposes(there, alpha)[clear], opposes(nhat, alpha)[clear])


def hexagon_normals() -> Array:
    turn = np.pi / 3 * np.arange(6)
    return np.c_[np.cos(turn), np.sin(turn), np.zeros(6)]


def test_hexagonal_walls_two_apart_at_the_tangent_of_30_degrees_do_not_oppose() -> None:
    # Their normals make 120 degrees: phi = 30 degrees = alpha, exactly.
    n = hexagon_normals()
    for a in range(6):
        pair = n[None, [a, (a + 2) % 6]]
        assert not pair_opposes(pair, np.array([np.pi / 6]))[0]
        assert pair_opposes(pair, np.array([np.pi / 6 + 1e-6]))[0]
        touching = n[None, [a, (a + 1) % 6, (a + 2) % 6]]
        assert not opposes(touching, np.array([np.pi / 6]))[0]


@pytest.mark.parametrize("seed", range(20))
def test_top_and_two_hexagonal_walls_at_half_do_not_oppose(seed: int) -> None:
    # The tips z and two at 120 degrees: sin(phi) = 1 / sqrt(5), so tan(phi) = 1/2 = mu, exactly.
    n = hexagon_normals()
    R = Rotation.random(random_state=seed).as_matrix()
    triple = np.array([[Z, n[k], n[(k + 2) % 6]] for k in range(6)]) @ R.T
    np.testing.assert_allclose(sine_of_tips_plane(triple)[1], 1 / np.sqrt(5))
    assert not opposes(triple, friction_angle(np.full((6, 3), 0.5))).any()
    assert opposes(triple, friction_angle(np.full((6, 3), 0.5 + 1e-6))).all()


def test_coincident_normals_never_oppose() -> None:
    steep = np.array([np.pi / 2 - 1e-3])
    assert not opposes(np.array([[X, X, X]]), steep)[0]
    assert not pair_opposes(np.array([[X, X]]), steep)[0]


def test_friction_of_a_set_is_the_largest_of_its_faces() -> None:
    np.testing.assert_allclose(friction_angle(np.array([[0.1, 1.0, 0.5]])), np.pi / 4)


@given(seeds)
def test_the_least_ball_holds_the_tips_and_none_is_smaller(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tips = random_normals(rng, 50, 3)
    centre = least_ball_centre(tips)
    distance = np.linalg.norm(tips - centre[:, None], axis=2)
    on_it = distance >= distance.max(axis=1, keepdims=True) - 1e-9
    assert (on_it.sum(axis=1) >= 2).all()
    other = centre + rng.choice([1e-3, 0.1], (50, 1)) * random_normals(rng, 50)
    farther = np.linalg.norm(tips - other[:, None], axis=2).max(axis=1)
    assert (farther > distance.max(axis=1)).all()


@given(seeds)
def test_the_tips_plane_makes_one_angle_with_all_three_normals(seed: int) -> None:
    nhat = random_normals(np.random.default_rng(seed), 50, 3)
    N, sine = sine_of_tips_plane(nhat)
    leaning = np.einsum("mk,mik->mi", N, nhat)
    np.testing.assert_allclose(leaning, np.repeat(sine[:, None], 3, axis=1), atol=1e-7)
    assert (sine >= 0).all()


def test_parallel_sets_have_an_axis_in_all_three_cones_and_others_have_none() -> None:
    rng = np.random.default_rng(3)
    axis = random_normals(rng, 3000)
    nhat = axis[:, None] * [[[1], [1], [-1]]] + rng.uniform(0, 1, (3000, 1, 1)) * random_normals(
        rng, 3000, 3
    )
    nhat /= np.linalg.norm(nhat, axis=2, keepdims=True)
    shuffled = rng.permuted(np.tile(np.arange(3), (3000, 1)), axis=1)
    nhat = np.take_along_axis(nhat, shuffled[..., None], axis=1)
    alpha = rng.uniform(0.1, 1.0, 3000)
    found = classify(nhat, alpha)
    rows = found.rows
    assert 0.2 < len(rows) / 3000 < 0.8
    # The closest pair is on one side, the third opposes it.
    close = np.stack([(nhat[:, (k + 1) % 3] * nhat[:, (k + 2) % 3]).sum(axis=1) for k in range(3)])
    opposing = close.argmax(axis=0)
    np.testing.assert_array_equal(found.opposing, opposing[rows])
    sign = np.where(np.arange(3) == opposing[:, None], -1, 1)
    along = np.einsum("mk,mik->mi", found.nhat_bs, nhat[rows]) * sign[rows]
    angle = np.arccos(np.clip(along, -1, 1))
    assert (angle < alpha[rows, None]).all()
    np.testing.assert_allclose(angle.max(axis=1), found.radius, atol=1e-7)
    others = random_normals(rng, 3000, 200)
    along = np.einsum("mok,mik->moi", others, sign[..., None] * nhat)
    in_cones = (along > np.cos(alpha)[:, None, None]).all(axis=2).any(axis=1)
    assert in_cones.any()
    assert set(np.flatnonzero(in_cones)) <= set(rows)


def test_a_step_is_parallel_and_the_face_alone_on_its_side_opposes() -> None:
    for opposing, signs in enumerate([(-1, 1, 1), (1, -1, 1), (1, 1, -1)]):
        found = classify(np.array(signs)[None, :, None] * Z, np.array([0.3]))
        assert found.rows.tolist() == [0]
        assert found.opposing.tolist() == [opposing]
        np.testing.assert_allclose(found.nhat_bs[0], Z)
        np.testing.assert_allclose(found.radius, 0, atol=1e-12)


def test_among_equally_close_pairs_the_least_cap_tells_who_opposes() -> None:
    # On a cube two faces and one that opposes the first: either of the opposed two may be alone,
    # and both caps are as wide; 45 degrees is what they need.
    nhat = np.array([[X, -X, Z]])
    assert classify(nhat, np.array([np.pi / 4 + 1e-6])).opposing.tolist() == [0]
    assert not len(classify(nhat, np.array([np.pi / 4])).rows)
    # Tilted by 0.1 the third leans towards one of them, whose pair with it is closer.
    leaning = np.array([np.sin(0.1), 0, np.cos(0.1)])
    found = classify(np.array([[X, -X, leaning]]), np.array([0.8]))
    assert found.opposing.tolist() == [1]
    np.testing.assert_allclose(found.radius, np.pi / 4 - 0.05)


def test_three_walls_of_a_triangular_prism_are_not_parallel() -> None:
    turn = 2 * np.pi / 3 * np.arange(3)
    nhat = np.c_[np.cos(turn), np.sin(turn), np.zeros(3)][None]
    assert opposes(nhat, np.array([0.3]))[0]
    assert not len(classify(nhat, np.array([0.3])).rows)
    np.testing.assert_allclose(sine_of_tips_plane(nhat)[1], 0, atol=1e-15)


def test_phi_of_a_step_is_that_of_its_opposed_pair() -> None:
    leaning = np.array([np.sin(0.2), 0, -np.cos(0.2)])
    np.testing.assert_allclose(sine_of_parallel(np.array([[leaning, Z, Z]])), np.sin(0.1))
    distinct = np.array([[-Z, Z, leaning * [-1, 1, -1]]])
    np.testing.assert_allclose(sine_of_parallel(distinct), sine_of_tips_plane(distinct)[1])


def test_the_friction_that_a_tetrahedron_needs() -> None:
    # tan(arcsin(1/3)) = 1 / sqrt(8), of any three of its faces.
    nhat = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    assert least_opposing_friction(nhat) == pytest.approx(1 / np.sqrt(8))


def test_the_least_opposing_friction_is_where_the_first_set_passes() -> None:
    nhat = random_normals(np.random.default_rng(5), 5)
    mu = least_opposing_friction(nhat)
    assert mu is not None
    triple, pair = nhat[np.concatenate(list(triples(5)))], nhat[pairs(5)]
    for factor, any_passes in ((1 - 1e-6, False), (1 + 1e-6, True)):
        alpha = np.arctan(mu * factor)
        passes = (
            opposes(triple, np.full(10, alpha)).any()
            or pair_opposes(pair, np.full(10, alpha)).any()
        )
        assert passes == any_passes


@pytest.mark.parametrize("nhat", [np.empty((0, 3)), Z[None], np.stack([Z, Z, Z])])
def test_no_friction_makes_faces_of_one_normal_oppose(nhat: Array) -> None:
    assert least_opposing_friction(nhat) is None


@pytest.mark.parametrize(
    ("name", "num_triples", "num_pairs"),
    # On a cube: the 3 opposed pairs, each with any of 4 other faces. On the triangular prism: its
    # caps with each other, with each of its 3 walls, and the 3 walls. On the hexagonal prism: its
    # 4 opposed pairs, each with any of 6 others, and the two triples of alternate walls.
    [("cube", 12, 3), ("triangular prism", 4, 1), ("hexagonal prism", 26, 4)],
)
def test_face_sets_of_named_solids(name: str, num_triples: int, num_pairs: int) -> None:
    shapes = {
        "cube": cube(),
        "triangular prism": regular_prism(3),
        "hexagonal prism": regular_prism(6),
    }
    nhat = erode(shapes[name].polyhedron).nhat_TB_B
    triple = np.concatenate(list(triples(len(nhat))))
    alpha = np.arctan(0.3)
    assert opposes(nhat[triple], np.full(len(triple), alpha)).sum() == num_triples
    pair = pairs(len(nhat))
    assert pair_opposes(nhat[pair], np.full(len(pair), alpha)).sum() == num_pairs


def test_no_rows_are_no_rows() -> None:
    none, no_angle = np.empty((0, 3, 3)), np.empty(0)
    assert opposes(none, no_angle).shape == (0,)
    assert pair_opposes(np.empty((0, 2, 3)), no_angle).shape == (0,)
    assert classify(none, no_angle).nhat_bs.shape == (0, 3)
    assert sine_of_parallel(none).shape == (0,)
