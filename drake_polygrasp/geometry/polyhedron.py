"""The exposed surface of an object as planar faces and near-planar patches.

In Section 2 of the paper the object is a polyhedron with faces A_i and inward normals n_i.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches, frozen
from drake_polygrasp.errors import ModelError
from drake_polygrasp.geometry.cavities import Cavities
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import dot, times, transformed

_PAIRS_AT_ONCE = 1 << 17
"""Number of face-vertex pairs compared at once, our choice: a megabyte."""


@dataclass(frozen=True, eq=False)
class Face:
    """A planar face of the exposed surface, or a near-planar patch of it.

    It may be non-convex and have holes; patches may overlap. Its frame F has its origin Fo on the
    plane of the face, and Fz along the outward normal.

    Attributes:
        R_BF: columns Fx, Fy, Fz, shape (3, 3).
        p_BF: position of Fo [m], shape (3,).
        polygon_F: the face in the coordinates of Fx and Fy [m].
        mu: friction coefficient.
        reach: greatest distance of the surface from the plane [m]: 0 for a face, above 0 for a
            patch, whose contacts are projected from the plane onto the surface.
        primitive: the curved solid that a patch is part of; None where triangles are the surface.
    """

    R_BF: Array
    p_BF: Array
    polygon_F: shapely.Polygon
    mu: float
    reach: float = 0.0
    primitive: Primitive | None = None

    @property
    def nhat_TB_B(self) -> Array:
        """Inward unit normal, the paper's n_i, shape (3,)."""
        return frozen(-self.R_BF[:, 2])


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """The faces of a body's exposed surface, and the triangles they are made of.

    Attributes:
        faces: faces and patches, in the order of outward normal, offset and centroid, rounded to
            1e-9 L.
        diameter: L, the greatest distance between two vertices [m].
        triangles_B: all collision triangles, counter-clockwise from outside [m], shape (T, 3, 3).
        triangle_face: the face that shares most of each triangle's area, -1 where the triangle is
            wholly covered or belongs to no face, shape (T,).
        closed: whether each triangle's shell is closed and so has an inside, shape (T,); None when
            all are.
        primitives: the curved solids among the body's parts; their triangles are inscribed.
        cavities: sealed cavities, whose walls are no faces; None when there are none.
        own: whether each triangle is of the body, not of another that covers it, shape (T,); None
            when all are.
        covering: the curved solids of other bodies that cover the body.
    """

    faces: tuple[Face, ...]
    diameter: float
    triangles_B: Array
    triangle_face: Ints
    closed: Bools | None = None
    primitives: tuple[Primitive, ...] = ()
    cavities: Cavities | None = None
    own: Bools | None = None
    covering: tuple[Primitive, ...] = ()

    @cached_property
    def own_triangles_B(self) -> Array:
        """The body's own triangles [m], shape (N, 3, 3)."""
        return self.triangles_B if self.own is None else frozen(self.triangles_B[self.own])

    @cached_property
    def own_triangle_face(self) -> Ints:
        """`triangle_face` of the body's own triangles, shape (N,)."""
        return self.triangle_face if self.own is None else frozen(self.triangle_face[self.own], int)

    @cached_property
    def _own_balls(self) -> tuple[Array, Array]:
        """Centres (3, N) and radii (N,) of balls around the body's own triangles [m]."""
        corners = np.ascontiguousarray(self.own_triangles_B.transpose(1, 2, 0))
        centres = corners.mean(axis=0)
        return centres, np.sqrt(((corners - centres) ** 2).sum(axis=1).max(axis=0))

    def own_triangles_near(self, p_BQ: Array, nhat_B: Array, distance: float) -> Ints:
        """Returns the body's own triangles that may be within a distance of a line, ascending.

        Args:
            p_BQ: a point on the line [m], shape (3,).
            nhat_B: its direction, unit length, shape (3,).
            distance: the distance [m].

        Returns:
            Indices in `own_triangles_B`, shape (K,): all that are as near, and few others.
        """
        centres, radius = self._own_balls
        off = centres - p_BQ[:, None]
        along = np.einsum("kn,k->n", off, nhat_B)
        square = np.einsum("kn,kn->n", off, off) - along * along
        near = radius + distance + LENGTH_TOLERANCE * self.diameter
        return np.flatnonzero(square <= near * near)

    @property
    def covers_B(self) -> Array:
        """The triangles of other bodies that cover the body [m], shape (K, 3, 3)."""
        return self.triangles_B[:0] if self.own is None else self.triangles_B[~self.own]

    @property
    def is_covered(self) -> bool:
        """Whether there are other bodies that cover the body or are in the way of fingertips."""
        return self.own is not None

    @cached_property
    def least_radius_of_solid(self) -> Array:
        """Least radius of the curved solid that each face is a patch of, else 0 [m], shape (F,)."""
        solids = [face.primitive for face in self.faces]
        return frozen([0.0 if solid is None else float(solid.radii.min()) for solid in solids])

    @cached_property
    def is_patch(self) -> Bools:
        """Whether each face is a patch of a curved or noisy surface, shape (F,)."""
        return frozen([face.reach > 0 for face in self.faces], bool)

    @cached_property
    def is_faceted(self) -> Bools:
        """Whether each face is a patch of triangles, not of a curved solid, shape (F,)."""
        return frozen([face.reach > 0 and face.primitive is None for face in self.faces], bool)

    @cached_property
    def polygon_F(self) -> npt.NDArray[np.object_]:
        """`Face.polygon_F` of all faces, shape (F,)."""
        return frozen([face.polygon_F for face in self.faces], object)

    @cached_property
    def R_BF(self) -> Array:
        """`Face.R_BF` of all faces, shape (F, 3, 3)."""
        return frozen([face.R_BF for face in self.faces]).reshape(-1, 3, 3)

    @cached_property
    def p_BF(self) -> Array:
        """`Face.p_BF` of all faces [m], shape (F, 3)."""
        return frozen([face.p_BF for face in self.faces]).reshape(-1, 3)

    @cached_property
    def mu(self) -> Array:
        """`Face.mu` of all faces, shape (F,)."""
        return frozen([face.mu for face in self.faces])

    @cached_property
    def greatest_rise(self) -> float:
        """Greatest height of a vertex above the plane of a face [m], small on convex bodies.

        Infinite where it exceeds `FLATNESS` L, on bodies with patches, whose planes are not their
        surface, and on bodies that others cover.
        """
        if self.is_patch.any() or self.is_covered:
            return np.inf
        vertices, rise = surface_vertices(self), 0.0
        Fz, level = self.R_BF[:, :, 2], dot(self.R_BF[:, :, 2], self.p_BF)
        for some in batches(len(level), max(1, _PAIRS_AT_ONCE // len(vertices))):
            rise = max(rise, float((times(vertices, Fz[some].T).max(axis=0) - level[some]).max()))
            if rise > FLATNESS * self.diameter:
                return np.inf
        return rise

    @property
    def is_convex(self) -> bool:
        """Whether the body is one convex solid: no vertex lies above any face."""
        return self.greatest_rise <= FLATNESS * self.diameter

    @cached_property
    def surface(self) -> TriangleSoup:
        """All triangles, for queries."""
        return TriangleSoup(self.triangles_B)

    @cached_property
    def solids(self) -> TriangleSoup:
        """The triangles of closed shells, for queries."""
        if self.closed is None:
            return self.surface
        return TriangleSoup(self.triangles_B[self.closed])

    @property
    def watertight(self) -> bool:
        """Whether all shells of the body are closed, so that it has an inside."""
        own = slice(None) if self.own is None else self.own
        return self.closed is None or bool(self.closed[own].all())


def surface_vertices(polyhedron: Polyhedron) -> Array:
    """Returns the vertices of all faces, with repetitions.

    Args:
        polyhedron: the body.

    Returns:
        Points in B [m], shape (V, 3).
    """
    return np.concatenate(
        [
            f.p_BF + times(shapely.get_coordinates(f.polygon_F), f.R_BF[:, :2].T)
            for f in polyhedron.faces
        ]
    )


def farthest_distance(polyhedron: Polyhedron, p_B: Array) -> float:
    """Returns the greatest distance of a point from the surface of a body [m].

    All triangles count, because the farthest point is never covered by another part.

    Args:
        polyhedron: the body.
        p_B: the point [m], shape (3,).
    """
    vertices = polyhedron.own_triangles_B.reshape(-1, 3)
    to_vertices = np.linalg.norm(vertices - p_B, axis=1).max()
    return max([float(to_vertices), *(solid.farthest(p_B) for solid in polyhedron.primitives)])


def volume_centroid(polyhedron: Polyhedron) -> Array:
    """Returns the centroid of the enclosed volume, by the divergence theorem.

    The integration is over the exposed surface, so that parts that overlap count once: the flux of
    x through the faces is 3 V, and that of x_i x is 4 V times the centroid. In patches the single
    facets count, and curved solids as the polyhedra inscribed in them. Sealed cavities count as
    solid.

    Args:
        polyhedron: a body that no other body covers, because covered faces would be missing.

    Returns:
        Point in B [m], shape (3,).

    Raises:
        ModelError: when the surface encloses no volume, as that of a sheet.
    """
    planar = [k for k, face in enumerate(polyhedron.faces) if face.primitive or not face.reach]
    faces = [polyhedron.faces[k] for k in planar]
    rest = ~np.isin(polyhedron.triangle_face, planar)
    if len(planar) == len(polyhedron.faces):
        rest[:] = False  # Without patches of facets, triangles of no face are covered.
    rest[rest] = ~_hidden(polyhedron, polyhedron.triangles_B[rest])
    nhat, area = unit_normals(polyhedron.triangles_B[rest])
    polygons = np.array([face.polygon_F for face in faces], dtype=object)
    xy = shapely.get_coordinates(shapely.centroid(polygons))
    p_BFc = np.array(
        [f.p_BF + transformed(f.R_BF[:, :2], c) for f, c in zip(faces, xy, strict=True)]
    )
    nhat = np.concatenate([np.array([f.R_BF[:, 2] for f in faces]).reshape(-1, 3), nhat])
    middle = polyhedron.triangles_B[rest].mean(axis=1)
    centroid = np.concatenate([p_BFc.reshape(-1, 3), middle])
    about = polyhedron.triangles_B.reshape(-1, 3).mean(axis=0)
    flux = np.einsum("ni,ni->n", centroid - about, nhat)
    flux *= np.append(shapely.area(polygons), area)
    if abs(flux.sum()) <= LENGTH_TOLERANCE * np.abs(flux).sum():
        raise ModelError("its surface encloses no volume; state its mass, or give it a thickness")
    return np.asarray(about + 3 / 4 * times((centroid - about).T, flux) / flux.sum())


def _hidden(polyhedron: Polyhedron, triangles: Array) -> Bools:
    """Returns which triangles have their centroid inside a closed shell or a sealed cavity."""
    nhat, _ = unit_normals(triangles)
    middle = triangles.mean(axis=1)
    outside = middle + FLATNESS * polyhedron.diameter * nhat
    hidden = polyhedron.solids.winding_numbers(outside) > 0
    if polyhedron.cavities is not None:
        hidden |= polyhedron.cavities.sealed_at(middle, -nhat)
    return hidden
