"""Near-planar patches of curved and noisy surfaces, where Section 2 of the paper asks for faces.

A scan has a facet every millimetre, and a planner on faces has nothing to grasp there. Facets that
together are almost a plane make one patch, which is planned on like a face; contacts then move to
the facets themselves. Patches may overlap: each reaches as far from its seed as the tolerances
let it, and seeds are what no earlier patch has reached, so all are wide and few are needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arguments import check_number, refuse
from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.geometry.inradius import rough_inradius
from drake_polygrasp.geometry.sections import merged
from drake_polygrasp.geometry.shells import connected_components, edge_neighbors
from drake_polygrasp.geometry.triangles import face_frame, tidy, unit_normals
from drake_polygrasp.vectors import dot, times

PATCH_ANGLE = np.radians(12.0)
"""[rad], ours, below the friction angle of most pairs: how far normals lean within a patch."""
PATCH_DEPTH = 0.005
"""Times the diameter L, ours: how far facets lie off the plane of their patch. On a sphere of
diameter L, this depth on either side is reached where the angle is."""
_MANY_FACETS = 1000
"""Ours: bodies of no more planar faces than this are planned on as they are."""
_BROAD = 0.0025
"""Times L squared, ours: planar faces larger than this are faces of any body."""
_ACROSS = 0.5
"""Cosine of the angle of neighbours that cannot be of one plane, whatever their noise, ours."""
_MAX_SEEDS = 1000
"""Ours: bounds the time on surfaces too rough for patches."""
_SMOOTHING = 0.02
"""Times L, ours: normals of noise are averaged over about this distance, a fingertip's radius."""
_NARROW = 0.01
"""Times L, ours: half the width of whiskers, and radius of holes, that outlines do without."""
_NARROWEST = 0.002
"""Times L, ours: the inradius below which there is no patch."""
_SIMPLER = 0.3
"""Times half a whisker's width, ours: how far outlines may run off the zigzag of facets."""
_MOST = 300
"""Ours: of more patches the widest are enough to grasp a body by."""
_SMALL_SHARE = 0.1
"""Of the inradius of the widest patch, ours: what rounded edges and noise leave is narrower."""
_GRID = 1e-9
"""Times L, ours: what makes unions robust."""
_FOLDED = 0.1
"""Cosine of the angle beyond which a facet does not count for the outline, ours."""


class Patch(NamedTuple):
    """A plane fitted to connected facets, and their outline.

    Attributes:
        R_BF: shape (3, 3), Fz outward.
        offset: of the plane along Fz [m].
        polygon_F: outline in the plane of the patch [m].
        reach: greatest distance of the facets from the plane [m].
        triangles: rows of the triangles of the patch.
        mu: friction coefficient.
    """

    R_BF: Array
    offset: float
    polygon_F: shapely.Polygon
    reach: float
    triangles: Ints
    mu: float


def check_tolerances(angle: float | None, depth: float | None) -> None:
    """Raise UsageError for an angle [rad] or a depth [m] that no patch has."""
    demand = "radians, above 0 and below pi/2"
    if angle is not None and not check_number("patch_angle", angle, demand, above=0.0) < np.pi / 2:
        raise refuse("patch_angle", angle, demand)
    if depth is not None:
        check_number("patch_depth", depth, "a length in metres, above 0", above=0.0)


def curved_triangles(vertices: Array, corners: Ints, L: float, flatness: float) -> Bools:
    """Which triangles are facets of a curved or noisy surface, shape (T,).

    None on bodies of at most `_MANY_FACETS` planes; on others all but those of broad planes.
    Vertices `flatness` [m] off a plane lie in it.
    """
    num = len(corners)
    if num <= _MANY_FACETS:
        return np.zeros(num, dtype=bool)
    nhat, area = unit_normals(vertices[corners])
    centroid = vertices[corners].mean(axis=1)
    t, u = edge_neighbors(corners)
    lift = np.einsum("nij,nj->ni", vertices[corners[u]] - centroid[t][:, None], nhat[t])
    flat = np.abs(lift).max(axis=1) <= flatness
    # A facet across an edge may be so small that its vertices are in the plane, too.
    flat &= np.einsum("ni,ni->n", nhat[t], nhat[u]) > _ACROSS
    plane = connected_components(num, t[flat], u[flat])
    # Many small turns make a curve: planes that are not flat as a whole fall apart.
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
    """Patches of the facets `corners` (T, 3), of friction `mu` (T,), flattest seeds first.

    A patch holds the facets connected to its seed whose normals, their own or those smoothed over
    a fingertip's radius, lean by at most `angle` [rad] (default: `PATCH_ANGLE`) from the seed's,
    and whose vertices lie within twice `depth` [m] (default: `PATCH_DEPTH` L) of its plane, so that
    a plane between them is `depth` away.
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
        # No disc is larger than the polygon that holds it.
        if size[k] < np.pi * least**2:
            break
        patch = _fit(surface, grown[k], L, least)
        if patch is not None:
            width = float(rough_inradius(np.array([patch.polygon_F]))[0])
            fitted[k] = patch, width
            widest = max(widest, width)
            # Outlines are wider than their facets by no more than what makes them simpler.
            least = max(least, _SMALL_SHARE * widest / (1 + _SIMPLER / 2))
    wide = [k for k, (_, width) in fitted.items() if width >= _SMALL_SHARE * widest]
    kept = sorted(wide, key=lambda k: (-fitted[k][1], k))[:_MOST]
    return [fitted[k][0] for k in sorted(kept)]


class _Surface(NamedTuple):
    """Facets and what growing asks of them again and again."""

    vertices: Array
    corners: Ints
    mu: Array
    neighbors: Ints
    """Facets across the three sides, -1 for none, shape (T, 3)."""
    nhat: Array
    area: Array
    smooth: Array
    """Normals averaged over `_SMOOTHING`, shape (T, 3)."""
    flatness: Array
    """Length of the mean of unit normals around: 1 on a plane, shape (T,)."""

    def seeds(self) -> Ints:
        """Facets, the flattest to a hundredth first, then the largest."""
        return np.lexsort((-self.area, -np.round(self.flatness, 2)))


def _surface(vertices: Array, corners: Ints, mu: Array, L: float) -> _Surface:
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
        # A quarter each of the facet and its neighbours; the last row stands for none.
        padded = np.pad(total, ((0, 1), (0, 0)))
        total = (total + padded[neighbors].sum(axis=1)) / 4
    length = np.linalg.norm(total[:, :3], axis=1)
    smooth = total[:, :3] / np.where(length > 0, length, 1)[:, None]
    flatness = length / np.where(total[:, 3] > 0, total[:, 3], 1)
    return _Surface(vertices, corners, mu, neighbors, nhat, area, smooth, flatness)


def _grow(surface: _Surface, seed: int, cos_angle: float, band: float) -> Ints:
    normal = surface.smooth[seed]
    level = dot(surface.vertices[surface.corners[seed]], normal).mean()
    met = np.zeros(len(surface.corners) + 1, dtype=bool)
    met[[seed, -1]] = True  # The last is neighbour -1, which is none.
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
    """The plane of the mean normal through the mean point; None for an inradius below `least`."""
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
    """The widest polygon of the union of triangles (k, 3, 2), without whiskers, simplified."""
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
