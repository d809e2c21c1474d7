"""The closed form and the support function, against known answers and independent judges."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.grasp import Grasp
from drake_polygrasp.wrenches.contacts import (
    contact_frames,
    edge_forces,
    force_closure,
    inner_forces,
    non_collinear,
)
from drake_polygrasp.wrenches.epsilon_bound import (
    FEW_ANGLES,
    NUM_ANGLES,
    critical_directions,
    epsilon_upper_bound,
)
from drake_polygrasp.wrenches.support import cone_wrenches, support
from tests.support.common import (
    RHO_BOX,
    box_grasp,
    collinear_contacts,
    grasp,
    lattice_contacts,
    prism_grasp,
    random_contacts,
    random_rotations,
    wedge_grasp,
)
from tests.support.lp_judge import is_force_closure


def closed_form(grasp_: Grasp) -> bool:
    return bool(force_closure(grasp_.p_BC[None], grasp_.nhat_TB_B[None], grasp_.mu[None])[0])


def judge(grasp_: Grasp, *, around: bool) -> bool:
    return is_force_closure(grasp_.p_BC, grasp_.nhat_TB_B, grasp_.mu, around=around)


def test_edge_forces_balance_whatever_x_is():
    p, _, _ = random_contacts(100)
    f = edge_forces(p, np.random.default_rng(0).normal(size=(100, 3)))
    np.testing.assert_allclose(f.sum(axis=1), 0, atol=1e-14)
    np.testing.assert_allclose(np.cross(p, f).sum(axis=1), 0, atol=1e-14)


def test_edge_forces_of_the_example():
    f = edge_forces(box_grasp().p_BC[None], np.array([[2.5, 2.5, -1.25]]))[0]
    np.testing.assert_allclose(f, [[-0.5, 0, 0], [0.25, 0, 0], [0.25, 0, 0]], atol=1e-15)


def test_contact_frames_are_right_handed_rotations():
    p, n, _ = random_contacts(100)
    frames = contact_frames(p, n)
    gram = frames @ frames.transpose(0, 1, 3, 2)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1)


# Where the paper's Proposition 1, taken as printed, errs.


def cones_share_a_point(grasp_: Grasp, reach: float) -> bool:
    """Condition C1, on a grid of the contacts' plane, which is that of B's x and z or x and y."""
    span = np.flatnonzero(np.ptp(grasp_.p_BC, axis=0) > 0)
    a, b = np.meshgrid(*[np.linspace(-reach, reach, 201)] * 2)
    points = np.zeros((*a.shape, 3))
    points[..., span[0]], points[..., span[1]] = a, b
    inside = np.ones(a.shape, dtype=bool)
    for p_i, n_i, mu_i in zip(grasp_.p_BC, grasp_.nhat_TB_B, grasp_.mu, strict=True):
        away = points - p_i
        inside &= (away @ n_i) * np.hypot(1, mu_i) >= np.linalg.norm(away, axis=-1)
    return bool(inside.any())


def test_c1_is_not_necessary_lower_cones_that_meet_above_the_upper_contact():
    contacts = grasp([[0, 0, 1], [1, 0, 0], [-1, 0, 0]], [[0, 0, -1], [0, 0, 1], [0, 0, 1]], 0.3)
    assert not cones_share_a_point(contacts, 5.0)
    assert closed_form(contacts)
    assert judge(contacts, around=False)


def test_c1_is_not_necessary_fingers_that_spread_inside_a_hole():
    contacts = prism_grasp(outward=True)
    assert not cones_share_a_point(contacts, 1.0)
    assert closed_form(contacts)
    assert judge(contacts, around=False)


def test_c2_needs_a_positive_span_forces_on_one_side_span_the_plane_and_meet():
    contacts = grasp([[0, 0, 0], [1, 0, 0], [0.5, 0, -0.2]], [[0, 0, 1]] * 3, 0.9)
    assert cones_share_a_point(contacts, 5.0)
    assert not closed_form(contacts)
    assert not judge(contacts, around=True)


def test_forces_opposed_in_the_plane_do_not_hold_when_the_plane_misses_the_cones():
    out, up = np.sin(0.5), np.cos(0.5)
    contacts = grasp(
        [[0, 0.1, 0], [1, 0, 0], [0, -0.1, 0]], [[out, 0, up], [-out, 0, up], [out, 0, up]], 0.3
    )
    assert not closed_form(contacts)
    assert not judge(contacts, around=True)


@pytest.mark.parametrize("phi", [0.05, 0.2, 0.5, 1.0])
def test_converging_faces_need_the_tangent_of_their_half_angle(phi):
    assert closed_form(wedge_grasp(phi, np.tan(phi) * 1.001))
    assert not closed_form(wedge_grasp(phi, np.tan(phi) * 0.999))
    assert not closed_form(wedge_grasp(phi, np.tan(phi)))


def test_collinear_contacts_turned_in_floating_point_are_not_force_closure():
    p, n, mu = collinear_contacts(1000)
    assert not non_collinear(p).any()
    assert not force_closure(p, n, mu).any()


def test_contacts_in_one_point_are_not_force_closure():
    p, n, mu = random_contacts(10)
    assert not force_closure(0 * p, n, mu).any()


@pytest.mark.parametrize("contacts", [random_contacts(1500), lattice_contacts(700)])
def test_the_closed_form_is_between_the_lenient_and_the_strict_linear_program(contacts):
    closed = force_closure(*contacts)
    assert 0.02 * len(closed) < closed.sum() < 0.5 * len(closed)
    for k, holds in enumerate(closed):
        p, n, mu = (values[k] for values in contacts)
        assert is_force_closure(p, n, mu, around=bool(holds)) == holds, k


@pytest.mark.parametrize("contacts", [random_contacts(1500), lattice_contacts(700)])
def test_inner_forces_are_in_the_cones_of_all_grasps_that_hold(contacts):
    p, n, mu = (values[force_closure(*contacts)] for values in contacts)
    f = edge_forces(p, inner_forces(p, n, mu))
    push = (f * n).sum(axis=2)
    slip = np.linalg.norm(f - push[..., None] * n, axis=2)
    assert len(p) > 10
    assert (slip < mu * push).all()


def test_the_closed_form_depends_on_neither_frame_nor_scale_nor_order():
    p, n, mu = random_contacts(2000, seed=3)
    R = random_rotations(1, np.random.default_rng(3))[0]
    order = [2, 0, 1]
    closed = force_closure(p, n, mu)
    moved = force_closure(0.003 * p[:, order] @ R.T + [5.0, 0, 0], n[:, order] @ R.T, mu[:, order])
    np.testing.assert_array_equal(closed, moved)


def test_more_friction_never_loses_a_grasp():
    p, n, mu = random_contacts(2000, seed=4)
    assert not (force_closure(p, n, mu) & ~force_closure(p, n, 1.1 * mu)).any()


def test_the_support_function_is_the_greatest_of_many_forces_in_the_cones():
    p, n, mu = random_contacts(5, seed=5)
    cones = cone_wrenches(p, n, mu, np.array([0.1, 0.2, 0.3]), 0.7)
    directions = np.random.default_rng(5).normal(size=(5, 40, 6))
    h, points = support(cones, directions)
    for k in range(5):
        for i in range(3):
            _, _, tangents = np.linalg.svd(n[k, i][None])
            angles = np.linspace(0, 2 * np.pi, 2000)
            rim = np.outer(np.cos(angles), tangents[1]) + np.outer(np.sin(angles), tangents[2])
            f = n[k, i] + mu[k, i] * rim
            wrenches = np.hstack([f, np.cross(p[k, i] - [0.1, 0.2, 0.3], f) / 0.7])
            brute = (wrenches @ directions[k].T).max(axis=0)
            np.testing.assert_allclose(h[k, :, i], brute, rtol=0, atol=1e-5)
            assert (h[k, :, i] >= brute - 1e-12).all()
    np.testing.assert_allclose((points * directions[:, :, None]).sum(-1), h, atol=1e-12)


def test_the_upper_bound_of_the_example_is_close():
    box = box_grasp()
    bound = epsilon_upper_bound(
        box.p_BC[None], box.nhat_TB_B[None], box.mu[None], np.zeros(3), RHO_BOX
    )
    assert 0.02448 <= bound[0] <= 1.05 * 0.02470


def test_no_direction_is_below_the_upper_bound_by_much_and_none_that_holds_has_zero():
    p, n, mu = random_contacts(400, seed=6)
    closed = force_closure(p, n, mu)
    p, n, mu = p[closed], n[closed], mu[closed]
    bound = epsilon_upper_bound(p, n, mu, np.zeros(3), 1.0)
    assert (bound > 0).all()
    directions = np.random.default_rng(6).normal(size=(len(p), 4000, 6))
    h, _ = support(cone_wrenches(p, n, mu, np.zeros(3), 1.0), directions)
    sampled = (h.max(axis=-1) / np.linalg.norm(directions, axis=-1)).min(axis=1)
    assert (bound < sampled).mean() > 0.95


@pytest.mark.parametrize("num_angles", [FEW_ANGLES, NUM_ANGLES])
@pytest.mark.parametrize("contacts", [random_contacts(400, seed=8), lattice_contacts(700, seed=8)])
def test_the_upper_bound_is_the_support_in_the_direction_where_it_is_attained(contacts, num_angles):
    spread = non_collinear(contacts[0])
    p, n, mu = (values[spread] for values in contacts)
    scale = np.array([0.01, -0.02, 0.005]), np.linalg.norm(p, axis=-1).max()
    w, least = critical_directions(p, n, mu, *scale, num_angles=num_angles)
    h, _ = support(cone_wrenches(p, n, mu, *scale), w)
    attained = np.maximum(h.max(axis=-1).min(axis=1), 0.0)
    np.testing.assert_allclose(np.linalg.norm(w, axis=-1), 1.0)
    np.testing.assert_allclose(least, attained, rtol=0, atol=1e-9)
    bound = epsilon_upper_bound(p, n, mu, *scale, num_angles)
    np.testing.assert_allclose(bound, attained, rtol=0, atol=1e-9)


def test_the_upper_bound_depends_on_neither_frame_nor_order_nor_batch():
    p, n, mu = random_contacts(600, seed=7)
    closed = force_closure(p, n, mu)
    p, n, mu = p[closed], n[closed], mu[closed]
    R = random_rotations(1, np.random.default_rng(7))[0]
    p_BBcm, shift, order = np.array([0.1, 0, 0]), np.array([1.0, 2, 3]), [1, 2, 0]
    bound = epsilon_upper_bound(p, n, mu, p_BBcm, 1.0)
    moved = epsilon_upper_bound(
        p[:, order] @ R.T + shift, n[:, order] @ R.T, mu[:, order], R @ p_BBcm + shift, 1.0
    )
    np.testing.assert_allclose(moved, bound, rtol=1e-4)
    alone = [epsilon_upper_bound(p[k:][:1], n[k:][:1], mu[k:][:1], p_BBcm, 1.0)[0] for k in (0, 5)]
    np.testing.assert_allclose(alone, bound[[0, 5]], rtol=1e-9)


def test_an_empty_batch_is_no_special_case():
    empty = np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3))
    assert force_closure(*empty).shape == (0,)
    assert inner_forces(*empty).shape == (0, 3)
    assert epsilon_upper_bound(*empty, np.zeros(3), 1.0).shape == (0,)
