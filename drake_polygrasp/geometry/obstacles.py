"""Solids around a body that fingertips must not touch."""

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
"""Our choice: rotation entries, and positions in metres, of equal poses differ by less."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Solids near a body, in its frame B, as they stood at one moment.

    Attributes:
        X_WB: pose of the body in the world at that moment; points of B are in the world at
            `p_WC = (X_WB @ p_BC.T).T`.
        names: scoped names of the bodies with geometry within `reach`.
        triangles_B: surfaces, counter-clockwise from outside [m], shape (T, 3, 3).
        closed: whether each triangle's shell is closed and so has an inside, shape (T,).
        primitives: curved solids, which are not among the triangles.
        reach: distance from the body's bounding box beyond which geometry is left out [m].
        body: identity of the body that the obstacles surround; None where it is not known.
    """

    X_WB: RigidTransform
    names: tuple[str, ...]
    triangles_B: Array
    closed: Bools
    primitives: tuple[Primitive, ...]
    reach: float
    body: BodyIdentity | None = None

    def joined(self, *others: Obstacles) -> Obstacles:
        """Returns these obstacles together with others around the same body.

        `a | b` joins two.

        Args:
            others: obstacles of other plants or moments, around the same body in the same pose.

        Raises:
            UsageError: when they are around another body, or the body is in another pose.
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
        """Returns the obstacles of both, as `joined` does."""
        return self.joined(other)

    @property
    def surface_B(self) -> Array:
        """All surfaces as triangles, curved ones as inscribed polyhedra [m], shape (N, 3, 3)."""
        return np.concatenate([self.triangles_B, *map(tessellation, self.primitives)])

    @cached_property
    def _surface(self) -> TriangleSoup:
        return TriangleSoup(self.triangles_B)

    @cached_property
    def _solids(self) -> TriangleSoup:
        return TriangleSoup(self.triangles_B[self.closed])

    def contain(self, p_B: Array) -> Bools:
        """Returns which points are inside a solid.

        Args:
            p_B: points [m], shape (M, 3).

        Returns:
            Shape (M,).
        """
        inside = self._solids.winding_numbers(p_B) > 0
        for solid in self.primitives:
            inside |= solid.distance(p_B) < 0
        return inside

    def block(self, p_BT: Array, reach: float) -> Bools:
        """Returns which points are inside a solid or near one.

        Args:
            p_BT: points, such as the centres of fingertips [m], shape (M, 3).
            reach: least distance of a point that is clear [m].

        Returns:
            Shape (M,).
        """
        blocked = self.contain(p_BT)
        blocked |= self._surface.within(p_BT, reach)
        for solid in self.primitives:
            blocked |= solid.distance(p_BT) < reach
        return blocked
