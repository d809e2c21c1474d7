"""Exports contacts as comma-separated values: one contact a line, for spreadsheets.

Columns are the keys of `contacts_jsonl`, vectors as three columns with the endings _x, _y and _z,
and what the file does not state is empty. What JSON Lines leave out is left out here too.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from drake_polygrasp.exporters.contacts_jsonl import contact_rows
from drake_polygrasp.exporters.writing import write_export
from drake_polygrasp.files.stated_grasp import GraspFile


def export_contacts_csv(
    file: GraspFile, output: Path | str, *, instance: str | None = None
) -> None:
    """Writes each contact of a grasp file as a line of comma-separated values, below a header.

        export_contacts_csv(load_grasps("cube.grasp.yaml"), "cube.csv")

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file to write.
        instance: name of the object's model in the other program; None for the file's.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `output` cannot be written, or is the grasp file.
    """
    write_export(file, output, instance, _render)


def _render(file: GraspFile, instance: str) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for number, row in enumerate(contact_rows(file, instance)):
        cells = dict(_cells(row))
        if number == 0:
            writer.writerow(cells)
        writer.writerow(cells.values())
    return text.getvalue()


def _cells(row: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yields names and values of a row's columns."""
    for name, value in row.items():
        if isinstance(value, list):
            yield from zip((f"{name}_{axis}" for axis in "xyz"), value, strict=True)
        else:
            yield name, value
