"""Writes a copy of a grasp file with the verdicts of a plant on its grasps."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drake_polygrasp.errors import UsageError
from drake_polygrasp.files.grasp_file import write_document
from drake_polygrasp.files.plain_yaml import read_mapping
from drake_polygrasp.files.plant_block import plant_document
from drake_polygrasp.files.whole_file import followed
from drake_polygrasp.grasp import PlantRecord
from drake_polygrasp.loading.packages import is_uri


def save_plant_results(
    file: Path | str, output: Path | str, reports: Sequence[PlantRecord | None]
) -> None:
    """Writes a copy of a grasp file with the verdicts of a plant on its grasps.

    Args:
        file: the grasp file, which is not changed.
        output: the copy to write.
        reports: verdicts on each grasp, in the file's order; None leaves a grasp as it is.

    Raises:
        GraspFileError: when the file cannot be read, or the copy not written.
        UsageError: when the copy would be the file.
    """
    file, output = followed(Path(file)), followed(Path(output))
    if output.exists() and output.samefile(file):
        raise UsageError(f"{output}: is the file to verify, which is not changed; name another")
    document = read_mapping(file).data
    for grasp, report in zip(document["grasps"], reports, strict=True):
        if report is not None:
            grasp["plant"] = plant_document(report)
    _move(document["object"], "model_file", file.parent, output.parent)
    if "hand" in document:
        _move(document["hand"], "description_file", file.parent, output.parent)
    write_document(output, document)


def _move(block: dict[str, Any], key: str, folder: Path, new_folder: Path) -> None:
    """Makes a path that is relative to the folder of a grasp file relative to another."""
    if not is_uri(block[key]):
        moved = os.path.relpath(folder.resolve() / block[key], new_folder.resolve())
        block[key] = Path(moved).as_posix()
