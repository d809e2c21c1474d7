"""Options that several subcommands share."""

from __future__ import annotations

import argparse
from typing import Any

from drake_polygrasp.cli.values import (
    read_angle,
    read_component,
    read_depth,
    read_faces,
    read_friction,
    read_length,
    read_package,
    read_scale,
)


def add_command(commands: Any, name: str, help_: str) -> argparse.ArgumentParser:
    """Adds a subcommand with its line of help."""
    parser: argparse.ArgumentParser = commands.add_parser(name, help=help_, description=help_)
    return parser


def add_package_options(parser: argparse.ArgumentParser) -> None:
    """Adds where packages are found."""
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


def add_joints_free(parser: argparse.ArgumentParser) -> None:
    """Adds whether links on joints are ignored."""
    parser.add_argument(
        "--joints-free",
        action="store_true",
        help="ignore the links on the body's joints (default: in the model's default posture they "
        "cover faces and leave fingertips no room)",
    )


def add_scale(parser: argparse.ArgumentParser) -> None:
    """Adds the scale of an OBJ model."""
    parser.add_argument(
        "--scale",
        metavar="S",
        type=read_scale,
        help="what the lengths of an .obj MODEL are multiplied by, 0.001 for millimetres (default: "
        "1; other models state the scale of their meshes)",
    )


def add_common_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of commands that print a report."""
    add_package_options(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object for machines")


def add_object_options(parser: argparse.ArgumentParser) -> None:
    """Adds the model, and what is asked of contacts on it."""
    parser.add_argument(
        "model", metavar="MODEL", help="what Drake reads: .sdf .urdf .xml .dmd.yaml .obj"
    )
    parser.add_argument(
        "--body",
        metavar="NAME",
        help="a link of the rigid body to grasp, whose frame is B (default: the base link of the "
        "only one)",
    )
    add_joints_free(parser)
    add_scale(parser)
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
        dest="avoid_directions",
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
