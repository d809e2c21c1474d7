"""Twists of simplices, against nearest points of hulls that non-negative least squares find."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize, nnls

from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.steepest import _raised
from drake_polygrasp.wrenches.linear_systems import inverse_definite
from drake_polygrasp.wrenches.region_support import load_reach


def swept_simplices(count: int, seed: int):
    """Wrenches (6, J, 6 V) of simplices whose six points range a little, on one side of a plane."""
    rng = np.random.default_rng(seed)
    middles = rng.normal(size=(6, count, 6, 1))
    middles[0] = np.abs(middles[0]) + 0.05
    return (middles + 0.1 * rng.normal(size=(6, count, 6, 5))).reshape(6, count, -1)


def distance(a) -> float:
    """Of the convex hull of wrenches (6, N) from the origin."""
    # The nearest point is the residual of the last row's ones, scaled.
    weight = 1e4
    shares, _ = nnls(np.vstack([a, np.full((1, a.shape[1]), weight)]), [0.0] * 6 + [weight])
    return float(np.linalg.norm(a @ (shares / shares.sum())))


def start(count: int):
    return np.tile(np.eye(6)[0], (count, 1))


def test_values_are_distances_of_hulls_from_the_origin():
    a = swept_simplices(200, seed=1)
    w, value = _raised(
        a, start(200), LoadNorm(np.zeros(200), np.zeros(200, bool)), np.full(200, 9.0)
    )
    expected = [distance(a[:, j]) for j in range(200)]
    # Heights up to a thousandth below one are taken as enough.
    np.testing.assert_allclose(value, expected, rtol=2e-3)
    np.testing.assert_allclose(np.einsum("kjn,jk->jn", a, w).min(axis=1), value, rtol=1e-7)


def test_values_under_an_uncertain_centre_of_mass_are_those_of_a_general_solver():
    count, com = 20, 0.05
    a = swept_simplices(count, seed=2)
    norm = LoadNorm(np.full(count, com), np.zeros(count, bool))
    w, value = _raised(a, start(count), norm, np.full(count, 1e3))
    for j in range(count):
        found = minimize(
            lambda x: load_reach(x[None], com)[0],
            w[j] / np.einsum("kn,k->n", a[:, j], w[j]).min(),
            constraints={"type": "ineq", "fun": lambda x, j=j: x @ a[:, j] - 1.0},
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-12},
        )
        # The norm is replaced by quadratic ones, which leaves a percent at most.
        assert 0.99 / found.fun <= value[j] <= 1.001 / found.fun


@pytest.mark.parametrize("forces_only", [False, True])
def test_values_are_heights_over_the_norm(forces_only):
    count, com = 50, 0.05
    a = swept_simplices(count, seed=2)
    norm = LoadNorm(np.full(count, com), np.full(count, forces_only))
    w, value = _raised(a, start(count), norm, np.full(count, 1e3))
    heights = np.einsum("kjn,jk->jn", a, w).min(axis=1)
    # Twists are rounded to nine decimals after their values are taken.
    np.testing.assert_allclose(
        value, heights / load_reach(w, com, forces_only=forces_only), rtol=1e-6
    )


def test_no_twist_is_improved_beyond_what_is_asked():
    a = swept_simplices(50, seed=3)
    norm = LoadNorm(np.zeros(50), np.zeros(50, bool))
    _, most = _raised(a, start(50), norm, np.full(50, 9.0))
    _, value = _raised(a, start(50), norm, 0.5 * most)
    assert (value >= 0.5 * most).all()


def test_a_twist_is_the_same_to_the_last_bit_alone_and_among_others():
    count = 40
    a = swept_simplices(count, seed=5)
    norm = LoadNorm(np.full(count, 0.05), np.zeros(count, bool))
    together, values = _raised(a, start(count), norm, np.full(count, 1e3))
    for j in range(count):
        some = np.array([j])
        alone, value = _raised(a[:, some], start(1), norm.take(some), np.full(1, 1e3))
        assert (alone[0] == together[j]).all() and value[0] == values[j]


def test_hulls_around_the_origin_have_no_positive_value():
    rng = np.random.default_rng(4)
    a = rng.normal(size=(6, 10, 48))
    a = np.concatenate([a, -a], axis=2)
    _, value = _raised(a, start(10), LoadNorm(np.zeros(10), np.zeros(10, bool)), np.full(10, 9.0))
    assert (value <= 0.0).all()


def test_inverses_of_definite_matrices_give_the_identity():
    rows = np.random.default_rng(6).normal(size=(6, 6, 100))
    matrices = np.einsum("csj,ctj->stj", rows, rows)
    product = np.einsum("stj,tuj->suj", matrices, inverse_definite(matrices))
    # Their condition numbers reach 1e6.
    np.testing.assert_allclose(product, np.eye(6)[:, :, None] + np.zeros(100), atol=1e-7)
