"""Writes grasp files in the formats of other programs, one file a format.

A format NAME is a line of `FORMATS` and a file NAME.py that defines

    def export_NAME(file: GraspFile, output: Path | str) -> None

`polygrasp export --NAME`, the names that this room offers, its tests and this table follow.

| file | what it holds |
|---|---|
| writing.py | `write_export`, which checks the arguments of an export and writes its text |
"""

from __future__ import annotations

from drake_polygrasp import lazy_names

FORMATS: dict[str, tuple[str, str]] = {
    "directives": ("dmd.yaml", "Drake model directives that add contact and fingertip frames"),
}
"""Ending of the files of each format, and what it is."""

__doc__ = f"{__doc__}" + "".join(f"| {name}.py | {what} |\n" for name, (_, what) in FORMATS.items())
__all__ = ["FORMATS", *(f"export_{name}" for name in FORMATS)]
__getattr__, __dir__ = lazy_names(__name__, {name: (f"export_{name}",) for name in FORMATS})
