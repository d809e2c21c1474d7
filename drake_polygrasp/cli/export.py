"""`polygrasp export`: its options, one for each format, and its call."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.options import add_command
from drake_polygrasp.cli.reporting import DONE
from drake_polygrasp.exporters import FORMATS


def add_export(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(commands, "export", "Write a grasp file in the format of another program.")
    parser.add_argument("file", metavar="FILE", type=Path, help="a grasp file")
    formats = parser.add_mutually_exclusive_group(required=True)
    for name, (ending, what) in FORMATS.items():
        option = f"--{name.replace('_', '-')}"
        formats.add_argument(option, metavar=f"OUT.{ending}", type=Path, help=what)


def run_export(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_export`.

    Returns:
        The exit code and what to print.

    Raises:
        GraspFileError: when the grasp file cannot be read or the output cannot be written.
    """
    from drake_polygrasp import exporters
    from drake_polygrasp.files.grasp_file import load_grasps

    name = next(name for name in FORMATS if getattr(arguments, name) is not None)
    output = getattr(arguments, name)
    getattr(exporters, f"export_{name}")(load_grasps(arguments.file), output)
    return DONE, f"wrote {output}"
