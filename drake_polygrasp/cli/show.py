"""`polygrasp show`: its options and its call."""

from __future__ import annotations

import argparse
import logging
from contextlib import suppress
from pathlib import Path, PurePath
from typing import Any

from drake_polygrasp.cli.calls import child_limits
from drake_polygrasp.cli.child_process import call_in_child
from drake_polygrasp.cli.options import add_command, add_joints_free, add_package_options, add_scale
from drake_polygrasp.cli.reporting import DONE, FAILED, print_error, print_result, print_warnings
from drake_polygrasp.cli.values import read_friction
from drake_polygrasp.errors import UsageError


def add_show(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(
        commands,
        "show",
        "Show the grasps of a file in 3-D, or plan those of a model and show them.",
    )
    parser.add_argument("name", metavar="FILE|MODEL", help="a grasp file, or a model as in plan")
    parser.add_argument(
        "--html",
        metavar="OUT.html",
        type=Path,
        help="write a page that opens offline (default: serve Meshcat until Ctrl-C)",
    )
    parser.add_argument("--body", metavar="NAME", help="the body of MODEL, where there are several")
    add_joints_free(parser)
    add_scale(parser)
    parser.add_argument("--mu", type=read_friction, help="friction for MODEL (default: as in plan)")
    add_package_options(parser)


def run_show(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_show`.

    Returns:
        The exit code and what is left to print.

    Raises:
        UsageError: when options of a model are given with a grasp file, or the page cannot be
            written.
    """
    from drake_polygrasp.cli.shown_scene import is_model, serve, write_page

    # Meshcat logs where it listens, which `serve` says too.
    logging.getLogger("drake").setLevel(logging.WARNING)
    name, packages = arguments.name, dict(arguments.packages)
    options = {"package_paths": arguments.package_path, "packages": packages}
    kind = "model" if is_model(name) else "file"
    if kind == "model":
        options |= {
            "body_name": arguments.body,
            "mu": arguments.mu,
            "joints_free": arguments.joints_free,
            "scale": arguments.scale,
        }
    elif arguments.joints_free or {arguments.body, arguments.mu, arguments.scale} != {None}:
        raise UsageError(
            f"{name}: a grasp file states its body, friction and scale, and whether joints are "
            "free; leave them out"
        )
    scene, _ = call_in_child(
        f"drake_polygrasp.cli.shown_scene:load_{kind}_scene",
        name,
        limits=child_limits(arguments, f"showing {name}"),
        **options,
    )
    print_warnings(scene.object_.warnings)
    code = DONE
    if not scene.grasps:
        code = print_error(f"{name}: no grasp to show, only the object", FAILED)
    if arguments.html is not None:
        write_page(scene, arguments.html, PurePath(name).name)
        return code, f"wrote {arguments.html}"
    with suppress(KeyboardInterrupt):
        for line in serve(scene):
            code = print_result(code, line)
    return code, ""
