"""What the planner's constructions prove by themselves, held against linear programs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.orientation import sine_of_tips_plane
from drake_polygrasp.paper.reasons import Candidates
from drake_polygrasp.paper.stages import plan_sets
from tests.support.convex_polyhedra import ellipsoid_hull, holed_prism, prism, tangent_polyhedron
from tests.support.lp_judge import is_force_closure
from tests.support.solids import cube, regular_polygon, scale_of, solid

SIDES = 24
ROOM = 0.99
"""Below cos(pi / SIDES), what a polygon inside the friction circle leaves of it: where a theorem
holds with this part of the friction, its polygonal cones must be force closure too."""

random_state = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def room(p_BC: Array) -> float:
    """Twice the area of the contacts' triangle over the square of its longest side."""
    side = p_BC - np.roll(p_BC, 1, axis=0)
    area = np.linalg.norm(np.cross(side[0], side[1]))
    return float(area / np.square(side).sum(axis=1).max())


def holds(p_BC: Array, nhat: Array, mu: float) -> bool:
    """With polygonal cones inside the true ones: if it holds here, it holds."""
    return is_force_closure(p_BC, nhat, np.full(3, mu), around=False, sides=SIDES)


def may_hold(p_BC: Array, nhat: Array, mu: float) -> bool:
    """With polygonal cones around the true ones: if it fails here, it fails."""
    return is_force_closure(p_BC, nhat, np.full(3, mu), around=True, sides=SIDES)


def concurrent_grasp(rng: np.random.Generator, heading: Array, phi: float) -> tuple[Array, Array]:
    """Contacts whose projected normals, at the headings given, meet in one point of their plane.

    Every normal makes the angle phi with the plane, on its upper side; contacts may lie before or
    behind the common point.
    """
    nprime = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(3)])
    nhat = np.cos(phi) * nprime + np.sin(phi) * np.array([0, 0, 1])
    distance = rng.choice([-1, 1], (3, 1)) * rng.uniform(0.2, 1, (3, 1))
    R = Rotation.random(random_state=rng).as_matrix()
    return (distance * nprime) @ R.T + rng.normal(size=3), nhat @ R.T


def widest_gap(heading: Array) -> float:
    h = np.sort(heading % (2 * np.pi))
    return float(np.diff(np.append(h, h[0] + 2 * np.pi)).max())


@settings(max_examples=200)
@given(random_state, st.floats(0.1, 1.2), st.floats(0, 1))
def test_concurrent_forces_around_a_point_are_force_closure(
    rng: np.random.Generator, mu: float, leaning: float
) -> None:
    heading = rng.uniform(0, 2 * np.pi, 3)
    assume(widest_gap(heading) < np.pi - 0.02)  # 0 is interior to hull(n'_i)
    p_BC, nhat = concurrent_grasp(rng, heading, leaning * np.arctan(ROOM * mu))
    assume(room(p_BC) > 0.02)
    assert holds(p_BC, nhat, mu)


@settings(max_examples=100)
@given(random_state, st.floats(0.1, 1.0), st.floats(0.01, 0.3))
def test_normals_that_lean_out_of_the_plane_by_more_than_alpha_never_hold(
    rng: np.random.Generator, mu: float, excess: float
) -> None:
    alpha = np.arctan(mu / np.cos(np.pi / SIDES))
    p_BC, nhat = concurrent_grasp(rng, rng.uniform(0, 2 * np.pi, 3), alpha + excess)
    assert not may_hold(p_BC, nhat, mu)


@settings(max_examples=100)
@given(random_state, st.floats(0.1, 0.6))
def test_normals_within_a_half_plane_that_friction_cannot_leave_never_hold(
    rng: np.random.Generator, mu: float
) -> None:
    alpha = np.arctan(mu / np.cos(np.pi / SIDES))
    heading = rng.uniform(alpha + 0.01, np.pi - alpha - 0.01, 3)
    p_BC, nhat = concurrent_grasp(rng, heading, 0.0)
    assert not may_hold(p_BC, nhat, mu)


def opposed_grasp(rng: np.random.Generator, x: Array, mu: float) -> tuple[Array, Array]:
    """A_1 against A_2 and A_3, with normals within alpha of n_bs; x across n_bs."""
    p_BC = np.column_stack([x, rng.uniform(-1, 1, 3), np.zeros(3)])
    n_bs = np.array([[0, -1, 0], [0, 1, 0], [0, 1, 0]], dtype=float)
    tangent = rng.normal(size=(3, 3))
    tangent -= (tangent * n_bs).sum(axis=1, keepdims=True) * n_bs
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    tilt = np.arctan(ROOM * mu) * rng.uniform(0, 1, (3, 1))
    nhat = np.cos(tilt) * n_bs + np.sin(tilt) * tangent
    R = Rotation.random(random_state=rng).as_matrix()
    return p_BC @ R.T + rng.normal(size=3), nhat @ R.T


@settings(max_examples=200)
@given(random_state, st.floats(0.1, 1.2), st.floats(0.02, 1), st.floats(0.02, 1))
def test_parallel_forces_in_strict_order_are_force_closure(
    rng: np.random.Generator, mu: float, left: float, right: float
) -> None:
    p_BC, nhat = opposed_grasp(rng, np.array([0, -left, right]), mu)
    assume(room(p_BC) > 0.02)
    assert holds(p_BC, nhat, mu)


def test_a_force_beyond_both_others_does_not_hold_without_much_friction() -> None:
    nhat = np.array([[0, -1, 0], [0, 1, 0], [0, 1, 0]], dtype=float)
    in_order = np.array([[0, 1, 0], [-1, 0, 0], [1, 0, 0]], dtype=float)
    beyond = np.array([[2, 1, 0], [-1, 0, 0], [1, 0, 0]], dtype=float)
    assert holds(in_order, nhat, 0.05)
    assert not may_hold(beyond, nhat, 0.05)


@settings(max_examples=30)
@given(random_state)
def test_forces_in_strict_order_on_one_line_do_not_hold(rng: np.random.Generator) -> None:
    p_BC, nhat = opposed_grasp(rng, np.array([0.0, -0.5, 0.7]), 0.5)
    p_BC[2] = p_BC[0] + 1.4 * (p_BC[0] - p_BC[1])
    assert not may_hold(p_BC, nhat, 0.5)


# The same of what the planner constructs.

SOLIDS = {
    "cube": cube(),
    "triangular prism": solid(prism(regular_polygon(3), 0.05)),
    "hexagonal prism at its limit": solid(prism(regular_polygon(6), 0.05), mu=np.tan(np.pi / 6)),
    "tangent polyhedron": solid(tangent_polyhedron(9, 1), mu=0.5),
    "ellipsoid": solid(ellipsoid_hull(12, 2), mu=0.4),
    "holed prism": solid(holed_prism(6, 2, 0), mu=0.5),
}


def contacts(object_: GraspObject, *, parallel: bool) -> tuple[Regions, Candidates]:
    """The planner's sets with contacts that are not nearly collinear."""
    regions, scale = erode(object_.polyhedron), scale_of(object_)
    rows = plan_sets(
        regions, scale.p_BBcm, scale.diameter, scale.rho, "enriched" if parallel else "paper"
    ).candidates
    built = ~np.isnan(rows.p_BC).any(axis=(1, 2)) & (rows.is_parallel == parallel)
    roomy = np.array([room(p_BC) > 0.01 for p_BC in rows.p_BC])
    return regions, rows.take(built & roomy)


def some(rows: Candidates) -> Candidates:
    """Forty at most, evenly spread: each costs a linear program."""
    step = -(-len(rows.set_index) // 40)
    return rows.take(np.arange(0, len(rows.set_index), max(1, step)))


@pytest.mark.parametrize("name", SOLIDS)
def test_sets_that_the_planner_takes_for_parallel_hold(name: str) -> None:
    object_ = SOLIDS[name]
    mu = object_.polyhedron.faces[0].mu
    regions, rows = contacts(object_, parallel=True)
    rows = some(rows)
    assert len(rows.set_index)
    for region, p_BC in zip(rows.region, rows.p_BC, strict=True):
        # A cap that barely fits needs all of the true cone, of which polygons leave 99 percent.
        assert may_hold(p_BC, regions.nhat_TB_B[region], mu)
        assert holds(p_BC, regions.nhat_TB_B[region], mu / ROOM)


@pytest.mark.parametrize("name", [name for name in SOLIDS if name != "cube"])
def test_sets_around_a_point_that_the_planner_takes_for_non_parallel_hold(name: str) -> None:
    object_ = SOLIDS[name]
    mu = object_.polyhedron.faces[0].mu
    regions, rows = contacts(object_, parallel=False)
    nhat = regions.nhat_TB_B[rows.region]
    N, _ = sine_of_tips_plane(nhat)
    interior = np.array([surrounds(*row) for row in zip(nhat, N, strict=True)])
    rows = some(rows.take(interior))
    assert len(rows.set_index)
    for region, p_BC in zip(rows.region, rows.p_BC, strict=True):
        assert may_hold(p_BC, regions.nhat_TB_B[region], mu)
        assert holds(p_BC, regions.nhat_TB_B[region], mu / ROOM)


def surrounds(nhat: Array, N: Array) -> bool:
    """Whether 0 is well inside the hull of the normals' projections along N."""
    Fx = np.cross(N, nhat[0])
    Fy = np.cross(N, Fx)
    return widest_gap(np.arctan2(nhat @ Fy, nhat @ Fx)) < np.pi - 0.02
