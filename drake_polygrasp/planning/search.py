"""Beyond the paper: the best triples of sample points, however many triples there are.

For directions w that some grasps resist least, a triple of points is no better than
min_w max_i h_i(w) (see face_support.py), so a triple beats a threshold only if each w is resisted
beyond it by one of its three points. That is a set cover: a bit for each point and direction, and
a triple passes when the bits of its points, joined, are all ones. Directions come
from grasps known before, then from the best triples themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.epsilon_bound import COARSE_TURNS, critical_directions
from drake_polygrasp.geometry.polyhedron import Regions
from drake_polygrasp.planning.face_support import points_on
from drake_polygrasp.planning.planar import gather
from drake_polygrasp.wrench import force_closure, frame_wrenches

POINTS = 100
"""Sample points on objects of few regions, ours."""
POINTS_A_REGION, SOME_POINTS = 2.5, 250
"""Of more regions so many each, up to so many in all, ours."""
LEAST_A_REGION = 1.3
"""Ours, where that is more than `SOME_POINTS`."""
MOST_POINTS = 1200
"""Ours: 3e8 triples, some seconds; of more regions the largest are sampled."""
STRIDES = (4, 2, 1)
"""Each pass searches every so many of the points, ours: those before it cost little, and tell it
the directions that their winners resist least."""
MANY_POINTS = 160
"""Ours: of fewer points the first pass would see too few."""
MOST_PASSES = 5
"""Ours, where none of the triples holds yet, as on flat objects that lie on a table."""
SOURCES = 24
"""Grasps whose weakest directions are taken in each pass, ours."""
KEPT = 400
"""Triples kept in each pass at least, ours; of many points, as many."""
OUTLINE = 0.05
"""Times the distance of points, ours: regions of scans have corners that are none."""
ENOUGH = 0.75
"""Of the triples wanted, ours: for fewer the search is repeated with a lower threshold."""
DRAWN = 3000
"""Triples drawn where no grasp is known before, ours."""
_BLOCK = 8
"""Times the number wanted: triples collected before the threshold is raised."""
_AT_ONCE = 400_000
"""Ours: pairs times directions or points looked at together, some megabytes."""
_CACHED = 150_000
"""Numbers gathered at once, which stay in the cache."""
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


@dataclass(frozen=True, eq=False)
class Triples:
    """Three contacts a row."""

    region: Ints
    """Shape (M, 3)."""
    p_BC: Array
    """[m], shape (M, 3, 3)."""

    def take(self, rows: Ints) -> Triples:
        """The same for some of the rows."""
        return Triples(self.region[rows], self.p_BC[rows])


def joined(first: Triples, second: Triples) -> Triples:
    """All rows of both."""
    return Triples(
        np.concatenate([first.region, second.region]), np.concatenate([first.p_BC, second.p_BC])
    )


def best_triples(
    regions: Regions, known: Triples, p_BBcm: Array, rho: float, num: int = POINTS
) -> Triples:
    """The triples of sample points that the weakest directions of grasps bound least.

    Args:
        regions: where contacts may be; polygons may be empty or have several parts.
        known: some grasps that hold, best first; where there is none, random ones are drawn.
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        num: how many points to sample, at least one in each region.

    Returns:
        Triples that are force closure, at most as many as points or `KEPT` from each pass, those
        of the last one first.
    """
    region, p_FC = sample_points(regions, num)
    if len(region) < 3:
        return known.take(np.arange(0))
    p_BC = points_on(regions, region, p_FC)
    cones = frame_wrenches(_frames(regions)[region], (p_BC - p_BBcm) / rho, regions.mu[region])
    if not len(known.region):
        known = _drawn(regions, region, p_BC)
    strides = STRIDES[len(region) < MANY_POINTS :]
    w, found = np.empty((0, 6)), known.take(np.arange(0))
    sources = known.take(np.arange(min(SOURCES, len(known.region))))
    for number in range(MOST_PASSES):
        if number >= len(strides) and len(found.region):
            break
        w = np.concatenate([w, _weakest(regions, sources, p_BBcm, rho)])
        some = np.arange(0, len(region), strides[min(number, len(strides) - 1)])
        rows = some[cover(_support(cones[some], w), max(KEPT, len(some)))]
        triples = Triples(region[rows], p_BC[rows])
        holding = _holding(regions, triples)
        holds, slips = (
            triples.take(holding),
            triples.take(np.setdiff1d(np.arange(len(rows)), holding)),
        )
        found = joined(holds, found)
        sources = joined(_first_of_sets(holds, SOURCES), _first_of_sets(slips, SOURCES))
    return found


def num_points(num_regions: int) -> int:
    """How many points to sample on so many regions."""
    some = min(int(POINTS_A_REGION * num_regions), SOME_POINTS)
    return max(POINTS, some, int(LEAST_A_REGION * num_regions))


def sample_points(regions: Regions, num: int) -> tuple[Ints, Array]:
    """A point in the middle of each region and others on rings, equally far apart.

    The best contacts are often at a region's corners, which the outermost ring includes.

    Returns:
        Region, shape (N,), and coordinates in the face's frame [m], shape (N, 2).
    """
    filled = np.flatnonzero(~shapely.is_empty(regions.polygon_F))
    largest = np.argsort(-regions.area[filled], kind="stable")[:MOST_POINTS]
    row = filled[np.sort(largest)]
    level = regions.polygon_F[row]
    spacing = _spacing(level, num)
    middle = shapely.centroid(level)
    inside = shapely.intersects(level, middle)
    middle = np.where(inside, middle, shapely.point_on_surface(level))
    found = [(row, shapely.get_coordinates(middle))]
    wide = shapely.area(level) > (0.7 * spacing) ** 2
    while wide.any():
        level, row = level[wide], row[wide]
        outline = shapely.simplify(level, OUTLINE * spacing)
        rings, owner = _rings(shapely.segmentize(outline, spacing))
        links = shapely.shortest_line(level[owner], shapely.points(rings))
        found.append((row[owner], shapely.get_coordinates(links)[::2]))
        level = shapely.buffer(level, -spacing, join_style="mitre")
        wide = ~shapely.is_empty(level)
    region, p_FC = zip(*found, strict=True)
    return np.concatenate(region), np.concatenate(p_FC)


def _spacing(polygons: npt.NDArray[np.object_], num: int) -> float:
    """The distance between points that gives about `num` of them [m]."""
    area, length = shapely.area(polygons), shapely.length(polygons)
    low, high = 1e-4 * np.sqrt(area.sum()), 10 * np.sqrt(area.sum())
    for _ in range(40):
        middle = np.sqrt(low * high)
        wide = area > (0.7 * middle) ** 2
        count = len(area) + np.where(wide, length / middle + area / middle**2, 0.0).sum()
        low, high = (middle, high) if count > num else (low, middle)
    return float(high)


def _rings(polygons: npt.NDArray[np.object_]) -> tuple[Array, Ints]:
    """The vertices of all rings, each once, shape (V, 2), and whose they are, shape (V,)."""
    parts, part_owner = shapely.get_parts(polygons, return_index=True)
    rings, ring_part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    repeated = np.append(ring[1:] != ring[:-1], True)
    return points[~repeated], part_owner[ring_part[ring[~repeated]]]


def _frames(regions: Regions) -> Array:
    """Inward normal and two tangents of each region as rows, shape (R, 3, 3)."""
    x, y, z = np.moveaxis(regions.R_BF, 2, 0)
    return np.stack([-z, x, y], axis=1)


def _support(cones: Array, w: Array) -> Array:
    """h_i(w) of the contacts of cones (N, 3, 6) in directions (K, 6), shape (N, K)."""
    n, t_1, t_2 = cones.transpose(1, 0, 2) @ w.T
    h: Array = n + np.sqrt(t_1 * t_1 + t_2 * t_2)
    return h


def _weakest(regions: Regions, triples: Triples, p_BBcm: Array, rho: float) -> Array:
    nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    contacts = triples.p_BC, nhat, mu
    w, _ = critical_directions(*contacts, p_BBcm, rho, num_turns=COARSE_TURNS, rotations=True)
    return w.reshape(-1, 6)


def _holding(regions: Regions, triples: Triples) -> Ints:
    nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    return np.flatnonzero(force_closure(triples.p_BC, nhat, mu))


def _drawn(regions: Regions, region: Ints, p_BC: Array) -> Triples:
    """Random triples, those that hold first."""
    rows = np.random.default_rng(0).integers(0, len(region), (DRAWN, 3))
    triples = Triples(region[rows], p_BC[rows])
    holds = _holding(regions, triples)
    slips = np.setdiff1d(np.arange(DRAWN), holds)
    return joined(triples.take(holds), triples.take(slips))


def first_of_each_set(region: Ints) -> Ints:
    """The first row of each set of regions, ascending, (M, 3) to (K,)."""
    _, first = np.unique(set_numbers(region), return_index=True)
    return np.sort(first)


def set_numbers(region: Ints) -> Ints:
    """A number for each row's set of regions, equal for equal sets, (M, 3) to (M,)."""
    i, j, k = sets_of(region).T
    num = region.max(initial=0) + 2
    numbers: Ints = (i * num + j) * num + k
    return numbers


def sets_of(region: Ints) -> Ints:
    """The regions of each row once, ascending; -1 for a pair's third, (M, 3) to (M, 3)."""
    sets = np.sort(region, axis=1)
    low, high = sets[:, 0] == sets[:, 1], sets[:, 1] == sets[:, 2]
    sets[low, 1] = sets[low, 2]
    sets[low | high, 2] = -1
    return sets


def _first_of_sets(triples: Triples, num: int) -> Triples:
    return triples.take(first_of_each_set(triples.region)[:num])


def cover(h: Array, num: int) -> Ints:
    """The `num` triples i < j < k of greatest min_w max(h_i, h_j, h_k), greatest first.

    Args:
        h: h_i(w) of N points and K directions, shape (N, K).
        num: how many triples; some may be missing at the end.

    Returns:
        Shape (at most num, 3).
    """
    for threshold in _thresholds(h, num):
        best = _above(h, threshold, num)
        if len(best) >= ENOUGH * num:
            break
    return best


def _thresholds(h: Array, num: int) -> Array:
    """Falling thresholds, from one that some more than `num` triples should pass to none at all."""
    N = len(h)
    sample = np.random.default_rng(0).integers(0, N, (500, 3))
    height = _heights(h, sample)
    share = min(1.0, max(20 * num / N**3, 1e-3))
    shares = np.geomspace(share, 1.0, 4)
    return np.append(np.quantile(height, 1.0 - shares), -np.inf)


def _above(h: Array, threshold: float, num: int) -> Ints:
    """The `num` greatest of the triples above a threshold, which rises as they are found."""
    best, height = np.empty((0, 3), int), np.empty(0)
    covers, fresh, first = _Covers(h > threshold), [best], 0
    while first < len(h):
        last = covers.last_at_once(first)
        fresh.append(covers.triples(first, last))
        first = last
        if sum(map(len, fresh)) > _BLOCK * num or first == len(h):
            best, height = _greatest(h, np.concatenate([best, *fresh]), num)
            fresh = []
            if len(height) == num and height[-1] > threshold:
                threshold = height[-1]
                covers = _Covers(h > threshold)
    return best


class _Covers:
    """Triples i < j < k of points that cover all directions, from what each covers, shape (N, K).

    Of the directions that i leaves, the one that fewest points cover has to be covered by j or k;
    so has, by the third, the rarest of those that are left then.
    """

    def __init__(self, above: Bools) -> None:
        N, K = above.shape
        rarest_first = np.argsort(above.sum(axis=0), kind="stable")
        # A last direction that all cover stands for none.
        self._above = np.column_stack([above[:, rarest_first], np.ones(N, dtype=bool)])
        padded = np.pad(self._above, ((0, 0), (0, -(K + 1) % 64)), constant_values=True)
        words = np.ascontiguousarray(np.packbits(padded, axis=1)).view(np.uint64)
        self._words = np.ascontiguousarray(words.T)
        direction, self._points = np.nonzero(self._above.T)
        self._offsets = np.searchsorted(direction, np.arange(K + 2))
        self._helps = np.triu(self._above[:, self._rarest_left(self._above)].T, 1)
        self._num_helpers = np.append(0, np.cumsum(self._helps.sum(axis=1)))

    @staticmethod
    def _rarest_left(covered: Bools) -> Ints:
        """The first direction that is not covered, or the last of all, shape (M, K) to (M,)."""
        first = covered.argmin(axis=1)
        all_covered = covered[np.arange(len(covered)), first]
        rarest: Ints = np.where(all_covered, covered.shape[1] - 1, first)
        return rarest

    def last_at_once(self, first: int) -> int:
        """One more than the last i, of those from `first`, whose triples fit into the cache."""
        most = self._num_helpers[first] + _AT_ONCE // max(self._above.shape)
        return max(first + 1, int(np.searchsorted(self._num_helpers, most, side="right")) - 1)

    def triples(self, first: int, last: int) -> Ints:
        """Those with first <= i < last, ascending, shape (M, 3)."""
        i, j = np.nonzero(self._helps[first:last])
        i += first
        direction = self._rarest_left(self._above[i] | self._above[j])
        rows, pair = gather(self._offsets, direction)
        k = self._points[rows]
        for word in self._words:
            covers = np.flatnonzero(((word[i] | word[j])[pair] | word[k]) == _ALL)
            pair, k = pair[covers], k[covers]
        i, j = i[pair], j[pair]
        # Where j and k both help i, the triple is met twice.
        new = (k > i) & (k != j) & ~(self._helps[i, k] & (k < j))
        i, j, k = i[new], j[new], k[new]
        found = np.column_stack([i, np.minimum(j, k), np.maximum(j, k)])
        return found[np.lexsort(found.T[::-1])]


def _greatest(h: Array, triples: Ints, num: int) -> tuple[Ints, Array]:
    height = _heights(h, triples)
    order = np.argsort(-height, kind="stable")[:num]
    return triples[order], height[order]


def _heights(h: Array, triples: Ints) -> Array:
    """min_w max(h_i, h_j, h_k) of triples (M, 3), shape (M,)."""
    height = np.empty(len(triples))
    for rows in np.array_split(np.arange(len(triples)), triples.size * h.shape[1] // _CACHED + 1):
        i, j, k = triples[rows].T
        # In place: new arrays of this size cost more than what is computed.
        highest = h.take(i, axis=0)
        np.maximum(highest, h.take(j, axis=0), out=highest)
        np.maximum(highest, h.take(k, axis=0), out=highest)
        height[rows] = highest.min(axis=1)
    return height
