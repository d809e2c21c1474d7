"""Improvement never loses, stays inside, and finds the best where that is known by hand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.robustness import epsilon_interval
from drake_polygrasp.geometry.face_sets import set_numbers
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.optimality import branch_and_bound
from drake_polygrasp.paper.reasons import has_contacts
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.search import local_improvement
from drake_polygrasp.search.face_support import contacts_on, points_in_faces, points_on
from drake_polygrasp.search.local_improvement import improved
from drake_polygrasp.search.selection import best_first, best_places, estimates, usable
from drake_polygrasp.search.triples import Triples
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import (
    FEW_ANGLES,
    critical_directions,
    epsilon_upper_bound,
)
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates, radii_of_lines
from tests.support.common import lattice_contacts, prism_grasp, random_contacts, random_rotations
from tests.support.convex_polyhedra import holed_prism, tangent_polyhedron
from tests.support.solids import cube, moved, regular_prism, solid

OBJECTS = {
    "cube": cube(),
    "octagonal prism": regular_prism(8, mu=0.5),
    "holed prism": solid(holed_prism(6, 1, 1)),
    "tangent polyhedron": solid(tangent_polyhedron(10, 0), mu=0.4),
}


def constructed(object_: GraspObject) -> tuple[Regions, Triples]:
    """The paper's grasps that hold, of best Q first."""
    regions = erode(object_.polyhedron)
    scale = object_.p_BBcm, object_.polyhedron.diameter, object_.rho
    rows = plan_sets(regions, *scale, "enriched").candidates
    rows = rows.take(has_contacts(rows.p_BC))
    mu = regions.mu[rows.region]
    rows = rows.take(force_closure(rows.p_BC, regions.nhat_TB_B[rows.region], mu))
    rows = rows.take(np.argsort(-rows.Q, kind="stable")[:12])
    return regions, Triples(rows.region, rows.p_BC)


def moved_by(
    object_: GraspObject, regions: Regions, starts: Triples, *rounds: int
) -> tuple[Array, Array]:
    return improved(regions, starts.region, starts.p_BC, object_.p_BBcm, object_.rho, rounds)


def epsilons(object_: GraspObject, regions: Regions, triples: Triples) -> Array:
    """By the judge, which shares no code with the planner."""
    nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    return np.array(
        [
            epsilon_interval(*grasp, object_.p_BBcm, object_.rho, relative_gap=0.005).lower
            for grasp in zip(triples.p_BC, nhat, mu, strict=True)
        ]
    )


@pytest.mark.parametrize("name", OBJECTS)
def test_no_grasp_becomes_worse_and_the_best_becomes_better(name: str) -> None:
    object_ = OBJECTS[name]
    regions, starts = constructed(object_)
    p_BC, estimate = moved_by(object_, regions, starts, *[12] * 8)
    before = epsilons(object_, regions, starts)
    after = epsilons(object_, regions, Triples(starts.region, p_BC))
    assert (after >= 0.95 * before).all()
    assert after.max() > before.max()
    assert np.median(after / before) > 1.05
    assert (estimate >= 0.99 * after).all()


@pytest.mark.parametrize("name", OBJECTS)
def test_contacts_stay_in_their_regions(name: str) -> None:
    object_ = OBJECTS[name]
    regions, starts = constructed(object_)
    p_BC, _ = moved_by(object_, regions, starts, *[12] * 5)
    p_FC = points_in_faces(regions, starts.region, p_BC)
    gap = shapely.distance(regions.polygon_F[starts.region], shapely.points(p_FC))
    assert gap.max() < 1e-9 * object_.polyhedron.diameter
    height = np.einsum(
        "mci,mci->mc", p_BC - regions.p_BF[starts.region], regions.nhat_TB_B[starts.region]
    )
    assert np.abs(height).max() < 1e-9 * object_.polyhedron.diameter


def test_no_rounds_change_nothing() -> None:
    regions, starts = constructed(OBJECTS["cube"])
    p_BC, _ = moved_by(OBJECTS["cube"], regions, starts)
    assert p_BC == pytest.approx(starts.p_BC)


def test_only_the_best_so_far_go_on() -> None:
    object_ = OBJECTS["tangent polyhedron"]
    regions, starts = constructed(object_)
    p_BC, estimate = moved_by(object_, regions, starts, 12)
    p_BC_later, later = moved_by(object_, regions, starts, 12, 3, 3)
    went_on = (p_BC_later != p_BC).any(axis=(1, 2))
    assert went_on.sum() == 3
    assert (later[went_on] > estimate[went_on]).all()
    assert estimate[went_on].min() >= np.sort(estimate)[-3]
    assert later[~went_on] == pytest.approx(estimate[~went_on])


def test_contacts_that_do_not_hold_are_no_grasp_to_compare_with() -> None:
    """All on one face, of which estimates, many of them high, say nothing."""
    object_ = OBJECTS["cube"]
    regions, starts = constructed(object_)
    scale = object_.p_BBcm, object_.rho
    corners = np.array([[[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]]])
    for face in range(6):
        region = np.full((1, 3), face)
        p_BC = points_on(regions, region, 0.01 * corners)
        _, estimate = improved(regions, region, p_BC, *scale, (1,) * 8)
        best, epsilon = branch_and_bound._improved(regions, region, p_BC, *scale)
        assert estimate.shape == (1,)
        assert not len(best.region)
        assert epsilon == 0.0
    best, epsilon = branch_and_bound._improved(regions, starts.region[:1], starts.p_BC[:1], *scale)
    assert len(usable(regions, best)) == 1
    assert epsilon > 0.0


def test_no_grasps_are_improved_to_none() -> None:
    regions, starts = constructed(OBJECTS["cube"])
    p_BC, estimate = moved_by(OBJECTS["cube"], regions, starts.take(slice(0)), 3, 2)
    assert p_BC.shape == (0, 3, 3)
    assert estimate.shape == (0,)


@pytest.mark.parametrize("name", OBJECTS)
def test_no_grasp_nearby_is_much_better_in_the_end(name: str) -> None:
    """By bounds, which estimates only approach, and of places drawn without any model."""
    object_ = OBJECTS[name]
    regions, starts = constructed(object_)
    scale = object_.p_BBcm, object_.rho
    p_BC, estimate = moved_by(object_, regions, starts, *[3] * 25)
    best = int(estimate.argmax())
    region = starts.region[[best]]
    p_FC = points_in_faces(regions, region, p_BC[[best]])
    rng = np.random.default_rng(8)
    length = 0.1 * object_.polyhedron.diameter * rng.random((4000, 1, 1))
    nearby = Triples(
        np.repeat(region, 4000, axis=0),
        points_on(regions, region, p_FC + length * rng.normal(size=(4000, 3, 2))),
    )
    nearby = nearby.take(usable(regions, nearby))
    assert len(nearby.region) > 100
    bound = epsilon_upper_bound(*contacts_on(regions, region, p_BC[[best]]), *scale)[0]
    others = epsilon_upper_bound(*contacts_on(regions, nearby.region, nearby.p_BC), *scale)
    assert others.max() < 1.02 * bound


@pytest.mark.parametrize("name", OBJECTS)
def test_slopes_foretell_radii(name: str) -> None:
    """Of the least radii, by steps thirty times as long as those that slopes are taken by."""
    object_ = OBJECTS[name]
    regions, starts = constructed(object_)
    scale = object_.p_BBcm, object_.rho
    p_FC = points_in_faces(regions, starts.region, starts.p_BC)
    step = np.full(len(p_FC), 1e-4 * object_.polyhedron.diameter)
    radii, slopes = local_improvement._linearised(regions, starts.region, p_FC, step, *scale)
    move = 3e-3 * object_.polyhedron.diameter * np.array([[0.8, -0.6], [0.0, 1.0], [-0.6, 0.8]])
    promised = (radii + np.einsum("mcxl,cx->ml", slopes, move)).min(axis=1)
    there, _ = local_improvement._linearised(regions, starts.region, p_FC + move, step, *scale)
    assert np.median(np.abs(promised / there[:, 0] - 1)) < 1e-3
    # Which is not for want of a change.
    assert np.median(np.abs(promised / radii[:, 0] - 1)) > 2e-3


def test_the_most_promising_places_are_found_among_all_combinations() -> None:
    rng = np.random.default_rng(4)
    radii = 1.0 + rng.random((5, local_improvement.NUM_RADII))
    slopes = rng.normal(size=(5, 3, 2, local_improvement.NUM_RADII))
    moves = rng.normal(size=(5, 4, 3, 2))
    found = local_improvement._most_promising(radii, slopes, 10.0 + moves, moves)
    for row in range(5):
        promised = {
            chosen: (radii[row] + np.einsum("cxl,cx->l", slopes[row], moves[row][chosen, range(3)]))
            for chosen in itertools.product(range(4), repeat=3)
        }
        best = max(promised, key=lambda chosen: promised[chosen].min())
        np.testing.assert_allclose(found[row], 10.0 + moves[row][best, range(3)])


def test_improvement_moves_with_the_object() -> None:
    object_ = OBJECTS["tangent polyhedron"]
    R = Rotation.random(random_state=3).as_matrix()
    there = moved(object_, R, [0.3, -0.1, 0.2])
    _, starts = constructed(object_)
    found = []
    for one, p_BC in ((object_, starts.p_BC), (there, starts.p_BC @ R.T + [0.3, -0.1, 0.2])):
        own = erode(one.polyhedron)
        found.append(moved_by(one, own, Triples(starts.region, p_BC), 12, 12)[1])
    # Moves are those of the frames of faces, which turned with the object.
    assert found[0] == pytest.approx(found[1], rel=1e-4)


@pytest.mark.parametrize("name", OBJECTS)
def test_starts_outside_or_without_force_closure_are_left_out(name: str) -> None:
    object_ = OBJECTS[name]
    regions, starts = constructed(object_)
    outside = Triples(starts.region, starts.p_BC + 0.01 * regions.R_BF[starts.region][..., 0] * 20)
    slipping = Triples(starts.region[:, [0, 0, 0]], starts.p_BC[:, [0, 0, 0]])
    assert len(usable(regions, starts)) == len(starts.region)
    for useless in (outside, slipping):
        assert not len(usable(regions, useless))


def test_starts_are_the_best_and_not_all_on_one_set() -> None:
    object_ = OBJECTS["octagonal prism"]
    regions, starts = constructed(object_)
    scale = object_.p_BBcm, object_.rho
    rows = best_places(starts.region, estimates(regions, starts, *scale), 5, 1)
    assert len(rows) == len(set(set_numbers(starts.region)[rows].tolist())) == 5
    nhat, mu = regions.nhat_TB_B[starts.region], regions.mu[starts.region]
    bound = epsilon_upper_bound(starts.p_BC, nhat, mu, *scale)
    assert rows[0] == best_first(bound)[0]
    assert (np.diff(bound[rows]) < 1e-6 * bound.max()).all()


def test_critical_directions_hold_the_nearest_facet() -> None:
    p_BC, nhat, mu = random_contacts(400, seed=4)
    holds = force_closure(p_BC, nhat, mu)
    contacts = p_BC[holds][:30], nhat[holds][:30], mu[holds][:30]
    zero = np.zeros(3)
    w, bound = critical_directions(*contacts, zero, 1.0)
    assert w.shape == (30, 12, 6)
    assert np.linalg.norm(w, axis=-1) == pytest.approx(1.0)
    exact = [
        epsilon_interval(*one, zero, 1.0, relative_gap=0.002) for one in zip(*contacts, strict=True)
    ]
    ratio = bound / [interval.upper for interval in exact]
    assert (bound >= [0.999 * interval.lower for interval in exact]).all()
    assert np.median(ratio) < 1.02
    assert np.quantile(ratio, 0.9) < 1.25


def test_three_contacts_around_a_prism_have_the_epsilon_of_a_small_tilt_exactly() -> None:
    grasp = prism_grasp(mu=0.4)
    contacts = grasp.p_BC[None], grasp.nhat_TB_B[None], grasp.mu[None]
    bound = epsilon_upper_bound(*contacts, np.zeros(3), 0.05)[0]
    exact = epsilon_interval(
        grasp.p_BC, grasp.nhat_TB_B, grasp.mu, np.zeros(3), 0.05, relative_gap=1e-3
    )
    assert exact.lower <= bound <= 1.01 * exact.upper


@pytest.mark.parametrize(
    "contacts", [random_contacts(20_000, seed=9), lattice_contacts(20_000, seed=9)]
)
def test_estimates_are_the_coarse_bounds_of_what_holds(
    contacts: tuple[Array, Array, Array],
) -> None:
    """Of random contacts and of those on a lattice, where many things coincide."""
    holds = force_closure(*contacts)
    p_BC, nhat, mu = (values[holds] for values in contacts)
    scale = np.array([0.01, -0.02, 0.005]), np.linalg.norm(p_BC, axis=-1).max()
    bound = epsilon_upper_bound(p_BC, nhat, mu, *scale, FEW_ANGLES)
    error = epsilon_estimates(p_BC, nhat, mu, *scale) / bound - 1
    assert len(error) > 100
    assert np.quantile(np.abs(error), 0.9) < 1e-4
    assert np.abs(error).max() < 0.01


def test_estimates_are_the_least_radii_of_lines() -> None:
    contacts = random_contacts(700, seed=6)  # several chunks
    estimate = epsilon_estimates(*contacts, np.zeros(3), 1.0)
    radii = radii_of_lines(*contacts, np.zeros(3), 1.0)
    assert radii.shape == (700, 2 * 6 * FEW_ANGLES)
    assert np.maximum(radii.min(axis=1), 0.0) == pytest.approx(estimate, rel=1e-5)


def test_estimates_of_contacts_that_cannot_hold_are_numbers() -> None:
    p_BC, nhat, mu = lattice_contacts(3000, seed=10)
    assert not force_closure(p_BC, nhat, mu).all()
    p_BC[:20, 1] = p_BC[:20, 0]
    p_BC[20:40] = p_BC[20:40, :1]
    estimate = epsilon_estimates(p_BC, nhat, mu, np.zeros(3), 1.0)
    assert np.isfinite(estimate).all()
    assert (estimate >= 0).all()
    assert epsilon_estimates(p_BC[:0], nhat[:0], mu[:0], np.zeros(3), 1.0).shape == (0,)


def test_critical_bounds_depend_on_neither_frame_nor_order() -> None:
    p_BC, nhat, mu = random_contacts(300, seed=2)
    holds = force_closure(p_BC, nhat, mu)
    p_BC, nhat, mu = p_BC[holds], nhat[holds], mu[holds]
    zero = np.zeros(3)
    _, here = critical_directions(p_BC, nhat, mu, zero, 1.0)
    R = random_rotations(1, np.random.default_rng(0))[0]
    order = [2, 0, 1]
    _, there = critical_directions(
        p_BC[:, order] @ R.T, nhat[:, order] @ R.T, mu[:, order], zero, 1.0
    )
    assert there == pytest.approx(here, rel=1e-6)
