"""The grammar of the command line: what `polygrasp` may be asked, and with which options."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drake_polygrasp.command_values import (
    read_angle,
    read_component,
    read_count,
    read_depth,
    read_face_set,
    read_faces,
    read_friction,
    read_length,
    read_package,
    read_scale,
)


def make_parser() -> argparse.ArgumentParser:
    """The whole grammar; the result's `command` says which command was given."""
    parser = argparse.ArgumentParser(
        prog="polygrasp",
        description="Plans grasps of three frictional point contacts on two or three faces of an "
        "object, and proves each one.",
        epilog="Exit status: 0 when all that was asked for holds, 1 when there is no certified "
        "grasp or something does not hold, 2 when the input or the usage is wrong.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", dest="command", required=True)
    _add_plan(commands)
    _add_verify(commands)
    _add_explain(commands)
    _add_show(commands)
    _add_export(commands)
    return parser


def _add_command(commands: Any, name: str, help_: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(name, help=help_, description=help_)
    return parser


def _add_package_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--package-path",
        metavar="DIR",
        action="append",
        default=[],
        help="folder to search for the packages of package:// and model:// URIs (may be repeated)",
    )
    parser.add_argument(
        "--package",
        metavar="NAME=DIR",
        type=read_package,
        action="append",
        default=[],
        dest="packages",
        help="the folder of one package, before all that are found (may be repeated)",
    )


def _add_joints_free(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--joints-free",
        action="store_true",
        help="ignore the links on the body's joints (default: in the model's default posture they "
        "cover faces and leave fingertips no room)",
    )


def _add_scale(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scale",
        metavar="S",
        type=read_scale,
        help="what the lengths of an .obj MODEL are multiplied by, 0.001 for millimetres (default: "
        "1; other models state the scale of their meshes)",
    )


def _add_common_options(parser: argparse.ArgumentParser) -> None:
    _add_package_options(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object for machines")


def _add_object_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "model", metavar="MODEL", help="what Drake reads: .sdf .urdf .xml .dmd.yaml .obj"
    )
    parser.add_argument(
        "--body",
        metavar="NAME",
        help="a link of the rigid body to grasp, whose frame is B (default: the base link of the "
        "only one)",
    )
    _add_joints_free(parser)
    _add_scale(parser)
    parser.add_argument(
        "--mu",
        type=read_friction,
        help="friction coefficient of all contacts (default: the model's, the lesser of static "
        "and dynamic; 0.3 where it states none)",
    )
    parser.add_argument(
        "--method",
        choices=("enriched", "paper"),
        default="enriched",
        help="the paper as printed, or with variants of its contacts (default: enriched)",
    )
    parser.add_argument(
        "--edge-clearance",
        metavar="M",
        type=read_length,
        help="least distance of a contact from its face's edges [m] (default: the lesser of "
        "1 percent of the object's diameter and a fifth of the face's inradius)",
    )
    parser.add_argument(
        "--tip-radius",
        metavar="M",
        type=read_length,
        help="radius of the fingertips that need room [m] (default: 2 percent of the object's "
        "diameter; 0: points)",
    )
    parser.add_argument(
        "--avoid-direction",
        metavar=("X", "Y", "Z"),
        nargs=3,
        type=read_component,
        action="append",
        default=[],
        help="no contact where the outward normal is within 45 degrees of this vector in the "
        "body's frame: 0 0 -1 for what stands on a table (may be repeated)",
    )
    parser.add_argument(
        "--exclude-faces",
        metavar="I,J,K",
        type=read_faces,
        default=(),
        help="no contact on the faces of these indices, as explain and plan number them",
    )
    parser.add_argument(
        "--patch-angle",
        metavar="RAD",
        type=read_angle,
        help="how far normals lean within a patch of a curved or noisy surface [rad] (default: "
        "0.21, 12 degrees)",
    )
    parser.add_argument(
        "--patch-depth",
        metavar="M",
        type=read_depth,
        help="how far facets lie off the plane of their patch [m] (default: 0.5 percent of the "
        "object's diameter)",
    )


def _add_plan(commands: Any) -> None:
    parser = _add_command(commands, "plan", "Plan grasps, prove them and write them.")
    _add_object_options(parser)
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
    _add_common_options(parser)


def _add_verify(commands: Any) -> None:
    parser = _add_command(
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
    _add_common_options(parser)


def _add_explain(commands: Any) -> None:
    parser = _add_command(
        commands, "explain", "Say of every set of faces whether it holds, or why not."
    )
    _add_object_options(parser)
    parser.add_argument(
        "--set",
        metavar="I,J,K",
        type=read_face_set,
        help="only the sets of these two or three faces (default: all, counted)",
    )
    parser.add_argument(
        "--figure",
        metavar="OUT",
        type=Path,
        help="draw a chart of the counts or, with --set, what the paper's steps compute for that "
        "set: .png, .pdf or .svg",
    )
    _add_common_options(parser)


def _add_show(commands: Any) -> None:
    parser = _add_command(
        commands, "show", "Show in 3-D what a grasp file states, or what is planned now."
    )
    parser.add_argument("name", metavar="FILE|MODEL", help="a grasp file, or what Drake reads")
    parser.add_argument(
        "--html",
        metavar="OUT.html",
        type=Path,
        help="write a page that opens offline (default: serve Meshcat until Ctrl-C)",
    )
    parser.add_argument("--body", metavar="NAME", help="the body of MODEL, where there are several")
    _add_joints_free(parser)
    _add_scale(parser)
    parser.add_argument("--mu", type=read_friction, help="friction for MODEL (default: as in plan)")
    _add_package_options(parser)


def _add_export(commands: Any) -> None:
    parser = _add_command(
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
