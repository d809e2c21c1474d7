"""Beyond the paper: moves the three contacts within their regions while epsilon rises.

The estimate of epsilon is the least of some hundred radii, one for each facet twist, which change
smoothly as contacts move. Each round computes the gradients of the least radii, predicts from them
the radii of every combination of some moves of the three contacts, and makes the best combination
if the estimate does rise; else later moves are shorter. Gradients of h at fixed w mislead, because
the weakest direction changes as contacts move; the facet twists move with the contacts.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Ints, Shapes, frozen
from drake_polygrasp.geometry.regions import Regions, nearest_points
from drake_polygrasp.search.face_support import contacts_on, points_in_faces, points_on
from drake_polygrasp.vectors import circle, product
from drake_polygrasp.wrenches.epsilon_estimate import radii_of_lines

MOVES = 15
"""Our choice: moves of each contact tried in a round, beside staying where it is."""
FARTHEST = 0.5
"""Our choice: the longest move at first, times the square root of the largest region's area."""
SPAN = 20.0
"""Our choice: ratio of the longest to the shortest move."""
SHRINKING = 0.6
"""Our choice: factor of the moves' lengths where the estimate did not rise."""
NUM_RADII = 24
"""Our choice: number of least radii whose gradients are computed; others hardly become the least in
one move."""
STEP = 1e-3
"""Our choice: step of finite differences, times the square root of the largest region's area; a
smaller one would be noise in single precision."""
_STEPS = np.concatenate([np.zeros((1, 3, 2)), np.eye(6).reshape(6, 3, 2)])
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_AT_ONCE = 2
"""Grasps whose combinations fit into the processor's cache."""


def improved(
    regions: Regions,
    region: Ints,
    p_BC: Array,
    p_BBcm: Array,
    rho: float,
    rounds: tuple[int, ...],
) -> tuple[Array, Array]:
    """Moves contacts to raise epsilon; no estimate falls.

    Args:
        regions: where contacts may be; their polygons may have several parts.
        region: region of each contact, shape (M, 3).
        p_BC: contact points in these regions, expressed in B [m], shape (M, 3, 3).
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        rounds: number of grasps, the best so far, that move in each round.

    Returns:
        p_BC [m], shape (M, 3, 3), and the estimates of epsilon, shape (M,). A few grasps may not be
        force closure any more, which the estimates do not show: the caller must test it.
    """
    polygons = regions.polygon_F[region]
    shapely.prepare(polygons)
    size = np.sqrt(regions.area[region].max(axis=1))
    step, farthest = STEP * size, FARTHEST * size
    p_FC, scale = points_in_faces(regions, region, p_BC), (p_BBcm, rho)
    radii, slopes = _linearised(regions, region, p_FC, step, *scale)
    for number, num in enumerate(rounds):
        rows = np.argsort(-radii[:, 0], kind="stable")[:num]
        here = p_FC[rows, None]
        places = np.repeat(here, 1 + MOVES, axis=1)
        places[:, 1:] += farthest[rows, None, None, None] * _spiral(number)[:, None]
        places[:, 1:] = _nearest_inside(polygons[rows, None], places[:, 1:])
        there = _most_promising(radii[rows], slopes[rows], places, places - here)
        radii_there, slopes_there = _linearised(regions, region[rows], there, step[rows], *scale)
        rises = radii_there[:, 0] > radii[rows, 0]
        better = rows[rises]
        p_FC[better], radii[better] = there[rises], radii_there[rises]
        slopes[better] = slopes_there[rises]
        farthest[rows[~rises]] *= SHRINKING
    return points_on(regions, region, p_FC), radii[:, 0].astype(float)


def _linearised(
    regions: Regions, region: Ints, p_FC: Array, step: Array, p_BBcm: Array, rho: float
) -> tuple[Array, Array]:
    """Computes the least radii of contacts (M, 3, 2), ascending, and their gradients.

    Shapes (M, NUM_RADII) and (M, 3, 2, NUM_RADII).
    """
    places = p_FC[:, None] + step[:, None, None, None] * _STEPS
    p_BC = points_on(regions, region[:, None], places).reshape(-1, 3, 3)
    contacts = contacts_on(regions, np.repeat(region, len(_STEPS), axis=0), p_BC)
    every = radii_of_lines(*contacts, p_BBcm, rho)
    every = every.reshape(len(region), len(_STEPS), every.shape[1])
    least = every[:, 0].argsort(axis=1, kind="stable")[:, None, :NUM_RADII]
    radii = every[np.arange(len(region))[:, None, None], np.arange(len(_STEPS))[:, None], least]
    slopes = (radii[:, 1:] - radii[:, :1]) / step[:, None, None].astype(radii.dtype)
    return radii[:, 0], slopes.reshape(*p_FC.shape, NUM_RADII)


def _most_promising(radii: Array, slopes: Array, places: Array, moves: Array) -> Array:
    """Selects from K places of each contact those of the greatest predicted least radius.

    The prediction is linear in `moves`, which lead to `places`; (M, K, 3, 2) to (M, 3, 2).
    """
    num, K = moves.shape[:2]
    # What moves of each contact add to radii, by contact (M, NUM_RADII, K).
    moves = moves.astype(slopes.dtype).transpose(2, 0, 3, 1)
    first, second, third = product(slopes.transpose(1, 0, 3, 2), moves)
    first += radii[..., None]
    best = np.empty(num, dtype=np.int64)
    for start in range(0, num, _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        two = second[rows, :, :, None] + third[rows, :, None]
        promised = first[rows, :, :, None] + two.reshape(len(two), NUM_RADII, 1, -1)
        best[rows] = promised.min(axis=1).reshape(len(two), -1).argmax(axis=1)
    chosen = np.column_stack(np.unravel_index(best, (K, K, K)))
    return places[np.arange(num)[:, None], chosen, np.arange(3)]


def _nearest_inside(polygons: Shapes, points: Array) -> Array:
    """Moves points (..., 2) that are outside their polygons (...) to the nearest boundary."""
    polygons = np.broadcast_to(polygons, points.shape[:-1])
    outside = ~shapely.intersects_xy(polygons, points[..., 0], points[..., 1])
    inside = points.copy()
    inside[outside] = nearest_points(polygons[outside], points[outside])
    return inside


@cache
def _spiral(number: int) -> Array:
    """Returns moves of many lengths and directions, other ones each round, at most 1 long."""
    turn = _GOLDEN_ANGLE * (MOVES * number + np.arange(MOVES))
    length = np.round(SPAN ** -np.linspace(0.0, 1.0, MOVES), 14)
    return frozen(length[:, None] * circle(turn))
