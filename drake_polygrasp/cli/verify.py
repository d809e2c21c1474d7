"""`polygrasp verify`: its options and its call."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.calls import child_limits
from drake_polygrasp.cli.child_process import WORK_SECONDS, call_in_child
from drake_polygrasp.cli.options import add_command, add_common_options
from drake_polygrasp.cli.reporting import DONE, FAILED, as_json, print_error, print_warnings
from drake_polygrasp.cli.values import read_count
from drake_polygrasp.errors import UsageError

_MISS_SECONDS = 60.0
"""Time to simulate one miss [s]. Our choice: a hundred times what it takes on our models."""


def add_verify(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(
        commands,
        "verify",
        "Check a grasp file without changing it: prove its FORCES, compare its SURFACE with the "
        "model, recompute its NUMBERS, and pose its HAND, if it has one.",
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="a grasp file")
    parser.add_argument(
        "--require-model",
        action="store_true",
        help="fail when a model is missing (default: warn, and check the rest)",
    )
    parser.add_argument(
        "--plant",
        action="store_true",
        help="also check each grasp in a MultibodyPlant: geometry, statics and simulation",
    )
    parser.add_argument(
        "--scene",
        metavar="DIRECTIVES",
        type=Path,
        help="with --plant: model directives of a scene with the object and other bodies, which "
        "neither fingertips nor the hand may penetrate (default: the object alone)",
    )
    parser.add_argument(
        "--misses",
        metavar="N",
        type=read_count,
        help="with --plant: also simulate each grasp with N misses, drawn within the errors of "
        "placement, friction and centre of mass that it is certified to bear",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="NEW",
        type=Path,
        help="with --plant: write a copy of FILE with the plant's verdicts",
    )
    add_common_options(parser)


def run_verify(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_verify`.

    Returns:
        The exit code and what to print.

    Raises:
        GraspFileError: when the grasp file cannot be read, or the copy cannot be written.
        ModelError: when the model or the scene is there but cannot be loaded.
        UsageError: when an option needs `--plant` and it is not given.
    """
    if arguments.output is not None and not arguments.plant:
        raise UsageError("-o: it writes the verdicts of checks in a plant; add --plant")
    if arguments.scene is not None and not arguments.plant:
        raise UsageError("--scene: it describes the plant to check grasps in; add --plant")
    if arguments.misses is not None and not arguments.plant:
        raise UsageError("--misses: misses are simulated in the plant; add --plant")
    report, _ = call_in_child(
        "drake_polygrasp.verification.verify:verify_file",
        arguments.file,
        limits=child_limits(
            arguments,
            f"verifying {arguments.file}",
            "grasps",
            WORK_SECONDS + _MISS_SECONDS * (arguments.misses or 0),
        ),
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
        plant=arguments.plant,
        scene=arguments.scene,
        misses=arguments.misses,
    )
    print_warnings(report.warnings)
    holds = report.holds
    if arguments.require_model and not (report.model_checked and report.hand_checked):
        holds = False
        print_error(
            f"{arguments.file}: --require-model is given, but a model was not found", FAILED
        )
    if arguments.plant and not report.plant_checked:
        holds = False
        print_error(
            f"{arguments.file}: not every grasp was checked in a plant, as only those are whose "
            "other checks do not fail",
            FAILED,
        )
    if arguments.output is not None:
        from drake_polygrasp.verification.plant_results import save_plant_results

        reports = [grasp.plant for grasp in report.grasps]
        save_plant_results(arguments.file, arguments.output, reports)

    from drake_polygrasp.cli.verify_table import verify_document, verify_table

    text = as_json(verify_document(report, holds)) if arguments.json else verify_table(report)
    return FAILED if holds is False or not report.plant_decided else DONE, text
