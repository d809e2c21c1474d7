"""`polygrasp verify`: its options and its call."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.calls import child_limits
from drake_polygrasp.cli.child_process import call_in_child
from drake_polygrasp.cli.options import add_command, add_common_options
from drake_polygrasp.cli.reporting import DONE, FAILED, as_json, complain, warn
from drake_polygrasp.errors import UsageError


def add_verify(commands: Any) -> None:
    """Adds the subcommand to those of the parser."""
    parser = add_command(
        commands, "verify", "Check what a grasp file claims; the file is not changed."
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="a grasp file")
    parser.add_argument(
        "--require-model",
        action="store_true",
        help="fail when the model is missing (default: warn, and check the rest)",
    )
    parser.add_argument(
        "--plant",
        action="store_true",
        help="have each grasp hold the model in a MultibodyPlant too: geometry, statics and "
        "simulation",
    )
    parser.add_argument(
        "--scene",
        metavar="DIRECTIVES",
        type=Path,
        help="with --plant: a file of model directives that hold the object and other bodies, "
        "which no fingertip may penetrate (default: the object alone)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="NEW",
        type=Path,
        help="with --plant: write a copy of FILE with the results",
    )
    add_common_options(parser)


def run_verify(arguments: argparse.Namespace) -> tuple[int, str]:
    """Returns the exit code and what to print."""
    if arguments.output is not None and not arguments.plant:
        raise UsageError("-o writes what a plant says of the grasps: add --plant")
    if arguments.scene is not None and not arguments.plant:
        raise UsageError("--scene is for the plant that grasps are checked in: add --plant")
    report, _ = call_in_child(
        "drake_polygrasp.verification.verify:verify_file",
        arguments.file,
        limits=child_limits(arguments, f"verifying {arguments.file}", "grasps"),
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
        plant=arguments.plant,
        scene=arguments.scene,
    )
    warn(report.warnings)
    holds = report.holds
    if arguments.require_model and not report.model_checked:
        holds = False
        complain(f"{arguments.file}: the model is required, and was not checked", FAILED)
    if arguments.plant and not report.plant_checked:
        holds = False
        complain(f"{arguments.file}: not every grasp was fit to be checked in a plant", FAILED)
    if arguments.output is not None:
        from drake_polygrasp.verification.plant_results import save_plant_results

        reports = [grasp.plant for grasp in report.grasps]
        save_plant_results(arguments.file, arguments.output, reports)

    from drake_polygrasp.cli.verify_table import verify_document, verify_table

    text = as_json(verify_document(report, holds)) if arguments.json else verify_table(report)
    return FAILED if holds is False or not report.plant_decided else DONE, text
