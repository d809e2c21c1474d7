"""`polygrasp plan`: its options and its call."""

from __future__ import annotations

import argparse
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.calls import child_limits, load_model, planning_options
from drake_polygrasp.cli.child_process import call_in_child
from drake_polygrasp.cli.hand_plan import (
    HAND_TOP,
    add_hand_options,
    check_hand_options,
    run_hand_plan,
)
from drake_polygrasp.cli.options import add_command, add_common_options, add_object_options
from drake_polygrasp.cli.reporting import DONE, FAILED, as_json, print_error
from drake_polygrasp.cli.values import read_count
from drake_polygrasp.errors import UsageError

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject
    from drake_polygrasp.optimality.gap import OptimalityGap
    from drake_polygrasp.pipeline.plan import GraspPlan


DEFAULT_TOP = 10
"""Grasps that are written by default. Our choice."""
_MAX_PLANT_CHECKS = 2
"""Grasps that `plan --plant` checks at most, per grasp wanted. Our choice."""


def add_plan(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(
        commands, "plan", "Plan grasps of a model, prove each one and write them to a grasp file."
    )
    add_object_options(parser)
    add_choice_options(parser)
    parser.set_defaults(top=None)
    add_hand_options(parser)
    parser.add_argument(
        "--gap",
        metavar="NODES",
        nargs="?",
        type=read_count,
        const=0,
        help="also report how close the best grasp is to the optimum, by branch and bound over "
        "this many nodes (default: 100000, about a minute); for objects with planar faces only",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help="grasp file to write (default: MODEL's name with .grasp.yaml in the current folder)",
    )
    parser.add_argument(
        "--region-proof",
        metavar="FILE",
        type=Path,
        help="also write the proofs of what each grasp withstands under errors, as JSON that "
        "`python -m drake_polygrasp.certification.exact_cycle FILE` checks in exact arithmetic",
    )
    add_common_options(parser)


def add_choice_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say how many grasps are wanted and how they are chosen.

    Args:
        parser: the subcommand's parser.
    """
    parser.add_argument(
        "--top",
        metavar="K",
        type=read_count,
        default=DEFAULT_TOP,
        help="greatest number of grasps to write, one per set of faces (default: 10; 3 with "
        "--hand)",
    )
    parser.add_argument(
        "--rank",
        choices=("epsilon", "margin", "Q"),
        help="rank grasps by Ferrari and Canny's epsilon, the margin of the proof or the paper's "
        "quality Q (default: epsilon; Q for --method paper)",
    )
    parser.add_argument(
        "--effort",
        choices=("full", "quick", "complete"),
        default="full",
        help="quick: search less and skip the paper's stages: a fraction of the time, somewhat "
        "lower epsilon, no Q; complete: evaluate every set of faces, up to 20 million, however "
        "many grasps are found (default: full)",
    )
    parser.add_argument(
        "--plant",
        action="store_true",
        help="also check grasps in a MultibodyPlant, best first, until K of them hold or 2 K were "
        "checked; those that fail are written after those that hold, all with their verdicts",
    )


def run_plan(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_plan`.

    Returns:
        The exit code and what to print.

    Raises:
        ModelError: when the model cannot be loaded.
        HandError: when the hand cannot be used.
        GraspFileError: when the grasp file cannot be written.
        UsageError: when an option does not fit the object or another option.
    """
    output = arguments.output or _default_output(arguments.model)
    if output.exists() and Path(arguments.model).exists() and output.samefile(arguments.model):
        raise UsageError(f"{output}: is the model, not a file to write to; name another with -o")
    check_hand_options(arguments)
    if arguments.top is None:
        arguments.top = DEFAULT_TOP if arguments.hand is None else HAND_TOP
    _check_proof_file(arguments.region_proof, output, Path(arguments.model))
    object_, load_seconds = load_model(arguments)
    if arguments.hand is not None:
        return run_hand_plan(arguments, object_, output, load_seconds)

    from drake_polygrasp.cli.plan_table import (
        gap_document,
        gap_lines,
        holds_in_plant,
        no_grasp_message,
        plan_table,
    )
    from drake_polygrasp.files.grasp_file import grasp_document, save_grasps

    if arguments.gap is not None:
        call_in_child(
            "drake_polygrasp.optimality.gap:require_planar",
            object_,
            limits=child_limits(arguments, f"bounding grasps of {arguments.model}"),
        )
    plan, _ = call_in_child(
        "drake_polygrasp.pipeline.plan:plan_grasps",
        object_,
        limits=child_limits(arguments, f"planning grasps of {arguments.model}"),
        **planning_options(arguments)
        | {"top": _MAX_PLANT_CHECKS * arguments.top if arguments.plant else arguments.top},
    )
    if arguments.plant and plan.grasps:
        plan = _rank_in_plant(arguments, object_, plan)
    if plan.grasps:
        proofs = _region_proofs(arguments, object_, plan)
        save_grasps(output, object_, plan.grasps, plan.settings)
    else:
        print_error(no_grasp_message(arguments.model, object_, plan, output), FAILED)
    gap = None if arguments.gap is None else _gap(arguments, object_, plan)
    code = DONE if plan.grasps else FAILED
    if arguments.plant and plan.grasps and not any(map(holds_in_plant, plan.grasps)):
        why = ": the model states no mass" if object_.mass is None else ""
        code = print_error(f"{output}: none of the grasps holds in the plant{why}", FAILED)
    proof_lines = []
    if plan.grasps and arguments.region_proof:
        proof_lines = _save_proofs(arguments.region_proof, proofs, len(plan.grasps))
        code = code if proof_lines else FAILED
    if not arguments.json:
        table = [plan_table(arguments.model, object_, plan, output)] if plan.grasps else []
        table += proof_lines
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
            **({"region_proof": str(arguments.region_proof)} if proof_lines else {}),
        }
    )


def _rank_in_plant(
    arguments: argparse.Namespace, object_: GraspObject, plan: GraspPlan
) -> GraspPlan:
    """Returns the plan with grasps that hold in a MultibodyPlant first."""
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
    """Bounds how far the plan is from the optimum."""
    gap: OptimalityGap
    gap, _ = call_in_child(
        "drake_polygrasp.optimality.gap:epsilon_gap",
        object_,
        plan,
        limits=child_limits(arguments, f"bounding grasps of {arguments.model}", "nodes"),
        **({"nodes": arguments.gap} if arguments.gap else {}),
    )
    return gap


def _check_proof_file(path: Path | None, output: Path, model: Path) -> None:
    """Raises UsageError where the proof file would replace the model or the grasp file."""
    for other, kind in ((model, "the model"), (output, "the grasp file")):
        is_same = path and (
            path.samefile(other) if path.exists() and other.exists() else path == other
        )
        if is_same:
            raise UsageError(f"{path}: is {kind}; name another file with --region-proof")


def _region_proofs(
    arguments: argparse.Namespace, object_: GraspObject, plan: GraspPlan
) -> list[dict[str, Any]]:
    """Returns the proofs of the grasps' bounds under errors; none unless they are asked for."""
    if arguments.region_proof is None:
        return []
    proofs: list[dict[str, Any]]
    proofs, _ = call_in_child(
        "drake_polygrasp.pipeline.region_proofs:region_proofs",
        object_,
        plan.grasps,
        limits=child_limits(arguments, f"proving what grasps of {arguments.model} withstand"),
    )
    return proofs


def _save_proofs(path: Path, proofs: list[dict[str, Any]], num_grasps: int) -> list[str]:
    """Writes the proof file; returns a line that says so, and prints why where there is none."""
    if not proofs:
        print_error(f"{path}: not written: nothing is proved of any grasp under errors", FAILED)
        return []
    from drake_polygrasp.files.region_proof_file import save_region_proofs

    save_region_proofs(path, proofs)
    return [f"wrote {path}: proofs of {len(proofs)} of {num_grasps} grasps under errors"]


def _default_output(model: str) -> Path:
    """Returns the model's name with .grasp.yaml, in the current folder."""
    name = PurePath(model).name.removesuffix(".yaml")
    return Path(f"{PurePath(name).stem}.grasp.yaml")
