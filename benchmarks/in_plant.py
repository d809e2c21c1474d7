"""Mathematics and simulation side by side: the best grasp of every model, as a Markdown table.

Run from the repository's root: `python benchmarks/in_plant.py`.
"""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

from drake_polygrasp import certify_in_plant, load_object, plan_grasps

MODELS = Path(__file__).parents[1] / "models"
NAMES = ("exact", "convex", "geometry", "statics", "simulation")


def main() -> None:
    print(f"| Model | {' | '.join(NAMES)} | on | seconds |")
    print("|---|" + "---|" * (len(NAMES) + 2))
    for folder in sorted(path for path in MODELS.iterdir() if path.is_dir()):
        (model,) = (path for path in folder.iterdir() if path.suffix in {".sdf", ".urdf"})
        print(f"| `{folder.name}` | {' | '.join(row(model))} |", flush=True)


def row(model: Path) -> list[str]:
    """What each verdict leaves until it would not hold, and why where it does not."""
    object_ = load_object(model)
    plan = plan_grasps(object_, top=1)
    if not plan.grasps:
        return ["no certified grasp", *[""] * (len(NAMES) + 1)]
    best, start = plan.grasps[0], perf_counter()
    x, tip_radius = best.certificate.internal_force, plan.settings["tip_radius"]
    report = certify_in_plant(object_, best.grasp, x, tip_radius=tip_radius)
    cells = [
        f"{v.margin:.2g}{'' if v.unit == '1' else ' ' + v.unit}"
        if v.verdict == "holds" and v.margin is not None
        else f"**{v.verdict}**: {v.reason}"
        for v in report.verdicts
    ]
    return [*cells, report.settings["simulated_on"], f"{perf_counter() - start:.1f}"]


if __name__ == "__main__":
    main()
