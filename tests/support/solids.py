"""Named solids, and what makes faces, regions and objects of polygons, for the planner's tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial.transform import Rotation
from shapely.affinity import affine_transform

from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.geometry.polyhedron import Face, Polyhedron, surface_vertices, volume_centroid
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.planar import Scale
from tests.support.convex_polyhedra import prism

X, Y, Z = np.eye(3)
UNIT = Scale(np.zeros(3), rho=1.0, diameter=1.0)
"""Of objects of loose faces, about the origin."""


def regular_polygon(num_sides: int, radius: float = 0.04) -> shapely.Polygon:
    """Around the origin, with a vertex on the positive x axis."""
    turn = 2 * np.pi * np.arange(num_sides) / num_sides
    return shapely.Polygon(radius * np.c_[np.cos(turn), np.sin(turn)])


def star(rng: np.random.Generator, num_sides: int, num_holes: int = 0) -> shapely.Polygon:
    """A random star-shaped polygon of size about 1 around the origin, with triangular holes."""
    angle = (np.arange(num_sides) + rng.uniform(-0.3, 0.3, num_sides)) * 2 * np.pi / num_sides
    outline = rng.uniform(0.5, 1.0, (num_sides, 1)) * np.c_[np.cos(angle), np.sin(angle)]
    polygon = shapely.Polygon(outline)
    for _ in range(num_holes):
        corners = rng.uniform(-0.25, 0.25, 2) + rng.uniform(-0.15, 0.15, (3, 2))
        polygon = polygon - shapely.Polygon(corners)
    return max(shapely.get_parts(polygon), key=shapely.area)


def face(
    polygon: shapely.Polygon,
    Fx: npt.ArrayLike = X,
    Fy: npt.ArrayLike = Y,
    p_BF: npt.ArrayLike = (0.0, 0.0, 0.0),
    mu: float = 0.3,
) -> Face:
    """A face in the plane of Fx and Fy; its outward normal is Fx x Fy."""
    R_BF = np.column_stack([Fx, Fy, np.cross(Fx, Fy)])
    return Face(frozen(R_BF), frozen(p_BF), shapely.orient_polygons(polygon), mu)


def top(polygon: shapely.Polygon, z: float, mu: float = 0.3) -> Face:
    """A face at height z that a finger pushes down on; `polygon` in coordinates x and y."""
    return face(polygon, X, Y, (0, 0, z), mu)


def bottom(polygon: shapely.Polygon, z: float, mu: float = 0.3) -> Face:
    """A face at height z that a finger pushes up on; `polygon` in coordinates x and y."""
    return face(affine_transform(polygon, [1, 0, 0, -1, 0, 0]), X, -Y, (0, 0, z), mu)


def regions_of(faces: Sequence[Face], diameter: float = 1.0) -> Regions:
    """Whole faces as regions, in the order given; they need not enclose anything."""
    none = np.empty((0, 3, 3))
    polyhedron = Polyhedron(tuple(faces), diameter, frozen(none), frozen([], np.int64))
    return erode(polyhedron, edge_clearance=0.0, min_inradius=0.0)


def object_of(polyhedron: Polyhedron, mass: float | None = 1.0) -> GraspObject:
    """Of uniform density."""
    p_BBcm = volume_centroid(polyhedron)
    rho = float(np.linalg.norm(surface_vertices(polyhedron) - p_BBcm, axis=1).max())
    return GraspObject(polyhedron, mass, frozen(p_BBcm), rho)


def solid(*parts: Array, mu: float = 0.3) -> GraspObject:
    """The union of closed triangle soups."""
    return object_of(build_polyhedron([Part(part, mu) for part in parts]))


def random_contacts(polyhedron: Polyhedron, count: int, seed: int) -> tuple[Array, Array, Ints]:
    """Points [m], inward normals and faces, inside the eroded regions of a polyhedron."""
    regions = erode(polyhedron)
    rng = np.random.default_rng(seed)
    row = rng.integers(len(regions.face), size=count)
    triangles = [shapely.constrained_delaunay_triangles(polygon) for polygon in regions.polygon_F]
    corners = [shapely.get_coordinates(rng.choice(triangles[r].geoms))[:3] for r in row]
    xy = np.einsum("ni,nij->nj", rng.dirichlet(np.ones(3), size=count), np.array(corners))
    p_BC = regions.p_BF[row] + np.einsum("nij,nj->ni", regions.R_BF[row][:, :, :2], xy)
    return p_BC, regions.nhat_TB_B[row], regions.face[row]


def scale_of(object_: GraspObject) -> Scale:
    return Scale(object_.p_BBcm, object_.rho, object_.polyhedron.diameter)


def moved(
    object_: GraspObject,
    R: Array,
    p: npt.ArrayLike,
    size: float = 1.0,
    order: Ints | None = None,
    turn: Array | None = None,
) -> GraspObject:
    """The object scaled, turned by R and shifted by p; its faces in another order.

    New face k is the old face order[k], its frame turned by turn[k] [rad] about its normal.
    """
    polyhedron = object_.polyhedron
    n = len(polyhedron.faces)
    order = np.arange(n) if order is None else order
    turn = np.zeros(n) if turn is None else turn
    faces = []
    for old, angle in zip(order, turn, strict=True):
        f = polyhedron.faces[old]
        c, s = size * np.cos(angle), size * np.sin(angle)
        faces.append(
            Face(
                frozen(R @ f.R_BF @ Rotation.from_euler("z", angle).as_matrix()),
                frozen(size * R @ f.p_BF + p),
                affine_transform(f.polygon_F, [c, s, -s, c, 0, 0]),
                f.mu,
            )
        )
    position = np.append(np.argsort(order), -1)
    there = replace(
        polyhedron,
        faces=tuple(faces),
        diameter=size * polyhedron.diameter,
        triangles_B=frozen(size * polyhedron.triangles_B @ R.T + p),
        triangle_face=frozen(position[polyhedron.triangle_face], np.int64),
    )
    p_BBcm = frozen(size * R @ object_.p_BBcm + p)
    return replace(object_, polyhedron=there, p_BBcm=p_BBcm, rho=size * object_.rho)


def cube(side: float = 0.06, mu: float = 0.3) -> GraspObject:
    return solid(prism(shapely.box(0, 0, side, side), side), mu=mu)


def regular_prism(num_sides: int, mu: float = 0.3) -> GraspObject:
    return solid(prism(regular_polygon(num_sides), 0.05), mu=mu)
