"""On solids where a search of sample points fails, the default is never worse than the paper."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from benchmarks.coverage import best_of_paper
from benchmarks.hard_objects import stellated
from drake_polygrasp.arrays import Array
from tests.support.convex_polyhedra import prism
from tests.support.planned import exact_plan
from tests.support.solids import solid


def gear(teeth: int) -> Array:
    """A wheel of 4 mm whose teeth taper from 100 to 60 mm across."""
    turn = 2 * np.pi * (np.arange(teeth)[:, None] + [0.25, 0.35, 0.65, 0.75]) / teeth
    radius = np.array([0.04, 0.05, 0.05, 0.04])
    outline = radius * np.stack([np.cos(turn), np.sin(turn)])
    return prism(shapely.Polygon(outline.reshape(2, -1).T), 0.004)


def star(points: int, ratio: float, height: float) -> Array:
    """Two pyramids over a star, base to base."""
    turn = np.pi * np.arange(2 * points) / points
    radius = 0.05 * np.where(np.arange(2 * points) % 2, ratio, 1.0)
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn])
    following = np.roll(ring, -1, axis=0)
    top, bottom = (np.broadcast_to([0.0, 0.0, z], ring.shape) for z in (height, -height))
    return np.concatenate(
        [np.stack([ring, following, top], 1), np.stack([following, ring, bottom], 1)]
    )


def spiked_cube(height: float) -> Array:
    corners = np.array(np.meshgrid(*[[-0.03, 0.03]] * 3)).reshape(3, -1).T
    return stellated(corners, height)


def stellated_icosahedron(height: float) -> Array:
    g = (1 + 5**0.5) / 2
    signs = [(a, b) for a in (-1, 1) for b in (-1, 1)]
    corners = [np.roll([0.0, a, b * g], k) for k in range(3) for a, b in signs]
    return stellated(0.026 * np.array(corners), height)


SOLIDS = {
    "gear, mu 0.1": (gear(10), 0.1),
    "gear, mu 0.3": (gear(17), 0.3),
    "star, mu 0.1": (star(9, 0.6, 0.05), 0.1),
    "star, mu 0.2": (star(7, 0.5, 0.02), 0.2),
    "spiked cube, mu 0.1": (spiked_cube(1.5), 0.1),
    "spiked cube, mu 0.3": (spiked_cube(0.8), 0.3),
    "stellated icosahedron, mu 0.3": (stellated_icosahedron(0.8), 0.3),
}


@pytest.mark.parametrize(("triangles", "mu"), SOLIDS.values(), ids=SOLIDS.keys())
def test_the_best_default_grasp_is_at_least_the_best_of_the_paper(
    triangles: Array, mu: float
) -> None:
    object_ = solid(triangles, mu=mu)
    paper = best_of_paper(object_)
    grasps = exact_plan(object_).grasps
    best = max((found.certificate.epsilon_upper for found in grasps), default=0.0)
    assert paper > 0
    assert best >= paper
