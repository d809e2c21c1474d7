"""Loads the model, and sets limits for the library's calls that commands run in a child process."""

from __future__ import annotations

import argparse
import sys
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.child_process import READ_SECONDS, WORK_SECONDS, ChildLimits, call_in_child
from drake_polygrasp.cli.reporting import print_warnings

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject


def child_limits(
    arguments: argparse.Namespace, name: str, unit: str = "", seconds: float = WORK_SECONDS
) -> ChildLimits:
    """Returns the limits of one call in a child process.

    Progress is hidden with `--json` unless standard output is a terminal: whoever reads JSON
    through a pipe does not expect it.

    Args:
        arguments: the command's arguments.
        name: what the call does, for messages: "planning grasps of cube.sdf".
        unit: plural of what the call's `progress` callback counts; empty if it takes none.
        seconds: time limit [s], counted anew from each report of progress.
    """
    quiet = getattr(arguments, "json", False) and not sys.stdout.isatty()
    return ChildLimits(name, seconds, unit, quiet)


def planning_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Returns the command's options that `PlanOptions` has, by its names.

    Args:
        arguments: the command's arguments, with those of `add_object_options`.
    """
    from drake_polygrasp.settings import PlanOptions

    return {
        field.name: getattr(arguments, field.name)
        for field in fields(PlanOptions)
        if hasattr(arguments, field.name)
    }


def load_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Returns the command's options that `load_object` has, by its names.

    Args:
        arguments: the command's arguments, with those of `add_object_options`.
    """
    return {
        "body_name": arguments.body,
        "mu": arguments.mu,
        "package_paths": arguments.package_path,
        "packages": dict(arguments.packages),
        "patch_angle": arguments.patch_angle,
        "patch_depth": arguments.patch_depth,
        "joints_free": arguments.joints_free,
        "scale": arguments.scale,
    }


def load_model(arguments: argparse.Namespace) -> tuple[GraspObject, float]:
    """Loads the object that the command's arguments name and prints the loader's warnings.

    Args:
        arguments: the command's arguments, with those of `add_object_options`.

    Returns:
        The object and the time that loading took [s].

    Raises:
        ModelError: when the model cannot be loaded.
        UsageError: when an option does not fit the model.
    """
    object_, seconds = call_in_child(
        "drake_polygrasp.loading.object_model:load_object",
        arguments.model,
        limits=child_limits(arguments, f"reading {arguments.model}", seconds=READ_SECONDS),
        **load_options(arguments),
    )
    print_warnings(object_.warnings)
    return object_, seconds
