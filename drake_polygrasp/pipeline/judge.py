"""Proves candidates, and keeps their outcomes and the proofs of those that hold."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.certification.certify import Proof, prove_many
from drake_polygrasp.geometry.face_sets import rank_within_set
from drake_polygrasp.geometry.surface_contact import face_at
from drake_polygrasp.grasp import Verdict
from drake_polygrasp.paper.reasons import CODE, EQUAL_QUALITY, UNJUDGED, Codes
from drake_polygrasp.pipeline.candidates import (
    ProjectedCandidates,
    clear_of_obstacles,
    has_fingertip_room,
)
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates

_OUTCOME = {
    Verdict.HOLDS: CODE["certified"],
    Verdict.FAILS: CODE["not_force_closure"],
    Verdict.UNDECIDED: CODE["undecided"],
}


Prove: TypeAlias = Callable[[Array, Array, Array], list[Proof]]
"""Proves grasps, of which it takes contact points, normals and friction."""
_TURNS = 3
"""Our choice: a set's candidates are judged one by one, but all that are left in the last turn."""


class Judge:
    """Judges candidates by the exact certificate, and keeps their outcomes.

    Attributes:
        work: the candidates.
        outcome: index in REASONS of each, UNJUDGED if it is not judged yet, shape (M,).
        proofs: proofs of the candidates that hold, by their indices.
    """

    def __init__(self, work: ProjectedCandidates, prove: Prove = prove_many) -> None:
        """Starts with the outcomes that candidates have from their projection.

        Args:
            work: the candidates.
            prove: proves grasps; `prove_any` where the margins of their proofs do not matter.
        """
        self.work, self._prove = work, prove
        self.outcome: Codes = work.outcome.copy()
        self.proofs: dict[int, Proof] = {}

    @property
    def open_rows(self) -> Ints:
        """Indices of the candidates that are not judged yet, ascending."""
        return np.flatnonzero(self.outcome == UNJUDGED)

    @property
    def held_sets(self) -> Ints:
        """Indices of the sets of faces on which a candidate holds, ascending."""
        return self.work.sets_of(np.flatnonzero(self.outcome == CODE["certified"]))

    def extend(self, more: ProjectedCandidates) -> None:
        """Adds candidates; those that are there keep their outcomes.

        Args:
            more: the candidates that are there, followed by new ones.
        """
        self.outcome = np.append(self.outcome, more.outcome[len(self.outcome) :])
        self.work = more

    def judge(self, rows: Ints) -> None:
        """Judges contacts on the surface, room for fingertips and force closure.

        As in `verify`, contacts must be on the exposed surface, with the body on the side of their
        inward normals and with at most the friction of their face.

        Args:
            rows: indices of the candidates, shape (N,).
        """
        if not len(rows):
            return
        work, request = self.work, self.work.request
        contacts = work.one_row_a_contact(rows)
        found = face_at(request.object_.polyhedron, *contacts).reshape(-1, 3)
        there = np.append(request.object_.polyhedron.mu, -np.inf)[found]
        on_face = work.mu[rows] <= there
        # The normals of contacts on a patch differ from its own, by which regions were excluded.
        avoided = request.exclusion.avoids(contacts[1], found.ravel())
        avoided = avoided.reshape(-1, 3)[on_face.all(axis=1)]
        rows = self._passed(rows, on_face, "off_face")
        rows = self._passed(rows, ~avoided, "excluded")
        for reason, passes in (
            ("tip_blocked", has_fingertip_room),
            ("obstructed", clear_of_obstacles),
        ):
            rows = self._passed(rows, passes(request, *work.one_row_a_contact(rows)), reason)
        proofs = self._prove(*work.contacts_of(rows))
        self.outcome[rows] = [_OUTCOME[proof.verdict] for proof in proofs]
        self.proofs |= {
            int(row): proof
            for row, proof in zip(rows, proofs, strict=True)
            if proof.verdict is Verdict.HOLDS
        }

    def _passed(self, rows: Ints, passes: Bools, reason: str) -> Ints:
        """Returns the rows of which all contacts pass; the others get the reason as outcome."""
        whole = np.logical_and.reduce(passes.reshape(-1, 3), axis=1)
        self.outcome[rows[~whole]] = CODE[reason]
        return rows[whole]

    def judge_each_set(self, asked: Bools) -> None:
        """Judges candidates of each set in their order, until one holds.

        Candidates that follow it may stay open; they say nothing else about their set.

        Args:
            asked: whether candidates of each set of faces are judged, shape (S,).
        """
        set_index, rows = self.work.candidates.set_index, self.open_rows
        asked = asked.copy()
        asked[self.held_sets] = False
        rows = rows[asked[set_index[rows]]]
        turn = np.minimum(rank_within_set(set_index[rows]), _TURNS - 1)
        for k in range(_TURNS):
            now = rows[(turn == k) & asked[set_index[rows]]]
            self.judge(now)
            asked[set_index[now]] = self.outcome[now] != CODE["certified"]

    def judge_best(self, rows: Ints, score: Array, wanted: int) -> None:
        """Judges candidates in descending order of score until `wanted` sets hold.

        Candidates whose scores are equal, up to EQUAL_QUALITY, are judged together.

        Args:
            rows: indices of the candidates, shape (N,); those that are judged already are skipped.
            score: score of each, shape (N,).
            wanted: number of sets that are to hold, including those that hold already.
        """
        waiting = self.outcome[rows] == UNJUDGED
        rows, score = rows[waiting], np.round(score[waiting] / EQUAL_QUALITY)
        order = np.lexsort((rows, -score))
        rows, score = rows[order], score[order]
        set_index = self.work.candidates.set_index
        while len(rows):
            held = self.held_sets
            missing = wanted - len(held)
            if missing <= 0:
                return
            _, first = np.unique(set_index[rows], return_index=True)
            fresh = np.sort(first[~np.isin(set_index[rows[first]], held)])
            last = fresh[missing - 1] if missing <= len(fresh) else -1
            # Ties are judged together, so that the result does not depend on their order.
            count = int(np.searchsorted(-score, -score[last], side="right"))
            self.judge(rows[:count])
            rows, score = rows[count:], score[count:]

    def estimates(self) -> Array:
        """Returns estimates of epsilon with the friction that errors leave, shape (M,).

        They are 0 for candidates that do not hold.
        """
        rows = np.flatnonzero(np.isin(self.outcome, (UNJUDGED, CODE["certified"])))
        object_, estimate = self.work.request.object_, np.zeros(len(self.outcome))
        contacts = self.work.narrowed_contacts_of(rows)
        estimate[rows] = epsilon_estimates(*contacts, object_.p_BBcm, object_.rho)
        return estimate

    def set_codes(self) -> Codes:
        """Returns the outcome of each set, the best of its candidates': index in REASONS, (S,)."""
        work, code = self.work, self.work.plan.code.copy()
        standing = np.select(
            [self.outcome == CODE["certified"], self.outcome == UNJUDGED], [0, 1], 2
        )
        # A set that the paper's stages reject keeps their reason, unless a candidate of the search
        # on it holds or is not judged yet.
        speaks = (standing <= 1) | ~np.isnan(work.candidates.q).any(axis=1)
        # The last assignment to a set counts: that of its best candidate, of ties the first.
        order = np.lexsort((-np.arange(len(standing)), -standing))
        order = order[speaks[order]]
        code[work.candidates.set_index[order]] = self.outcome[order]
        return code
