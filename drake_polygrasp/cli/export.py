"""`polygrasp export`: its options and its call."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.options import add_command
from drake_polygrasp.cli.reporting import DONE


def add_export(commands: Any) -> None:
    """Adds the subcommand to those of the parser."""
    parser = add_command(
        commands, "export", "Write the contact frames of a grasp file for Drake's pipelines."
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="a grasp file")
    parser.add_argument(
        "--directives",
        metavar="OUT.dmd.yaml",
        type=Path,
        required=True,
        help="model directives that add contact and fingertip frames to the model, which must be "
        "in the plant already",
    )


def run_export(arguments: argparse.Namespace) -> tuple[int, str]:
    """Returns the exit code and what to print."""
    from drake_polygrasp.exporters.directives import export_directives
    from drake_polygrasp.files.grasp_file import load_grasps

    file = load_grasps(arguments.file)
    export_directives(file, arguments.directives)
    return DONE, f"wrote {arguments.directives}"
