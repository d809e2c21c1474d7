"""What commands have a child process do: what it is called, and loading the model."""

from __future__ import annotations

import argparse
import sys
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.child_process import READ_SECONDS, WORK_SECONDS, ChildLimits, call_in_child
from drake_polygrasp.cli.reporting import warn

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject


def child_limits(
    arguments: argparse.Namespace, name: str, unit: str = "", seconds: float = WORK_SECONDS
) -> ChildLimits:
    """What a child is to do; machines that read JSON through a pipe are told no progress."""
    quiet = getattr(arguments, "json", False) and not sys.stdout.isatty()
    return ChildLimits(name, seconds, unit, quiet)


def planning_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """What is asked of a plan: those of the command's options that `PlanOptions` has, by name."""
    from drake_polygrasp.settings import PlanOptions

    return {
        field.name: getattr(arguments, field.name)
        for field in fields(PlanOptions)
        if hasattr(arguments, field.name)
    }


def load_model(arguments: argparse.Namespace) -> tuple[GraspObject, float]:
    """The object, and the seconds it took to load; warnings are printed."""
    object_, seconds = call_in_child(
        "drake_polygrasp.loading.object_model:load_object",
        arguments.model,
        limits=child_limits(arguments, f"reading {arguments.model}", seconds=READ_SECONDS),
        body_name=arguments.body,
        mu=arguments.mu,
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
        patch_angle=arguments.patch_angle,
        patch_depth=arguments.patch_depth,
        joints_free=arguments.joints_free,
        scale=arguments.scale,
    )
    warn(object_.warnings)
    return object_, seconds
