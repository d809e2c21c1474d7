"""What a plant says of a file's grasps, as it stands in the optional `plant` block of each."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drake_polygrasp.errors import UsageError
from drake_polygrasp.grasp_file import write_document
from drake_polygrasp.loading.model_source import is_uri
from drake_polygrasp.plain_yaml import read_mapping

if TYPE_CHECKING:
    from drake_polygrasp.certification.in_plant import PlantReport


def plant_document(report: PlantReport) -> dict[str, Any]:
    """The verdicts, the settings, and Drake's contact wrenches under the weight along each axis."""
    return {
        "verdicts": [
            {
                "name": verdict.name,
                "verdict": str(verdict.verdict),
                "margin": verdict.margin,
                "unit": verdict.unit,
                "reason": verdict.reason,
            }
            for verdict in report.verdicts
        ],
        "settings": report.settings,
        "equilibria": [
            {
                "weight_B": equilibrium.weight_B.tolist(),
                "residual": equilibrium.residual,
                "contact_wrenches": [
                    {"p_BC": p_BC, "f_Bc_B": f_Bc_B}
                    for p_BC, f_Bc_B in zip(
                        equilibrium.p_BC.tolist(), equilibrium.f_Bc_B.tolist(), strict=True
                    )
                ],
            }
            for equilibrium in report.equilibria
        ],
    }


def save_plant_results(
    file: Path | str, output: Path | str, reports: Sequence[PlantReport | None]
) -> None:
    """Writes a copy of a grasp file with what a plant says of its grasps.

    Args:
        file: the grasp file, which is not changed.
        output: the copy.
        reports: one for each grasp; None leaves it as it was.

    Raises:
        GraspFileError: when the file cannot be read, or the copy not written.
        UsageError: when the copy would be the file.
    """
    file, output = Path(file), Path(output)
    if output.exists() and output.samefile(file):
        raise UsageError(f"{output}: is the file to verify, which is not changed; name another")
    document = read_mapping(file).data
    for grasp, report in zip(document["grasps"], reports, strict=True):
        if report is not None:
            grasp["plant"] = plant_document(report)
    model_file = document["object"]["model_file"]
    if not is_uri(model_file):
        # It is relative to the folder of the file that names it.
        moved = os.path.relpath(file.parent.resolve() / model_file, output.parent.resolve())
        document["object"]["model_file"] = Path(moved).as_posix()
    write_document(output, document)
