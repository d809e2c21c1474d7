"""The output of `polygrasp verify`: a table and a document for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.table import align_columns
from drake_polygrasp.files.plant_block import plant_document
from drake_polygrasp.verification.report import Status

if TYPE_CHECKING:
    from drake_polygrasp.verification.report import GraspVerification, VerificationReport


def _plant_column(report: VerificationReport) -> list[tuple[str, ...]]:
    """Returns the cells "PLANT" of header and rows; empty rows where there is no plant verdict."""
    if not any(grasp.plant or grasp.stated_plant for grasp in report.grasps):
        return [()] * (1 + len(report.grasps))
    return [("PLANT",), *((_plant_cell(grasp),) for grasp in report.grasps)]


def _plant_cell(grasp: GraspVerification) -> str:
    """Returns the plant's verdict now, or else what the file states, marked "stated"."""
    if grasp.plant is not None:
        return str(grasp.plant.verdict)
    return "-" if grasp.stated_plant is None else f"stated: {grasp.stated_plant.verdict}"


def _bears_column(report: VerificationReport) -> list[tuple[str, ...]]:
    """Returns the cells "bears [mm]" of header and rows; empty rows where no error is stated."""
    if all(grasp.bears is None for grasp in report.grasps):
        return [()] * (1 + len(report.grasps))
    return [("bears [mm]",), *((_bears_cell(grasp),) for grasp in report.grasps)]


def _bears_cell(grasp: GraspVerification) -> str:
    """Returns the misses that a grasp bears; "-" where it states none or a check fails."""
    failed = any(line.status is Status.FAILED for line in grasp.lines.values())
    return "-" if grasp.bears is None or failed else f"{1e3 * grasp.bears:.2f}"


def _plant_lines(report: VerificationReport) -> list[str]:
    """Returns a table of the plant's verdicts, with how far each check is from failing."""
    rows = []
    for rank, grasp in enumerate(report.grasps, start=1):
        if grasp.plant is None:
            continue
        rows += [
            (
                str(rank),
                v.name,
                str(v.verdict),
                "-" if v.margin is None else f"{v.margin:.3g}",
                "" if v.unit == "1" else v.unit,
                v.reason,
            )
            for v in grasp.plant.verdicts
        ]
        not_drawn = grasp.plant.settings.get("misses")
        if isinstance(not_drawn, str):
            rows.append((str(rank), "misses", "-", "-", "", not_drawn))
    if not rows:
        return []
    return [
        *align_columns([("rank", "check", "verdict", "margin", "unit", ""), *rows]),
        *_surroundings_line(report),
    ]


def _surroundings_line(report: VerificationReport) -> list[str]:
    """Returns a line that names the scene's other bodies and the check that regards them."""
    for grasp in report.grasps:
        if grasp.plant is not None and "surroundings" in grasp.plant.settings:
            names = ", ".join(grasp.plant.settings["surroundings"]) or "no other body"
            return [f"the scene has {names}: regarded in geometry, not in statics and simulation"]
    return []


def verify_table(report: VerificationReport) -> str:
    """Returns the table of a verification: a row per grasp, and below it the checks' reasons.

    Args:
        report: what verification found.
    """
    added = [
        (*bears, *plant)
        for bears, plant in zip(_bears_column(report), _plant_column(report), strict=True)
    ]
    names = ["FORCES", "SURFACE", "NUMBERS"]
    names += ["HAND"] if any(grasp.hand for grasp in report.grasps) else []
    rows = [
        (
            str(rank),
            *(str(grasp.lines[name].status) if name in grasp.lines else "-" for name in names),
            *cell,
        )
        for rank, (grasp, cell) in enumerate(zip(report.grasps, added[1:], strict=True), start=1)
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
        summary += "" if report.hand_checked else "; HAND was not checked"
        summary += "" if report.plant_decided else "; some grasps are undecided in the plant"
    return "\n".join(
        [
            f"{report.path}: {len(rows)} grasp{'' if len(rows) == 1 else 's'}",
            *align_columns([("rank", *names, *added[0]), *rows]),
            *remarks,
            *_plant_lines(report),
            summary if rows else "the file holds no grasp",
        ]
    )


def verify_document(report: VerificationReport, holds: bool | None) -> dict[str, Any]:
    """Returns the verification as a document for JSON.

    Args:
        report: what verification found.
        holds: whether all that was asked for holds; None if undecided.
    """
    return {
        "file": str(report.path),
        "holds": holds,
        "model_checked": report.model_checked,
        "warnings": list(report.warnings),
        "grasps": [_verified_document(grasp) for grasp in report.grasps],
    }


def _verified_document(grasp: GraspVerification) -> dict[str, Any]:
    document: dict[str, Any] = {
        name: {"status": str(line.status), "reason": line.reason}
        for name, line in grasp.lines.items()
    }
    if grasp.bears is not None:
        document["bears"] = grasp.bears
    if grasp.plant is not None:
        document["plant"] = plant_document(grasp.plant)
    if grasp.stated_plant is not None:
        document["stated_plant"] = {"status": "stated", "verdict": str(grasp.stated_plant.verdict)}
    return document
