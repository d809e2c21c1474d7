"""The least support over regions, tilts and centres of mass, against points of them."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import unit
from drake_polygrasp.wrenches.region_support import (
    PlanePolygons,
    least_support,
    least_tilted_support,
    load_reach,
    support_range,
    worst_centres_of_mass,
    worst_normals,
)


def polygon(rng: np.random.Generator, size: float) -> tuple[Array, Array]:
    """Corners on a circle of a random plane, and its unit normal."""
    nhat, e_1 = unit(rng.normal(size=(2, 3)))
    e_1 = unit(np.cross(nhat, e_1))
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 9)))[:, None]
    return (
        rng.normal(size=3) + size * (np.cos(angles) * e_1 + np.sin(angles) * np.cross(nhat, e_1)),
        nhat,
    )


def twists(rng: np.random.Generator, corners: Array, nhat: Array) -> Array:
    """Random ones, and some that leave a point of the polygon where it is or lift it."""
    w = rng.normal(size=(40, 6))
    inside = rng.dirichlet(np.ones(len(corners)), 20) @ corners
    w[20:, :3] = rng.normal(size=(20, 1)) * nhat - np.cross(w[20:, 3:], inside)
    return w


def alike(corners: Array, nhat: Array, mu: float, num: int) -> tuple[PlanePolygons, Array, Array]:
    """The same polygon, normal and friction for each of some twists."""
    polygons = PlanePolygons.of(np.tile(corners, (num, 1, 1)))
    return polygons, np.tile(nhat[:, None], num), np.full(num, mu)


def h_of(w: Array, r: Array, nhat: Array, mu: float) -> Array:
    """h of points and normals, by the definition, broadcast over all but the last axis."""
    u = w[..., :3] + np.cross(w[..., 3:], r)
    push = (u * nhat).sum(axis=-1)
    return push + mu * np.linalg.norm(u - push[..., None] * nhat, axis=-1)


@pytest.mark.parametrize("size", [0.02, 0.3])
@pytest.mark.parametrize("lean", [0.0, 0.1])
def test_no_point_of_a_polygon_has_less_support_than_the_least(size, lean):
    rng = np.random.default_rng(3)
    for mu in (0.1, 0.5, 1.0):
        corners, nhat = polygon(rng, size)
        w = twists(rng, corners, nhat)
        nhat = unit(nhat + lean * rng.normal(size=3))
        h, r = least_support(w.T, *alike(corners, nhat, mu, len(w)))
        np.testing.assert_allclose(h, h_of(w, r.T, nhat, mu), atol=1e-12)
        points = rng.dirichlet(np.full(len(corners), 0.5), 20000) @ corners
        sampled = h_of(w[:, None], points, nhat, mu).min(axis=1)
        assert (h <= sampled + 1e-12).all()
        # 20,000 points lie closer than a tenth of the polygon; h changes by (1 + mu) |omega|.
        slope = (1 + mu) * np.linalg.norm(w[:, 3:], axis=1)
        assert (sampled - h <= 0.1 * size * slope).all()


def test_a_hinge_through_the_polygon_has_no_support_there():
    # It turns about the y axis: the points (0, y, 0) do not move, all others slip or lift.
    square = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    turn = np.array([[0.0, 0, 0, 0, 1, 0]])
    h, r = least_support(turn.T, *alike(square, np.array([1.0, 0, 0]), 0.5, 1))
    assert h[0] == 0.0 and r[0, 0] == 0.0
    # Turned about z at (1, 0, 0) by one: u = (-y, x - 1, 0); along y, h = mu |y| + x - 1.
    turn = np.array([[0.0, -1, 0, 0, 0, 1]])
    h, r = least_support(turn.T, *alike(square, np.array([0.0, 1, 0]), 0.5, 1))
    assert h[0] == pytest.approx(-2.0, abs=1e-15)
    np.testing.assert_allclose(r[:, 0], [-1, 0, 0], atol=1e-15)


def test_one_point_is_a_polygon():
    rng = np.random.default_rng(0)
    w, r, nhat = rng.normal(size=(30, 6)), rng.normal(size=(1, 3)), unit(rng.normal(size=3))
    for corners in (r, np.tile(r, (4, 1))):
        h, _ = least_support(w.T, *alike(corners, nhat, 0.4, len(w)))
        np.testing.assert_allclose(h, h_of(w, r[0], nhat, 0.4), atol=1e-14)


def tilted(rng: np.random.Generator, nhat: Array, tilt: float, num: int) -> Array:
    sideways = rng.normal(size=(num, 3))
    sideways = unit(sideways - (sideways @ nhat)[:, None] * nhat)
    angles = tilt * np.sqrt(rng.uniform(size=(num, 1)))
    return np.cos(angles) * nhat + np.sin(angles) * sideways


def test_no_tilted_normal_has_less_support_than_the_worst():
    rng = np.random.default_rng(1)
    for mu in (0.1, 0.5, 1.0):
        nhat = unit(rng.normal(size=3))
        u = np.concatenate([rng.normal(size=(40, 3)), nhat + 0.05 * rng.normal(size=(20, 3))])
        u = np.concatenate([u, nhat - 2 * u[40:], nhat[None], -nhat[None]])
        twist = np.concatenate([u, np.zeros_like(u)], axis=1)
        stated, worst = worst_normals(u.T, nhat[:, None], np.array(mu), 0.1)
        worst = worst.T
        assert (worst @ nhat >= np.cos(0.1) - 1e-14).all()
        sampled = h_of(twist[:, None], np.zeros(3), tilted(rng, nhat, 0.1, 5000), mu).min(axis=1)
        least = h_of(twist, np.zeros(3), worst, mu)
        np.testing.assert_allclose(stated, least, atol=1e-12)
        assert (least <= sampled + 1e-12).all()
        # 5,000 normals of a cap of 0.1 rad are 0.005 apart.
        assert (sampled - least <= 0.005 * (1 + mu) * np.linalg.norm(u, axis=1)).all()


def test_a_point_with_a_normal_that_may_tilt_is_a_polygon_of_one_corner():
    rng = np.random.default_rng(11)
    corners, nhat = polygon(rng, 0.3)
    w, point = twists(rng, corners, nhat), corners[:1]
    for tilt in (0.0, 0.2):
        alone = least_tilted_support(w.T, *alike(point, nhat, 0.4, len(w)), tilt)
        thrice = alike(np.tile(point, (3, 1)), nhat, 0.4, len(w))
        triple = least_tilted_support(w.T, *thrice, tilt)
        for one, other in zip(alone, triple, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-12)


def test_what_a_tilted_contact_supports_is_attained_and_is_less_than_upright():
    rng = np.random.default_rng(2)
    for mu in (0.1, 0.5, 1.0):
        corners, nhat = polygon(rng, 0.1)
        w = twists(rng, corners, nhat)
        arguments = w.T, *alike(corners, nhat, mu, len(w))
        h, r, n = least_tilted_support(*arguments, 0.1)
        np.testing.assert_allclose(h, h_of(w, r.T, n.T, mu), atol=1e-12)
        assert (n.T @ nhat >= np.cos(0.1) - 1e-14).all()
        assert (h <= least_support(*arguments)[0] + 1e-12).all()


@pytest.mark.parametrize("tilt", [0.0, 0.1])
def test_least_supports_are_within_their_bounds(tilt):
    rng = np.random.default_rng(4)
    for mu in (0.0, 0.1, 0.5, 1.0):
        corners, nhat = polygon(rng, 0.1)
        w = twists(rng, corners, nhat)
        arguments = alike(corners, nhat, mu, len(w))
        centre = corners.mean(axis=0)
        radius = np.linalg.norm(corners - centre, axis=1).max()
        place = np.tile(centre[:, None], len(w)), np.full(len(w), radius)
        low, high = support_range(w.T, *place, *arguments[1:], tilt)
        h, _, _ = least_tilted_support(w.T, *arguments, tilt)
        assert (low <= h + 1e-12).all()
        assert (h <= high + 1e-12).all()
        np.testing.assert_allclose(high, h_of(w, centre, nhat, mu), atol=1e-12)


def test_the_reach_of_loads_about_centres_of_mass_near_by():
    rng = np.random.default_rng(0)
    w, s = rng.normal(size=(100, 6)), 0.05
    d = s * unit(rng.normal(size=(20000, 3)))
    moved = w[:, None, :3] + np.cross(w[:, None, 3:], d)
    force = np.linalg.norm(moved, axis=-1).max(axis=1)
    whole = np.hypot(force, np.linalg.norm(w[:, 3:], axis=1))
    worst = w[:, :3] + np.cross(w[:, 3:], worst_centres_of_mass(w, s))
    for forces_only, sampled in ((True, force), (False, whole)):
        reach = load_reach(w, s, forces_only=forces_only)
        # 20,000 points on a sphere miss its greatest value by 1e-4 of the radius.
        assert (sampled <= reach + 1e-12).all() and (reach <= sampled + 1e-3 * s * 5).all()
    attained = np.linalg.norm(worst, axis=1)
    np.testing.assert_allclose(attained, load_reach(w, s, forces_only=True), rtol=1e-12)
    # By hand: a unit force and a turn about an axis across it.
    by_hand = np.array([[1.0, 0, 0, 0, 2, 0]])
    assert load_reach(by_hand, 0.25)[0] == pytest.approx(np.sqrt(1.5**2 + 4))
    assert load_reach(by_hand, 0.25, forces_only=True)[0] == pytest.approx(1.5)
