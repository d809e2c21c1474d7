"""What stands around a body, seen from it: where fingertips have no room though its surface has."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from drake_polygrasp.arguments import check_instance
from drake_polygrasp.arrays import Array, Bools, frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.body_identity import BodyIdentity
from drake_polygrasp.geometry.primitives import Primitive, tessellation
from drake_polygrasp.geometry.triangle_soup import TriangleSoup

if TYPE_CHECKING:
    from pydrake.math import RigidTransform


_SAME_POSE = 1e-9
"""Ours: what entries of rotations, and positions in metres, may differ by in one pose."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Solids near a body, in its frame B, as they stood at one moment.

    Attributes:
        X_WB: the body's pose at that moment: what is planned in B is in the world by `p_WC = (X_WB
            @ p_BC.T).T`.
        names: of those of which something is within `reach`.
        triangles_B: surfaces [m], shape (T, 3, 3), counter-clockwise from outside.
        closed: whether each triangle's shell is closed and so has an inside, shape (T,).
        primitives: curved solids, which have no triangles here.
        reach: what is farther than this from the body's bounding box has been left out [m].
        body: whose obstacles these are; None where that is not known.
    """

    X_WB: RigidTransform
    names: tuple[str, ...]
    triangles_B: Array
    closed: Bools
    primitives: tuple[Primitive, ...]
    reach: float
    body: BodyIdentity | None = None

    def joined(self, *others: Obstacles) -> Obstacles:
        """Returns these obstacles with those of other plants or moments around the same body.

        Args:
            others: obstacles around the same body in the same pose. `a | b` joins two.

        Raises:
            UsageError: when they are of another body, or of one in another pose.
        """
        every = (self, *others)
        for some in others:
            check_instance(
                "what is joined", some, Obstacles, "as obstacles_from_plant returns them"
            )
        bodies = [some.body for some in every if some.body is not None]
        if not all(body.is_shape_of(bodies[0]) for body in bodies):
            raise UsageError(
                "obstacles cannot be joined: they are of different bodies, or of one body in "
                "different frames"
            )
        poses = np.array([some.X_WB.GetAsMatrix34() for some in every])
        if not (np.abs(poses - poses[0]) <= _SAME_POSE).all():
            raise UsageError(
                "obstacles cannot be joined: their body's poses X_WB differ; take all of them with "
                "the body in one pose"
            )
        names = tuple(dict.fromkeys(name for body in bodies for name in body.names))
        return Obstacles(
            X_WB=self.X_WB,
            names=tuple(dict.fromkeys(name for some in every for name in some.names)),
            triangles_B=frozen(np.concatenate([some.triangles_B for some in every])),
            closed=frozen(np.concatenate([some.closed for some in every]), bool),
            primitives=tuple(solid for some in every for solid in some.primitives),
            reach=min(some.reach for some in every),
            body=replace(bodies[0], names=names) if bodies else None,
        )

    def __or__(self, other: Obstacles) -> Obstacles:
        """Returns both together, as `joined` does."""
        return self.joined(other)

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
