"""Margin, least friction and escape: against closed forms and independent linear programs."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.convex import (
    MU_FLOOR,
    find_escape,
    find_internal_forces,
    friction_at,
    least_frictions,
)
from drake_polygrasp.certification.exact import (
    attained_margin,
    check_escaping_hinge,
    check_escaping_twist,
    check_force_closure,
)
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.wrenches.contacts import edge_forces, force_closure
from tests.support.common import (
    box_grasp,
    prism_grasp,
    random_contacts,
    random_rotations,
    wedge_grasp,
)
from tests.support.lp_judge import greatest_margin, is_force_closure


def arrays(grasp: Grasp) -> tuple[Array, Array, Array]:
    return grasp.p_BC, grasp.nhat_TB_B, grasp.mu


def internal_force(grasp: Grasp) -> Array:
    return find_internal_forces(*(values[None] for values in arrays(grasp)))[0]


def margin(p: Array, n: Array, mu: Array, x: Array) -> float:
    return attained_margin(p.tolist(), n.tolist(), mu.tolist(), x.tolist())


def holds(p: Array, n: Array, mu: Array, x: Array) -> bool:
    return check_force_closure(p.tolist(), n.tolist(), mu.tolist(), x.tolist()).ok


def held_contacts(num: int, seed: int) -> tuple[Array, Array, Array]:
    contacts = random_contacts(num, seed)
    closed = force_closure(*contacts)
    return tuple(values[closed] for values in contacts)


def test_the_internal_force_of_the_example():
    x = internal_force(box_grasp())
    np.testing.assert_allclose(x, [2.5, 2.5, -1.25], rtol=1e-12)
    assert margin(*arrays(box_grasp()), x) == pytest.approx(0.75, abs=1e-12)


def test_a_symmetric_prism_has_margin_one():
    assert margin(*arrays(prism_grasp()), internal_force(prism_grasp())) == pytest.approx(1.0)


def test_normal_forces_add_up_to_one_to_the_last_digits():
    p, n, mu = held_contacts(300, seed=1)
    f = edge_forces(p, find_internal_forces(p, n, mu))
    np.testing.assert_allclose((f * n).sum(axis=(1, 2)), 1, atol=1e-14)


def test_the_margin_attained_is_the_greatest_there_is():
    p, n, mu = held_contacts(400, seed=2)
    x = find_internal_forces(p, n, mu)
    for k in range(len(p)):
        attained = margin(p[k], n[k], mu[k], x[k])
        assert greatest_margin(p[k], n[k], mu[k], around=False) <= attained + 1e-6
        assert attained <= greatest_margin(p[k], n[k], mu[k], around=True) + 1e-6


@pytest.mark.parametrize("scale", [1e-3, 5.0])
def test_the_internal_force_scales_with_one_over_length_and_turns_with_the_frame(scale):
    p, n, mu = held_contacts(200, seed=3)
    R = random_rotations(1, np.random.default_rng(3))[0]
    x = find_internal_forces(p, n, mu)
    moved = find_internal_forces(scale * p @ R.T + [1.0, 2.0, 3.0], n @ R.T, mu)
    np.testing.assert_allclose(scale * moved, x, rtol=1e-5, atol=1e-5 * np.abs(x).max())


def least_friction(p: Array, n: Array, mu: Array, x: Array) -> tuple[float, Array]:
    """That of one grasp."""
    (answer,) = least_frictions(p[None], n[None], mu[None], x[None])
    return answer


def test_a_batch_answers_as_one_at_a_time():
    p, n, mu = random_contacts(30, seed=4)
    batch = find_internal_forces(p, n, mu)
    for k in range(30):
        one = find_internal_forces(p[k][None], n[k][None], mu[k][None])[0]
        np.testing.assert_array_equal(one, batch[k])


def test_least_frictions_of_a_batch_are_those_of_one_at_a_time():
    p, n, mu = held_contacts(120, seed=8)
    x = find_internal_forces(p, n, mu)
    for k, (mu_min, witness) in enumerate(least_frictions(p, n, mu, x)):
        one, alone = least_friction(p[k], n[k], mu[k], x[k])
        assert mu_min == one
        np.testing.assert_array_equal(witness, alone)


@pytest.mark.parametrize("phi", [0.05, 0.2, 0.28])
def test_converging_faces_need_friction_of_the_tangent_of_their_half_angle(phi):
    wedge = wedge_grasp(phi, 0.3)
    mu_min, x = least_friction(*arrays(wedge), internal_force(wedge))
    assert mu_min == pytest.approx(np.tan(phi), rel=1.1e-3)
    assert mu_min > np.tan(phi)
    assert holds(wedge.p_BC, wedge.nhat_TB_B, friction_at(wedge.mu, mu_min), x)


def test_parallel_faces_need_hardly_any_friction():
    box = box_grasp()
    mu_min, x = least_friction(*arrays(box), internal_force(box))
    assert mu_min == 0.0
    np.testing.assert_allclose(friction_at(box.mu, mu_min), MU_FLOOR)
    assert holds(box.p_BC, box.nhat_TB_B, friction_at(box.mu, mu_min), x)


def test_friction_is_lowered_by_one_factor_and_never_raised():
    mu = np.array([0.2, 0.4, 0.1])
    np.testing.assert_allclose(friction_at(mu, 0.2), [0.1, 0.2, 0.05])
    np.testing.assert_allclose(friction_at(mu, 0.0), mu * MU_FLOOR / 0.4)
    np.testing.assert_allclose(friction_at(1e-6 * mu, 0.0), 1e-6 * mu)


def test_the_least_friction_holds_and_a_little_less_does_not():
    p, n, mu = held_contacts(250, seed=5)
    for k in range(25):
        contacts = p[k], n[k], mu[k]
        x = find_internal_forces(*(values[None] for values in contacts))[0]
        mu_min, witness = least_friction(*contacts, x)
        assert 0 < mu_min <= mu[k].max()
        assert holds(p[k], n[k], friction_at(mu[k], mu_min), witness)
        less = friction_at(mu[k], mu_min / 1.0011)
        assert not force_closure(p[k][None], n[k][None], less[None])[0]
        assert not is_force_closure(p[k], n[k], less, around=False)


def test_whatever_does_not_hold_lets_the_object_escape_and_nothing_else_does():
    p, n, mu = random_contacts(400, seed=6)
    closed = force_closure(p, n, mu)
    for k in range(len(p)):
        escape = find_escape(p[k], n[k], mu[k])
        assert (escape is None) == closed[k]
        if escape is None:
            continue
        contacts = p[k].tolist(), n[k].tolist(), mu[k].tolist()
        if escape.hinge is not None:
            assert check_escaping_hinge(*contacts, escape.hinge).ok
            omega, v = escape.twist[:3], escape.twist[3:]
            on_axis = v + np.cross(omega, p[k][list(escape.hinge)])
            np.testing.assert_allclose(on_axis, 0, atol=1e-12)
        else:
            omega, v = escape.twist[:3].tolist(), escape.twist[3:].tolist()
            assert check_escaping_twist(*contacts, v, omega).ok


@pytest.mark.parametrize("scale", [1e-3, 5.0])
def test_an_escape_is_found_at_every_size(scale):
    p, n, mu = random_contacts(60, seed=7)
    closed = force_closure(p, n, mu)
    for k in np.flatnonzero(~closed):
        assert find_escape(scale * p[k] + scale, n[k], mu[k]) is not None


def test_contacts_on_one_face_let_go():
    p, _, mu = arrays(box_grasp())
    escape = find_escape(p, np.tile([0.0, 0.0, 1.0], (3, 1)), mu)
    assert escape is not None
