"""Columns and lines that the tables of several subcommands share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject


_MAX_NAMED_FACES = 12
"""How many excluded faces a line lists by index; of more it states the number. Our choice."""


def align_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Returns rows of a table as lines, with columns of numbers aligned right and of text left.

    Args:
        rows: cells, as many in each row; the first row is the header.
    """
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


def counted(number: int, noun: str) -> str:
    """Returns a number with its noun, in the plural where it is not one.

    Args:
        number: how many.
        noun: what, in the singular; its plural ends in s.
    """
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def lacking_friction(object_: GraspObject, mu_needed: float | None) -> float | None:
    """Returns `mu_needed` if no face of the object has as much friction, else None.

    Args:
        object_: the object.
        mu_needed: least friction at which some set of faces passes orientation.
    """
    if mu_needed is None or mu_needed <= max(face.mu for face in object_.polyhedron.faces):
        return None
    return mu_needed


def friction_hint(mu_needed: float | None) -> str:
    """Returns the end of a "no grasp" message that says how much friction is needed.

    Args:
        mu_needed: least friction at which some set of faces passes orientation; None where friction
            is not what is lacking, and then the text is empty.
    """
    if mu_needed is None:
        return ""
    return f"; the first set of faces passes orientation at a friction above {mu_needed:.4f}"


def head_line(model: str, num_faces: int, excluded: Sequence[int], num_sets: int) -> str:
    """Returns a table's first line: the model, its faces and its sets of faces.

    Args:
        model: the model's name.
        num_faces: number of its faces.
        excluded: indices of the faces excluded by the user, ascending.
        num_sets: number of its sets of two or three faces.
    """
    listed = len(excluded) <= _MAX_NAMED_FACES
    faces = " ".join(map(str, excluded)) if listed else f"{len(excluded)} faces"
    exclusion = f" (excluded: {faces})" if excluded else ""
    return f"{model}: {num_faces} faces{exclusion}, {num_sets} sets of faces"
