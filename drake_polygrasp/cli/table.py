"""Lines and columns that the tables of several subcommands share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject


MOST_NAMED = 12
"""Faces that a line names by their indices, ours; of more it tells how many."""


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines: columns of numbers stand on the right, text on the left."""
    columns = list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    numeric = [
        "," not in column[-1] and not any(cell[:1].isalpha() for cell in column[1:])
        for column in columns
    ]
    return [
        "  ".join(
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        ).rstrip()
        for row in rows
    ]


def lacking_friction(object_: GraspObject, mu_needed: float | None) -> float | None:
    """`mu_needed` where the object has less: else it is not friction that is lacking."""
    if mu_needed is None or mu_needed <= max(face.mu for face in object_.polyhedron.faces):
        return None
    return mu_needed


def friction_hint(mu_needed: float | None) -> str:
    """How much friction the first set of faces needs, where friction is lacking."""
    if mu_needed is None:
        return ""
    return f"; the first set of faces passes orientation at a friction above {mu_needed:.4f}"


def head_line(model: str, num_faces: int, excluded: Sequence[int], num_sets: int) -> str:
    """The model, its faces, those excluded, and its sets of faces."""
    named = (
        " ".join(map(str, excluded)) if len(excluded) <= MOST_NAMED else f"{len(excluded)} faces"
    )
    avoided = f" (excluded: {named})" if excluded else ""
    return f"{model}: {num_faces} faces{avoided}, {num_sets} sets of faces"
