"""Near-planar patches of curved and noisy surfaces, in place of the faces of the paper's Section 2.

On a scan with a facet every millimetre no single facet is large enough to grasp. Connected facets
that are nearly coplanar form a patch, which is planned on like a face; contacts are then projected
onto the facets themselves. Patches may overlap: each grows from its seed as far as the tolerances
allow, and seeds are facets that no earlier patch has reached, so a few wide patches suffice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arguments import check_number, refuse
from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.geometry.inradius import rough_inradius
from drake_polygrasp.geometry.polygons import merged
from drake_polygrasp.geometry.shells import connected_components, edge_neighbors
from drake_polygrasp.geometry.triangles import face_frame, tidy, unit_normals
from drake_polygrasp.vectors import dot, times

PATCH_ANGLE = np.radians(12.0)
"""[rad], our choice, below the friction angle of most pairs: greatest angle between the normals of
a facet and of its patch's seed."""
PATCH_DEPTH = 0.005
"""Times the diameter L, our choice: distance of facets from the plane of their patch. On a sphere
of diameter L, `PATCH_ANGLE` leads to the same depth on either side."""
_MANY_FACETS = 1000
"""Our choice: bodies with no more planar faces get no patches of facets."""
_BROAD = 0.0025
"""Times L squared, our choice: larger planar faces stay faces on every body."""
_ACROSS = 0.5
"""Cosine, our choice: neighbours at a greater angle are not of one plane, whatever their noise."""
_MAX_SEEDS = 1000
"""Our choice: bounds the time on surfaces that are too rough for patches."""
_SMOOTHING = 0.02
"""Times L, our choice: normals are averaged over about this distance, a fingertip's radius."""
_NARROW = 0.01
"""Times L, our choice: outlines drop protrusions of at most twice this width and holes of at most
this radius."""
_NARROWEST = 0.002
"""Times L, our choice: least inradius of a patch."""
_SIMPLER = 0.3
"""Times half the width of a dropped protrusion, our choice: tolerance of simplified outlines."""
_MOST = 300
"""Our choice: greatest number of patches; the widest are kept."""
_SMALL_SHARE = 0.1
"""Times the inradius of the widest patch, our choice: narrower patches, which come from rounded
edges and noise, are dropped."""
_GRID = 1e-9
"""Times L, our choice: grid of coordinates that makes unions robust."""
_FOLDED = 0.1
"""Cosine, our choice: facets that lean more from the patch do not count for its outline."""


class Patch(NamedTuple):
    """A plane fitted to connected facets, and their outline.

    Attributes:
        R_BF: columns Fx, Fy in the plane and Fz outward, shape (3, 3).
        offset: coordinate of the plane along Fz, from Bo [m].
        polygon_F: outline in the coordinates of Fx and Fy [m].
        reach: greatest distance of a vertex of the facets from the plane [m].
        triangles: indices of the facets, shape (K,).
        mu: friction coefficient.
    """

    R_BF: Array
    offset: float
    polygon_F: shapely.Polygon
    reach: float
    triangles: Ints
    mu: float


def check_tolerances(angle: float | None, depth: float | None) -> None:
    """Checks the tolerances of patches that a user gives.

    Args:
        angle: greatest angle between normals [rad]; None for the default.
        depth: greatest distance from the plane [m]; None for the default.

    Raises:
        UsageError: when the angle is not between 0 and pi/2, or the depth not above 0.
    """
    demand = "radians, above 0 and below pi/2"
    if angle is not None and not check_number("patch_angle", angle, demand, above=0.0) < np.pi / 2:
        raise refuse("patch_angle", angle, demand)
    if depth is not None:
        check_number("patch_depth", depth, "a length in metres, above 0", above=0.0)


def curved_triangles(vertices: Array, corners: Ints, L: float, flatness: float) -> Bools:
    """Returns which triangles are facets of a curved or noisy surface.

    On bodies with at most `_MANY_FACETS` planes there are none; on others all triangles are that
    do not belong to a broad plane.

    Args:
        vertices: [m], shape (V, 3).
        corners: vertex indices, shape (T, 3).
        L: diameter of the body [m].
        flatness: vertices within this of a plane lie in it [m].

    Returns:
        Shape (T,).
    """
    num = len(corners)
    if num <= _MANY_FACETS:
        return np.zeros(num, dtype=bool)
    nhat, area = unit_normals(vertices[corners])
    centroid = vertices[corners].mean(axis=1)
    t, u = edge_neighbors(corners)
    lift = np.einsum("nij,nj->ni", vertices[corners[u]] - centroid[t][:, None], nhat[t])
    flat = np.abs(lift).max(axis=1) <= flatness
    # A neighbour at a large angle may be so small that its vertices are near the plane too.
    flat &= np.einsum("ni,ni->n", nhat[t], nhat[u]) > _ACROSS
    plane = connected_components(num, t[flat], u[flat])
    # Many small angles add up to a curve: components that are not plane as a whole are not planes.
    whole = np.bincount(plane, weights=area, minlength=num)
    seed = np.full(num, -1)
    order = np.argsort(area, kind="stable")
    seed[plane[order]] = order
    seed = seed[plane]
    lift = np.einsum("nij,nj->ni", vertices[corners] - centroid[seed][:, None], nhat[seed])
    bent = np.bincount(plane, weights=np.abs(lift).max(axis=1) > 2 * flatness, minlength=num) > 0
    if (~bent[plane] & (plane == np.arange(num))).sum() + bent[plane].sum() <= _MANY_FACETS:
        return np.zeros(num, dtype=bool)
    return np.asarray(bent[plane] | (whole[plane] < _BROAD * L**2))


def grow_patches(
    vertices: Array,
    corners: Ints,
    mu: Array,
    L: float,
    angle: float | None = None,
    depth: float | None = None,
) -> list[Patch]:
    """Returns the patches of a curved or noisy surface.

    A patch consists of the facets connected to its seed that lean little from the seed and lie
    close to its plane. Seeds are taken in the order of the flatness of their surroundings.

    Args:
        vertices: [m], shape (V, 3).
        corners: vertex indices of the facets, shape (T, 3).
        mu: friction coefficient of each facet, shape (T,); a patch has one.
        L: diameter of the body [m].
        angle: greatest angle between the normal of a facet, its own or smoothed over a fingertip's
            radius, and that of the seed [rad]; None for `PATCH_ANGLE`.
        depth: half the greatest distance of a vertex from the plane of the seed [m], about the
            depth on either side of the plane fitted later; None for `PATCH_DEPTH` L.
    """
    if not len(corners):
        return []
    angle = PATCH_ANGLE if angle is None else angle
    depth = PATCH_DEPTH * L if depth is None else depth
    surface = _surface(vertices, corners, mu, L)
    level_cosine = float(to_decimals(np.cos(angle)))
    waiting = surface.area > 0
    grown: list[Ints] = []
    for seed in surface.seeds():
        if waiting[seed]:
            grown.append(_grow(surface, int(seed), level_cosine, 2 * depth))
            waiting[grown[-1]] = False
        if len(grown) == _MAX_SEEDS:
            break
    size = np.array([surface.area[members].sum() for members in grown])
    fitted: dict[int, tuple[Patch, float]] = {}
    widest, least = 0.0, _NARROWEST * L
    for k in np.argsort(-size, kind="stable").tolist():
        # Without the area of a disc of the least inradius, neither this nor a smaller patch counts.
        if size[k] < np.pi * least**2:
            break
        patch = _fit(surface, grown[k], L, least)
        if patch is not None:
            width = float(rough_inradius(np.array([patch.polygon_F]))[0])
            fitted[k] = patch, width
            widest = max(widest, width)
            # Simplifying makes an outline wider than its facets by at most this factor.
            least = max(least, _SMALL_SHARE * widest / (1 + _SIMPLER / 2))
    wide = [k for k, (_, width) in fitted.items() if width >= _SMALL_SHARE * widest]
    kept = sorted(wide, key=lambda k: (-fitted[k][1], k))[:_MOST]
    return [fitted[k][0] for k in sorted(kept)]


class _Surface(NamedTuple):
    """Facets with the properties that growing patches needs.

    Attributes:
        vertices: [m], shape (V, 3).
        corners: vertex indices, shape (T, 3).
        mu: friction coefficients, shape (T,).
        neighbors: facets of the same friction across the three sides, -1 for none, shape (T, 3).
        nhat: outward unit normals, shape (T, 3).
        area: [m^2], shape (T,).
        smooth: unit normals averaged over `_SMOOTHING` L, shape (T, 3).
        flatness: length of that average before it was normalised, 1 on a plane, shape (T,).
    """

    vertices: Array
    corners: Ints
    mu: Array
    neighbors: Ints
    nhat: Array
    area: Array
    smooth: Array
    flatness: Array

    def seeds(self) -> Ints:
        """Returns the facets by descending flatness, rounded to a hundredth, then area."""
        return np.lexsort((-self.area, -np.round(self.flatness, 2)))


def _surface(vertices: Array, corners: Ints, mu: Array, L: float) -> _Surface:
    """Returns facets with their neighbours and smoothed normals."""
    nhat, area = unit_normals(vertices[corners])
    t, u = edge_neighbors(corners)
    same = mu[t] == mu[u]
    t, u = t[same], u[same]
    neighbors = np.full((len(corners), 3), -1)
    for column in range(3):
        free = neighbors[t, column] < 0
        neighbors[t[free], column] = u[free]
        placed = free & (neighbors[t, column] == u)
        t, u = t[~placed], u[~placed]
    edge = np.sqrt(2 * area.sum() / max(1, len(corners)))
    rounds = int(np.clip(np.ceil((_SMOOTHING * L / edge) ** 2), 1, 30))
    total = np.column_stack([nhat * area[:, None], area])
    for _ in range(rounds):
        # A quarter each of the facet and its three neighbours; the last row, 0, stands for none.
        padded = np.pad(total, ((0, 1), (0, 0)))
        total = (total + padded[neighbors].sum(axis=1)) / 4
    length = np.linalg.norm(total[:, :3], axis=1)
    smooth = total[:, :3] / np.where(length > 0, length, 1)[:, None]
    flatness = length / np.where(total[:, 3] > 0, total[:, 3], 1)
    return _Surface(vertices, corners, mu, neighbors, nhat, area, smooth, flatness)


def _grow(surface: _Surface, seed: int, cos_angle: float, band: float) -> Ints:
    """Returns the facets of the patch around a seed, by breadth-first search."""
    normal = surface.smooth[seed]
    level = dot(surface.vertices[surface.corners[seed]], normal).mean()
    met = np.zeros(len(surface.corners) + 1, dtype=bool)
    met[[seed, -1]] = True  # The last entry stands for neighbour -1, which is none.
    frontier = np.array([seed])
    found = [frontier]
    while len(frontier):
        fresh = np.zeros_like(met)
        fresh[surface.neighbors[frontier]] = True
        around = np.flatnonzero(fresh & ~met)
        met[around] = True
        height = times(surface.vertices[surface.corners[around]], normal) - level
        near = (np.abs(height) <= band).all(axis=1)
        near &= (times(surface.nhat[around], normal) >= cos_angle) | (
            times(surface.smooth[around], normal) >= cos_angle
        )
        frontier = around[near]
        found.append(frontier)
    return np.concatenate(found)


def _fit(surface: _Surface, members: Ints, L: float, least: float) -> Patch | None:
    """Returns the patch in the plane of mean normal and point; None for inradii below `least`."""
    area, nhat = surface.area[members], surface.nhat[members]
    weight = area / area.sum()
    R_BF = face_frame(tidy(times(nhat.T, weight)))
    corners = surface.corners[members]
    points = times(surface.vertices[corners], R_BF)
    offset = float(times(points[:, :, 2].mean(axis=1), weight))
    upright = times(nhat, R_BF[:, 2]) > _FOLDED
    outline = _outline(points[upright, :, :2], L, least)
    if outline is None:
        return None
    reach = float(np.abs(points[:, :, 2] - offset).max())
    return Patch(R_BF, offset, outline, reach, members, float(surface.mu[members[0]]))


def _outline(triangles: Array, L: float, least: float) -> shapely.Polygon | None:
    """Returns the widest polygon of the union of triangles (k, 3, 2), simplified.

    Narrow protrusions are cut off; the result is None for an inradius below `least`.
    """
    parts = shapely.get_parts(merged(shapely.polygons(triangles), _GRID * L))
    parts = parts[shapely.get_dimensions(parts) == 2]
    width = float(rough_inradius(parts).max(initial=0))
    if width < least:
        return None
    whisker = min(_NARROW * L, width / 2)
    core = shapely.buffer(parts, -whisker, quad_segs=2)
    core = core[np.argmax(shapely.area(core))]
    wide = shapely.buffer(core, whisker, quad_segs=2)
    parts = shapely.get_parts(shapely.simplify(wide, whisker * _SIMPLER))
    widest = parts[np.argmax(shapely.area(parts))]
    holes = [hole for hole in widest.interiors if shapely.Polygon(hole).area > np.pi * whisker**2]
    return shapely.orient_polygons(shapely.Polygon(widest.exterior, holes))
