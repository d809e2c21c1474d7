"""The regions of an object's faces that contacts may use, away from edges: the planner's A_i.

In Section 2 of the paper no contact lies on an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, Shapes, distinct_values, frozen
from drake_polygrasp.geometry.inradius import inradius, rough_inradius
from drake_polygrasp.geometry.polygons import polygon_corners, shrunk
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE

DEFAULT_CLEARANCE = 0.01
"""Times the diameter L, our choice: least distance of contacts from edges."""
CLEARANCE_OF_INRADIUS = 0.2
"""Times a face's inradius, our choice: least distance of contacts from edges on small faces."""
PLACEMENT_ERROR = 0.02
"""Times the diameter L, our choice: a typical error of a robot's fingertips."""
ERROR_OF_INRADIUS = 0.5
"""Times a face's inradius, our choice: contacts on small faces may miss by no more than this."""
MIN_INRADIUS = 0.002
"""Times the diameter L, our choice: faces with a smaller inradius are too narrow for a finger."""


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions that erosion leaves of the faces: the planner's A_i, one row each.

    The rings of region r begin and end at the vertices `ring_offsets[region_offsets[r]:
    region_offsets[r + 1] + 1]`; the first ring is the exterior.

    Attributes:
        polygon_F: shapely Polygons in the frame F of their face [m], shape (n,).
        face: index of the face, shape (n,).
        R_BF: orientation of the face, shape (n, 3, 3).
        p_BF: origin of the face's frame [m], shape (n, 3).
        nhat_TB_B: inward unit normal, shape (n, 3).
        mu: friction coefficient, shape (n,).
        area: [m^2], shape (n,).
        p_BV: vertices of all rings, the first of each repeated at its end [m], shape (V, 3).
        ring_offsets: index in `p_BV` at which each ring begins, and V.
        region_offsets: index of the first ring of each region, and the number of rings.
        num_left_out: number of faces without a region, because they are too narrow.
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
        """Returns some of the regions.

        Args:
            kept: whether to keep each region, shape (n,).
        """
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
    least_clearance: float | Array = 0.0,
) -> Regions:
    """Returns the parts of the faces that keep a distance from every edge.

    This is the paper's security distance, applied once and before everything else. At reflex
    corners the offset edges are extended to their intersection, which removes a little more than
    the distance and keeps polygons simple.

    Args:
        polyhedron: the body.
        edge_clearance: the distance [m]; by default, for each face, the lesser of
            `DEFAULT_CLEARANCE` L and `CLEARANCE_OF_INRADIUS` times its inradius.
        min_inradius: least inradius of a face [m], by default `MIN_INRADIUS` L. A patch of a curved
            solid, which continues in its neighbours, may be narrower if the least radius of the
            solid is not.
        least_clearance: what the distance is at least [m], one number or one for each face, shape
            (F,).

    Returns:
        Regions, sorted by face, then centroid; a face can have several.
    """
    L = polyhedron.diameter
    polygons = polyhedron.polygon_F
    narrowest = MIN_INRADIUS * L if min_inradius is None else min_inradius
    most = max(edge_clearance or 0.0, float(np.max(least_clearance, initial=0.0)))
    wide = max(narrowest, most, DEFAULT_CLEARANCE / CLEARANCE_OF_INRADIUS * L)
    radius = _radii(polyhedron, polygons, wide)
    clearance = np.minimum(DEFAULT_CLEARANCE * L, CLEARANCE_OF_INRADIUS * radius)
    if edge_clearance is not None:
        clearance = np.full(len(radius), edge_clearance)
    clearance = np.maximum(clearance, least_clearance)
    is_wide = np.maximum(radius, polyhedron.least_radius_of_solid) >= narrowest
    kept = np.flatnonzero(is_wide & (radius > clearance))
    eroded = shrunk(polygons[kept], clearance[kept])
    parts, owner = shapely.get_parts(
        shapely.simplify(eroded, LENGTH_TOLERANCE * L), return_index=True
    )
    solid = shapely.area(parts) > (LENGTH_TOLERANCE * L) ** 2
    return _regions(polyhedron, parts[solid], kept[owner[solid]])


def default_placement_errors(polyhedron: Polyhedron) -> Array:
    """Returns the default placement error of a contact on each face.

    It is the lesser of `PLACEMENT_ERROR` L and `ERROR_OF_INRADIUS` times the face's inradius, so
    that contacts with this error fit on narrow faces.

    Args:
        polyhedron: the body.

    Returns:
        [m], shape (F,).
    """
    most = PLACEMENT_ERROR * polyhedron.diameter
    radius = _radii(polyhedron, polyhedron.polygon_F, most / ERROR_OF_INRADIUS)
    return np.minimum(most, ERROR_OF_INRADIUS * radius)


def _radii(polyhedron: Polyhedron, polygons: npt.NDArray[np.object_], wide: float) -> Array:
    """Returns inradii of faces [m]: lower bounds for patches and above `wide`, else exact."""
    is_faceted = polyhedron.is_faceted
    radius = np.empty(len(polygons))
    radius[is_faceted] = rough_inradius(polygons[is_faceted])
    radius[~is_faceted] = rough_inradius(polygons[~is_faceted], wide / 10)
    narrow = ~is_faceted & (radius <= wide)
    radius[narrow] = inradius(polygons[narrow])
    return radius


def _regions(polyhedron: Polyhedron, polygons: npt.NDArray[np.object_], face: Ints) -> Regions:
    """Returns polygons on faces as sorted regions."""
    centroid = shapely.get_coordinates(shapely.centroid(polygons))
    keys = np.round(centroid / (LENGTH_TOLERANCE * polyhedron.diameter))
    order = np.lexsort((keys[:, 1], keys[:, 0], face))
    polygons, face = shapely.orient_polygons(polygons[order]), face[order]
    R_BF, p_BF, mu = polyhedron.R_BF[face], polyhedron.p_BF[face], polyhedron.mu[face]
    xy, ring_offsets, region_offsets = np.empty((0, 2)), np.zeros(1, int), np.zeros(1, int)
    if len(polygons):
        xy, ring_offsets, region_offsets = polygon_corners(polygons)
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
        num_left_out=len(polyhedron.faces) - len(distinct_values(face)),
    )


def regions_at(regions: Regions, face: Ints, p_BC: Array) -> Ints:
    """Returns the region of a face that each of some points is on, or is nearest to.

    Args:
        regions: the regions.
        face: face of each point, which has a region, shape (N,).
        p_BC: points expressed in B [m], shape (N, 3).

    Returns:
        Indices of regions, shape (N,).
    """
    first = np.searchsorted(regions.face, face)
    count = np.searchsorted(regions.face, face, side="right") - first
    point = np.repeat(np.arange(len(face)), count)
    region = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
    region += np.repeat(first, count)
    p_FC = np.einsum("nij,ni->nj", regions.R_BF[region], p_BC[point] - regions.p_BF[region])
    apart = shapely.distance(regions.polygon_F[region], shapely.points(p_FC[:, :2]))
    nearest = np.lexsort((apart, point))
    at: Ints = region[nearest[np.cumsum(count) - count]]
    return at


def nearest_points(shapes: Shapes, points: Array) -> Array:
    """Returns the point of each shape that is nearest to a given point.

    Args:
        shapes: shapely geometries, shape (M,).
        points: one point for each, shape (M, 2).

    Returns:
        Shape (M, 2).
    """
    links = shapely.shortest_line(shapes, shapely.points(points))
    nearest: Array = shapely.get_coordinates(links)[::2]
    return nearest


@dataclass(frozen=True, eq=False)
class Boundary:
    """The directed edges of all regions; every vertex is the tail of exactly one edge.

    Attributes:
        tail: start points [m], shape (E, 3).
        head: end points [m], shape (E, 3).
        offsets: region r has the edges `offsets[r]:offsets[r + 1]`, shape (n + 1,).
    """

    tail: Array
    head: Array
    offsets: Ints


def boundary(regions: Regions) -> Boundary:
    """Returns the edges of the regions' rings.

    Args:
        regions: the regions.
    """
    is_tail = np.ones(len(regions.p_BV), dtype=bool)
    is_tail[regions.ring_offsets[1:] - 1] = False
    tails = np.flatnonzero(is_tail)
    vertex_offsets = regions.ring_offsets[regions.region_offsets]
    return Boundary(
        tail=frozen(regions.p_BV[tails]),
        head=frozen(regions.p_BV[tails + 1]),
        offsets=frozen(np.searchsorted(tails, vertex_offsets), np.int64),
    )
