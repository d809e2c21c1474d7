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
    read_share,
    read_tilt,
)


def add_command(commands: Any, name: str, help_: str) -> argparse.ArgumentParser:
    """Adds a subcommand to `polygrasp`.

    Args:
        commands: the subparsers of `polygrasp`.
        name: the subcommand's name.
        help_: one sentence on what it does, for `--help`.

    Returns:
        The subcommand's parser, to which its options are added.
    """
    parser: argparse.ArgumentParser = commands.add_parser(name, help=help_, description=help_)
    return parser


def add_package_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say where packages are.

    Args:
        parser: the subcommand's parser.
    """
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
        help="folder of one package, in place of any found by searching (may be repeated)",
    )


def add_joints_free(parser: argparse.ArgumentParser) -> None:
    """Adds the option that ignores links on the body's joints.

    Args:
        parser: the subcommand's parser.
    """
    parser.add_argument(
        "--joints-free",
        action="store_true",
        help="ignore the links on the body's joints (default: in the model's default posture, they "
        "cover its faces and block fingertips)",
    )


def add_scale(parser: argparse.ArgumentParser) -> None:
    """Adds the scale of an OBJ model.

    Args:
        parser: the subcommand's parser.
    """
    parser.add_argument(
        "--scale",
        metavar="S",
        type=read_scale,
        help="factor for the lengths of an .obj MODEL: 0.001 if they are in millimetres (default: "
        "1; other models state the scale of their meshes)",
    )


def add_common_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of commands that print a report: those of packages, and JSON.

    Args:
        parser: the subcommand's parser.
    """
    add_package_options(parser)
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object instead of a table"
    )


def add_object_options(parser: argparse.ArgumentParser) -> None:
    """Adds the model and the options that all planning shares.

    Args:
        parser: the subcommand's parser.
    """
    parser.add_argument(
        "model",
        metavar="MODEL",
        help="a model that Drake reads: .sdf, .urdf, .xml (MJCF), .dmd.yaml or .obj",
    )
    add_planning_options(parser)


def add_planning_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of loading an object and planning on it, without the model's name.

    Args:
        parser: the subcommand's parser.
    """
    parser.add_argument(
        "--body",
        metavar="NAME",
        help="a link of the rigid body to grasp; its frame is B (default: the base link, where the "
        "model is one rigid body)",
    )
    add_joints_free(parser)
    add_scale(parser)
    parser.add_argument(
        "--mu",
        type=read_friction,
        help="friction coefficient of all contacts (default: the lesser of the model's static and "
        "dynamic coefficients; 0.3 where it states none)",
    )
    parser.add_argument(
        "--method",
        choices=("enriched", "paper"),
        default="enriched",
        help="paper: one grasp per set of faces, as printed, ranked by Q; enriched: also search "
        "the faces for contacts of high epsilon (default: enriched)",
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
        help="radius of the spherical fingertips that must fit at the contacts [m] (default: 2 "
        "percent of the object's diameter; 0: points, which fit anywhere)",
    )
    parser.add_argument(
        "--avoid-direction",
        metavar=("X", "Y", "Z"),
        nargs=3,
        type=read_component,
        action="append",
        default=[],
        dest="avoid_directions",
        help="allow no contact where the outward normal is within 45 degrees of this vector, given "
        "in the body's frame: 0 0 -1 for an object that stands on a table (may be repeated)",
    )
    parser.add_argument(
        "--exclude-faces",
        metavar="I,J,K",
        type=read_faces,
        default=(),
        help="allow no contact on the faces of these indices, as plan and explain number them",
    )
    _add_error_options(parser)
    parser.add_argument(
        "--patch-angle",
        metavar="RAD",
        type=read_angle,
        help="greatest angle between a patch's normal and those of its facets, on curved or noisy "
        "surfaces [rad] (default: 0.21, 12 degrees)",
    )
    parser.add_argument(
        "--patch-depth",
        metavar="M",
        type=read_depth,
        help="greatest distance of facets from the plane of their patch [m] (default: 0.5 percent "
        "of the object's diameter)",
    )


def _add_error_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--placement-error",
        metavar="M",
        type=read_length,
        help="distance by which each fingertip may miss its contact along the face, in any "
        "direction [m]; contacts keep at least this distance from edges (default: 2 "
        "percent of the object's diameter; less on narrow faces, where others have too few grasps)",
    )
    parser.add_argument(
        "--tilt-error",
        metavar="RAD",
        type=read_tilt,
        help="angle by which the true normal at each contact may differ from the model's [rad]; "
        "grasps are planned with the friction that is left (default: 0.0873, 5 degrees)",
    )
    parser.add_argument(
        "--friction-error",
        metavar="SHARE",
        type=read_share,
        help="share by which friction coefficients may be less than the model's: 0.2 for 20 "
        "percent; grasps are planned with the friction that is left (default: 0.2)",
    )
    parser.add_argument(
        "--com-error",
        metavar="M",
        type=read_length,
        help="distance by which the centre of mass may be off, in any direction [m]; it counts in "
        "the bounds of epsilon and squeeze force under errors, and no set of faces is rejected for "
        "it (default: 2 percent of the object's diameter)",
    )
