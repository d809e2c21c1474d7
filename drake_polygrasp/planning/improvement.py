"""Beyond the paper: moves the three contacts within their regions while epsilon rises.

Section 7 puts contacts where forces balance simply, not where the grasp resists most. About each
grasp others are drawn whose contacts lie nearby, and the best of them takes its place. epsilon is
estimated for all at once, which costs less than knowing where to go: the least of many h(w) for
fixed directions w, with its slopes, misleads, for the weakest w turn as contacts move.
"""

from __future__ import annotations

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.geometry.polyhedron import Regions
from drake_polygrasp.planning.epsilon_estimate import epsilon_estimates
from drake_polygrasp.planning.face_support import contacts_on, points_in_faces, points_on
from drake_polygrasp.planning.planar import Shapes
from drake_polygrasp.wrench import force_closure

NEAREST = 0.02
"""Steps, times the square root of the largest region's area, ours: the least,"""
FARTHEST = 0.3
"""and the greatest, in the first round,"""
SHRINKING = 0.8
"""and by how much it is less in each round that follows."""
MOVING = 0.7
"""How likely a contact moves, ours: where two are best, the third should not spoil it."""
SEED = 1


def improved(
    regions: Regions,
    region: Ints,
    p_BC: Array,
    estimate: Array,
    p_BBcm: Array,
    rho: float,
    rounds: tuple[tuple[int, int], ...],
) -> tuple[Array, Array]:
    """Contacts moved to raise epsilon; none ends with a lower estimate than it began with.

    Args:
        regions: where contacts may be; their polygons may have several parts.
        region: region of each contact, shape (M, 3).
        p_BC: contact points in these regions that hold [m], shape (M, 3, 3).
        estimate: their `epsilon_estimates`, shape (M,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        rounds: how many grasps, the best so far, go on, and how many others are drawn about each.

    Returns:
        p_BC [m], shape (M, 3, 3), and their estimates, shape (M,).
    """
    rng = np.random.default_rng(SEED)
    polygons = regions.polygon_F[region]
    shapely.prepare(polygons)
    size = np.sqrt(regions.area[region].max(axis=1))
    p_FC, estimate = points_in_faces(regions, region, p_BC), estimate.copy()
    farthest = FARTHEST
    for num_grasps, num in rounds:
        rows = np.argsort(-estimate, kind="stable")[:num_grasps]
        length = NEAREST * (farthest / NEAREST) ** rng.random((len(rows), num, 1, 1))
        steps = rng.normal(size=(len(rows), num, 3, 2)) * length * size[rows, None, None, None]
        grasp, _, contact = moves = np.nonzero(rng.random(steps.shape[:3]) < MOVING)
        places = np.repeat(p_FC[rows, None], num, axis=1)
        places[moves] = _nearest_inside(
            polygons[rows[grasp], contact], places[moves] + steps[moves]
        )
        better = _estimates(regions, region[rows, None], places, estimate[rows], p_BBcm, rho)
        each, best = np.arange(len(rows)), better.argmax(axis=1)
        rises = better[each, best] > estimate[rows]
        p_FC[rows[rises]] = places[each, best][rises]
        estimate[rows[rises]] = better[each, best][rises]
        farthest = max(farthest * SHRINKING, NEAREST)
    return points_on(regions, region, p_FC), estimate


def _estimates(
    regions: Regions, region: Ints, p_FC: Array, least: Array, p_BBcm: Array, rho: float
) -> Array:
    """Of contacts (M, N, 3, 2) on regions (M, 1, 3), shape (M, N); 0 where that is at most `least`.

    And where contacts do not hold, of which the estimate says nothing.
    """
    p_BC = points_on(regions, region, p_FC).reshape(-1, 3, 3)
    region = np.broadcast_to(region, p_FC.shape[:-1]).reshape(-1, 3)
    contacts = contacts_on(regions, region, p_BC)
    estimate = epsilon_estimates(*contacts, p_BBcm, rho).reshape(p_FC.shape[:2])
    higher = estimate > least[:, None]
    rows = np.flatnonzero(higher)
    higher.flat[rows] = force_closure(*(values[rows] for values in contacts))
    return np.where(higher, estimate, 0.0)


def _nearest_inside(polygons: Shapes, points: Array) -> Array:
    """Points (N, 2), those outside their polygons (N,) moved to the nearest boundary."""
    outside = ~shapely.intersects_xy(polygons, points[:, 0], points[:, 1])
    links = shapely.shortest_line(polygons[outside], shapely.points(points[outside]))
    inside = points.copy()
    inside[outside] = shapely.get_coordinates(links)[::2]
    return inside
