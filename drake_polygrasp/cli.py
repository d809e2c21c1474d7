"""The `polygrasp` command: each subcommand is a call of the library and a table of its answer.

Modules are imported where they are used, so that `verify` runs with no planner loaded.
"""

from __future__ import annotations

import argparse
import io
import json
import logging
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from drake_polygrasp.child_process import READ_SECONDS, WORK_SECONDS, Task, call_in_child
from drake_polygrasp.command_line import make_parser
from drake_polygrasp.errors import PolygraspError, UsageError

if TYPE_CHECKING:
    from drake_polygrasp.gap import Gap
    from drake_polygrasp.grasp import GraspObject
    from drake_polygrasp.pipeline import GraspPlan

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: all that was asked for holds; something does not, or nothing was found; the input or
the usage is wrong; stopped from the keyboard."""

_FILE = re.compile(r"(.+?)(?=(?::\d+[^:]*)?: )")
"""The file that a message begins with, before its line."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code; usage errors leave through argparse with 2."""
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            # A file's name need not be text in the terminal's encoding.
            sys.stdout.reconfigure(errors="backslashreplace")
        arguments = make_parser().parse_args(argv)
        return _print(*COMMANDS[arguments.command](arguments))
    except PolygraspError as error:
        return _complain(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    except OSError as error:
        return _complain(f"{error.filename or 'system'}: {error.strerror}", BAD_INPUT)
    except Exception as error:
        return _complain(
            f"internal error ({type(error).__name__}: {error}); please report it", BAD_INPUT
        )


def _print(code: int, text: str) -> int:
    """Prints the result and passes the code on; who closes the pipe early has read enough."""
    try:
        if text:
            print(text, flush=True)
    except OSError as error:
        # Python flushes once more on leaving.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            return _complain(f"standard output: {error.strerror}", BAD_INPUT)
    return code


def _complain(message: str, code: int) -> int:
    """Says in one line why the exit code is not 0, and passes the code on."""
    _say(f"polygrasp: {message}")
    return code


def _warn(warnings: Iterable[str]) -> None:
    """Prints each in a line, with the name of the file it is about but not its folders."""
    for warning in warnings:
        file = _FILE.match(warning)
        if file and Path(file[0]).exists():
            warning = Path(file[0]).name + warning[file.end() :]
        _say(f"warning: {warning}")


def _say(message: str) -> None:
    """Prints one line on standard error, where there is one."""
    if sys.stderr is not None:
        with suppress(OSError):
            print(" ".join(message.splitlines()), file=sys.stderr, flush=True)


def _task(
    arguments: argparse.Namespace, name: str, unit: str = "", seconds: float = WORK_SECONDS
) -> Task:
    """What a child is to do; machines that read JSON through a pipe are told no progress."""
    quiet = getattr(arguments, "json", False) and not sys.stdout.isatty()
    return Task(name, seconds, unit, quiet)


def _load(arguments: argparse.Namespace) -> tuple[GraspObject, float]:
    """The object, and the seconds it took to load; warnings are printed."""
    object_, seconds = call_in_child(
        "drake_polygrasp.loading.object_model:load_object",
        arguments.model,
        task=_task(arguments, f"reading {arguments.model}", seconds=READ_SECONDS),
        body_name=arguments.body,
        mu=arguments.mu,
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
        patch_angle=arguments.patch_angle,
        patch_depth=arguments.patch_depth,
        joints_free=arguments.joints_free,
        scale=arguments.scale,
    )
    _warn(object_.warnings)
    return object_, seconds


def _plan(arguments: argparse.Namespace) -> tuple[int, str]:
    output = arguments.output or _default_output(arguments.model)
    if output.exists() and Path(arguments.model).exists() and output.samefile(arguments.model):
        raise UsageError(f"{output}: is the model; name another file with -o")
    object_, load_seconds = _load(arguments)

    from drake_polygrasp.grasp_file import grasp_document, save_grasps
    from drake_polygrasp.plant_table import MOST_ASKED, holds_in_plant
    from drake_polygrasp.tables import gap_document, gap_lines, no_grasp_message, plan_table

    if arguments.gap is not None:
        call_in_child("drake_polygrasp.gap:require_planar", object_)
    plan, _ = call_in_child(
        "drake_polygrasp.pipeline:plan_grasps",
        object_,
        task=_task(arguments, f"planning grasps of {arguments.model}"),
        method=arguments.method,
        top=MOST_ASKED * arguments.top if arguments.plant else arguments.top,
        rank=arguments.rank,
        effort=arguments.effort,
        edge_clearance=arguments.edge_clearance,
        tip_radius=arguments.tip_radius,
        avoid_directions=arguments.avoid_direction,
        exclude_faces=arguments.exclude_faces,
    )
    if arguments.plant and plan.grasps:
        plan = _in_plant(arguments, object_, plan)
    if plan.grasps:
        # Without it, the friction stated here would look better than the model's.
        override = {} if arguments.mu is None else {"mu": arguments.mu}
        save_grasps(output, object_, plan.grasps, plan.settings | override)
    else:
        _complain(no_grasp_message(arguments.model, object_, plan, output), FAILED)
    gap = None if arguments.gap is None else _gap(arguments, object_, plan)
    code = DONE if plan.grasps else FAILED
    if arguments.plant and plan.grasps and not any(map(holds_in_plant, plan.grasps)):
        code = _complain(f"{output}: a plant bears out none of the grasps", FAILED)
    if not arguments.json:
        table = [plan_table(arguments.model, object_, plan, output)] if plan.grasps else []
        return code, "\n".join(table + (gap_lines(gap) if gap else []))
    return code, _json(
        {
            "model": arguments.model,
            "num_faces": len(object_.polyhedron.faces),
            "excluded_faces": plan.excluded_faces,
            "num_sets": plan.num_sets,
            "num_certified": plan.num_certified,
            "seconds": {"load": load_seconds, **plan.seconds},
            "reasons": plan.reasons,
            "outcome": plan.outcome,
            "output": str(output) if plan.grasps else None,
            "grasps": [grasp_document(grasp) for grasp in plan.grasps],
            **({"gap": gap_document(gap)} if gap else {}),
        }
    )


def _in_plant(arguments: argparse.Namespace, object_: GraspObject, plan: GraspPlan) -> GraspPlan:
    ranked: GraspPlan
    ranked, _ = call_in_child(
        "drake_polygrasp.plant_ranking:rank_in_plant",
        object_,
        plan,
        task=_task(arguments, f"holding grasps of {arguments.model} in a plant", "grasps"),
        top=arguments.top,
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
    )
    return ranked


def _gap(arguments: argparse.Namespace, object_: GraspObject, plan: GraspPlan) -> Gap:
    gap: Gap
    gap, _ = call_in_child(
        "drake_polygrasp.gap:epsilon_gap",
        object_,
        plan,
        task=_task(arguments, f"bounding grasps of {arguments.model}", "nodes"),
        **({"nodes": arguments.gap} if arguments.gap else {}),
    )
    return gap


def _default_output(model: str) -> Path:
    name = PurePath(model).name.removesuffix(".yaml")
    return Path(f"{PurePath(name).stem}.grasp.yaml")


def _verify(arguments: argparse.Namespace) -> tuple[int, str]:
    if arguments.output is not None and not arguments.plant:
        raise UsageError("-o writes what a plant says of the grasps: add --plant")
    if arguments.scene is not None and not arguments.plant:
        raise UsageError("--scene is for the plant that grasps are checked in: add --plant")
    report, _ = call_in_child(
        "drake_polygrasp.verification:verify_file",
        arguments.file,
        task=_task(arguments, f"verifying {arguments.file}", "grasps"),
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
        plant=arguments.plant,
        scene=arguments.scene,
    )
    _warn(report.warnings)
    holds = report.holds
    if arguments.require_model and not report.model_checked:
        holds = False
        _complain(f"{arguments.file}: the model is required, and was not checked", FAILED)
    if arguments.plant and not report.plant_checked:
        holds = False
        _complain(f"{arguments.file}: not every grasp was fit to be checked in a plant", FAILED)
    if arguments.output is not None:
        from drake_polygrasp.plant_results import save_plant_results

        reports = [grasp.plant for grasp in report.grasps]
        save_plant_results(arguments.file, arguments.output, reports)

    from drake_polygrasp.tables import verify_document, verify_table

    text = _json(verify_document(report, holds)) if arguments.json else verify_table(report)
    return FAILED if holds is False or not report.plant_decided else DONE, text


def _explain(arguments: argparse.Namespace) -> tuple[int, str]:
    object_, _ = _load(arguments)

    from drake_polygrasp.tables import all_sets_table, explain_document, one_set_table

    explanation, _ = call_in_child(
        "drake_polygrasp.pipeline:explain_sets",
        object_,
        task=_task(arguments, f"explaining {arguments.model}"),
        method=arguments.method,
        edge_clearance=arguments.edge_clearance,
        tip_radius=arguments.tip_radius,
        avoid_directions=arguments.avoid_direction,
        exclude_faces=arguments.exclude_faces,
    )
    document = explain_document(arguments.model, object_, explanation, arguments.set)
    if arguments.figure is not None:
        from drake_polygrasp.visualization.explanation import draw_explanation
        from drake_polygrasp.visualization.figures import save_figure

        figure = draw_explanation(
            object_, explanation, arguments.set, arguments.edge_clearance, arguments.tip_radius
        )
        save_figure(figure, arguments.figure)
    table = one_set_table if arguments.set else all_sets_table
    return DONE, _json(document) if arguments.json else table(document)


def _export(arguments: argparse.Namespace) -> tuple[int, str]:
    from drake_polygrasp.export import export_directives
    from drake_polygrasp.grasp_file import load_grasps

    file = load_grasps(arguments.file)
    export_directives(file, arguments.directives)
    return DONE, f"wrote {arguments.directives}"


def _show(arguments: argparse.Namespace) -> tuple[int, str]:
    from drake_polygrasp.visualization.show import is_model, serve, write_page

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
    maker = f"drake_polygrasp.visualization.show:exhibit_{kind}"
    exhibit, _ = call_in_child(maker, name, task=_task(arguments, f"showing {name}"), **options)
    _warn(exhibit.object_.warnings)
    code = DONE
    if not exhibit.grasps:
        code = _complain(f"{name}: no grasp to show, only the object", FAILED)
    if arguments.html is not None:
        write_page(exhibit, arguments.html, PurePath(name).name)
        return code, f"wrote {arguments.html}"
    with suppress(KeyboardInterrupt):
        for line in serve(exhibit):
            code = _print(code, line)
    return code, ""


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=2, allow_nan=False)


COMMANDS: dict[str, Callable[[argparse.Namespace], tuple[int, str]]] = {
    "plan": _plan,
    "verify": _verify,
    "explain": _explain,
    "show": _show,
    "export": _export,
}
"""Each returns its exit code and what it prints."""
