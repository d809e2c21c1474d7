"""The worst placement of contacts in regions, against all of the twists and polygons one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from drake_polygrasp.arrays import Array
from drake_polygrasp.region_bounds import worst_placement
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.side_by_side import Search, run_side_by_side
from drake_polygrasp.region_bounds.worst_placement import WorstPlacement
from drake_polygrasp.vectors import unit
from drake_polygrasp.wrenches.region_support import PlanePolygons, least_tilted_support


@dataclass(frozen=True, eq=False)
class Piece:
    """A flat piece of a region, or a curved one."""

    p_BV: Array
    nhat_TB_B: Array
    tan_spread: float = 0.0


def regions(rng: np.random.Generator) -> list[list[Piece]]:
    """Pieces around three points of a sphere, of normals that differ a little; one is curved."""
    found = []
    for angle in (0.1, 2.2, 4.3):
        inward = -np.array([np.cos(angle), np.sin(angle), 0.0])
        pieces = []
        for k in range(3):
            nhat = unit(inward + 0.2 * rng.normal(size=3))
            e_1 = unit(np.cross(nhat, rng.normal(size=3)))
            turns = np.sort(rng.uniform(0, 2 * np.pi, 5))[:, None]
            rim = 0.1 * (np.cos(turns) * e_1 + np.sin(turns) * np.cross(nhat, e_1))
            pieces.append(Piece(rim - inward, nhat, 0.05 * (k == 2)))
        found.append(pieces)
    return found


def withstood(w: Array, pieces: Sequence[list[Piece]], mu: float, tilt: float) -> Array:
    """K(w), by the least support of each contact on each polygon, or at each corner."""
    least = []
    for region in pieces:
        each = []
        for piece in region:
            corners = piece.p_BV[:, None] if piece.tan_spread else piece.p_BV[None]
            for r_V in corners:
                polygons = PlanePolygons.of(np.tile(r_V, (len(w), 1, 1)))
                nhat = np.tile(piece.nhat_TB_B[:, None], len(w))
                arguments = polygons, nhat, np.full(len(w), mu), tilt
                each.append(least_tilted_support(w.T, *arguments)[0])
        least.append(np.min(each, axis=0))
    return np.max(least, axis=0)


@pytest.mark.parametrize("tilt", [0.0, 0.05])
@pytest.mark.parametrize("forces_only", [False, True])
def test_no_twist_or_polygon_that_matters_is_left_out(tilt, forces_only, monkeypatch):
    # Only the given twists, and none along which worse placements withstand least.
    monkeypatch.setattr(worst_placement, "_ROUNDS", 0)
    norm = LoadNorm(0.02, forces_only=forces_only)
    searches, expected = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        pieces, first, then = regions(rng), rng.normal(size=(30, 6)), rng.normal(size=(200, 6))
        placed = worst_placement.placeable(pieces, np.full(9, 0.5), np.zeros(3), 1.0)
        searches.append(lowered(WorstPlacement(placed, tilt, norm), first, then))
        expected.append(
            [(withstood(w, pieces, 0.5, tilt) / norm.of(w)).min() for w in (first, then)]
        )
    for bounds, least in zip(run_side_by_side(searches), expected, strict=True):
        np.testing.assert_allclose(bounds, np.minimum.accumulate(least), atol=1e-11)


def lowered(worst: WorstPlacement, *twists: Array) -> Search[list[float]]:
    """The bounds after each of several arrays of twists."""
    bounds = []
    for w in twists:
        bounds.append((yield from worst.lowered(w)))
    return bounds


@pytest.mark.parametrize("tilt", [0.0, 0.05])
def test_a_bound_is_what_one_placement_withstands(tilt):
    rng = np.random.default_rng(7)
    pieces, norm, w = regions(rng), LoadNorm(0.02), rng.normal(size=(30, 6))
    placed = worst_placement.placeable(pieces, np.full(9, 0.5), np.zeros(3), 1.0)
    worst = WorstPlacement(placed, tilt, norm)
    ((bound,),) = run_side_by_side([lowered(worst, w)])
    assert bound <= (withstood(w, pieces, 0.5, tilt) / norm.of(w)).min() + 1e-12
    along = withstood(worst.w[None], pieces, 0.5, tilt) / norm.of(worst.w[None])
    assert bound == pytest.approx(along[0], abs=1e-11)
