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
from drake_polygrasp.cli.reporting import DONE, FAILED, complain, print_result, warn
from drake_polygrasp.cli.values import read_friction
from drake_polygrasp.errors import UsageError


def add_show(commands: Any) -> None:
    """Adds the subcommand to those of the parser."""
    parser = add_command(
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
    add_joints_free(parser)
    add_scale(parser)
    parser.add_argument("--mu", type=read_friction, help="friction for MODEL (default: as in plan)")
    add_package_options(parser)


def run_show(arguments: argparse.Namespace) -> tuple[int, str]:
    """Returns the exit code and what to print."""
    from drake_polygrasp.cli.exhibit import is_model, serve, write_page

    logging.getLogger("drake").setLevel(logging.WARNING)  # Meshcat says where it listens; so do we
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
    maker = f"drake_polygrasp.cli.exhibit:exhibit_{kind}"
    exhibit, _ = call_in_child(
        maker, name, limits=child_limits(arguments, f"showing {name}"), **options
    )
    warn(exhibit.object_.warnings)
    code = DONE
    if not exhibit.grasps:
        code = complain(f"{name}: no grasp to show, only the object", FAILED)
    if arguments.html is not None:
        write_page(exhibit, arguments.html, PurePath(name).name)
        return code, f"wrote {arguments.html}"
    with suppress(KeyboardInterrupt):
        for line in serve(exhibit):
            code = print_result(code, line)
    return code, ""
