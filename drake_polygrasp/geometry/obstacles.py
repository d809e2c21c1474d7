"""What stands around a body, seen from it: where fingertips have no room though its surface has."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.geometry.primitives import Primitive, tessellation
from drake_polygrasp.geometry.triangle_soup import TriangleSoup

if TYPE_CHECKING:
    from pydrake.math import RigidTransform


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Solids near a body, in its frame B, as they stood at one moment."""

    X_WB: RigidTransform
    """The body's pose at that moment: what is planned in B is in the world by
    `p_WC = (X_WB @ p_BC.T).T`."""
    names: tuple[str, ...]
    """Of those of which something is within `reach`."""
    triangles_B: Array
    """Surfaces [m], shape (T, 3, 3), counter-clockwise from outside."""
    closed: Bools
    """Whether each triangle's shell is closed and so has an inside, shape (T,)."""
    primitives: tuple[Primitive, ...]
    """Curved solids, which have no triangles here."""
    reach: float
    """What is farther than this from the body's bounding box has been left out [m]."""

    @property
    def surface_B(self) -> Array:
        """All surfaces as triangles [m], curved ones as inscribed polyhedra, shape (N, 3, 3)."""
        return np.concatenate([self.triangles_B, *map(tessellation, self.primitives)])

    @cached_property
    def _surface(self) -> TriangleSoup:
        return TriangleSoup(self.triangles_B)

    @cached_property
    def _solids(self) -> TriangleSoup:
        return TriangleSoup(self.triangles_B[self.closed])

    def contain(self, p_B: Array) -> Bools:
        """Whether points p_B [m], shape (M, 3), are inside a solid; shape (M,)."""
        inside = self._solids.winding_numbers(p_B) > 0
        for solid in self.primitives:
            inside |= solid.distance(p_B) < 0
        return inside

    def block(self, p_BT: Array, reach: float) -> Bools:
        """Whether points p_BT [m], shape (M, 3), are inside a solid or within `reach` [m] of one.

        Shape (M,).
        """
        blocked = self.contain(p_BT)
        blocked |= self._surface.within(p_BT, reach)
        for solid in self.primitives:
            blocked |= solid.distance(p_BT) < reach
        return blocked
