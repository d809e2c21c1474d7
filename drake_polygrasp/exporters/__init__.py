"""Writes grasp files in the formats of other programs, one file a format.

A format NAME is a line of `FORMATS` and a file NAME.py that defines

    def export_NAME(file: GraspFile, output: Path | str, *, instance: str | None = None) -> None

`polygrasp export --to NAME` and `--NAME`, the names that this room offers, its tests and this table
follow. What a format cannot carry is said in its file.

| file | what it holds |
|---|---|
| writing.py | `write_export`, which checks the arguments of an export and writes its text |
| poses.py | poses of contacts, fingertips and palms: `contact_poses`, `pose_document` |
| holding.py | how a hand holds the grasps of a file, for formats that are about hands |
"""

from __future__ import annotations

from drake_polygrasp import lazy_names

FORMATS: dict[str, tuple[str, str]] = {
    "directives": (
        "dmd.yaml",
        "Drake model directives: frames of contacts, fingertips and palms",
    ),
    "isaac_grasp": ("yaml", "postures of a hand, for NVIDIA Isaac's isaac_grasp reader"),
    "moveit": ("yaml", "postures of a hand, as a list of MoveIt's moveit_msgs/Grasp"),
    "contacts_jsonl": ("jsonl", "contacts as JSON Lines, one contact a line"),
    "contacts_csv": ("csv", "contacts as comma-separated values, one contact a line"),
    "frames_json": ("json", "poses of contacts, fingertips and palms as plain JSON"),
}
"""Ending of the files of each format, and what it is."""

__doc__ = f"{__doc__}" + "".join(f"| {name}.py | {what} |\n" for name, (_, what) in FORMATS.items())
__all__ = ["FORMATS", *(f"export_{name}" for name in FORMATS)]
__getattr__, __dir__ = lazy_names(__name__, {name: (f"export_{name}",) for name in FORMATS})
