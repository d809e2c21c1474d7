"""`polygrasp export`: its options, among them one for each format, and its call."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.options import add_command
from drake_polygrasp.cli.reporting import DONE
from drake_polygrasp.errors import UsageError
from drake_polygrasp.exporters import FORMATS


def add_export(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(commands, "export", "Write a grasp file in the format of another program.")
    parser.add_argument("file", metavar="FILE", type=Path, help="a grasp file")
    formats = parser.add_mutually_exclusive_group(required=True)
    names = [name.replace("_", "-") for name in FORMATS]
    formats.add_argument(
        "--to",
        metavar="NAME",
        choices=names,
        help=f"the format: {', '.join(names)}",
    )
    for name, (ending, what) in zip(names, FORMATS.values(), strict=True):
        formats.add_argument(f"--{name}", metavar=f"OUT.{ending}", type=Path, help=what)
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=Path,
        help="with --to: the file to write (default: FILE's name with the format's ending, in the "
        "current folder)",
    )
    parser.add_argument(
        "--instance",
        metavar="NAME",
        help="name of the object's model in the other program: of its model instance, in a plant "
        "that renamed it (default: the one in FILE)",
    )


def run_export(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_export`.

    Returns:
        The exit code and what to print.

    Raises:
        GraspFileError: when the grasp file cannot be read, does not state what the format is
            about, or the output cannot be written.
        UsageError: when `-o` is given without `--to`.
    """
    from drake_polygrasp import exporters
    from drake_polygrasp.files.grasp_file import load_grasps

    if arguments.to is None:
        if arguments.output is not None:
            raise UsageError("-o: it goes with --to; the option of a format names its own file")
        name = next(name for name in FORMATS if getattr(arguments, name) is not None)
        output = getattr(arguments, name)
    else:
        name = arguments.to.replace("-", "_")
        output = arguments.output or _default_output(arguments.file, name)
    export = getattr(exporters, f"export_{name}")
    export(load_grasps(arguments.file), output, instance=arguments.instance)
    # Where the export itself goes to standard output, nothing else may.
    return DONE, "" if output.is_relative_to("/dev") else f"wrote {output}"


def _default_output(file: Path, name: str) -> Path:
    """Returns the grasp file's name with the format's ending, in the current folder."""
    stem = file.name.removesuffix(".yaml").removesuffix(".grasp")
    ending, _ = FORMATS[name]
    unlike = "" if ending != "yaml" else f".{name}"
    return Path(f"{stem}{unlike}.{ending}")
