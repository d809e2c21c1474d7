"""The intervals hold the truth, and what they promise the user keeps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.robustness import (
    GRAVITY,
    RELATIVE_GAP,
    epsilon_interval,
    epsilon_intervals,
    friction_tolerance,
    placement_tolerance,
    squeeze_force,
    squeeze_intervals,
    tilt_tolerance,
)
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.wrenches.contacts import contact_frames, force_closure
from drake_polygrasp.wrenches.support import cone_wrenches, support
from tests.support.common import (
    RHO_BOX,
    box_grasp,
    collinear_contacts,
    prism_grasp,
    random_contacts,
    random_rotations,
    squeeze_interval,
    wedge_grasp,
)
from tests.support.lp_judge import least_normal_force, polygon_wrenches

ORIGIN = np.zeros(3)
P_CM = np.array([0.1, -0.05, 0.02])


def arrays(grasp: Grasp) -> tuple[Array, Array, Array]:
    return grasp.p_BC, grasp.nhat_TB_B, grasp.mu


def held_contacts(num: int, seed: int) -> list[tuple[Array, Array, Array]]:
    """Contacts that hold, a tuple each."""
    contacts = random_contacts(60 * num, seed)
    closed = np.flatnonzero(force_closure(*contacts))[:num]
    return [tuple(values[k] for values in contacts) for k in closed]


HELD = [*held_contacts(12, seed=1), arrays(box_grasp()), arrays(prism_grasp())]


def rho_of(p: Array) -> float:
    return 1.1 * float(np.linalg.norm(p - P_CM, axis=1).max())


def hull_radius(p: Array, n: Array, mu: Array, *, around: bool, part: slice) -> float:
    G = polygon_wrenches(p, n, mu, sides=16, around=around, centre=P_CM, length=rho_of(p))
    facets = ConvexHull(G.T).equations
    return float((-facets[:, 6] / np.linalg.norm(facets[:, :6][:, part], axis=1)).min())


def test_the_figures_of_the_example():
    box = arrays(box_grasp())
    epsilon = epsilon_interval(*box, ORIGIN, RHO_BOX)
    assert epsilon.lower == pytest.approx(0.02440, abs=5e-6)
    assert epsilon.upper == pytest.approx(0.02484, abs=5e-6)
    fine = epsilon_interval(*box, ORIGIN, RHO_BOX, relative_gap=0.002)
    assert fine.lower == pytest.approx(0.02449, abs=5e-6)
    assert fine.upper == pytest.approx(0.02450, abs=5e-6)
    tolerance = placement_tolerance(epsilon.lower, box[2], RHO_BOX, edge_distance=0.03)
    assert tolerance == pytest.approx(0.00286, abs=5e-6)
    squeeze = squeeze_force(*box, ORIGIN, RHO_BOX, mass=1.0)
    assert 34.1 < squeeze <= 34.7
    assert GRAVITY / squeeze_interval(*box, ORIGIN, RHO_BOX).upper < 34.2


def test_epsilon_of_a_prism_with_little_friction_in_closed_form():
    # Normal forces are 1/3 each; friction along the axis, mu/3 at most, makes the wrenches
    # (F_z, torque / rho) of a zonotope. Its nearest facet is spanned by two of the contacts.
    mu, radius, rho = 1e-3, 0.05, 0.1
    prism = prism_grasp(mu, radius)
    columns = np.hstack([np.ones((3, 1)), prism.p_BC[:, :2] / rho])
    facet = np.cross(columns[0], columns[1])
    expected = mu / 3 * abs(facet @ columns[2]) / np.linalg.norm(facet)
    epsilon = epsilon_interval(*arrays(prism), ORIGIN, rho)
    assert epsilon.lower <= expected * (1 + 2 * mu)
    assert expected <= epsilon.upper * (1 + 2 * mu)


@pytest.mark.parametrize("contacts", HELD)
def test_epsilon_lies_in_its_interval(contacts):
    p, n, mu = contacts
    epsilon = epsilon_interval(p, n, mu, P_CM, rho_of(p))
    assert 0 < epsilon.lower <= epsilon.upper <= epsilon.lower / (1 - 1.001 * RELATIVE_GAP)
    assert hull_radius(p, n, mu, around=False, part=slice(6)) <= epsilon.upper * (1 + 1e-9)
    assert hull_radius(p, n, mu, around=True, part=slice(6)) >= epsilon.lower


@pytest.mark.parametrize("contacts", HELD)
def test_the_squeeze_radius_lies_in_its_interval(contacts):
    p, n, mu = contacts
    radius = squeeze_interval(p, n, mu, P_CM, rho_of(p))
    assert 0 < radius.lower <= radius.upper <= radius.lower / (1 - 1.001 * RELATIVE_GAP)
    assert hull_radius(p, n, mu, around=False, part=slice(3)) <= radius.upper * (1 + 1e-9)
    assert hull_radius(p, n, mu, around=True, part=slice(3)) >= radius.lower


@pytest.mark.parametrize("contacts", HELD)
def test_no_direction_supports_less_than_the_lower_end(contacts):
    p, n, mu = contacts
    epsilon = epsilon_interval(p, n, mu, P_CM, rho_of(p))
    cones = cone_wrenches(p[None], n[None], mu[None], P_CM, rho_of(p))
    directions = np.random.default_rng(0).normal(size=(1, 50000, 6))
    directions = np.concatenate([directions, epsilon.normals[None]], axis=1)
    h = support(cones, directions)[0].max(axis=-1) / np.linalg.norm(directions, axis=-1)
    assert h.min() >= epsilon.lower


@pytest.mark.parametrize("contacts", HELD)
def test_the_intervals_depend_on_neither_frame_nor_scale_nor_order(contacts):
    p, n, mu = contacts
    R = random_rotations(1, np.random.default_rng(2))[0]
    shift, order, scale = np.array([0.1, 0.2, 0.3]), [2, 0, 1], 0.01
    moved = scale * p[order] @ R.T + shift, n[order] @ R.T, mu[order]
    for interval in (epsilon_interval, squeeze_interval):
        here = interval(*contacts, P_CM, rho_of(p))
        there = interval(*moved, scale * R @ P_CM + shift, scale * rho_of(p))
        assert there.lower == pytest.approx(here.lower, rel=1e-9)
        assert there.upper == pytest.approx(here.upper, rel=1e-9)


def test_intervals_are_what_they_are_alone():
    contacts = [np.stack(each) for each in zip(*HELD, strict=True)]
    rho = max(rho_of(p) for p, _, _ in HELD)
    for intervals in (epsilon_intervals, squeeze_intervals):
        together = intervals(*contacts, P_CM, rho, relative_gap=0.005)
        for k, found in enumerate(together):
            (alone,) = intervals(
                *(each[k, None] for each in contacts), P_CM, rho, relative_gap=0.005
            )
            assert (found.lower, found.upper) == (alone.lower, alone.upper)
            np.testing.assert_array_equal(found.normals, alone.normals)


def test_what_does_not_hold_has_no_radius():
    wedge = wedge_grasp(0.5, 0.3)
    assert epsilon_interval(*arrays(wedge), ORIGIN, 0.2).lower == 0.0
    assert squeeze_force(*arrays(wedge), ORIGIN, 0.2, mass=1.0) is None
    p, n, mu = (values[0] for values in collinear_contacts(1))
    interval = epsilon_interval(p, n, mu, ORIGIN, 1.0)
    assert interval.lower == 0.0
    assert np.isfinite(interval.upper)


def test_a_finer_interval_meets_the_usual_one():
    for p, n, mu in HELD:
        for interval in (epsilon_interval, squeeze_interval):
            usual = interval(p, n, mu, P_CM, rho_of(p))
            fine = interval(p, n, mu, P_CM, rho_of(p), relative_gap=0.002)
            assert fine.upper - fine.lower <= 0.002 * fine.upper
            assert usual.lower <= fine.upper
            assert fine.lower <= usual.upper


def test_a_grasp_that_has_lost_is_given_up_early():
    p, n, mu = HELD[0]
    full = epsilon_interval(p, n, mu, P_CM, rho_of(p))
    lost = epsilon_interval(p, n, mu, P_CM, rho_of(p), at_least=2 * full.upper)
    assert len(lost.offsets) < len(full.offsets)
    assert lost.lower <= full.upper <= lost.upper * (1 + 1e-12)
    won = epsilon_interval(p, n, mu, P_CM, rho_of(p), at_least=0.5 * full.lower)
    assert (won.lower, won.upper) == (full.lower, full.upper)


def directions_in_tangent_planes(p: Array, n: Array, num: int, seed: int) -> Array:
    """Unit vectors along the faces, one for each contact, shape (num, 3, 3)."""
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi, (num, 3, 1))
    t = contact_frames(p[None], n[None])[0][:, 1:]
    return np.cos(angle) * t[:, 0] + np.sin(angle) * t[:, 1]


def all_hold(p: Array, n: Array, mu: Array) -> bool:
    shape = np.broadcast_shapes(p.shape, n.shape, (len(p), 3, 3))
    p, n = np.broadcast_to(p, shape), np.broadcast_to(n, shape)
    return bool(force_closure(p, n, np.broadcast_to(mu, shape[:2])).all())


def moved(p: Array, n: Array, distance: float, num: int = 500) -> Array:
    return p + distance * directions_in_tangent_planes(p, n, num, seed=3)


def tilted(p: Array, n: Array, angle: float, num: int = 500) -> Array:
    return np.cos(angle) * n + np.sin(angle) * directions_in_tangent_planes(p, n, num, seed=4)


@pytest.mark.parametrize("contacts", HELD)
def test_contacts_within_the_placement_tolerance_hold(contacts):
    p, n, mu = contacts
    epsilon = epsilon_interval(p, n, mu, P_CM, rho_of(p)).lower
    tolerance = placement_tolerance(epsilon, mu, rho_of(p))
    assert all_hold(moved(p, n, 0.999 * tolerance), n, mu)


@pytest.mark.parametrize("contacts", HELD)
def test_normals_within_the_tilt_tolerance_hold(contacts):
    p, n, mu = contacts
    epsilon = epsilon_interval(p, n, mu, P_CM, rho_of(p)).lower
    tolerance = tilt_tolerance(epsilon, p, mu, P_CM, rho_of(p))
    assert all_hold(np.broadcast_to(p, (500, 3, 3)), tilted(p, n, 0.999 * tolerance), mu)


@pytest.mark.parametrize("contacts", HELD)
def test_friction_within_its_tolerance_holds(contacts):
    p, n, mu = contacts
    epsilon = epsilon_interval(p, n, mu, P_CM, rho_of(p)).lower
    tolerance = friction_tolerance(epsilon, p, mu, P_CM, rho_of(p))
    assert 0 < tolerance <= mu.min()
    assert all_hold(p[None], n[None], mu - 0.999 * tolerance)


def test_far_beyond_the_tolerances_grasps_are_lost():
    lost = {"placement": 0, "tilt": 0, "friction": 0}
    for p, n, mu in HELD:
        rho = rho_of(p)
        epsilon = epsilon_interval(p, n, mu, P_CM, rho).lower
        placement = placement_tolerance(epsilon, mu, rho)
        tilt = tilt_tolerance(epsilon, p, mu, P_CM, rho)
        friction = friction_tolerance(epsilon, p, mu, P_CM, rho)
        lost["placement"] += not all_hold(moved(p, n, 10 * placement), n, mu)
        lost["tilt"] += not all_hold(np.broadcast_to(p, (500, 3, 3)), tilted(p, n, 10 * tilt), mu)
        weak = np.maximum(mu - 10 * friction, 1e-6)
        lost["friction"] += not all_hold(p[None], n[None], weak)
    assert all(count >= 5 for count in lost.values()), lost


def test_an_edge_nearer_than_the_tolerance_limits_it():
    mu = np.full(3, 0.3)
    free = placement_tolerance(0.02, mu, 0.1)
    assert placement_tolerance(0.02, mu, 0.1, edge_distance=free / 2) == free / 2
    assert placement_tolerance(0.02, mu, 0.1, edge_distance=2 * free) == free


@pytest.mark.parametrize("contacts", HELD[::3])
def test_the_squeeze_force_holds_the_weight_in_every_orientation_and_is_no_waste(contacts):
    p, n, mu = contacts
    squeeze = squeeze_force(p, n, mu, P_CM, rho_of(p), mass=2.0)
    weight = 2.0 * GRAVITY
    directions = np.random.default_rng(5).normal(size=(12, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for d in directions:
        needed = least_normal_force(p, n, mu, weight * d, P_CM, around=False)
        assert needed <= squeeze * 1.005
    radius = squeeze_interval(p, n, mu, P_CM, rho_of(p))
    force = np.linalg.norm(radius.normals[:, :3], axis=1)
    tightest = (radius.offsets / np.maximum(force, 1e-9)).argmin()
    worst = radius.normals[tightest, :3] / force[tightest]
    needed = least_normal_force(p, n, mu, weight * worst, P_CM, around=True)
    assert needed >= 0.95 * squeeze
