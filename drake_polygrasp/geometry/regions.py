"""The eroded regions of an object's faces that fingers may use: the planner's A_i.

Section 2 of the paper: no contact lies on an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, Shapes, frozen
from drake_polygrasp.geometry.inradius import inradius, rough_inradius
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE

DEFAULT_CLEARANCE = 0.01
"""Times the diameter L, ours: how far contacts stay away from edges."""
CLEARANCE_OF_INRADIUS = 0.2
"""Times a face's inradius, ours: on small faces contacts stay away from edges only this far."""
PLACEMENT_ERROR = 0.02
"""Times the diameter L, our choice: by how much robots miss."""
ERROR_OF_INRADIUS = 0.5
"""Times a face's inradius, our choice: contacts on small faces may miss by no more than this."""
MIN_INRADIUS = 0.002
"""Times the diameter L, ours: narrower faces are no place for a finger."""


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions that erosion leaves of the faces: the planner's A_i, one row each.

    Boundaries are ragged: region r has the closed rings `ring_offsets[region_offsets[r]:
    region_offsets[r + 1] + 1]` into `p_BV`, the first of each Polygon its exterior.

    Attributes:
        polygon_F: shapely Polygons in the coordinates of their face's frame F, shape (n,).
        face: index of the face, shape (n,).
        R_BF: shape (n, 3, 3).
        p_BF: [m], shape (n, 3).
        nhat_TB_B: inward unit normals, shape (n, 3).
        mu: shape (n,).
        area: [m^2], shape (n,).
        p_BV: ring vertices, each ring's first repeated at its end [m], shape (V, 3).
        ring_offsets: where each ring's vertices begin.
        region_offsets: where each region's rings begin.
        num_left_out: faces too narrow for a finger.
    """

    polygon_F: npt.NDArray[np.object_]
    face: Ints
    R_BF: Array
    p_BF: Array
    nhat_TB_B: Array
    mu: Array
    area: Array
    p_BV: Array
    ring_offsets: Ints
    region_offsets: Ints
    num_left_out: int

    def take(self, kept: Bools) -> Regions:
        """Those that `kept` says, shape (n,)."""
        num_rings, num_vertices = np.diff(self.region_offsets), np.diff(self.ring_offsets)
        rings = np.repeat(kept, num_rings)
        return Regions(
            polygon_F=frozen(self.polygon_F[kept], object),
            face=frozen(self.face[kept], np.int64),
            R_BF=frozen(self.R_BF[kept]),
            p_BF=frozen(self.p_BF[kept]),
            nhat_TB_B=frozen(self.nhat_TB_B[kept]),
            mu=frozen(self.mu[kept]),
            area=frozen(self.area[kept]),
            p_BV=frozen(self.p_BV[np.repeat(rings, num_vertices)]),
            ring_offsets=frozen(np.append(0, np.cumsum(num_vertices[rings])), np.int64),
            region_offsets=frozen(np.append(0, np.cumsum(num_rings[kept])), np.int64),
            num_left_out=self.num_left_out,
        )


def erode(
    polyhedron: Polyhedron,
    edge_clearance: float | None = None,
    min_inradius: float | None = None,
) -> Regions:
    """The parts of the faces that lie `edge_clearance` [m] away from every edge.

    This is the paper's security distance, applied once and before everything else. At reflex
    corners the offset edges are extended to their intersection, which removes a little more than
    the distance and keeps polygons simple. Faces with an inradius below `min_inradius` [m]
    (default: `MIN_INRADIUS` L) are left out; a patch of a curved solid, whose neighbours continue
    it, only where the solid's least radius is below that too. The default clearance is, for each
    face, the lesser of `DEFAULT_CLEARANCE` L and `CLEARANCE_OF_INRADIUS` times its inradius.
    Regions are sorted by face, then centroid.
    """
    L = polyhedron.diameter
    polygons = polyhedron.polygon_F
    narrowest = MIN_INRADIUS * L if min_inradius is None else min_inradius
    wide = max(narrowest, edge_clearance or 0.0, DEFAULT_CLEARANCE / CLEARANCE_OF_INRADIUS * L)
    radius = _radii(polyhedron, polygons, wide)
    clearance = np.minimum(DEFAULT_CLEARANCE * L, CLEARANCE_OF_INRADIUS * radius)
    if edge_clearance is not None:
        clearance = np.full(len(radius), edge_clearance)
    is_wide = np.maximum(radius, polyhedron.least_radius_of_solid) >= narrowest
    kept = np.flatnonzero(is_wide & (radius > clearance))
    eroded = shrunk(polygons[kept], clearance[kept])
    parts, owner = shapely.get_parts(
        shapely.simplify(eroded, LENGTH_TOLERANCE * L), return_index=True
    )
    solid = shapely.area(parts) > (LENGTH_TOLERANCE * L) ** 2
    return _regions(polyhedron, parts[solid], kept[owner[solid]])


def default_placement_errors(polyhedron: Polyhedron) -> Array:
    """Returns by how much a contact on each face may miss by default [m], shape (F,).

    The lesser of `PLACEMENT_ERROR` L and `ERROR_OF_INRADIUS` times the face's inradius, so that
    thin faces keep room for contacts that may miss.
    """
    most = PLACEMENT_ERROR * polyhedron.diameter
    radius = _radii(polyhedron, polyhedron.polygon_F, most / ERROR_OF_INRADIUS)
    return np.minimum(most, ERROR_OF_INRADIUS * radius)


def shrunk(polygons: npt.NDArray[np.object_], by: float | Array) -> npt.NDArray[np.object_]:
    """Polygons less what is nearer than `by` [m] to their edges, with sharp corners."""
    # GEOS divides by zero at some corners, to no harm, and numpy would warn of it.
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(shapely.buffer(polygons, -by, join_style="mitre"))


def _radii(polyhedron: Polyhedron, polygons: npt.NDArray[np.object_], wide: float) -> Array:
    """Inradii of the faces [m], rough ones of patches; what is above `wide` is a lower bound."""
    is_faceted = polyhedron.is_faceted
    radius = np.empty(len(polygons))
    radius[is_faceted] = rough_inradius(polygons[is_faceted])
    radius[~is_faceted] = rough_inradius(polygons[~is_faceted], wide / 10)
    narrow = ~is_faceted & (radius <= wide)
    radius[narrow] = inradius(polygons[narrow])
    return radius


def _regions(polyhedron: Polyhedron, polygons: npt.NDArray[np.object_], face: Ints) -> Regions:
    centroid = shapely.get_coordinates(shapely.centroid(polygons))
    keys = np.round(centroid / (LENGTH_TOLERANCE * polyhedron.diameter))
    order = np.lexsort((keys[:, 1], keys[:, 0], face))
    polygons, face = shapely.orient_polygons(polygons[order]), face[order]
    R_BF, p_BF, mu = polyhedron.R_BF[face], polyhedron.p_BF[face], polyhedron.mu[face]
    xy, ring_offsets, region_offsets = np.empty((0, 2)), np.zeros(1, int), np.zeros(1, int)
    if len(polygons):
        _, xy, (ring_offsets, region_offsets) = shapely.to_ragged_array(polygons)
    vertex_region = np.repeat(np.arange(len(face)), np.diff(ring_offsets[region_offsets]))
    p_BV = p_BF[vertex_region] + np.einsum("vij,vj->vi", R_BF[vertex_region][:, :, :2], xy)
    return Regions(
        polygon_F=frozen(polygons, object),
        face=frozen(face, np.int64),
        R_BF=frozen(R_BF),
        p_BF=frozen(p_BF),
        nhat_TB_B=frozen(-R_BF[:, :, 2]),
        mu=frozen(mu),
        area=frozen(shapely.area(polygons)),
        p_BV=frozen(p_BV),
        ring_offsets=frozen(ring_offsets, np.int64),
        region_offsets=frozen(region_offsets, np.int64),
        num_left_out=len(polyhedron.faces) - len(np.unique(face)),
    )


def nearest_points(shapes: Shapes, points: Array) -> Array:
    """The point of each shape nearest to one point, (M,) and (M, 2) to (M, 2)."""
    links = shapely.shortest_line(shapes, shapely.points(points))
    nearest: Array = shapely.get_coordinates(links)[::2]
    return nearest


@dataclass(frozen=True, eq=False)
class Boundary:
    """The directed edges of all regions, flat; every vertex is the tail of exactly one edge.

    Attributes:
        tail: [m], shape (E, 3).
        head: [m], shape (E, 3).
        offsets: region r has the edges `offsets[r]:offsets[r + 1]`, shape (n + 1,).
    """

    tail: Array
    head: Array
    offsets: Ints


def boundary(regions: Regions) -> Boundary:
    """The edges of the regions' closed rings."""
    is_tail = np.ones(len(regions.p_BV), dtype=bool)
    is_tail[regions.ring_offsets[1:] - 1] = False
    tails = np.flatnonzero(is_tail)
    vertex_offsets = regions.ring_offsets[regions.region_offsets]
    return Boundary(
        tail=frozen(regions.p_BV[tails]),
        head=frozen(regions.p_BV[tails + 1]),
        offsets=frozen(np.searchsorted(tails, vertex_offsets), np.int64),
    )
