"""Bounds of epsilon over regions, against closed forms, single contacts and sampled placements."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from drake_polygrasp.certification.contact_regions import DiscPolygon
from drake_polygrasp.certification.robustness import epsilon_interval, squeeze_force
from drake_polygrasp.region_bounds.region_epsilon import region_epsilon
from drake_polygrasp.region_bounds.region_task import RegionTask
from drake_polygrasp.region_bounds.steepest import Steepen
from drake_polygrasp.vectors import unit
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound
from tests.support.common import random_contacts, random_rotations

ORIGIN = np.zeros(3)


def polygons(p, n, radius: float, num: int = 8):
    """Regular polygons about contacts, points where the radius is 0."""
    regions = []
    for centre, nhat in zip(p, n, strict=True):
        first = unit(np.cross(nhat, np.eye(3)[np.abs(nhat).argmin()]))
        angle = 2 * np.pi * np.arange(num)[:, None] / num
        ring = np.cos(angle) * first + np.sin(angle) * np.cross(nhat, first)
        regions.append([DiscPolygon(centre + radius * ring, nhat)])
    return regions


def bounds_of(regions, mu, p_BBcm=ORIGIN, **errors):
    """The bounds of a grasp of an object of rho = 1."""
    return region_epsilon(RegionTask(regions, mu, p_BBcm, 1.0, **errors))


def grasps_that_hold():
    """Those of random grasps that hold, the strongest first."""
    p, n, mu = random_contacts(300, seed=11, mu=(0.4, 1.0))
    bound = epsilon_upper_bound(p, n, mu, ORIGIN, 1.0)
    holds = force_closure(p, n, mu) & (bound > 0.05)
    return [(p[k], n[k], mu[k]) for k in np.argsort(-bound) if holds[k]]


def samples(found_for, count: int, seed: int, tilt: float, loss: float, com: float):
    """Placements, normals, friction and centres of mass within errors, half of them extreme."""
    regions, mu = found_for
    rng = np.random.default_rng(seed)
    places, normals = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    for i, region in enumerate(regions):
        for k, s in enumerate(rng.integers(0, len(region), count)):
            corners = region[s].p_BV
            share = rng.dirichlet(np.full(len(corners), 0.2))
            if k % 2:
                share = np.eye(len(corners))[rng.integers(len(corners))]
            places[k, i], normals[k, i] = share @ corners, region[s].nhat_TB_B
    across = unit(np.cross(rng.normal(size=normals.shape), normals))
    angle = tilt * rng.choice([1.0, 0.5], (count, 3, 1))
    normals = np.cos(angle) * normals + np.sin(angle) * across
    d = com * unit(rng.normal(size=(count, 3)))
    return places, normals, np.tile((1 - loss) * mu, (count, 1)), d


def least_sampled(regions, mu, count=400, seed=0, tilt=0.0, loss=0.0, com=0.0, rho=1.0) -> float:
    p, n, friction, d = samples((regions, mu), count, seed, tilt, loss, com)
    return float(epsilon_upper_bound(p - d[:, None], n, friction, ORIGIN, rho, 32).min())


def test_regions_that_are_points_have_the_epsilon_and_squeeze_of_the_grasp():
    for p, n, mu in grasps_that_hold():
        found = bounds_of(polygons(p, n, 0.0), mu, mass=2.0)
        judge = epsilon_interval(p, n, mu, ORIGIN, 1.0)
        assert found.epsilon_lower <= judge.upper and judge.lower <= found.epsilon_upper
        assert 0.97 * found.epsilon_upper <= found.epsilon_lower <= found.epsilon_upper
        squeeze = squeeze_force(p, n, mu, ORIGIN, 1.0, 2.0)
        assert found.squeeze_force is not None
        assert 0.98 * squeeze <= found.squeeze_force <= squeeze / (1 - 0.1 - 0.02)


def test_the_bounds_bracket_the_worst_of_placements():
    for p, n, mu in grasps_that_hold():
        regions = polygons(p, n, 0.03)
        found = bounds_of(regions, mu)
        assert found.epsilon_lower >= 0.95 * found.epsilon_upper > 0
        sampled = least_sampled(regions, mu)
        # Of 400 placements, 200 are triples of corners, of which there are 512.
        assert found.epsilon_lower <= sampled and found.epsilon_upper <= 1.03 * sampled


def test_larger_regions_and_errors_leave_less():
    p, n, mu = grasps_that_hold()[0]
    by_radius = [bounds_of(polygons(p, n, r), mu) for r in (0, 0.02, 0.05, 0.1)]
    regions = polygons(p, n, 0.02)
    errors = [{}, {"tilt_error": 0.05}, {"tilt_error": 0.05, "friction_error": 0.1}]
    errors.append({**errors[-1], "com_error": 0.1})
    by_error = [bounds_of(regions, mu, mass=1.0, **each) for each in errors]
    for found in (by_radius, by_error):
        for one, more in itertools.pairwise(found):
            assert one.epsilon_lower > more.epsilon_lower > 0
            assert one.epsilon_upper > more.epsilon_upper
    squeezes = [found.squeeze_force for found in by_error]
    assert squeezes == sorted(squeezes)


def test_a_centre_of_mass_that_is_off_costs_no_more_than_the_shear():
    # (f, tau) to (f, tau - d x f) has the least singular value sqrt(1 + s^2 / 4) - s / 2.
    s = 0.1
    for p, n, mu in grasps_that_hold()[:5]:
        regions = polygons(p, n, 0.02)
        known = bounds_of(regions, mu)
        off = bounds_of(regions, mu, com_error=s)
        assert off.epsilon_upper >= (math.sqrt(1 + s * s / 4) - s / 2) * known.epsilon_lower
        assert off.epsilon_lower < known.epsilon_upper


@pytest.mark.parametrize(
    ("errors", "near"),
    [
        ({"tilt_error": 0.0, "friction_error": 0.0, "com_error": 0.0}, 0.97),
        ({"tilt_error": 0.06, "friction_error": 0.15, "com_error": 0.05}, 0.85),
    ],
)
def test_no_placement_withstands_less_than_the_lower_bound(errors, near):
    size = 0.0
    for seed, (p, n, mu) in enumerate(grasps_that_hold()[:8]):
        for radius in (0.02, 0.06):
            regions = polygons(p, n, radius)
            found = bounds_of(regions, mu, **errors)
            sampled = least_sampled(regions, mu, 300, seed, *errors.values())
            assert sampled >= found.epsilon_lower
            size = max(size, found.epsilon_lower / sampled)
    assert size > near


def test_the_squeeze_force_holds_the_weight_wherever_contacts_are():
    errors = {"tilt_error": 0.05, "friction_error": 0.1, "com_error": 0.05}
    for seed, (p, n, mu) in enumerate(grasps_that_hold()[:4]):
        regions = polygons(p, n, 0.02)
        squeeze = bounds_of(regions, mu, mass=1.0, **errors).squeeze_force
        # With torques divided by next to nothing, epsilon is the least force withstood.
        r_w = least_sampled(regions, mu, 200, seed, *errors.values(), rho=1e-6)
        if squeeze is not None:
            assert 0.68 * squeeze < 9.81 / r_w <= squeeze


def test_contacts_that_may_lose_the_grasp_have_no_bound():
    p, n, mu = grasps_that_hold()[0]
    far = bounds_of(polygons(p, n, 0.8), mu, mass=1.0)
    steep = bounds_of(polygons(p, n, 0.01), mu, mass=1.0, tilt_error=1.0)
    for found in (far, steep):
        assert (found.epsilon_lower, found.squeeze_force) == (0.0, None)
        assert found.proof.epsilon is None and found.proof.weight is None
    assert far.epsilon_upper == 0.0


def leaning_pieces(p, n, radius: float, lean: float, spread: float):
    """Three pieces about each contact, with normals that lean apart, curved by a spread."""
    regions = []
    for (piece,), nhat in zip(polygons(p, n, radius, 6), n, strict=True):
        regions.append(
            [
                DiscPolygon(piece.p_BV[[k, k + 1, (k + 2) % 6]], unit(nhat + lean * side), spread)
                for k in (0, 2, 4)
                for side in [unit(piece.p_BV[k] - p[n.tolist().index(nhat.tolist())])]
            ]
        )
    return regions


def test_regions_of_several_pieces_and_curved_ones_are_bounded():
    for seed, (p, n, mu) in enumerate(grasps_that_hold()[:3]):
        flat = bounds_of(leaning_pieces(p, n, 0.03, 0.0, 0.0), mu)
        regions = leaning_pieces(p, n, 0.03, 0.05, 0.0)
        found = bounds_of(regions, mu)
        sampled = least_sampled(regions, mu, 400, seed)
        assert 0.9 * sampled < found.epsilon_lower <= sampled
        # A normal that leans by 0.05 within a piece is one that tilts by 0.05.
        curved = bounds_of(leaning_pieces(p, n, 0.03, 0.0, math.tan(0.05)), mu)
        tilted = bounds_of(leaning_pieces(p, n, 0.03, 0.0, 0.0), mu, tilt_error=0.05)
        assert curved.epsilon_lower == pytest.approx(tilted.epsilon_lower, rel=0.03)
        assert curved.epsilon_lower < flat.epsilon_lower


def test_the_frame_and_the_order_of_contacts_do_not_matter():
    p, n, mu = grasps_that_hold()[1]
    regions = polygons(p, n, 0.03)
    first = bounds_of(regions, mu)
    shift = np.array([0.3, -2.0, 1.0])
    for R in random_rotations(4, np.random.default_rng(2)):
        order = [2, 0, 1]
        turned = [[DiscPolygon(regions[i][0].p_BV @ R.T + shift, n[i] @ R.T)] for i in order]
        found = bounds_of(turned, mu[order], shift)
        assert found.epsilon_lower == pytest.approx(first.epsilon_lower, rel=0.02)


def test_facets_high_enough_for_the_weight_are_not_swept_again(monkeypatch):
    swept = {False: 0, True: 0}
    together = Steepen.together.__func__

    def counted(kind, works):
        for work in works:
            swept[work.norm.forces_only] += len(work.w)
        return together(kind, works)

    monkeypatch.setattr(Steepen, "together", classmethod(counted))
    p, n, mu = grasps_that_hold()[0]
    regions = leaning_pieces(p, n, 0.03, 0.05, 0.02)
    bounds = bounds_of(regions, mu, mass=1.0, com_error=0.01)
    facets = bounds.proof.epsilon.simplices
    assert 0 < swept[True] < len(facets) / 2 < swept[False]
