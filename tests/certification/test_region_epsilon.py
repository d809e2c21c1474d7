"""Bounds of epsilon over regions, against closed forms, single contacts and sampled placements."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.certification.contact_regions import DiscPolygon
from drake_polygrasp.certification.region_epsilon import region_epsilon
from drake_polygrasp.certification.robustness import epsilon_interval, squeeze_force
from drake_polygrasp.vectors import unit
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound
from tests.support.common import random_contacts

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


def grasps_that_hold():
    p, n, mu = random_contacts(300, seed=11, mu=(0.4, 1.0))
    holds = force_closure(p, n, mu) & (epsilon_upper_bound(p, n, mu, ORIGIN, 1.0) > 0.05)
    return [(p[k], n[k], mu[k]) for k in np.flatnonzero(holds)]


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
        found = region_epsilon(polygons(p, n, 0.0), mu, ORIGIN, 1.0, mass=2.0)
        judge = epsilon_interval(p, n, mu, ORIGIN, 1.0)
        assert found.epsilon_lower <= judge.upper and judge.lower <= found.epsilon_upper
        assert 0.97 * found.epsilon_upper <= found.epsilon_lower <= found.epsilon_upper
        squeeze = squeeze_force(p, n, mu, ORIGIN, 1.0, 2.0)
        assert found.squeeze_force == pytest.approx(squeeze, rel=0.04)


def test_the_bounds_bracket_the_worst_of_placements():
    for p, n, mu in grasps_that_hold():
        regions = polygons(p, n, 0.03)
        found = region_epsilon(regions, mu, ORIGIN, 1.0)
        assert found.epsilon_lower >= 0.95 * found.epsilon_upper > 0
        sampled = least_sampled(regions, mu)
        # Of 400 placements, 200 are triples of corners, of which there are 512.
        assert found.epsilon_lower <= sampled and found.epsilon_upper <= 1.03 * sampled
