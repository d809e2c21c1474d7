"""Exports contacts as JSON Lines: one contact a line, for data frames and scripts.

A line has the contact and what its grasp is worth. Proofs, other numbers of the certificate,
verdicts of plants and hands are left to the grasp file.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from drake_polygrasp.exporters.writing import write_export
from drake_polygrasp.files.stated_grasp import GraspFile


def export_contacts_jsonl(
    file: GraspFile, output: Path | str, *, instance: str | None = None
) -> None:
    """Writes each contact of a grasp file as a JSON object in a line of its own.

    Keys are those of the grasp file, with `grasp`, the rank from 1, and `contact`, from 1 to 3.

        export_contacts_jsonl(load_grasps("cube.grasp.yaml"), "cube.jsonl")

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file to write.
        instance: name of the object's model in the other program; None for the file's.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `output` cannot be written, or is the grasp file.
    """
    write_export(file, output, instance, _render)


def contact_rows(file: GraspFile, instance: str) -> Iterator[dict[str, Any]]:
    """Yields each contact as plain data, grasp by grasp.

    Args:
        file: the grasp file.
        instance: name of the object's model.

    Yields:
        Values by the names of the grasp file; vectors are lists, and what is not stated is None.
    """
    for rank, stated in enumerate(file.grasps, start=1):
        grasp, certificate = stated.grasp, stated.certificate
        for i in range(3):
            yield {
                "model_name": instance,
                "body_name": file.object_.body_name,
                "grasp": rank,
                "kind": grasp.kind,
                "contact": i + 1,
                "face": grasp.faces[i],
                "p_BC": grasp.p_BC[i].tolist(),
                "nhat_TB_B": grasp.nhat_TB_B[i].tolist(),
                "mu": float(grasp.mu[i]),
                "f_Bc_B": stated.f_Bc_B[i].tolist(),
                "margin": certificate.margin,
                "epsilon_lower": certificate.epsilon_lower,
                "squeeze_force": certificate.squeeze_force,
            }


def _render(file: GraspFile, instance: str) -> str:
    return "".join(f"{json.dumps(row)}\n" for row in contact_rows(file, instance))
