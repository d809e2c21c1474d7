"""The flow chart of Sections 4 to 7: every set of faces ends with contact points or one reason.

Sets pass the stages in batches; a set that a stage rejects keeps that stage's reason. Contacts are
constructed here and not proved: whoever returns them as a grasp must certify them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_polygrasp.arrays import Array, Batch, Bools, Ints, join_rows
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.geometry.face_sets import CHUNK, pairs, triples
from drake_polygrasp.geometry.regions import Boundary, Regions, boundary
from drake_polygrasp.paper.contact_points import (
    HALF,
    SPREADS,
    nonparallel_contacts,
    opposed_contacts,
)
from drake_polygrasp.paper.grasp_plane import (
    grouped_ties,
    nonparallel_planes,
    opposed_planes,
    parallel_directions,
)
from drake_polygrasp.paper.orientation import (
    classify,
    friction_angle,
    opposes,
    pair_opposes,
    sine_of_pair,
    sine_of_parallel,
    sine_of_tips_plane,
)
from drake_polygrasp.paper.planar import Scale
from drake_polygrasp.paper.position import (
    opposed,
    parallel_faces_meet,
    plane_directions,
    region_rl,
    strip_rs,
    two_faces_meet,
)
from drake_polygrasp.paper.quality import q_directions, q_orientation, q_positions
from drake_polygrasp.paper.reasons import (
    CODE,
    EQUAL_QUALITY,
    UNJUDGED,
    Candidates,
    Codes,
    SetPlan,
    has_contacts,
)
from drake_polygrasp.paper.region_p import Cut, cut_nonparallel, cut_parallel, cut_two_faces
from drake_polygrasp.paper.two_faces import choices, two_face_planes
from drake_polygrasp.settings import Method
from drake_polygrasp.vectors import unit

_OPPOSING_FIRST = np.array([[0, 1, 2], [1, 0, 2], [2, 0, 1]])
"""Order of three faces with face 0, 1 or 2 as A_1."""


@dataclass(frozen=True, eq=False)
class _Found(Batch):
    """Sets with contacts, one row for each variant, with what Q scaled by maxima still needs."""

    set_index: Ints
    region: Ints
    is_parallel: Bools
    p_BC: Array
    nhat_B: Array
    p_BP: Array
    d_1: Array
    d_2: Array
    area_s: Array
    area_p: Array
    q_4: Array
    q_5: Array


def plan_sets(
    regions: Regions,
    p_BBcm: Array,
    diameter: float,
    rho: float,
    method: Method = "paper",
    *,
    spread: bool = True,
    chosen: Ints | None = None,
) -> SetPlan:
    """Takes all sets of three and of two regions, or chosen ones, through Sections 4 to 7.

    Args:
        regions: the eroded faces A_i.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        diameter: L, greatest distance between two vertices [m].
        rho: greatest distance from the centre of mass to the surface [m].
        method: "paper" as the text is read here; "enriched" scales Q by the object.
        spread: whether "enriched" tries all of `SPREADS` in 7.2 and 7.3.
        chosen: the only sets to evaluate, ascending, -1 for the third of a pair, shape (M, 3).

    Returns:
        Every set with its reason, and the contacts constructed, triples first.
    """
    spreads = SPREADS if method == "enriched" and spread else (HALF,)
    scale = Scale(p_BBcm, rho, diameter)
    stages = _Stages(regions, boundary(regions), scale, method, spreads)
    sets: list[Ints] = []
    codes: list[Codes] = []
    found: list[_Found] = []
    first = 0
    for batch in _batches(len(regions.face), chosen):
        code, some = (stages.triples if batch.shape[1] == 3 else stages.pairs)(batch, first)
        sets.append(np.full((len(batch), 3), -1))
        sets[-1][:, : batch.shape[1]] = batch
        codes.append(code)
        found.extend(some)
        first += len(batch)
    return SetPlan(np.concatenate(sets), np.concatenate(codes), _candidates(found, rho, method))


def _batches(num_regions: int, chosen: Ints | None) -> Iterator[Ints]:
    """Yields the triples in batches of shape (M, 3), and last the pairs, shape (M, 2)."""
    if chosen is None:
        yield from triples(num_regions)
        yield pairs(num_regions)
    else:
        threes = chosen[chosen[:, 2] >= 0]
        yield from np.array_split(threes, len(threes) // CHUNK + 1)
        yield chosen[chosen[:, 2] < 0, :2]


def _candidates(found: list[_Found], rho: float, method: Method) -> Candidates:
    """Joins what was found in the order of the sets, with the factors of Q."""
    rows = join_rows(*found)
    scale: Literal["paper", "object"] = "paper" if method == "paper" else "object"
    q = np.column_stack(
        [
            q_positions(rows.d_1, rows.d_2, rows.area_s, rows.area_p, rho, scale),
            rows.q_4,
            rows.q_5,
        ]
    )
    order = np.argsort(rows.set_index, kind="stable")
    return Candidates(
        rows.set_index, rows.region, rows.is_parallel, rows.p_BC, rows.nhat_B, rows.p_BP, q
    ).take(order)


@dataclass(frozen=True, eq=False)
class _Stages:
    """The stages on one object; each method takes a batch of sets through them.

    Sets of a batch are numbered from `first` among all sets. `where` holds positions in the batch,
    whose `code` a stage sets to its own reason before it keeps only the sets that pass.
    """

    regions: Regions
    edges: Boundary
    scale: Scale
    method: Method
    spreads: tuple[float, ...]

    def triples(self, region: Ints, first: int) -> tuple[Codes, list[_Found]]:
        """Plans sets of three regions, shape (M, 3); returns their codes and what was found."""
        nhat = self.regions.nhat_TB_B[region]
        alpha = friction_angle(self.regions.mu[region])
        code = np.full(len(region), CODE["orientation"], dtype=np.int8)
        rows = np.flatnonzero(opposes(nhat, alpha))
        parallel = classify(nhat[rows], alpha[rows])

        found = []
        flat = np.delete(rows, parallel.rows)
        if len(flat):
            found.append(self._nonparallel(region[flat], alpha[flat], code, flat, first))

        steep = rows[parallel.rows]
        if len(steep):
            roles = region[steep[:, None], _OPPOSING_FIRST[parallel.opposing]]
            found.append(
                self._parallel(
                    roles, alpha[steep], parallel.nhat_bs, parallel.radius, code, steep, first
                )
            )
        return code, found

    def _nonparallel(
        self, region: Ints, alpha: Array, code: Codes, where: Ints, first: int
    ) -> _Found:
        """Plans non-parallel sets: regions R^l and R^s, Pi_p, P, and contacts by 7.1."""
        regions, edges, scale = self.regions, self.edges, self.scale
        nhat = regions.nhat_TB_B[region]
        N, sine = sine_of_tips_plane(nhat)
        phi = to_decimals(np.arcsin(sine))
        on = plane_directions(N, nhat)
        code[where] = CODE["rl_empty"]
        meets, low, high = region_rl(edges, region, on, scale.length_slack)
        region, alpha, phi, where = region[meets], alpha[meets], phi[meets], where[meets]
        on = on.take(meets)

        code[where] = CODE["rs_empty"]
        _, apex = on.polygon(low[meets], high[meets])
        low, high = strip_rs(edges, region, on, apex, alpha - phi)
        meets = high - low > scale.length_slack
        region, alpha, phi, where = region[meets], alpha[meets], phi[meets], where[meets]
        on = on.take(meets)

        code[where] = CODE["p_empty"]
        planes = nonparallel_planes(regions, edges, region, on, low[meets], high[meets], scale)
        cut = cut_nonparallel(regions, edges, planes, on.take(planes.owner), scale)
        nhat = regions.nhat_TB_B[cut.region]
        q_4 = q_orientation(phi[cut.owner], alpha[cut.owner])
        q_5 = q_directions(nhat, cut.nhat_B, parallel=False)
        best = self._best(cut, q_4, q_5)
        cut, q_4, q_5 = cut.take(best), q_4[best], q_5[best]

        contacts = nonparallel_contacts(cut, on.take(cut.owner), scale)
        self._mark(code, where[cut.owner], contacts, "off_face")
        return self._found(cut, contacts, q_4, q_5, where[cut.owner] + first, is_parallel=False)

    def _parallel(
        self,
        region: Ints,
        alpha: Array,
        nhat_bs: Array,
        radius: Array,
        code: Codes,
        where: Ints,
        first: int,
    ) -> _Found:
        """Plans parallel sets with A_1 first: position, s_e, Pi_p, P, and contacts by 7.2."""
        regions, edges, scale = self.regions, self.edges, self.scale
        code[where] = CODE["not_opposed"]
        sets = opposed(regions, region, nhat_bs)
        meets = parallel_faces_meet(sets, scale.length_slack, scale.area_slack)
        sets, where, alpha, radius = sets.take(meets), where[meets], alpha[meets], radius[meets]

        code[where] = CODE["no_direction"]
        owner, direction = parallel_directions(sets, scale)
        code[where[owner]] = CODE["rs_empty"]
        planes, _ = opposed_planes(edges, sets, owner, direction, scale)
        code[where[planes.owner]] = CODE["p_empty"]
        cut = cut_parallel(regions, edges, planes, scale)

        nhat = regions.nhat_TB_B[cut.region]
        if self.method == "paper":
            phi = to_decimals(np.arcsin(sine_of_parallel(nhat)))
        else:
            phi = radius[cut.owner]
        q_4 = q_orientation(phi, alpha[cut.owner])
        q_5 = q_directions(nhat, cut.nhat_B, parallel=True)
        return self._opposed_contacts(cut, q_4, q_5, code, where, first)

    def pairs(self, region: Ints, first: int) -> tuple[Codes, list[_Found]]:
        """Plans sets of two regions, shape (M, 2); returns their codes and what was found."""
        regions, edges, scale = self.regions, self.edges, self.scale
        nhat = regions.nhat_TB_B[region]
        alpha = friction_angle(regions.mu[region])
        code = np.full(len(region), CODE["orientation"], dtype=np.int8)
        where = np.flatnonzero(pair_opposes(nhat, alpha))

        code[where] = CODE["not_opposed"]
        nhat_bs = unit(nhat[where, 1] - nhat[where, 0])
        sets = opposed(regions, region[where][:, [0, 1, 1]], nhat_bs)
        meets = two_faces_meet(sets, scale.area_slack)
        sets, where = sets.take(meets), where[meets]
        rows = choices(sets, scale)
        code[where[rows.owner]] = CODE["rs_empty"]
        planes, kept = two_face_planes(edges, sets, rows, scale)
        code[where[planes.owner]] = CODE["p_empty"]
        cut = cut_two_faces(
            regions, edges, planes, sets, rows.widest[kept], rows.pocket[kept], scale
        )
        phi = to_decimals(np.arcsin(sine_of_pair(regions.nhat_TB_B[cut.region[:, :2]])))
        q_4 = q_orientation(phi, alpha[where[cut.owner]])
        # Two faces have n_2 = n_3, so d_min = 0 and q_5 (eq. 10) is 1.
        found = self._opposed_contacts(cut, q_4, np.ones_like(q_4), code, where, first)
        return code, [found]

    def _opposed_contacts(
        self, cut: Cut, q_4: Array, q_5: Array, code: Codes, where: Ints, first: int
    ) -> _Found:
        """Constructs contacts by 7.2 or 7.3 on the best plane of each set, for every spread.

        A set's reason is that of the first spread, the text's.
        """
        best = self._best(cut, q_4, q_5)
        variants = np.repeat(best, len(self.spreads))
        cut, q_4, q_5 = cut.take(variants), q_4[variants], q_5[variants]
        where = where[cut.owner]
        contacts = opposed_contacts(cut, self.scale, np.tile(self.spreads, len(best)))
        is_text = slice(None, None, len(self.spreads))  # The first spread is `HALF`.
        self._mark(code, where[is_text], contacts[is_text], "wrong_order")
        return self._found(cut, contacts, q_4, q_5, where + first, is_parallel=True)

    def _best(self, cut: Cut, q_4: Array, q_5: Array) -> Ints:
        """Selects the plane of best Q of each set, Q being scaled by the object."""
        q = q_positions(cut.d_1, cut.d_2, cut.area_s, cut.area_p, self.scale.rho, "object")
        located = q.prod(axis=1)
        num_sets = int(cut.owner.max(initial=-1)) + 1
        best = grouped_ties(located * q_4 * q_5, cut.owner, num_sets, EQUAL_QUALITY)
        best = best[grouped_ties(located[best], cut.owner[best], num_sets, EQUAL_QUALITY)]
        first: Ints = best[np.unique(cut.owner[best], return_index=True)[1]]
        return first

    @staticmethod
    def _mark(code: Codes, where: Ints, contacts: Array, failure: str) -> None:
        """Sets the codes of sets with contacts to `UNJUDGED`, those of others to the failure's."""
        code[where] = np.where(has_contacts(contacts), UNJUDGED, CODE[failure])

    def _found(
        self,
        cut: Cut,
        contacts: Array,
        q_4: Array,
        q_5: Array,
        set_index: Ints,
        *,
        is_parallel: bool,
    ) -> _Found:
        return _Found(
            set_index,
            cut.region,
            np.full(len(set_index), is_parallel),
            contacts,
            cut.nhat_B,
            cut.p_Bc,
            cut.d_1,
            cut.d_2,
            cut.area_s,
            cut.area_p,
            q_4,
            q_5,
        )
