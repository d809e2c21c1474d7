"""Random solids for tests and benchmarks: closed triangle soups, counter-clockwise from outside.

Every function returns triangles in metres, shape (T, 3, 3), and is a function of its seed alone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from scipy.spatial import ConvexHull, HalfspaceIntersection
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array


def tangent_polyhedron(num_faces: int, seed: int, size: float = 0.05) -> Array:
    """A convex polyhedron with exactly `num_faces` >= 4 polygonal faces, all tangent to a sphere.

    A tangent plane touches the sphere inside all other half-spaces, so every one yields a face.
    """
    rng = np.random.default_rng(seed)
    spread = np.inf
    while spread > 4.0:
        normals = _scattered_directions(num_faces, rng)
        if ConvexHull(normals).equations[:, 3].max() > -0.1:
            continue  # The half-spaces are unbounded, or nearly so.
        solid = HalfspaceIntersection(np.c_[normals, -np.ones(num_faces)], np.zeros(3))
        spread = np.linalg.norm(solid.intersections, axis=1).max()
    planes_of_vertex = np.array(solid.dual_facets)
    faces = [
        _fan(solid.intersections[(planes_of_vertex == i).any(axis=1)], normals[i])
        for i in range(num_faces)
    ]
    return size * np.concatenate(faces)


def ellipsoid_hull(
    num_faces: int, seed: int, semi_axes: tuple[float, float, float] = (0.07, 0.05, 0.04)
) -> Array:
    """The hull of points scattered on an ellipsoid: `num_faces` triangles, an even number >= 4."""
    if num_faces < 4 or num_faces % 2:
        raise ValueError(f"{num_faces} faces: by Euler's formula 2 V - 4 triangles, even and >= 4")
    rng = np.random.default_rng(seed)
    points = _scattered_directions(num_faces // 2 + 2, rng) * semi_axes
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    inward = np.linalg.det(triangles - points.mean(axis=0)) < 0
    triangles[inward] = triangles[inward, ::-1]
    return triangles


def prism(profile: shapely.Polygon, height: float) -> Array:
    """The prism over `profile` (may be concave, may have holes) from z = 0 to `height`."""
    profile = shapely.orient_polygons(profile)
    cover = shapely.get_parts(shapely.constrained_delaunay_triangles(profile))
    ring = shapely.get_coordinates(shapely.orient_polygons(cover)).reshape(-1, 4, 2)[:, :3]
    bottom = np.pad(ring[:, ::-1], ((0, 0), (0, 0), (0, 1)))
    top = np.pad(ring, ((0, 0), (0, 0), (0, 1)), constant_values=height)
    walls = []
    for boundary in (profile.exterior, *profile.interiors):
        a = np.pad(shapely.get_coordinates(boundary), ((0, 0), (0, 1)))
        b = a + np.array([0.0, 0.0, height])
        walls += [np.stack([a[:-1], a[1:], b[1:]], axis=1), np.stack([a[:-1], b[1:], b[:-1]], 1)]
    return np.concatenate([bottom, top, *walls])


def holed_prism(num_sides: int, num_holes: int, seed: int) -> Array:
    """A randomly turned prism over a random star-shaped polygon, most often concave, with holes.

    It has `num_sides` + 2 faces and four more for each hole.
    """
    rng = np.random.default_rng(seed)
    angle = (np.arange(num_sides) + rng.uniform(-0.3, 0.3, num_sides)) * 2 * np.pi / num_sides
    radius = rng.uniform(0.05, 0.09, num_sides)
    outline = radius[:, None] * np.c_[np.cos(angle), np.sin(angle)]
    inner = 0.4 * radius.min() * np.cos(np.pi / num_sides)
    turn = (np.arange(num_holes) + rng.uniform()) * 2 * np.pi / max(num_holes, 1)
    centres = inner * np.c_[np.cos(turn), np.sin(turn)] * (num_holes > 1)
    half_diagonal = 0.4 * inner * min(1.0, 2.0 * np.sin(np.pi / max(num_holes, 2)))
    square = half_diagonal * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    profile = shapely.Polygon(outline, [centre + square for centre in centres])
    rotation = Rotation.random(random_state=seed).as_matrix()
    return prism(profile, rng.uniform(0.03, 0.1)) @ rotation.T


def boxes(num_boxes: int, seed: int, *, aligned: bool = False) -> Array:
    """Boxes around a common point, so that they overlap: each a closed shell of its own.

    With `aligned` their sides and corners are multiples of a centimetre: many are coplanar, touch
    or are doubled.
    """
    rng = np.random.default_rng(seed)
    if aligned:
        lower = 0.01 * rng.integers(-5, 0, (num_boxes, 3))
        upper = 0.01 * rng.integers(1, 6, (num_boxes, 3))
        turns = np.broadcast_to(np.eye(3), (num_boxes, 3, 3))
    else:
        lower = rng.uniform(-0.06, -0.01, (num_boxes, 3))
        upper = rng.uniform(0.01, 0.06, (num_boxes, 3))
        turns = Rotation.random(num_boxes, random_state=seed).as_matrix()
    unit = prism(shapely.box(0, 0, 1, 1), 1.0)
    scaled = lower[:, None, None] + unit * (upper - lower)[:, None, None]
    return (scaled @ turns.swapaxes(-1, -2)[:, None]).reshape(-1, 3, 3)


def shells(num_shells: int, num_faces: int, seed: int) -> Array:
    """Convex shells of `num_faces` triangles each that overlap along a bent line."""
    rng = np.random.default_rng(seed)
    centre, heading, found = np.zeros(3), np.array([1.0, 0.0, 0.0]), []
    for k in range(num_shells):
        semi_axes = tuple(rng.uniform(0.03, 0.06, 3))
        turn = Rotation.random(random_state=seed + 1000 * k).as_matrix()
        found.append(ellipsoid_hull(num_faces, seed + k, semi_axes) @ turn + centre)
        heading = heading + rng.normal(scale=0.5, size=3)
        centre = centre + 0.02 * heading / np.linalg.norm(heading)
    return np.concatenate(found)


def write_obj(path: Path, triangles: Array) -> None:
    """Writes `triangles` as a Wavefront OBJ, equal vertices welded."""
    vertices, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (index.reshape(-1, 3) + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")


def _scattered_directions(count: int, rng: np.random.Generator) -> Array:
    """Unit vectors, shape (count, 3): each the farthest of ten candidates from those before."""
    chosen = np.empty((count, 3))
    for i in range(count):
        candidates = rng.normal(size=(10, 3))
        candidates /= np.linalg.norm(candidates, axis=1, keepdims=True)
        nearest = (candidates @ chosen[:i].T).max(axis=1, initial=-1.0)
        chosen[i] = candidates[nearest.argmin()]
    return chosen


def _fan(vertices: Array, normal: Array) -> Array:
    """Triangles of the convex polygon with these vertices, counter-clockwise about `normal`."""
    arms = vertices - vertices.mean(axis=0)
    x = arms[0] / np.linalg.norm(arms[0])
    ring = vertices[np.argsort(np.arctan2(arms @ np.cross(normal, x), arms @ x))]
    return np.stack([np.broadcast_to(ring[0], ring[1:-1].shape), ring[1:-1], ring[2:]], axis=1)
