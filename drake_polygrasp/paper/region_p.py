"""Section 6: the segments a_i = Pi_p cut with A_i, and the region P where lines of force can meet.

Departures from the text. All segments of a face that is not convex are kept, because treating them
as one puts contacts into holes. P may be empty although the set passed Section 4, which projects
whole faces: then three other offsets of Pi_p within R^s are tried. Which of two faces holds two
contacts is decided here, by the rule of 7.3, because P depends on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Batch, Ints, Shapes, join_rows
from drake_polygrasp.geometry.regions import Boundary, Regions
from drake_polygrasp.paper.grasp_plane import Planes, other_heights
from drake_polygrasp.paper.planar import Scale, Section, outer_ends, section
from drake_polygrasp.paper.position import Opposed, PlaneDirections
from drake_polygrasp.paper.strips import hulls_in_strips, strips_meet
from drake_polygrasp.paper.two_faces import FIRST, OVERLAP
from drake_polygrasp.vectors import cross, dot, product


@dataclass(frozen=True, eq=False)
class Cut(Batch):
    """Grasp planes with their segments a_i and a non-empty P; A_1 opposes A_2 and A_3.

    Attributes:
        owner: index of each row's set, shape (M,).
        region: A_1, A_2, A_3, shape (M, 3).
        nhat_B: N, unit normal of Pi_p, shape (M, 3).
        along_B: unit direction in Pi_p, shape (M, 3): n_bs, or n'_i of the face that defines Pi_s.
        height: N . p of the points of Pi_p [m], shape (M,).
        segments: a_1, a_2, a_3; its arrays have one axis more, shapes (M, 3, 3), (M, 3, 3) and
            (M, 3, S, 2).
        area_s: I^s [m^2], shape (M,).
        d_1: distance from c_I^s to c_m^s [m], shape (M,).
        area_p: I^p, the area of P [m^2], shape (M,).
        p_Bc: c_I^p, centroid of P, expressed in B [m], shape (M, 3).
        d_2: distance from c_I^p to c_m^p [m], shape (M,).
    """

    owner: Ints
    region: Ints
    nhat_B: Array
    along_B: Array
    height: Array
    segments: Section
    area_s: Array
    d_1: Array
    area_p: Array
    p_Bc: Array
    d_2: Array


def _join_cuts(cuts: list[Cut]) -> Cut:
    """One batch of several, in order."""
    if len(cuts) == 1:
        return cuts[0]
    size = max(cut.segments.intervals.shape[2] for cut in cuts)
    padded = []
    for cut in cuts:
        spare = size - cut.segments.intervals.shape[2]
        pad = ((0, 0), (0, 0), (0, spare), (0, 0))
        intervals = np.pad(cut.segments.intervals, pad, constant_values=np.nan)
        padded.append(replace(cut, segments=replace(cut.segments, intervals=intervals)))
    return join_rows(*padded)


def _segments(
    regions: Regions,
    edges: Boundary,
    region: Ints,
    nhat: Array,
    height: Array,
    axis: Array,
    scale: Scale,
) -> Section:
    """Cuts J faces of each row with the row's plane: region (M, J), axis (M, J, 3)."""
    shape = region.shape
    rows = np.repeat(np.arange(shape[0]), shape[1])
    cut = section(
        regions,
        edges,
        region.ravel(),
        nhat[rows],
        height[rows],
        axis.reshape(-1, 3),
        scale.length_slack,
    )
    return Section(
        cut.p_BS.reshape(*shape, 3),
        cut.slope_B.reshape(*shape, 3),
        cut.intervals.reshape(*shape, *cut.intervals.shape[1:]),
    )


def _cut(
    planes: Planes,
    region: Ints,
    height: Array,
    segments: Section,
    area_p: Array,
    p_Bc: Array,
    scale: Scale,
) -> Cut:
    """Adds P's area and centroid, and d_2, to planes and their segments."""
    depth = dot(planes.nhat_B, scale.p_BBcm) - height
    from_cm = p_Bc - scale.p_BBcm + depth[:, None] * planes.nhat_B
    return Cut(
        planes.owner,
        region,
        planes.nhat_B,
        planes.along_B,
        height,
        segments,
        planes.area_s,
        planes.d_1,
        area_p,
        p_Bc,
        np.sqrt(dot(from_cm, from_cm)),
    )


def _at_first_height(planes: Planes, attempt: Callable[[Ints, Array], tuple[Cut, Ints]]) -> Cut:
    """Keeps planes whose P is not empty, each at the first of its offsets for which that is so.

    `attempt` cuts the planes of some indices at given offsets [m]; it returns the cuts with a
    non-empty P and the index of each one's plane.
    """
    pending = np.ones(len(planes.owner), dtype=bool)
    cut, done = attempt(np.flatnonzero(pending), planes.height)
    found = [cut]
    pending[done] = False
    if pending.any():
        for height in other_heights(planes).T:
            cut, done = attempt(np.flatnonzero(pending), height[pending])
            found.append(cut)
            pending[done] = False
    return _join_cuts(found)


def cut_nonparallel(
    regions: Regions, edges: Boundary, planes: Planes, on: PlaneDirections, scale: Scale
) -> Cut:
    """Computes segments and P of non-parallel sets (Section 6).

    P is the intersection of three strips along n'_i, tangent to a_i.

    Args:
        regions: all regions.
        edges: their boundary.
        planes: M planes parallel to Pi_l.
        on: directions on Pi_l of the planes' sets, M rows.
        scale: the object's size.

    Returns:
        The planes with a non-empty P, each at the first offset that gives one.
    """

    def attempt(rows: Ints, height: Array) -> tuple[Cut, Ints]:
        segments = _segments(
            regions, edges, planes.region[rows], planes.nhat_B[rows], height, on.that[rows], scale
        )
        ends = outer_ends(segments.intervals)
        meet = strips_meet(on.turn[rows], ends[..., 0], ends[..., 1], scale.length_slack)
        rows, height, ends = rows[meet], height[meet], ends[meet]
        area, centre = on.take(rows).polygon(ends[..., 0], ends[..., 1])
        p_Bc = centre + height[:, None] * planes.nhat_B[rows]
        trial, segments = planes.take(rows), segments.take(meet)
        return _cut(trial, trial.region, height, segments, area, p_Bc, scale), rows

    return _at_first_height(planes, attempt)


def cut_without_p(
    regions: Regions, edges: Boundary, planes: Planes, axis: Array, scale: Scale
) -> Cut:
    """Computes the segments of planes at their first offset where P is empty, to show why it is.

    Args:
        regions: all regions.
        edges: their boundary.
        planes: M planes.
        axis: unit directions in Pi_p along which the segments are measured, shape (M, 3, 3).
        scale: the object's size.

    Returns:
        The cuts, with P of area 0 and a centroid of NaN.
    """
    segments = _segments(regions, edges, planes.region, planes.nhat_B, planes.height, axis, scale)
    area_p, p_Bc = np.zeros(len(planes.owner)), np.full((len(planes.owner), 3), np.nan)
    return _cut(planes, planes.region, planes.height, segments, area_p, p_Bc, scale)


def cut_parallel(regions: Regions, edges: Boundary, planes: Planes, scale: Scale) -> Cut:
    """Computes segments and P of parallel sets (Section 6).

    P is the part of hull(a_1, a_2, a_3) within the strip along n_bs tangent to a_1.

    Args:
        regions: all regions.
        edges: their boundary.
        planes: M planes through n_bs.
        scale: the object's size.

    Returns:
        The planes with a non-empty P, each at the first offset that gives one.
    """
    axis = np.repeat(_across(planes)[:, None], 3, axis=1)

    def attempt(rows: Ints, height: Array) -> tuple[Cut, Ints]:
        region = planes.region[rows]
        segments = _segments(regions, edges, region, planes.nhat_B[rows], height, axis[rows], scale)
        cut, good = _with_region_p(planes.take(rows), region, height, segments, scale)
        return cut, rows[good]

    return _at_first_height(planes, attempt)


def cut_two_faces(
    regions: Regions,
    edges: Boundary,
    planes: Planes,
    sets: Opposed,
    widest: Ints,
    pocket: Shapes,
    scale: Scale,
) -> Cut:
    """Computes segments and P of pairs (Section 6); decides which face holds two contacts.

    It is A_i where R_maxT is R_i, else the face with the longer segment (7.3), or each of the two
    where the segments are equally long. P is that of parallel sets.

    Args:
        regions: all regions.
        edges: their boundary.
        planes: M planes through n_bs.
        sets: the pairs on their Pi_s, which planes.owner refers to.
        widest: which region R_maxT is, shape (M,).
        pocket: the pocket between the two contacts where R_maxT is R_i, shape (M,).
        scale: the object's size.

    Returns:
        The planes with a non-empty P, each at the first offset that gives one.
    """
    axis = np.repeat(_across(planes)[:, None], 2, axis=1)
    settled = widest != OVERLAP

    def attempt(rows: Ints, height: Array) -> tuple[Cut, Ints]:
        pair = planes.region[rows, :2]
        both = _segments(regions, edges, pair, planes.nhat_B[rows], height, axis[rows], scale)
        length = np.nansum(both.intervals[..., 1] - both.intervals[..., 0], axis=-1)
        # 7.3: the longer segment holds two contacts; of equal ones, either.
        longer = length >= length.max(axis=1, keepdims=True) - scale.length_slack
        chosen = (widest[rows] - FIRST)[:, None] == np.arange(2)
        row, double = np.nonzero(np.where(settled[rows, None], chosen, longer))

        which = row[:, None], np.stack([1 - double, double, double], axis=1)
        segments = Section(both.p_BS[which], both.slope_B[which], both.intervals[which])
        rows, height = rows[row], height[row]
        divided = np.flatnonzero(settled[rows])
        if len(divided):
            segments.intervals[divided, 1:] = _beside_pocket(
                segments.take(divided),
                sets.take(planes.owner[rows[divided]]),
                pocket[rows[divided]],
            )
        cut, good = _with_region_p(planes.take(rows), pair[which], height, segments, scale)
        return cut, rows[good]

    return _at_first_height(planes, attempt)


def _across(planes: Planes) -> Array:
    """Returns the unit direction in Pi_p across `along_B`, shape (M, 3)."""
    return cross(planes.along_B, planes.nhat_B)


def _beside_pocket(segments: Section, sets: Opposed, pocket: Shapes) -> Array:
    """Splits A_i's segments into a_2 and a_3 on either side of the widest gap in the pocket.

    They are the two segments next to the gap. Where no gap is in the pocket, because the plane
    passes beside it, both are all of A_i's segments. Shape (M, 2, S, 2).
    """
    both = segments.intervals[:, 1:].copy()
    intervals = segments.intervals[:, 1]
    gap = intervals[:, 1:, 0] - intervals[:, :-1, 1]
    middle = (intervals[:, 1:, 0] + intervals[:, :-1, 1]) / 2
    points = segments.p_BS[:, 1, None] + middle[..., None] * segments.slope_B[:, 1, None]
    u, v = dot(points, sets.u[:, None]), dot(points, sets.v[:, None])
    in_pocket = shapely.intersects_xy(pocket[:, None], np.nan_to_num(u), np.nan_to_num(v))
    gap = np.where(in_pocket & np.isfinite(gap), gap, -np.inf)
    rows = np.flatnonzero(gap.max(axis=1, initial=-np.inf) > 0)
    left = np.argmax(gap[rows], axis=1) if len(rows) else rows
    for side in (0, 1):
        kept = intervals[rows, left + side]
        both[rows, side] = np.nan
        both[rows, side, 0] = kept
    return both


def _with_region_p(
    planes: Planes, region: Ints, height: Array, segments: Section, scale: Scale
) -> tuple[Cut, Ints]:
    """Keeps the rows where P, hull(a_1, a_2, a_3) within a_1's strip, has an area."""
    ends = outer_ends(segments.intervals)
    rows = np.flatnonzero(~np.isnan(ends[..., 0]).any(axis=1))
    left, right = ends[rows, 0].T
    hull = segment_hulls(segments.take(rows), planes.along_B[rows], _across(planes)[rows])
    area, centre = hulls_in_strips(hull, left, right)
    good = area > scale.area_slack
    rows, area, centre = rows[good], area[good], centre[good]
    planes, height = planes.take(rows), height[rows]
    p_Bc = (
        centre[:, :1] * planes.along_B
        + centre[:, 1:] * _across(planes)
        + height[:, None] * planes.nhat_B
    )
    return _cut(planes, region[rows], height, segments.take(rows), area, p_Bc, scale), rows


def segment_hulls(segments: Section, x_axis: Array, y_axis: Array) -> Shapes:
    """Computes hull(a_1, a_2, a_3) in coordinates of Pi_p.

    Args:
        segments: a_1, a_2, a_3 of M planes, arrays as in `Cut`.
        x_axis: first unit axis in Pi_p, shape (M, 3).
        y_axis: second unit axis in Pi_p, shape (M, 3).

    Returns:
        Convex hulls, shape (M,).
    """
    ends = outer_ends(segments.intervals)
    points = segments.p_BS[:, :, None] + ends[..., None] * segments.slope_B[:, :, None]
    axes = np.stack([x_axis, y_axis], axis=2)
    hulls: Shapes = shapely.convex_hull(
        shapely.linestrings(product(points.reshape(-1, 6, 3), axes), handle_nan="skip")
    )
    return hulls
