"""Beyond the paper: moves the three contacts within their regions while epsilon rises.

Section 7 puts contacts where forces balance simply, not where the grasp resists most. Each grasp
remembers the directions w in which it, or a grasp near it, was weakest; the least h over these is
a surrogate of epsilon that moves of contacts are tried against, all three at once (a pattern
search). What looks best by steps of three lengths is measured anew, which adds its own weakest
directions, and kept only if the measured bound rose: as in a method of cutting planes, no error
of the surrogate lasts, and a step that is too long for it costs no round.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.epsilon_bound import COARSE_TURNS, critical_directions
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
FIRST_STEP = 0.1
"""Times the square root of the largest region's area, ours."""
SCALES = np.array([3.0, 1.0, 0.3])
"""Steps that are tried side by side and measured together, times the step, ours."""
NEXT_STEP = np.array([0.2, 4.5, 1.5, 0.45])
"""What the step is multiplied by if none of them rises, and if one is best, ours."""
LEAST_RISE = 1e-3
"""Relative, ours: what would rise less stays where it is."""
PATIENCE = 3
"""Rounds in a row in which a grasp does not rise, before it ends, ours."""
ROUNDS_OF_ALL = 2
"""Rounds before the best few go on alone, ours."""
WEAKEST = 24
"""Directions that each measurement adds, ours."""
REMEMBERED = 48
"""Directions a grasp remembers at most, ours."""


def improved(
    regions: Regions,
    region: Ints,
    p_BC: Array,
    p_BBcm: Array,
    rho: float,
    rounds: int,
    finalists: int | None = None,
) -> tuple[Array, Array]:
    """Contacts moved to raise epsilon; none ends with a lower bound than it began with.

    Args:
        regions: where contacts may be; their polygons may have several parts.
        region: region of each contact, shape (M, 3).
        p_BC: contact points in these regions that hold [m], shape (M, 3, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        rounds: measurements.
        finalists: how many grasps go on after `ROUNDS_OF_ALL` (default: all).

    Returns:
        p_BC [m], shape (M, 3, 3), and the bound of epsilon over all directions met, shape (M,).
    """
    polygons = regions.polygon_F[region]
    shapely.prepare(polygons)
    p_FC = points_in_faces(regions, region, p_BC)
    contacts = p_BC, regions.nhat_TB_B[region], regions.mu[region]
    w, bound = critical_directions(*contacts, p_BBcm, rho, WEAKEST, COARSE_TURNS)
    twists = face_twists(regions, region, w[:, None], p_BBcm, rho)
    step = FIRST_STEP * np.sqrt(regions.area[region].max(axis=1))
    failures = np.zeros(len(region), dtype=np.int64)
    rows = np.arange(len(region))
    for number in range(rounds):
        if number == ROUNDS_OF_ALL:
            best = np.argsort(-bound[rows], kind="stable")[:finalists]
            rows, twists = rows[best], twists.take(best)
        if not len(rows):
            break
        steps = step[rows, None] * SCALES
        moved = _climb(twists.support, polygons[rows], p_FC[rows], steps, number)
        w, moved_bound = _measured(
            regions,
            np.repeat(region[rows], len(SCALES), axis=0),
            moved.swapaxes(1, 2).reshape(-1, 3, 2),
            p_BBcm,
            rho,
        )
        w = w.reshape(len(rows), 1, -1, 6)
        twists = twists.joined(face_twists(regions, region[rows], w, p_BBcm, rho))
        places = np.concatenate([p_FC[rows, :, None], moved], axis=2)
        height = twists.support(places).max(axis=1)
        bounds = np.column_stack([bound[rows], moved_bound.reshape(steps.shape)])
        bounds = np.minimum(bounds, height.min(axis=2))
        best = np.where(bounds > (1 + LEAST_RISE) * bounds[:, :1], bounds, 0.0).argmax(axis=1)
        each = np.arange(len(rows))
        p_FC[rows], bound[rows] = places[each, :, best], bounds[each, best]
        if number + 1 == rounds:
            break
        step[rows] *= NEXT_STEP[best]
        failures[rows] = np.where(best > 0, 0, failures[rows] + 1)
        weakest = height[each, best].argsort(axis=1, kind="stable")[:, :REMEMBERED]
        goes_on = np.flatnonzero(failures[rows] < PATIENCE)
        rows, twists = rows[goes_on], twists.only(weakest).take(goes_on)
    return points_on(regions, region, p_FC), bound


def _measured(
    regions: Regions, region: Ints, p_FC: Array, p_BBcm: Array, rho: float
) -> tuple[Array, Array]:
    """The weakest directions of grasps, shape (M, K, 6), and their bounds, shape (M,)."""
    contacts = points_on(regions, region, p_FC), regions.nhat_TB_B[region], regions.mu[region]
    w, bound = critical_directions(*contacts, p_BBcm, rho, WEAKEST, COARSE_TURNS)
    # Of contacts that cannot hold, the bound says nothing.
    return w, np.where(force_closure(*contacts), bound, 0.0)


def _climb(
    support: Callable[[Array], Array], polygons: Shapes, p_FC: Array, steps: Array, number: int
) -> Array:
    """The best joint moves against the directions of `support`, `STEPS` times.

    Args:
        support: of places (M, 3, C, 2), shape (M, 3, C, K).
        polygons: where each contact may be, shape (M, 3).
        p_FC: contacts, shape (M, 3, 2).
        steps: lengths of moves that are tried side by side [m], shape (M, S).
        number: turns the axes of the moves.

    Returns:
        Shape (M, 3, S, 2).
    """
    (M, S), C = steps.shape, len(MOVES)
    row, side = np.arange(M)[:, None], np.arange(S)
    p_FC = np.repeat(p_FC[:, :, None], S, axis=2)
    for turn in TURN * (STEPS * number + np.arange(STEPS)):
        c, s = np.cos(turn), np.sin(turn)
        offsets = steps[:, None, :, None, None] * (MOVES @ np.array([[c, s], [-s, c]]))
        places = _nearest_inside(polygons, (p_FC[:, :, :, None] + offsets).reshape(M, 3, -1, 2))
        # Directions first: least values over the last axis take several times as long.
        h = np.moveaxis(support(places).reshape(M, 3, S, C, -1), -1, 0).copy()
        places = places.reshape(M, 3, S, C, 2)
        both = np.maximum(h[:, :, 0, :, :, None], h[:, :, 1, :, None])
        thirds = (h[:, :, 2, :, c, None, None] for c in range(C))
        height = np.stack([np.maximum(both, third).min(axis=0) for third in thirds], axis=-1)
        best = height.reshape(M, S, -1).argmax(axis=2)
        chosen = np.unravel_index(best, (C, C, C))
        p_FC = np.stack([places[row, i, side, chosen[i]] for i in range(3)], axis=1)
        steps = np.where(best == 0, steps / 2, steps)
    return p_FC


def _nearest_inside(polygons: Shapes, points: Array) -> Array:
    """Points (M, 3, C, 2), those outside their polygons (M, 3) moved to the nearest boundary."""
    each = np.broadcast_to(polygons[..., None], points.shape[:-1])
    outside = ~shapely.intersects_xy(each, points[..., 0], points[..., 1])
    links = shapely.shortest_line(each[outside], shapely.points(points[outside]))
    inside = points.copy()
    inside[outside] = shapely.get_coordinates(links)[::2]
    return inside
