"""Writes and reads the optional `plant` block of a grasp: the verdicts of checks in a plant."""

from __future__ import annotations

from typing import Any

import numpy as np

from drake_polygrasp.arrays import frozen
from drake_polygrasp.files.plain_yaml import Block
from drake_polygrasp.grasp import HeldWeight, PlantRecord, PlantVerdict, Verdict


def plant_document(record: PlantRecord) -> dict[str, Any]:
    """Returns a plant block as it stands in the file.

    Args:
        record: verdicts, settings, and Drake's contact forces that hold the weight along each axis.
    """
    return {
        "verdicts": [
            {
                "name": verdict.name,
                "verdict": str(verdict.verdict),
                "margin": verdict.margin,
                "unit": verdict.unit,
                "reason": verdict.reason,
            }
            for verdict in record.verdicts
        ],
        "settings": dict(record.settings),
        "equilibria": [
            {
                "weight_B": held.weight_B.tolist(),
                "residual": held.residual,
                "contact_wrenches": [
                    {"p_BC": p_BC, "f_Bc_B": f_Bc_B}
                    for p_BC, f_Bc_B in zip(held.p_BC.tolist(), held.f_Bc_B.tolist(), strict=True)
                ],
            }
            for held in record.equilibria
        ],
    }


def read_plant(block: Block) -> PlantRecord:
    """Reads a plant block, without checking that what it states is true.

    Args:
        block: the plant block.

    Returns:
        The verdicts that the file states; GraspFileError when it breaks the format.
    """
    return PlantRecord(
        verdicts=tuple(_read_verdict(item) for item in block.blocks("verdicts")),
        settings=block.block("settings").data if "settings" in block.data else {},
        equilibria=tuple(_read_held_weight(item) for item in block.blocks("equilibria"))
        if "equilibria" in block.data
        else (),
    )


def _read_verdict(block: Block) -> PlantVerdict:
    return PlantVerdict(
        name=block.text("name"),
        verdict=Verdict(block.text("verdict", tuple(Verdict))),
        margin=None if block.data.get("margin") is None else block.number("margin"),
        unit=block.text("unit") if "unit" in block.data else "1",
        reason=block.text("reason") if block.data.get("reason") else "",
    )


def _read_held_weight(block: Block) -> HeldWeight:
    wrenches = block.blocks("contact_wrenches")
    p_BC, f_Bc_B = (
        np.reshape([wrench.vector(key) for wrench in wrenches], (-1, 3))
        for key in ("p_BC", "f_Bc_B")
    )
    return HeldWeight(
        block.vector("weight_B"), block.number("residual"), frozen(p_BC), frozen(f_Bc_B)
    )
