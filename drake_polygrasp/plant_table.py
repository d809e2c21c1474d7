"""What the command line prints of a plant's verdicts, and how it aligns every table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drake_polygrasp.grasp import CertifiedGrasp
    from drake_polygrasp.verification import GraspReport, Report

MOST_ASKED = 2
"""Times the grasps wanted, ours: how many `plan --plant` has a plant asked about at most."""


def holds_in_plant(grasp: CertifiedGrasp) -> bool:
    """Whether a plant was asked and all its verdicts are "holds"."""
    return grasp.plant is not None and grasp.plant.holds


def plant_column(grasps: Sequence[CertifiedGrasp]) -> list[tuple[str, ...]]:
    """The last cells of a plan's header, its units and its rows; empty where no plant was asked."""
    if not any(grasp.plant for grasp in grasps):
        return [()] * (2 + len(grasps))
    verdicts = [("-" if grasp.plant is None else str(grasp.plant.verdict),) for grasp in grasps]
    return [("plant",), ("",), *verdicts]


def plan_plant_lines(grasps: Sequence[CertifiedGrasp]) -> list[str]:
    """How many grasps a plant bears out, and for each other one the first verdict against it."""
    asked = [grasp for grasp in grasps if grasp.plant is not None]
    if not asked:
        return []
    ranks: dict[str, list[str]] = {}
    for rank, grasp in enumerate(grasps, start=1):
        if grasp.plant is not None and not grasp.plant.holds:
            against = next(v for v in grasp.plant.verdicts if v.verdict is grasp.plant.verdict)
            reason = f": {against.reason}" if against.reason else ""
            ranks.setdefault(f"{against.name} {against.verdict}{reason}", []).append(str(rank))
    return [
        f"in a plant {sum(map(holds_in_plant, asked))} of {len(asked)} grasps hold",
        *(
            f"grasp{'s' if len(who) > 1 else ''} {', '.join(who)}, {fault}"
            for fault, who in ranks.items()
        ),
    ]


def verified_plant_column(report: Report) -> list[tuple[str, ...]]:
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


def verified_plant_lines(report: Report) -> list[str]:
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


def _surroundings_line(report: Report) -> list[str]:
    """What other bodies were there, and for what."""
    for grasp in report.grasps:
        if grasp.plant is not None and "surroundings" in grasp.plant.settings:
            names = ", ".join(grasp.plant.settings["surroundings"]) or "no other body"
            return [f"in the scene stood {names}: part of geometry, not of statics and simulation"]
    return []


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines: columns of numbers stand on the right, text on the left."""
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
