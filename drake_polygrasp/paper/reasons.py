"""What becomes of sets of faces: a reason each, and the contacts that were constructed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array, Batch, Bools, Ints

Method = Literal["enriched", "paper"]

REASONS = (
    "certified",
    "excluded",
    "orientation",
    "rl_empty",
    "rs_empty",
    "not_opposed",
    "no_direction",
    "p_empty",
    "off_face",
    "wrong_order",
    "collinear",
    "tip_blocked",
    "obstructed",
    "not_force_closure",
    "undecided",
    "not_evaluated",
)
"""What can become of a set of faces; codes in arrays are positions in this tuple."""
MEANING = {
    "certified": ("all", "a grasp was built and proved"),
    "excluded": ("faces", "a face, or the surface at a contact, is one to avoid"),
    "orientation": ("faces (4)", "the normals cannot oppose each other with this friction"),
    "rl_empty": ("faces (4)", "no point lies over all three along their normals (R^l is empty)"),
    "rs_empty": ("faces (4, 5)", "no height is common to the faces (R^s is empty)"),
    "not_opposed": ("faces (4)", "the faces do not lie opposite each other"),
    "no_direction": ("plane (5)", "no direction of the grasp plane meets all faces"),
    "p_empty": ("plane (5, 6)", "forces on the cut faces have no common point (P is empty)"),
    "off_face": ("contacts (7)", "a contact would lie off its face"),
    "wrong_order": ("contacts (7)", "the lone contact would not lie between the other two"),
    "collinear": ("contacts (7)", "the contacts would lie on one line"),
    "tip_blocked": ("fingertips", "a fingertip has no room beside the object or another one"),
    "obstructed": ("fingertips", "an obstacle is where a fingertip would be"),
    "not_force_closure": ("proof", "the contacts do not hold the object"),
    "undecided": ("proof", "neither proved to hold nor proved not to"),
    "not_evaluated": ("search", "enough grasps were proved before it was its turn"),
}
"""What ended a set of faces: the step, with its section in the paper, and a sentence."""
CODE = {reason: code for code, reason in enumerate(REASONS)}
UNJUDGED = CODE["not_evaluated"]
"""Code of a set with contact points that nobody has judged yet."""

EQUAL_QUALITY = 1e-9
"""Ours: values of Q nearer than this are a tie."""


@dataclass(frozen=True, eq=False)
class Candidates(Batch):
    """Constructed contacts, one row a set (or a variant of it); NaN where construction failed.

    Attributes:
        set_index: position of the set in SetPlan.sets, shape (C,).
        region: region of each contact, shape (C, 3).
        is_parallel: whether the set was planned with parallel forces, shape (C,).
        p_BC: [m], shape (C, 3, 3).
        nhat_B: N, unit normal of Pi_p, shape (C, 3).
        p_BP: a point of Pi_p, c_I^p [m], shape (C, 3).
        q: q_1 to q_5, shape (C, 5).
    """

    set_index: Ints
    region: Ints
    is_parallel: Bools
    p_BC: Array
    nhat_B: Array
    p_BP: Array
    q: Array

    @property
    def Q(self) -> Array:
        """The paper's quality (eq. 5), shape (C,)."""
        product: Array = self.q.prod(axis=1)
        return product


@dataclass(frozen=True, eq=False)
class SetPlan:
    """Every set of faces with its reason so far, and the contacts of those that have some.

    Attributes:
        sets: regions of each set, ascending; -1 for a pair's third, shape (M, 3).
        code: position in REASONS; UNJUDGED for sets with contact points, shape (M,).
        candidates: sets with a non-empty P, in the order of sets; NaN contacts where Section 7
            failed.
    """

    sets: Ints
    code: npt.NDArray[np.int8]
    candidates: Candidates


def unplanned(sets: Ints) -> SetPlan:
    """Sets (M, 3) that no stage has seen, without candidates."""
    none, points = np.empty(0, dtype=np.int64), np.empty((0, 3))
    candidates = Candidates(
        none,
        np.empty((0, 3), dtype=np.int64),
        none.astype(bool),
        np.empty((0, 3, 3)),
        points,
        points,
        np.empty((0, 5)),
    )
    return SetPlan(sets, np.full(len(sets), UNJUDGED, dtype=np.int8), candidates)


def has_contacts(p_BC: Array) -> Bools:
    """Whether all contacts of each row were constructed, shape (C, 3, 3) to (C,)."""
    constructed: Bools = np.logical_and.reduce(np.isfinite(p_BC), axis=(1, 2))
    return constructed
