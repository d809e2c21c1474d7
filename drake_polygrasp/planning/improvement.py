"""Beyond the paper: moves the three contacts within their regions while epsilon rises.

Section 7 puts contacts where forces balance simply, not where the grasp resists most. Each grasp
remembers the directions w in which it, or a grasp near it, was weakest; the least h over these is
a surrogate of epsilon that moves of contacts are tried against, all three at once (a pattern
search). What looks best is measured anew, which adds its own weakest directions, and kept only if
the measured bound rose: as in a method of cutting planes, no error of the surrogate lasts.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.epsilon_bound import critical_directions
from drake_polygrasp.geometry.polyhedron import Regions
from drake_polygrasp.planning.face_support import face_twists, points_in_faces, points_on
from drake_polygrasp.planning.planar import Shapes
from drake_polygrasp.wrench import force_closure

MOVES = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=float)
"""Of one contact: it stays or steps along either of two axes."""
STEPS = 3
"""Joint moves between measurements, ours."""
TURN = np.pi / 5.1
"""[rad], ours: how far the axes turn from step to step, so that they favour no direction."""
FIRST_STEP = 0.35
"""Times the square root of the largest region's area, ours."""
GROW, SHRINK = 1.3, 0.6
"""Of the step after a success and a failure, ours."""
PATIENCE = 6
"""Measurements in a row in which no grasp rises, before all end, ours."""
REMEMBERED = 48
"""Directions a grasp remembers at most, ours."""


def improved(
    regions: Regions,
    region: Ints,
    p_BC: Array,
    p_BBcm: Array,
    rho: float,
    rounds: int,
    first_step: float = FIRST_STEP,
) -> tuple[Array, Array]:
    """Contacts moved to raise epsilon; none ends with a lower bound than it began with.

    Args:
        regions: where contacts may be; their polygons may have several parts.
        region: region of each contact, shape (M, 3).
        p_BC: contact points in these regions [m], shape (M, 3, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        rounds: measurements.
        first_step: times the square root of the largest region's area.

    Returns:
        p_BC [m], shape (M, 3, 3), and the bound of epsilon over all directions met, shape (M,).
    """
    nhat_TB_B, mu = regions.nhat_TB_B[region], regions.mu[region]
    polygons = regions.polygon_F[region]

    def measure(p_FC: Array) -> tuple[Array, Array]:
        contacts = points_on(regions, region, p_FC), nhat_TB_B, mu
        w, bound = critical_directions(*contacts, p_BBcm, rho)
        # Of contacts that cannot hold, the bound says nothing.
        return w, np.where(force_closure(*contacts), bound, 0.0)

    p_FC = points_in_faces(regions, region, p_BC)
    step = first_step * np.sqrt(regions.area[region].max(axis=1))
    w, bound = measure(p_FC)
    failures = 0
    for number in range(rounds):
        twists = face_twists(regions, region, w[:, None], p_BBcm, rho)
        moved = _climb(twists.support, polygons, p_FC, step, number)
        found, moved_bound = measure(moved)
        w = np.concatenate([w, found], axis=1)
        twists = face_twists(regions, region, w[:, None], p_BBcm, rho)
        heights = [twists.support(p[:, :, None]).max(axis=(1, 2)) for p in (p_FC, moved)]
        bound = np.minimum(bound, heights[0].min(axis=1))
        moved_bound = np.minimum(moved_bound, heights[1].min(axis=1))
        rises = moved_bound > bound
        p_FC = np.where(rises[:, None, None], moved, p_FC)
        bound = np.where(rises, moved_bound, bound)
        failures = 0 if rises.any() else failures + 1
        if failures == PATIENCE:
            break
        step = step * np.where(rises, GROW, SHRINK)
        height = np.where(rises[:, None], heights[1], heights[0])
        kept = np.argsort(height, axis=1, kind="stable")[:, :REMEMBERED]
        w = np.take_along_axis(w, kept[..., None], axis=1)
    return points_on(regions, region, p_FC), bound


def _climb(
    support: Callable[[Array], Array], polygons: Shapes, p_FC: Array, step: Array, number: int
) -> Array:
    """The best joint moves against the directions of `support`, `STEPS` times, (M, 3, 2)."""
    combinations = (len(MOVES),) * 3
    for turn in TURN * (STEPS * number + np.arange(STEPS)):
        c, s = np.cos(turn), np.sin(turn)
        offsets = MOVES @ np.array([[c, s], [-s, c]])
        places = p_FC[:, :, None] + step[:, None, None, None] * offsets
        places = _nearest_inside(polygons, places)
        places[:, :, 0] = p_FC
        h = support(places)
        both = np.maximum(h[:, 0, :, None], h[:, 1, None])
        height = np.maximum(both[:, :, :, None], h[:, 2, None, None]).min(axis=-1)
        best = height.reshape(len(p_FC), -1).argmax(axis=1)
        chosen = np.stack(np.unravel_index(best, combinations), axis=1)
        p_FC = np.take_along_axis(places, chosen[..., None, None], axis=2)[:, :, 0]
        step = np.where(best == 0, step / 2, step)
    return p_FC


def _nearest_inside(polygons: Shapes, points: Array) -> Array:
    """Points (M, 3, C, 2), those outside their polygons (M, 3) moved to the nearest boundary."""
    each = np.broadcast_to(polygons[..., None], points.shape[:-1])
    outside = ~shapely.intersects_xy(each, points[..., 0], points[..., 1])
    links = shapely.shortest_line(each[outside], shapely.points(points[outside]))
    inside = points.copy()
    inside[outside] = shapely.get_coordinates(links)[::2]
    return inside
