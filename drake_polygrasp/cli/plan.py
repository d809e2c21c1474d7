"""`polygrasp plan`: its options and its call."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.calls import child_limits, load_model, planning_options
from drake_polygrasp.cli.child_process import call_in_child
from drake_polygrasp.cli.options import add_command, add_common_options, add_object_options
from drake_polygrasp.cli.reporting import DONE, FAILED, as_json, complain
from drake_polygrasp.cli.values import read_count
from drake_polygrasp.errors import UsageError

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject
    from drake_polygrasp.optimality.gap import OptimalityGap
    from drake_polygrasp.pipeline.plan import GraspPlan


MOST_ASKED = 2
"""Times the grasps wanted, ours: how many `plan --plant` has a plant asked about at most."""


def add_plan(commands: Any) -> None:
    """Adds the subcommand to those of the parser."""
    parser = add_command(commands, "plan", "Plan grasps, prove them and write them.")
    add_object_options(parser)
    parser.add_argument(
        "--top",
        metavar="K",
        type=read_count,
        default=10,
        help="how many grasps to write at most (default: 10)",
    )
    parser.add_argument(
        "--rank",
        choices=("epsilon", "margin", "Q"),
        help="what puts one grasp before another (default: epsilon; Q for --method paper)",
    )
    parser.add_argument(
        "--effort",
        choices=("full", "quick", "complete"),
        default="full",
        help="quick: search less and without the paper's stages, for grasps of a somewhat lower "
        "epsilon and without Q in a fraction of the time; complete: evaluate every set of faces, "
        "up to 20 million, however many grasps are found (default: full)",
    )
    parser.add_argument(
        "--gap",
        metavar="NODES",
        nargs="?",
        type=read_count,
        const=0,
        help="say too how near the best grasp is to the best possible one, by branch and bound "
        "over so many pieces of the faces (default: 100000, about a minute); for bodies without "
        "curved or noisy surfaces",
    )
    parser.add_argument(
        "--plant",
        action="store_true",
        help="have grasps hold the model in a MultibodyPlant, best first, until K of them hold or "
        "2 K were asked about; those that fail are written behind those that hold, all with their "
        "verdicts",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help="the grasp file (default: MODEL's name with .grasp.yaml in the current folder)",
    )
    add_common_options(parser)


def run_plan(arguments: argparse.Namespace) -> tuple[int, str]:
    """Returns the exit code and what to print."""
    output = arguments.output or _default_output(arguments.model)
    if output.exists() and Path(arguments.model).exists() and output.samefile(arguments.model):
        raise UsageError(f"{output}: is the model; name another file with -o")
    object_, load_seconds = load_model(arguments)

    from drake_polygrasp.cli.plan_table import (
        gap_document,
        gap_lines,
        holds_in_plant,
        no_grasp_message,
        plan_table,
    )
    from drake_polygrasp.files.grasp_file import grasp_document, save_grasps

    if arguments.gap is not None:
        call_in_child("drake_polygrasp.optimality.gap:require_planar", object_)
    plan, _ = call_in_child(
        "drake_polygrasp.pipeline.plan:plan_grasps",
        object_,
        limits=child_limits(arguments, f"planning grasps of {arguments.model}"),
        **planning_options(arguments)
        | {"top": MOST_ASKED * arguments.top if arguments.plant else arguments.top},
    )
    if arguments.plant and plan.grasps:
        plan = _in_plant(arguments, object_, plan)
    if plan.grasps:
        # Without it, the friction stated here would look better than the model's.
        settings = replace(plan.settings, mu=arguments.mu)
        save_grasps(output, object_, plan.grasps, settings)
    else:
        complain(no_grasp_message(arguments.model, object_, plan, output), FAILED)
    gap = None if arguments.gap is None else _gap(arguments, object_, plan)
    code = DONE if plan.grasps else FAILED
    if arguments.plant and plan.grasps and not any(map(holds_in_plant, plan.grasps)):
        code = complain(f"{output}: a plant bears out none of the grasps", FAILED)
    if not arguments.json:
        table = [plan_table(arguments.model, object_, plan, output)] if plan.grasps else []
        return code, "\n".join(table + (gap_lines(gap) if gap else []))
    return code, as_json(
        {
            "model": arguments.model,
            "num_faces": len(object_.polyhedron.faces),
            "excluded_faces": plan.excluded_faces,
            "num_sets": plan.num_sets,
            "num_certified": plan.num_certified,
            "seconds": {"load": load_seconds, **plan.seconds},
            "reasons": plan.reasons,
            "outcome": plan.outcome,
            "output": str(output) if plan.grasps else None,
            "grasps": [grasp_document(grasp) for grasp in plan.grasps],
            **({"gap": gap_document(gap)} if gap else {}),
        }
    )


def _in_plant(arguments: argparse.Namespace, object_: GraspObject, plan: GraspPlan) -> GraspPlan:
    ranked: GraspPlan
    ranked, _ = call_in_child(
        "drake_polygrasp.pipeline.plant_ranking:rank_in_plant",
        object_,
        plan,
        limits=child_limits(arguments, f"holding grasps of {arguments.model} in a plant", "grasps"),
        top=arguments.top,
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
    )
    return ranked


def _gap(arguments: argparse.Namespace, object_: GraspObject, plan: GraspPlan) -> OptimalityGap:
    gap: OptimalityGap
    gap, _ = call_in_child(
        "drake_polygrasp.optimality.gap:epsilon_gap",
        object_,
        plan,
        limits=child_limits(arguments, f"bounding grasps of {arguments.model}", "nodes"),
        **({"nodes": arguments.gap} if arguments.gap else {}),
    )
    return gap


def _default_output(model: str) -> Path:
    name = PurePath(model).name.removesuffix(".yaml")
    return Path(f"{PurePath(name).stem}.grasp.yaml")
