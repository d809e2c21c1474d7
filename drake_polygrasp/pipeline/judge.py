"""What becomes of candidates: which are judged, which hold, and the proofs of those that do."""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.certification.certify import Proof, prove_many
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


class Judge:
    """Judges candidates by the exact certificate and remembers what it found.

    Attributes:
        work: the candidates.
        outcome: position in REASONS of each, UNJUDGED where it is still open, shape (M,).
        proofs: the proof of each candidate that was found to hold, by its row.
    """

    def __init__(self, work: ProjectedCandidates) -> None:
        """Begins with the outcomes that the candidates have."""
        self.work = work
        self.outcome: Codes = work.outcome.copy()
        self.proofs: dict[int, Proof] = {}

    @property
    def open_rows(self) -> Ints:
        """Candidates that may hold and are not judged yet, ascending."""
        return np.flatnonzero(self.outcome == UNJUDGED)

    @property
    def held_sets(self) -> Ints:
        """Sets of faces on which a candidate holds, ascending positions."""
        return self.work.sets_of(self.proofs)

    def extend(self, more: ProjectedCandidates) -> None:
        """Takes more candidates, the first of which are those it has; these keep their outcomes."""
        self.outcome = np.append(self.outcome, more.outcome[len(self.outcome) :])
        self.work = more

    def judge(self, rows: Ints) -> None:
        """Judges candidates: whether fingertips fit, and whether the exact certificate holds.

        Contacts must be where `verify` finds them too: on the exposed surface, with the body
        behind them and no more friction than is there.

        Args:
            rows: which candidates, shape (N,).
        """
        if not len(rows):
            return
        work, request = self.work, self.work.request
        contacts = work.one_row_a_contact(rows)
        found = face_at(request.object_.polyhedron, *contacts).reshape(-1, 3)
        there = np.append(request.object_.polyhedron.mu, -np.inf)[found]
        on_face = work.mu[rows] <= there
        # On curved surfaces, whose faces are patches, the true normals decide what is excluded.
        avoided = request.exclusion.avoids(contacts[1], found.ravel())
        avoided = avoided.reshape(-1, 3)[on_face.all(axis=1)]
        rows = self._passed(rows, on_face, "off_face")
        rows = self._passed(rows, ~avoided, "excluded")
        for reason, passes in (
            ("tip_blocked", has_fingertip_room),
            ("obstructed", clear_of_obstacles),
        ):
            rows = self._passed(rows, passes(request, *work.one_row_a_contact(rows)), reason)
        proofs = prove_many(*work.contacts_of(rows))
        self.outcome[rows] = [_OUTCOME[proof.verdict] for proof in proofs]
        self.proofs |= {
            int(row): proof
            for row, proof in zip(rows, proofs, strict=True)
            if proof.verdict is Verdict.HOLDS
        }

    def _passed(self, rows: Ints, passes: Bools, reason: str) -> Ints:
        """Returns the rows all of whose contacts pass; the others get the reason as outcome."""
        whole = np.logical_and.reduce(passes.reshape(-1, 3), axis=1)
        self.outcome[rows[~whole]] = CODE[reason]
        return rows[whole]

    def judge_best(self, rows: Ints, score: Array, wanted: int) -> None:
        """Judges candidates of best score until `wanted` sets hold and the next score is less.

        Scores nearer than EQUAL_QUALITY are a tie.

        Args:
            rows: the candidates, shape (N,); those that are judged already are skipped.
            score: of each, shape (N,).
            wanted: how many sets are to hold, with those that hold already.
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
            # Whole ties, so that which of them are judged does not depend on their order.
            count = int(np.searchsorted(-score, -score[last], side="right"))
            self.judge(rows[:count])
            rows, score = rows[count:], score[count:]

    def estimates(self) -> Array:
        """Estimates epsilon of all candidates that hold or may hold; 0 for others, shape (M,)."""
        rows = np.flatnonzero(np.isin(self.outcome, (UNJUDGED, CODE["certified"])))
        object_, estimate = self.work.request.object_, np.zeros(len(self.outcome))
        contacts = self.work.narrowed_contacts_of(rows)
        estimate[rows] = epsilon_estimates(*contacts, object_.p_BBcm, object_.rho)
        return estimate

    def set_codes(self) -> Codes:
        """Returns what became of each set: the best of its candidates' outcomes, shape (S,)."""
        work, code = self.work, self.work.plan.code.copy()
        standing = np.select(
            [self.outcome == CODE["certified"], self.outcome == UNJUDGED], [0, 1], 2
        )
        # A set that no stage of the paper lets pass keeps its reason unless a grasp of it holds, or
        # one that may hold has not been judged.
        speaks = (standing <= 1) | ~np.isnan(work.candidates.q).any(axis=1)
        # Written in this order, the best and then the first candidate of a set has the last word.
        order = np.lexsort((-np.arange(len(standing)), -standing))
        order = order[speaks[order]]
        code[work.candidates.set_index[order]] = self.outcome[order]
        return code
