"""Sections 4 to 7 for one set of faces, with what each step computes.

The steps are the planner's own functions on a batch of one set; the outcome is the planner's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Ints, Shapes, distinct_values, frozen, gather
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.regions import Boundary, Regions, boundary, erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.grasp_plane import (
    Planes,
    nonparallel_planes,
    opposed_planes,
    parallel_directions,
)
from drake_polygrasp.paper.orientation import (
    classify,
    friction_angle,
    sine_of_pair,
    sine_of_parallel,
    sine_of_tips_plane,
)
from drake_polygrasp.paper.planar import Scale, centroids, outer_ends, project
from drake_polygrasp.paper.position import (
    PlaneDirections,
    hull_of,
    opposed,
    plane_directions,
    portion_heights,
    region_rl,
)
from drake_polygrasp.paper.quality import q_positions
from drake_polygrasp.paper.reasons import REASONS, Candidates
from drake_polygrasp.paper.region_p import (
    Cut,
    cut_nonparallel,
    cut_parallel,
    cut_two_faces,
    cut_without_p,
    segment_hulls,
)
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.paper.strips import strips_polygon
from drake_polygrasp.paper.trace_result import OnPiL, OnPiP, OnPiS, SetTrace
from drake_polygrasp.paper.two_faces import choices, two_face_planes
from drake_polygrasp.vectors import unit


def trace_set(
    object_: GraspObject,
    faces: Sequence[int],
    edge_clearance: float | None = None,
    least_clearance: float = 0.0,
) -> SetTrace:
    """Computes what every step of the paper (`method="paper"`) finds for one set of faces.

    Where erosion leaves several regions of a face, the set of regions with the best Q is taken.

    Args:
        object_: the object to grasp.
        faces: two or three indices of faces of its polyhedron.
        edge_clearance: least distance of a contact from the edges of its face [m]; None for the
            default of `plan_grasps`.
        least_clearance: contacts are at least as far from the edges [m].

    Returns:
        The trace, up to the step that ended the set.

    Raises:
        UsageError: when `faces` are not two or three faces wide enough for a finger.
    """
    regions = erode(object_.polyhedron, edge_clearance, least_clearance=least_clearance)
    wanted = set(faces)
    if len(wanted) not in (2, 3) or not wanted <= set(regions.face.tolist()):
        raise UsageError(
            f"{tuple(faces)} is not a set of two or three faces wide enough for a finger; those "
            f"that are: {distinct_values(regions.face).tolist()}"
        )
    regions = _only(regions, np.flatnonzero(np.isin(regions.face, list(wanted))))
    scale = Scale(object_.p_BBcm, object_.rho, object_.polyhedron.diameter)
    plan = plan_sets(regions, scale.p_BBcm, scale.diameter, scale.rho, "paper")
    face = np.append(regions.face, -1)[plan.sets]
    mine = [i for i, row in enumerate(face.tolist()) if {*row} - {-1} == wanted]
    rows = np.flatnonzero(np.isin(plan.candidates.set_index, mine))
    found = plan.candidates.take(rows)
    best = found.take(np.argsort(-found.Q, kind="stable")[:1]) if len(rows) else None
    index = mine[0] if best is None else int(best.set_index[0])
    region = plan.sets[index]
    reason = REASONS[plan.code[index]]
    steps = _Steps(regions, boundary(regions), scale, reason, best)
    return steps.pair(region[:2]) if region[2] < 0 else steps.triple(region)


def _only(regions: Regions, rows: Ints) -> Regions:
    """Returns the regions of some rows."""
    ring, owner = gather(regions.region_offsets, rows)
    vertex, ring_owner = gather(regions.ring_offsets, ring)

    def offsets(owners: Ints, count: int) -> Ints:
        return frozen(np.cumsum([0, *np.bincount(owners, minlength=count)]), np.int64)

    per_row = ("polygon_F", "face", "R_BF", "p_BF", "nhat_TB_B", "mu", "area")
    return Regions(
        **{name: getattr(regions, name)[rows] for name in per_row},
        p_BV=regions.p_BV[vertex],
        ring_offsets=offsets(ring_owner, len(ring)),
        region_offsets=offsets(owner, len(rows)),
        num_left_out=regions.num_left_out,
    )


@dataclass(frozen=True, eq=False)
class _Steps:
    """The steps on one set of faces; `best` is the planner's candidate, if P was not empty."""

    regions: Regions
    edges: Boundary
    scale: Scale
    reason: str
    best: Candidates | None

    def triple(self, region: Ints) -> SetTrace:
        nhat = self.regions.nhat_TB_B[region][None]
        alpha = friction_angle(self.regions.mu[region][None])
        parallel = classify(nhat, alpha)
        if self.reason == "orientation":
            return self._trace(region, alpha, to_decimals(np.arcsin(sine_of_tips_plane(nhat)[1])))
        if not len(parallel.rows):
            return self._nonparallel(region, nhat, alpha)
        first = int(parallel.opposing[0])
        region = region[[first, *np.delete(np.arange(3), first)]]
        phi = to_decimals(np.arcsin(sine_of_parallel(self.regions.nhat_TB_B[region][None])))
        sets = opposed(self.regions, region[None], parallel.nhat_bs)
        axes = np.stack([sets.u[0], sets.v[0]])
        if self.reason == "not_opposed":
            return self._projections(region, alpha, phi, axes)
        owner, direction = parallel_directions(sets, self.scale)
        planes, _ = opposed_planes(self.edges, sets, owner, direction, self.scale)
        auxiliary = shapely.intersection(sets.faces[:, 0], hull_of(sets.faces[:, 1:]))[0]
        cut = cut_parallel(self.regions, self.edges, planes, self.scale)
        return self._opposed(region, alpha, phi, planes, cut, [auxiliary] * len(owner), axes)

    def pair(self, region: Ints) -> SetTrace:
        regions, edges, scale = self.regions, self.edges, self.scale
        nhat = regions.nhat_TB_B[region][None]
        alpha = friction_angle(regions.mu[region][None])
        phi = to_decimals(np.arcsin(sine_of_pair(nhat)))
        region = region[[0, 1, 1]]
        if self.reason == "orientation":
            return self._trace(region, alpha, phi)
        sets = opposed(regions, region[None], unit(nhat[:, 1] - nhat[:, 0]))
        axes = np.stack([sets.u[0], sets.v[0]])
        if self.reason == "not_opposed":
            return self._projections(region, alpha, phi, axes)
        rows = choices(sets, scale)
        planes, kept = two_face_planes(edges, sets, rows, scale)
        cut = cut_two_faces(
            regions, edges, planes, sets, rows.widest[kept], rows.pocket[kept], scale
        )
        return self._opposed(region, alpha, phi, planes, cut, list(rows.pocket[kept]), axes)

    def _nonparallel(self, region: Ints, nhat: Array, alpha: Array) -> SetTrace:
        regions, edges, scale = self.regions, self.edges, self.scale
        N, sine = sine_of_tips_plane(nhat)
        phi, on = to_decimals(np.arcsin(sine)), plane_directions(N, nhat)
        meets, low, high = region_rl(edges, region[None], on, scale.length_slack)
        on_pi_l = self._on_pi_l(region, on, low[0], high[0], alpha - phi, bool(meets[0]))
        if not meets[0]:
            return self._trace(region, alpha, phi, on_pi_l=on_pi_l)
        _, apex = on.polygon(low, high)
        heights = np.stack(portion_heights(edges, region[None], on, apex, alpha - phi), axis=-1)
        low, high = heights[..., 0].max(axis=1), heights[..., 1].min(axis=1)
        if self.reason == "rs_empty":
            axes = np.stack([np.cross(on.nprime[0, 0], N[0]), N[0]])
            return self._projections(region, alpha, phi, axes, on_pi_l, heights[0])
        planes = nonparallel_planes(regions, edges, region[None], on, low, high, scale)
        cut = cut_nonparallel(regions, edges, planes, on.take(planes.owner), scale)
        plane, cut = self._chosen(planes, cut, on.that)
        on_pi_s = self._on_pi_s(planes, plane, shapely.Polygon())
        on_pi_p = self._on_pi_p(cut, on)
        return self._trace(region, alpha, phi, on_pi_l, on_pi_s, on_pi_p)

    def _opposed(
        self,
        region: Ints,
        alpha: Array,
        phi: Array,
        planes: Planes,
        cut: Cut,
        common: list[shapely.Geometry],
        axes_uv: Array,
    ) -> SetTrace:
        if not len(planes.owner):
            return self._projections(region, alpha, phi, axes_uv)
        across = np.cross(planes.along_B, planes.nhat_B)
        plane, cut = self._chosen(planes, cut, np.repeat(across[:, None], 3, axis=1))
        axes = np.stack([across[plane], planes.nhat_B[plane]])
        turned = shapely.transform(common[plane], lambda uv: uv @ (axes @ axes_uv.T).T)
        on_pi_s = self._on_pi_s(planes, plane, turned)
        on_pi_p = self._on_pi_p(cut, None)
        return self._trace(cut.region[0], alpha, phi, None, on_pi_s, on_pi_p, is_parallel=True)

    def _projections(
        self,
        region: Ints,
        alpha: Array,
        phi: Array,
        axes: Array,
        on_pi_l: OnPiL | None = None,
        heights: Array | None = None,
    ) -> SetTrace:
        """Traces a set for which no plane Pi_p was found."""
        faces, p_cm = self._projected(region, axes), axes @ self.scale.p_BBcm
        on_pi_s = OnPiS(axes, faces, shapely.Polygon(), None, None, None, p_cm, heights)
        return self._trace(region, alpha, phi, on_pi_l, on_pi_s, is_parallel=on_pi_l is None)

    def _chosen(self, planes: Planes, cut: Cut, axis: Array) -> tuple[int, Cut]:
        """Finds the plane, and its row of `cut`, that became the planner's candidate.

        Without one, these are the first plane and its segments along `axis`, shape (R, 3, 3).
        """
        if self.best is None or not len(cut.owner):
            first = planes.take(np.array([0]))
            return 0, cut_without_p(self.regions, self.edges, first, axis[:1], self.scale)
        gap = np.linalg.norm(cut.p_Bc - self.best.p_BP, axis=1) / self.scale.diameter
        gap += np.linalg.norm(cut.nhat_B - self.best.nhat_B, axis=1)
        gap += (cut.region != self.best.region).any(axis=1)
        q = q_positions(cut.d_1, cut.d_2, cut.area_s, cut.area_p, self.scale.rho, "object")
        row = int(np.lexsort((-q.prod(axis=1), np.round(gap, 9)))[0])
        turn = np.linalg.norm(planes.nhat_B - cut.nhat_B[row], axis=1)
        turn += np.linalg.norm(planes.along_B - cut.along_B[row], axis=1)
        return int(np.argmin(turn)), cut.take(np.array([row]))

    def _on_pi_l(
        self, region: Ints, on: PlaneDirections, low: Array, high: Array, gamma: Array, meets: bool
    ) -> OnPiL:
        axes = np.stack([on.that[0, 0], np.cross(on.nhat_B[0], on.that[0, 0])])
        outline = strips_polygon(on.that @ axes.T, on.turn, low[None], high[None])[0]
        return OnPiL(
            axes,
            self._projected(region, axes),
            on.nprime[0] @ axes.T,
            low,
            high,
            float(gamma[0]),
            shapely.convex_hull(shapely.MultiPoint(outline)) if meets else None,
        )

    def _on_pi_s(self, planes: Planes, row: int, common: shapely.Geometry) -> OnPiS:
        N = planes.nhat_B[row]
        axes = np.stack([np.cross(planes.along_B[row], N), N])
        return OnPiS(
            axes,
            self._projected(planes.region[row], axes),
            common,
            float(planes.low[row]),
            float(planes.high[row]),
            float(planes.height[row]),
            axes @ self.scale.p_BBcm,
        )

    def _on_pi_p(self, cut: Cut, on: PlaneDirections | None) -> OnPiP:
        """Traces the plane of one cut; `on` is given for a non-parallel set."""
        N, along = cut.nhat_B[0], cut.along_B[0]
        axes = np.stack([np.cross(along, N), along])
        hull = segment_hulls(cut.segments, axes[:1], axes[1:])[0]
        ends = outer_ends(cut.segments.intervals)[0]
        nhat = self.regions.nhat_TB_B[cut.region[0]]
        nprime = unit(nhat @ axes.T)
        p_cI = axes @ cut.p_Bc[0]
        if np.isnan(p_cI).any():
            region_p, p_cI = shapely.Polygon(), None
            directions = np.tile([0.0, 1.0], (3, 1)) if on is None else nprime
        elif on is None:
            left, right = ends[0]
            _, bottom, _, top = hull.bounds
            region_p = hull & shapely.box(left, bottom, right, top)
            directions = np.tile([0.0, 1.0], (3, 1))
        else:
            that = on.that @ axes.T
            outline = strips_polygon(that, on.turn, ends[None, :, 0], ends[None, :, 1])[0]
            region_p, directions = shapely.convex_hull(shapely.MultiPoint(outline)), nprime
        p_BC = self.best.p_BC[0] if self.best is not None else np.full((3, 3), np.nan)
        return OnPiP(
            axes,
            float(cut.height[0]),
            np.array([self._segments(cut, i, axes) for i in range(3)], dtype=object),
            directions,
            nprime,
            region_p,
            p_cI,
            centroids(hull),
            axes @ self.scale.p_BBcm,
            p_BC @ axes.T if np.isfinite(p_BC).all() else None,
        )

    @staticmethod
    def _segments(cut: Cut, i: int, axes: Array) -> shapely.MultiLineString:
        """Returns a_i in coordinates of the plane."""
        s = cut.segments.intervals[0, i]
        s = s[np.isfinite(s).all(axis=1)]
        points = cut.segments.p_BS[0, i] + s[..., None] * cut.segments.slope_B[0, i]
        return shapely.MultiLineString(list(points @ axes.T))

    def _projected(self, region: Ints, axes: Array) -> Shapes:
        return project(self.regions, region, *(np.tile(axis, (3, 1)) for axis in axes))

    def _trace(
        self,
        region: Ints,
        alpha: Array,
        phi: Array,
        on_pi_l: OnPiL | None = None,
        on_pi_s: OnPiS | None = None,
        on_pi_p: OnPiP | None = None,
        *,
        is_parallel: bool = False,
    ) -> SetTrace:
        a, b, c = self.regions.face[region].tolist()
        best = self.best
        built = best is not None and np.isfinite(best.p_BC).all()
        return SetTrace(
            (a, b, c),
            is_parallel,
            float(alpha[0]),
            float(phi[0]),
            self.reason,
            self.regions.nhat_TB_B[region],
            self.regions.mu[region],
            None if best is None else best.q[0],
            best.p_BC[0] if best is not None and built else None,
            on_pi_l,
            on_pi_s,
            on_pi_p,
        )
