"""What becomes of sets of faces: one reason each, and the contacts that were constructed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array, Batch, Bools, Ints

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
"""What can become of a set of faces. Codes in arrays are positions in this tuple."""
MEANING = {
    "certified": ("all", "a grasp was built and proved"),
    "excluded": ("faces", "the user excludes a face, or the surface at a contact"),
    "orientation": ("faces (4)", "the normals cannot oppose each other with this friction"),
    "rl_empty": ("faces (4)", "no point lies over all three along their normals (R^l is empty)"),
    "rs_empty": ("faces (4, 5)", "no height is common to the faces (R^s is empty)"),
    "not_opposed": ("faces (4)", "the faces do not lie opposite each other"),
    "no_direction": ("plane (5)", "no direction of the grasp plane meets all faces"),
    "p_empty": ("plane (5, 6)", "forces on the cut faces have no common point (P is empty)"),
    "off_face": ("contacts (7)", "a contact would lie off its face"),
    "wrong_order": ("contacts (7)", "the lone contact would not lie between the other two"),
    "collinear": ("contacts (7)", "the contacts would lie on one line"),
    "tip_blocked": ("fingertips", "a fingertip would penetrate the object or another fingertip"),
    "obstructed": ("fingertips", "a fingertip would penetrate an obstacle"),
    "not_force_closure": ("proof", "the contacts do not hold the object"),
    "undecided": ("proof", "neither proved to hold nor proved not to"),
    "not_evaluated": ("search", "enough grasps were proved before it was its turn"),
}
"""For each reason the step that ended the set, with its section in the paper, and a sentence."""
CODE = {reason: code for code, reason in enumerate(REASONS)}
"""Position of each reason in `REASONS`."""
Codes: TypeAlias = npt.NDArray[np.int8]
"""Codes of sets of faces."""
UNJUDGED = CODE["not_evaluated"]
"""Code of a set whose contacts are constructed and not judged yet."""

EQUAL_QUALITY = 1e-9
"""Our choice: values of Q that differ by less are a tie."""


@dataclass(frozen=True, eq=False)
class Candidates(Batch):
    """Constructed contacts, one row for each set or variant of it; NaN where Section 7 failed.

    Attributes:
        set_index: index of the row's set in `SetPlan.sets`, shape (C,).
        region: region of each contact, shape (C, 3).
        is_parallel: whether the set was planned with parallel forces, shape (C,).
        p_BC: contact points expressed in B [m], shape (C, 3, 3).
        nhat_B: N, unit normal of Pi_p, shape (C, 3).
        p_BP: c_I^p, a point of Pi_p [m], shape (C, 3).
        q: factors q_1 to q_5 of Q, shape (C, 5).
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
        """The paper's quality Q (eq. 5), shape (C,)."""
        product: Array = self.q.prod(axis=1)
        return product


@dataclass(frozen=True, eq=False)
class SetPlan:
    """Every set of faces with its reason so far, and the contacts constructed on them.

    Attributes:
        sets: regions of each set, ascending, -1 for the third of a pair, shape (M, 3).
        code: position of each set's reason in `REASONS`; `UNJUDGED` for sets with contacts, shape
            (M,).
        candidates: contacts of the sets with a non-empty P, in the order of `sets`; NaN where
            Section 7 failed.
    """

    sets: Ints
    code: Codes
    candidates: Candidates


def unplanned(sets: Ints) -> SetPlan:
    """Returns sets that no stage has seen, all not evaluated and without candidates.

    Args:
        sets: regions of each set, ascending, -1 for the third of a pair, shape (M, 3).
    """
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
    """Tests whether all three contacts of each row were constructed.

    Args:
        p_BC: contact points, NaN where construction failed, shape (C, 3, 3).

    Returns:
        Whether they were, shape (C,).
    """
    constructed: Bools = np.logical_and.reduce(np.isfinite(p_BC), axis=(1, 2))
    return constructed
