"""Pieces of the surface around contacts, their corners as arrays, and their exact check."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.exact import Check, check_region

_CORNERS = 4
"""Our choice: polygons get a multiple of so many corners."""


class RegionPiece(Protocol):
    """A part of the surface around a contact, as `exact.check_region` takes it."""

    @property
    def p_BV(self) -> Array:
        """Corners of a convex polygon or polytope that contains the part [m], shape (n, 3)."""

    @property
    def nhat_TB_B(self) -> Array:
        """Inward unit normal, shape (3,)."""

    @property
    def tan_spread(self) -> float:
        """Tangent of the greatest angle between that normal and the surface's in the part."""


def check_pieces(
    regions: Sequence[Sequence[RegionPiece]],
    mu: Array,
    x: Array,
    tilt_error: float,
    friction_error: float,
) -> Check:
    """Checks in exact arithmetic that x proves every placement in three regions: `check_region`.

    Args:
        regions: the pieces of each contact's region.
        mu: friction coefficients, shape (3,).
        x: the internal force x_12, x_13, x_23 [1/m], shape (3,).
        tilt_error: angle by which normals may differ from the surface's [rad].
        friction_error: share by which friction coefficients may be less.

    Returns:
        The check, with the reason if it fails.
    """
    pieces = [[(s.p_BV.tolist(), s.nhat_TB_B.tolist(), s.tan_spread) for s in r] for r in regions]
    return check_region(pieces, mu.tolist(), x.tolist(), tilt_error, friction_error)


def padded(corners: Sequence[Array]) -> Array:
    """Returns polygons of as many corners, with their last ones repeated.

    The number is a multiple of four, or one, so that different grasps often have as many.

    Args:
        corners: of each, shapes (V, 3).
    """
    most = max(map(len, corners))
    most = most if most == 1 else -(-most // _CORNERS) * _CORNERS
    return np.stack([c[np.minimum(np.arange(most), len(c) - 1)] for c in corners])
