"""Puts proved candidates in order, best first, and certifies those that are returned."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drake_polygrasp.certification.certify import Proof
from drake_polygrasp.certification.robustness import RELATIVE_GAP, Interval
from drake_polygrasp.grasp import CertifiedGrasp
from drake_polygrasp.pipeline.candidates import Contenders
from drake_polygrasp.pipeline.judging import Rank
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound


@dataclass(frozen=True, order=True)
class _Ranked:
    """A proved candidate; sorts best first."""

    score: float
    """Negative, rounded to 1e-9 as the margin is, so that ties stay ties."""
    margin: float
    faces: tuple[int, ...]
    row: int


def ranked_candidates(work: Contenders, proofs: dict[int, Proof], rank: Rank) -> list[_Ranked]:
    """The best candidate of each set, best first."""
    rows = np.array(sorted(proofs), dtype=np.int64)
    margin = np.array([proofs[row].margin for row in rows.tolist()])
    if rank == "Q":
        score = work.candidates.Q[rows]
    elif rank == "margin" or len(rows) == 1:  # one alone needs no score
        score = margin
    else:
        object_ = work.request.object_
        score = epsilon_upper_bound(*work.contacts_of(rows), object_.p_BBcm, object_.rho)
    entries = sorted(
        _Ranked(-round(float(s), 9), -round(float(m), 9), tuple(work.face[row].tolist()), int(row))
        for s, m, row in zip(score, margin, rows, strict=True)
    )
    seen: set[int] = set()
    first = []
    for entry in entries:
        set_index = int(work.candidates.set_index[entry.row])
        if set_index not in seen:
            seen.add(set_index)
            first.append(entry)
    return first


def certified_best(
    work: Contenders, proofs: dict[int, Proof], ranked: list[_Ranked], rank: Rank, top: int
) -> tuple[CertifiedGrasp, ...]:
    """The `top` best with their certificates."""
    measured = _of_greatest_epsilon(work, ranked, top) if rank == "epsilon" else {}
    rows = list(measured) or [entry.row for entry in ranked[:top]]
    epsilons = [measured.get(row) for row in rows]
    return work.certified(np.array(rows, dtype=np.int64), [proofs[row] for row in rows], epsilons)


def _of_greatest_epsilon(work: Contenders, ranked: list[_Ranked], top: int) -> dict[int, Interval]:
    """The `top` rows of greatest epsilon, best first, with its bounds.

    Scores are upper bounds: candidates are measured until that of none of the rest is above the
    intervals of the best by more than these are wide.
    """
    found: list[tuple[_Ranked, Interval]] = []
    for entry in ranked:
        full = len(found) == top
        least = min(epsilon.upper for _, epsilon in found) if full else -np.inf
        if -entry.score * (1.0 - RELATIVE_GAP) <= least:
            break
        epsilon = work.epsilon(entry.row, at_least=-found[-1][0].score if full else 0.0)
        found.append((replace(entry, score=-round(epsilon.lower, 9)), epsilon))
        found = sorted(found, key=lambda pair: pair[0])[:top]
    return {entry.row: epsilon for entry, epsilon in found}
