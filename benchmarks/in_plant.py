"""Mathematics and simulation side by side: the best grasp of every model, as a Markdown table.

    python -m benchmarks.in_plant [--top 10]

Each cell is what a verdict leaves until it would not hold: exact and convex the margin of the
proof, geometry the room of the contacts, statics the spare friction, simulation the share of its
bounds that is not used. Below the table stand all grasps, of the `--top` best of each model, that a
plant does not bear out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.objects import models
from drake_polygrasp import GraspPlan, PlantReport, certify_in_plant, load_object, plan_grasps

NAMES = ("exact", "convex", "geometry", "statics", "simulation")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.in_plant", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--top", type=int, default=1, help="grasps of each model (default: 1)")
    top = parser.parse_args().top
    print(f"| model | {' | '.join(NAMES)} |")
    print("|---|" + "---|" * len(NAMES))
    asked, refused = 0, []
    for _, name, model, _ in models():
        reports = plant_reports(model, top)
        print(f"| `{name}` | {' | '.join(row(reports))} |", flush=True)
        asked += len(reports)
        refused += [
            f"`{name}`, grasp {rank}: {fault(report)}"
            for rank, report in enumerate(reports, 1)
            if not report.holds
        ]
    print(f"\nOf {asked} grasps a plant does not bear out {len(refused)}.", *refused, sep="\n")


def plant_reports(model: Path, top: int) -> list[PlantReport]:
    object_ = load_object(model)
    plan: GraspPlan = plan_grasps(object_, top=top)
    return [certify_in_plant(object_, found) for found in plan.grasps]


def fault(report: PlantReport) -> str:
    """The first verdict that does not hold."""
    verdict = next(v for v in report.verdicts if v.verdict != "holds")
    return f"{verdict.name} {verdict.verdict}, {verdict.reason}"


def row(reports: list[PlantReport]) -> list[str]:
    """The best grasp's verdicts."""
    if not reports:
        return ["no certified grasp", *[""] * (len(NAMES) - 1)]
    return [
        f"{v.margin:.2g}{'' if v.unit == '1' else ' ' + v.unit}"
        if v.verdict == "holds" and v.margin is not None
        else f"**{v.verdict}**"
        for v in reports[0].verdicts
    ]


if __name__ == "__main__":
    main()
