"""`polygrasp plan --hand`: its options, its call and its table."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from drake_polygrasp.cli.calls import planning_options
from drake_polygrasp.cli.plan_table import error_columns, error_lines
from drake_polygrasp.cli.reporting import DONE, FAILED, as_json, print_error, print_warnings
from drake_polygrasp.cli.table import align_columns, counted
from drake_polygrasp.cli.values import read_component, read_mass, read_seconds, read_seed
from drake_polygrasp.errors import UsageError

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject
    from drake_polygrasp.hand_grasp import HandGrasp
    from drake_polygrasp.pipeline.hand_plan import HandPlan

HAND_TOP = 3
"""Grasps that `plan --hand` writes by default. Our choice."""
HAND_OPTIONS = {"up": "--up", "mass": "--mass", "budget": "--budget", "seed": "--seed"}
"""Options that need a hand, by their names in the arguments."""
OTHER_OPTIONS = {
    "region_proof": "--region-proof",
    "gap": "--gap",
    "plant": "--plant",
    "tip_radius": "--tip-radius",
    "rank": "--rank",
    "method": "--method",
    "effort": "--effort",
}
"""Options that do not go with one."""
SHARED_OPTIONS = (
    *("avoid_directions", "exclude_faces", "edge_clearance"),
    *("placement_error", "tilt_error", "friction_error", "com_error"),
)
"""Options of plans that plans of a hand have too."""


def add_hand_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `plan` that ask for grasps which a hand can make.

    Args:
        parser: the parser of `plan`.
    """
    group = parser.add_argument_group("grasps of a hand")
    group.add_argument(
        "--hand",
        metavar="HAND.yaml",
        help="write grasps that this hand can make, with its posture, joint torques and a clear "
        "way there; contacts keep 0.3 tip radii from edges, and default errors do not change the "
        "search",
    )
    group.add_argument(
        "--up",
        metavar=("X", "Y", "Z"),
        nargs=3,
        type=read_component,
        help="direction against gravity in the body's frame; torques hold 1.2 times the weight in "
        "this orientation (default: the weight in every orientation)",
    )
    group.add_argument(
        "--mass",
        metavar="KG",
        type=read_mass,
        help="mass that the torques must hold (default: the model's)",
    )
    group.add_argument(
        "--budget",
        metavar="S",
        type=read_seconds,
        help="time after which no more postures are tried [s] (default: 10)",
    )
    group.add_argument(
        "--seed", metavar="N", type=read_seed, help="seed of random postures (default: 0)"
    )


def check_hand_options(arguments: argparse.Namespace) -> None:
    """Checks that the options of a hand are given with a hand, and no others with it.

    Args:
        arguments: those of `plan`.

    Raises:
        UsageError: naming the option that does not go with the others.
    """
    if arguments.hand is None:
        for name, option in HAND_OPTIONS.items():
            if getattr(arguments, name) is not None:
                raise UsageError(f"{option} is for grasps of a hand; name one with --hand")
        return
    usual = {"plant": False, "method": "enriched", "effort": "full"}
    for name, option in OTHER_OPTIONS.items():
        if getattr(arguments, name, usual.get(name)) != usual.get(name):
            raise UsageError(f"{option} does not go with --hand; leave one of them out")


def run_hand_plan(
    arguments: argparse.Namespace, object_: GraspObject, output: Path, load_seconds: float
) -> tuple[int, str]:
    """Plans grasps that a hand can make, and writes them to a file.

    Args:
        arguments: those of `plan`, with a hand.
        object_: the object.
        output: grasp file to write.
        load_seconds: time that loading the object took [s].

    Returns:
        The exit code and what to print.

    Raises:
        HandError: when the hand cannot be used.
        GraspFileError: when the file cannot be written.
        UsageError: when an option does not fit the object.
    """
    from drake_polygrasp.files.grasp_file import grasp_document, save_grasps
    from drake_polygrasp.hands.model import load_hand
    from drake_polygrasp.pipeline.hand_grasps import plan_hand_grasps

    packages = {"package_paths": arguments.package_path, "packages": dict(arguments.packages)}
    asked = {
        key: value for key, value in planning_options(arguments).items() if key in SHARED_OPTIONS
    }
    asked |= {"up_B": arguments.up, "load_mass": arguments.mass}
    asked |= {"budget": arguments.budget, "seed": arguments.seed, **packages}
    hand = load_hand(arguments.hand, **packages)
    given = {key: value for key, value in asked.items() if value is not None}
    plan = plan_hand_grasps(object_, hand, top=arguments.top, **given)
    print_warnings(plan.warnings)
    code = DONE
    if plan.grasps:
        save_grasps(output, object_, plan.grasps, plan.settings)
    else:
        code = print_error(_no_grasp(arguments.model, hand.name, plan, output), FAILED)
    if not arguments.json:
        return code, _table(arguments.model, hand.name, plan, output) if plan.grasps else ""
    return code, as_json(
        {
            "model": arguments.model,
            "hand": arguments.hand,
            "num_faces": len(object_.polyhedron.faces),
            "candidates": plan.candidates,
            "tried": plan.tried,
            "refusals": plan.refusals,
            "sentences": plan.sentences,
            "seconds": {**plan.seconds, "load": load_seconds + plan.seconds["load"]},
            "output": str(output) if plan.grasps else None,
            "grasps": [grasp_document(grasp) for grasp in plan.grasps],
        }
    )


_COLUMNS = (
    "effort: share of the joints' efforts that holding takes; opening: how far fingertips back off "
    "before closing; way: direction in the body's frame in which the palm moves away"
)

_SQUEEZE = (
    "squeeze: total normal force of the fingers; a warning says where the errors that a grasp "
    "bears ask for more"
)


def _table(model: str, hand: str, plan: HandPlan, output: Path) -> str:
    """Returns the table of grasps, best first, one per row."""
    from drake_polygrasp.hands.squeeze import total_normal

    header = ("rank", "faces", "fingers", "epsilon", "effort", "clearance", "opening", "way")
    units = ("", "", "", "", "[percent]", "[mm]", "[mm]", "")
    rows = [_row(rank, grasp) for rank, grasp in enumerate(plan.grasps, start=1)]
    certified = [grasp.certified for grasp in plan.grasps]
    # The squeeze under errors is stated for the object's own mass; a load may have another.
    bears = [cells[:1] for cells in error_columns(plan.settings, certified)]
    forces = [total_normal(g.certified.grasp, g.torque.f_Bc_B) for g in plan.grasps]
    squeezes = [("squeeze",), ("[N]",), *((f"{force:.1f}",) for force in forces)]
    return "\n".join(
        [
            f"{model}: {counted(len(plan.grasps), 'grasp')} that '{hand}' can make, "
            f"{plan.tried} of {plan.candidates} candidates tried{_counts(plan)}",
            *align_columns(
                [
                    (*row, *squeeze, *misses)
                    for row, squeeze, misses in zip(
                        [header, units, *rows], squeezes, bears, strict=True
                    )
                ]
            ),
            _COLUMNS,
            *error_lines(plan.settings, certified, _SQUEEZE),
            f"wrote {output}",
        ]
    )


def _row(rank: int, grasp: HandGrasp) -> tuple[str, ...]:
    share, direction = grasp.torque.share, grasp.pregrasp.direction_B
    certified = grasp.certified
    return (
        str(rank),
        " ".join(map(str, certified.grasp.faces)),
        " ".join(grasp.fingers),
        f"{certified.certificate.epsilon_lower:.4f}",
        "-" if share is None else f"{100 * share:.0f}",
        f"{1e3 * grasp.clearance:.1f}",
        f"{1e3 * grasp.pregrasp.opening:.0f}",
        "(" + " ".join(f"{round(x, 2) + 0.0:.2f}" for x in direction) + ")",
    )


def _counts(plan: HandPlan) -> str:
    """Returns the refusals by reason, empty for none."""
    if not plan.refusals:
        return ""
    return " (" + ", ".join(f"{count} {reason}" for reason, count in plan.refusals.items()) + ")"


def _no_grasp(model: str, hand: str, plan: HandPlan, output: Path) -> str:
    """Returns the message of a plan without grasps: the refusals counted and in words."""
    left = f"{output} is left as it was" if output.exists() else "no file is written"
    words = "; ".join(plan.sentences.values())
    return (
        f"{model}: no grasp that '{hand}' can make; {plan.tried} of {plan.candidates} candidates "
        f"within reach tried{_counts(plan)}: {words}; {left}"
    )
