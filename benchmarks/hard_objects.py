"""Solids on which a search for grasps fails most easily: spiky, thin, concave or nearly flat.

Each family is a function of a seed alone, which also picks the friction coefficient, from 0.1 to
0.8. All are in metres, about a hand's size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from shapely.affinity import rotate, translate

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import GraspObject
from tests.support.convex_polyhedra import boxes, ellipsoid_hull, holed_prism, prism, shells
from tests.support.solids import solid

FRICTIONS = (0.1, 0.3, 0.8, 0.2, 0.5, 0.15)
SEEDS = 18
"""Of each family, each friction coefficient three times."""
_GOLDEN = (1 + np.sqrt(5)) / 2
_SIGNS = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T


class HardObject(NamedTuple):
    """An object to plan on."""

    family: str
    name: str
    mu: float
    make: Callable[[], GraspObject]


def hard_objects(first_seed: int = 0, num_seeds: int = SEEDS) -> Iterator[HardObject]:
    """`num_seeds` objects of each family, from seed `first_seed`."""
    for family, parts in _FAMILIES.items():
        for seed in range(first_seed, first_seed + num_seeds):
            mu = FRICTIONS[seed % len(FRICTIONS)]
            make = partial(_object_of, parts, seed, mu)
            yield HardObject(family, f"{family}_{seed} (mu {mu:g})", mu, make)


def _object_of(parts: Callable[[int], list[Array]], seed: int, mu: float) -> GraspObject:
    return solid(*parts(seed), mu=mu)


def stellated(points: Array, height: Array | float) -> Array:
    """A pyramid on each face of the convex hull of some points.

    Args:
        points: shape (N, 3) [m].
        height: of each pyramid over the distance of its face from the origin, one or one a face.
    """
    hull = ConvexHull(points)
    planes = np.round(hull.equations, 9)
    normals, face = np.unique(planes, axis=0, return_inverse=True)
    heights = np.broadcast_to(height, len(normals))
    triangles = []
    for k, normal in enumerate(normals[:, :3]):
        corners = points[np.unique(hull.simplices[face.ravel() == k])]
        middle = corners.mean(axis=0)
        apex = middle + heights[k] * abs(normals[k, 3]) * normal
        arms = corners - middle
        turn = np.arctan2(
            arms @ np.cross(normal, arms[0]), arms @ arms[0] / np.linalg.norm(arms[0])
        )
        ring = corners[np.argsort(np.arctan2(np.sin(turn), np.cos(turn)))]
        triangles += [[a, b, apex] for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    return np.array(triangles)


def _platonic(number: int) -> Array:
    """Corners of a tetrahedron, cube, octahedron, dodecahedron or icosahedron of radius 1."""
    g = _GOLDEN
    cyclic = [np.roll([0.0, a, b * g], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)]
    inverse = [np.roll([0.0, a * g, b / g], k) for k in range(3) for a in (-1, 1) for b in (-1, 1)]
    corners = (
        _SIGNS[_SIGNS.prod(axis=1) > 0],
        _SIGNS,
        np.concatenate([np.eye(3), -np.eye(3)]),
        np.concatenate([_SIGNS, inverse]),
        np.array(cyclic),
    )[number % 5]
    points: Array = np.asarray(corners, dtype=float)
    return points / np.linalg.norm(points[0])


def _stellation(seed: int) -> list[Array]:
    """A platonic solid with equal pyramids, from flat to twice as high as the solid is deep."""
    height = (0.8, 0.3, 1.5, 2.0)[(seed // 5) % 4]
    return [stellated(0.05 * _platonic(seed), height)]


def _spikes(seed: int) -> list[Array]:
    """A random polyhedron, some of whose faces carry spikes of random heights."""
    rng = np.random.default_rng(seed)
    points = np.unique(
        ellipsoid_hull(int(rng.choice([8, 12, 20, 30])), seed).reshape(-1, 3), axis=0
    )
    height = rng.uniform(0.3, 2.5, len(ConvexHull(points).simplices))
    return [stellated(points, height * (rng.random(len(height)) < 0.8))]


def _gear(seed: int) -> list[Array]:
    """A wheel of 6 to 20 tapered teeth, from a coin to a shaft."""
    rng = np.random.default_rng(seed)
    teeth, outer = int(rng.integers(6, 21)), 0.05
    inner = outer * rng.uniform(0.6, 0.9)
    angle = 2 * np.pi * (np.arange(teeth)[:, None] + [0.0, 0.25, 0.35, 0.65, 0.75]) / teeth
    angle = np.delete(angle, 0, axis=1)
    radius = np.array([inner, outer, outer, inner])
    outline = (radius * np.stack([np.cos(angle), np.sin(angle)])).reshape(2, -1).T
    profile = shapely.Polygon(outline)
    if seed % 2:
        profile -= shapely.Point(0, 0).buffer(0.3 * inner, quad_segs=2)
    return [_turned(prism(profile, rng.choice([0.004, 0.015, 0.06])), seed)]


def _box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> Array:
    low, high = np.array(lower), np.array(upper)
    triangles: Array = low + prism(shapely.box(0, 0, 1, 1), 1.0) * (high - low)
    return triangles


def _tray(seed: int) -> list[Array]:
    """A flat open box with walls of 1 to 3 mm."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.05, 0.15, 2)
    z, t = rng.uniform(0.006, 0.03), rng.uniform(0.001, 0.003)
    return [
        _box((0, 0, 0), (x, y, t)),
        _box((0, 0, 0), (x, t, z)),
        _box((0, y - t, 0), (x, y, z)),
        _box((0, 0, 0), (t, y, z)),
        _box((x - t, 0, 0), (x, y, z)),
    ]


def _knife(seed: int) -> list[Array]:
    """A blade of 1 to 8 degrees, or a plate of 0.5 to 2 mm whose rim is bevelled on both sides."""
    rng = np.random.default_rng(seed)
    length, width = rng.uniform(0.08, 0.15), rng.uniform(0.02, 0.06)
    if seed % 2:
        half = width * np.tan(np.radians(rng.uniform(1, 8)) / 2)
        profile = shapely.Polygon([(0, -half), (width, 0), (0, half)])
        return [_turned(prism(profile, length), seed)]
    half, bevel = rng.uniform(0.00025, 0.001), rng.uniform(0.1, 0.4) * width
    face = np.array(shapely.box(-length / 2, -width / 2, length / 2, width / 2).exterior.coords)[:4]
    rim = face * (1 + bevel / np.abs(face).min())
    z = [np.full(4, z) for z in (-half, 0.0, half)]
    points = np.concatenate([np.column_stack(p) for p in zip((face, rim, face), z, strict=True)])
    return [_turned(_hull(points), seed)]


def _hull(points: Array) -> Array:
    """The convex hull's triangles, counter-clockwise from outside."""
    hull = ConvexHull(points)
    triangles: Array = points[hull.simplices]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0
    triangles[inward] = triangles[inward, ::-1]
    return triangles


def _small_faces(seed: int) -> list[Array]:
    """A large block with its corners cut off and small knobs, or a large wedge with a step."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.04, 0.08, 3)
    taper = 1 - rng.uniform(0.2, 0.7, 2) * (seed % 3 > 0)
    corners = _SIGNS * size / 2
    corners[corners[:, 2] > 0, :2] *= taper
    cuts = [
        corner + share * rng.uniform(0.04, 0.15) * (other - corner)
        for corner in corners
        for other in corners
        if (share := float(np.isclose(np.sign(corner) @ np.sign(other), 1.0))) > 0
    ]
    knob = rng.uniform(0.004, 0.01)
    parts = [_hull(np.array(cuts))]
    for axis in range(seed % 4):
        place = 0.3 * size * rng.uniform(-1, 1, 3)
        place[axis] = -size[axis] / 2
        parts.append(_box(tuple(place - knob), tuple(place + knob)))
    return parts


def _comb(seed: int) -> list[Array]:
    """A bar with 3 to 12 teeth, parallel or tapered."""
    rng = np.random.default_rng(seed)
    teeth, depth = int(rng.integers(3, 13)), rng.uniform(0.01, 0.05)
    pitch = 0.12 / teeth
    taper = 0.0 if seed % 2 else rng.uniform(0.1, 0.35)
    lower, upper = 0.3 * pitch, (0.3 - taper) * pitch
    top = [
        point
        for k in range(teeth)
        for point in (
            ((k + 0.5) * pitch - lower, 0.015),
            ((k + 0.5) * pitch - max(upper, 0.02 * pitch), 0.015 + depth),
            ((k + 0.5) * pitch + max(upper, 0.02 * pitch), 0.015 + depth),
            ((k + 0.5) * pitch + lower, 0.015),
        )
    ]
    profile = shapely.Polygon([(0, 0), (0, 0.015), *top, (0.12, 0.015), (0.12, 0)])
    return [_turned(prism(profile, rng.uniform(0.003, 0.04)), seed)]


def _prism(seed: int) -> list[Array]:
    """A concave prism with up to three holes."""
    return [holed_prism(5 + seed % 8, seed % 4, seed)]


def _letter(seed: int) -> list[Array]:
    """A prism over an L, U, T, Z, a cross or a frame, with strokes from thin to thick."""
    rng = np.random.default_rng(seed)
    stroke = rng.uniform(0.003, 0.02)
    x, y = rng.uniform(0.05, 0.1, 2)

    def bar(left: float, low: float, right: float, high: float) -> shapely.Polygon:
        line = shapely.LineString([(left * x, low * y), (right * x, high * y)])
        return line.buffer(stroke / 2, cap_style="square")

    letters = (
        [bar(0, 0, 0, 1), bar(0, 0, 1, 0)],
        [bar(0, 0, 0, 1), bar(0, 0, 1, 0), bar(1, 0, 1, 1)],
        [bar(0.5, 0, 0.5, 1), bar(0, 1, 1, 1)],
        [bar(0, 0, 0.5, 0), bar(0.5, 0, 0.5, 1), bar(0.5, 1, 1, 1)],
        [bar(0.5, 0, 0.5, 1), bar(0, 0.5, 1, 0.5)],
        [bar(0, 0, 1, 0), bar(0, 1, 1, 1), bar(0, 0, 0, 1), bar(1, 0, 1, 1)],
    )
    profile = shapely.union_all(letters[seed // 3 % 6])
    return [_turned(prism(profile, rng.uniform(0.005, 0.05)), seed)]


def _union(seed: int) -> list[Array]:
    """Overlapping boxes or convex shells."""
    if seed % 2:
        return [shells(2 + seed % 3, 20, seed)]
    return [boxes(2 + seed % 4, seed, aligned=seed % 4 == 0)]


def _star(seed: int) -> list[Array]:
    """A prism over a star with 5 to 12 sharp points, or two pyramids over it."""
    rng = np.random.default_rng(seed)
    points, ratio = int(rng.integers(5, 13)), rng.uniform(0.3, 0.75)
    angle = np.pi * np.arange(2 * points) / points
    radius = 0.05 * np.where(np.arange(2 * points) % 2, ratio, 1.0)
    outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    if seed % 2:
        return [_turned(prism(shapely.Polygon(outline), rng.uniform(0.005, 0.08)), seed)]
    ring = np.pad(outline, ((0, 0), (0, 1)))
    following = np.roll(ring, -1, axis=0)
    high, low = rng.uniform(0.01, 0.06, 2)
    apices = np.broadcast_to([0, 0, high], ring.shape), np.broadcast_to([0, 0, -low], ring.shape)
    upper = np.stack([ring, following, apices[0]], axis=1)
    lower = np.stack([following, ring, apices[1]], axis=1)
    return [_turned(np.concatenate([upper, lower]), seed)]


def _sliver(seed: int) -> list[Array]:
    """The hull of points on a very flat or very long ellipsoid, or a steep frustum."""
    rng = np.random.default_rng(seed)
    axes = ((0.07, 0.05, 0.003), (0.1, 0.008, 0.008), (0.07, 0.06, 0.02))[seed % 3]
    faces = int(rng.choice([8, 14, 24, 40]))
    if seed % 4:
        return [ellipsoid_hull(faces, seed, axes)]
    sides = int(rng.integers(3, 9))
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    base = np.pad(0.04 * ring, ((0, 0), (0, 1)))
    top = np.pad(rng.uniform(0.005, 0.02) * ring, ((0, 0), (0, 1)), constant_values=(0.0, 0.0))
    top[:, 2] = rng.uniform(0.02, 0.1)
    return [_turned(_hull(np.concatenate([base, top])), seed)]


def _bent(seed: int) -> list[Array]:
    """Bars that cross at odd angles, as caltrops and jacks."""
    rng = np.random.default_rng(seed)
    thickness = rng.uniform(0.004, 0.015)
    bars = []
    for k in range(2 + seed % 4):
        length = rng.uniform(0.05, 0.12)
        profile = translate(rotate(shapely.box(0, 0, thickness, thickness), 30 * k), 1e-3 * k)
        bar = prism(profile, length) - [0, 0, rng.uniform(0.2, 0.8) * length]
        bars.append(bar @ Rotation.random(random_state=100 * seed + k).as_matrix().T)
    return bars


def _turned(triangles: Array, seed: int) -> Array:
    turned: Array = triangles @ Rotation.random(random_state=seed).as_matrix().T
    return turned


_FAMILIES: dict[str, Callable[[int], list[Array]]] = {
    "stellation": _stellation,
    "spikes": _spikes,
    "gear": _gear,
    "tray": _tray,
    "knife": _knife,
    "small_faces": _small_faces,
    "comb": _comb,
    "prism": _prism,
    "letter": _letter,
    "union": _union,
    "star": _star,
    "sliver": _sliver,
    "bent": _bent,
}
