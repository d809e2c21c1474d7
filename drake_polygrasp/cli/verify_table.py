"""What `polygrasp verify` prints: a table for people, a plain document for machines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.table import aligned
from drake_polygrasp.files.plant_block import plant_document

if TYPE_CHECKING:
    from drake_polygrasp.verification.report import GraspReport, VerificationReport


def verified_plant_column(report: VerificationReport) -> list[tuple[str, ...]]:
    """The last cells of the header and of each row; empty where nothing says anything of a plant.

    What the file states and no plant was asked again is "stated".
    """
    if not any(grasp.plant or grasp.stated_plant for grasp in report.grasps):
        return [()] * (1 + len(report.grasps))
    return [("PLANT",), *((_cell(grasp),) for grasp in report.grasps)]


def _cell(grasp: GraspReport) -> str:
    if grasp.plant is not None:
        return str(grasp.plant.verdict)
    return "-" if grasp.stated_plant is None else f"stated: {grasp.stated_plant.verdict}"


def verified_plant_lines(report: VerificationReport) -> list[str]:
    """A row for each verdict of a plant, with what is left until it would not hold."""
    rows = [
        (
            str(rank),
            v.name,
            str(v.verdict),
            "-" if v.margin is None else f"{v.margin:.3g}",
            "" if v.unit == "1" else v.unit,
            v.reason,
        )
        for rank, grasp in enumerate(report.grasps, start=1)
        if grasp.plant is not None
        for v in grasp.plant.verdicts
    ]
    if not rows:
        return []
    return [
        *aligned([("rank", "check", "verdict", "margin", "unit", ""), *rows]),
        *_surroundings_line(report),
    ]


def _surroundings_line(report: VerificationReport) -> list[str]:
    """What other bodies were there, and for what."""
    for grasp in report.grasps:
        if grasp.plant is not None and "surroundings" in grasp.plant.settings:
            names = ", ".join(grasp.plant.settings["surroundings"]) or "no other body"
            return [f"in the scene stood {names}: part of geometry, not of statics and simulation"]
    return []


def verify_table(report: VerificationReport) -> str:
    """One row a grasp, and below it a sentence for each line that has something to say."""
    in_plant = verified_plant_column(report)
    rows = [
        (str(rank), *(str(line.status) for line in grasp.lines.values()), *cell)
        for rank, (grasp, cell) in enumerate(zip(report.grasps, in_plant[1:], strict=True), start=1)
    ]
    remarks = [
        f"grasp {rank}, {name}: {line.reason}"
        for rank, grasp in enumerate(report.grasps, start=1)
        for name, line in grasp.lines.items()
        if line.reason
    ]
    summary = "something does not hold" if report.holds is False else "all that was checked holds"
    if report.holds is None:
        summary += "" if report.model_checked else "; SURFACE was not checked"
        summary += "" if report.plant_decided else "; a plant leaves grasps undecided"
    return "\n".join(
        [
            f"{report.path}: {len(rows)} grasp{'' if len(rows) == 1 else 's'}",
            *aligned([("rank", "FORCES", "SURFACE", "NUMBERS", *in_plant[0]), *rows]),
            *remarks,
            *verified_plant_lines(report),
            summary if rows else "the file holds no grasp",
        ]
    )


def verify_document(report: VerificationReport, holds: bool | None) -> dict[str, Any]:
    """The report for machines; `holds` is that of the report or, as more was asked for, False."""
    return {
        "file": str(report.path),
        "holds": holds,
        "model_checked": report.model_checked,
        "warnings": list(report.warnings),
        "grasps": [_verified_document(grasp) for grasp in report.grasps],
    }


def _verified_document(grasp: GraspReport) -> dict[str, Any]:
    document: dict[str, Any] = {
        name: {"status": str(line.status), "reason": line.reason}
        for name, line in grasp.lines.items()
    }
    if grasp.plant is not None:
        document["plant"] = plant_document(grasp.plant)
    if grasp.stated_plant is not None:
        document["stated_plant"] = {"status": "stated", "verdict": str(grasp.stated_plant.verdict)}
    return document
