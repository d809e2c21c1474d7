"""The `polygrasp` command: each subcommand is a call of the library and a table of its answer.

Modules are imported where they are used, so that `verify` runs with no planner loaded.
"""

from __future__ import annotations

import argparse
import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from drake_polygrasp.child_process import call_in_child
from drake_polygrasp.errors import PolygraspError, UsageError

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes: all that was asked for holds; something does not, or nothing was found; the input or
the usage is wrong; stopped from the keyboard."""
MAX_FRICTION, MAX_LENGTH = 100.0, 1000.0
"""Ours: coefficients and lengths [m] beyond these are slips of the pen."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code; usage errors leave through argparse with 2."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A file's name need not be text in the terminal's encoding.
        sys.stdout.reconfigure(errors="backslashreplace")
    arguments = _parser().parse_args(argv)
    try:
        code, text = arguments.run(arguments)
    except PolygraspError as error:
        return _complain(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    except Exception as error:
        description = " ".join(f"{type(error).__name__}: {error}".split())
        return _complain(f"internal error ({description}); please report it", BAD_INPUT)
    return _print(text, code)


def _print(text: str, code: int) -> int:
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
    print(f"polygrasp: {message}", file=sys.stderr)
    return code


def _warn(warnings: Iterable[str]) -> None:
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="polygrasp",
        description="Plans grasps of three frictional point contacts on two or three faces of an "
        "object, and proves each one.",
        epilog="Exit status: 0 when all that was asked for holds, 1 when there is no certified "
        "grasp or something does not hold, 2 when the input or the usage is wrong.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    _add_plan(commands)
    _add_verify(commands)
    _add_explain(commands)
    _add_show(commands)
    return parser


def _add_command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], tuple[int, str]], help_: str
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(name, help=help_, description=help_)
    parser.set_defaults(run=run)
    return parser


def _add_package_path(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--package-path",
        metavar="DIR",
        action="append",
        default=[],
        help="folder to search for the packages of package:// URIs (may be repeated)",
    )


def _add_common_options(parser: argparse.ArgumentParser) -> None:
    _add_package_path(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object for machines")


def _add_object_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "model", metavar="MODEL", help="what Drake reads: .sdf .urdf .xml .dmd.yaml .obj"
    )
    parser.add_argument("--body", metavar="NAME", help="the body to grasp, where there are several")
    parser.add_argument(
        "--mu",
        type=_friction,
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
        type=_length,
        help="least distance of a contact from its face's edges [m] (default: the lesser of "
        "1 percent of the object's diameter and a fifth of the face's inradius)",
    )
    parser.add_argument(
        "--tip-radius",
        metavar="M",
        type=_length,
        help="radius of the fingertips that need room [m] (default: 2 percent of the object's "
        "diameter; 0: points)",
    )


def _add_plan(commands: Any) -> None:
    parser = _add_command(commands, "plan", _plan, "Plan grasps, prove them and write them.")
    _add_object_options(parser)
    parser.add_argument(
        "--top",
        metavar="K",
        type=_count,
        default=10,
        help="how many grasps to write at most (default: 10)",
    )
    parser.add_argument(
        "--rank",
        choices=("epsilon", "margin", "Q"),
        help="what puts one grasp before another (default: epsilon; Q for --method paper)",
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
        commands, "verify", _verify, "Check what a grasp file claims; the file is not changed."
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="a grasp file")
    parser.add_argument(
        "--require-model",
        action="store_true",
        help="fail when the model is missing (default: warn, and check the rest)",
    )
    _add_common_options(parser)


def _add_explain(commands: Any) -> None:
    parser = _add_command(
        commands, "explain", _explain, "Say of every set of faces whether it holds, or why not."
    )
    _add_object_options(parser)
    parser.add_argument(
        "--set",
        metavar="I,J,K",
        type=_face_set,
        help="only the sets of these two or three faces (default: all, counted)",
    )
    _add_common_options(parser)


def _add_show(commands: Any) -> None:
    parser = _add_command(
        commands, "show", _show, "Show in 3-D what a grasp file states, or what is planned now."
    )
    parser.add_argument("name", metavar="FILE|MODEL", help="a grasp file, or what Drake reads")
    parser.add_argument(
        "--html",
        metavar="OUT.html",
        type=Path,
        help="write a page that opens offline (default: serve Meshcat until Ctrl-C)",
    )
    parser.add_argument("--body", metavar="NAME", help="the body of MODEL, where there are several")
    parser.add_argument("--mu", type=_friction, help="friction for MODEL (default: as in plan)")
    _add_package_path(parser)


def _number(text: str, most: float) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 <= number <= most:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to {most:g}")
    return number


def _friction(text: str) -> float:
    number = _number(text, MAX_FRICTION)
    if number == 0:
        raise argparse.ArgumentTypeError("without friction there is no grasp")
    return number


def _length(text: str) -> float:
    return _number(text, MAX_LENGTH)


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive whole number")
    return int(text)


def _face_set(text: str) -> tuple[int, ...]:
    indices = text.split(",")
    if len(indices) not in (2, 3) or not all(i.isascii() and i.isdigit() for i in indices):
        raise argparse.ArgumentTypeError(f"{text!r} is not I,J or I,J,K, indices of faces")
    return tuple(sorted(int(i) for i in indices))


def _load(arguments: argparse.Namespace) -> tuple[GraspObject, float]:
    """The object, and the seconds it took to load; warnings are printed."""
    object_, seconds = call_in_child(
        "drake_polygrasp.object_model:load_object",
        arguments.model,
        body_name=arguments.body,
        mu=arguments.mu,
        package_paths=arguments.package_path,
    )
    _warn(object_.warnings)
    return object_, seconds


def _plan(arguments: argparse.Namespace) -> tuple[int, str]:
    output = arguments.output or _default_output(arguments.model)
    if output.exists() and Path(arguments.model).exists() and output.samefile(arguments.model):
        raise UsageError(f"{output}: is the model; name another file with -o")
    object_, load_seconds = _load(arguments)

    from drake_polygrasp.grasp_file import grasp_document, save_grasps
    from drake_polygrasp.pipeline import plan_grasps
    from drake_polygrasp.tables import no_grasp_message, plan_table

    plan = plan_grasps(
        object_,
        method=arguments.method,
        top=arguments.top,
        rank=arguments.rank,
        edge_clearance=arguments.edge_clearance,
        tip_radius=arguments.tip_radius,
    )
    if plan.grasps:
        # Without it, the friction stated here would look better than the model's.
        override = {} if arguments.mu is None else {"mu": arguments.mu}
        save_grasps(output, object_, plan.grasps, plan.settings | override)
    else:
        _complain(no_grasp_message(arguments.model, object_, plan, output), FAILED)
    code = DONE if plan.grasps else FAILED
    if not arguments.json:
        return code, plan_table(arguments.model, object_, plan, output) if plan.grasps else ""
    return code, _json(
        {
            "model": arguments.model,
            "num_faces": len(object_.polyhedron.faces),
            "num_sets": plan.num_sets,
            "num_certified": plan.num_certified,
            "seconds": {"load": load_seconds, **plan.seconds},
            "reasons": plan.reasons,
            "output": str(output) if plan.grasps else None,
            "grasps": [grasp_document(grasp) for grasp in plan.grasps],
        }
    )


def _default_output(model: str) -> Path:
    name = PurePath(model).name.removesuffix(".yaml")
    return Path(f"{PurePath(name).stem}.grasp.yaml")


def _verify(arguments: argparse.Namespace) -> tuple[int, str]:
    report, _ = call_in_child(
        "drake_polygrasp.verification:verify_file",
        arguments.file,
        package_paths=arguments.package_path,
    )
    _warn(report.warnings)
    holds = report.holds and (report.model_checked or not arguments.require_model)
    if report.holds and not holds:
        _complain(f"{arguments.file}: the model is required, and was not checked", FAILED)

    from drake_polygrasp.tables import verify_document, verify_table

    text = _json(verify_document(report, holds)) if arguments.json else verify_table(report)
    return DONE if holds else FAILED, text


def _explain(arguments: argparse.Namespace) -> tuple[int, str]:
    object_, _ = _load(arguments)

    from drake_polygrasp.pipeline import explain_sets
    from drake_polygrasp.tables import all_sets_table, explain_document, one_set_table

    explanation = explain_sets(
        object_,
        method=arguments.method,
        edge_clearance=arguments.edge_clearance,
        tip_radius=arguments.tip_radius,
    )
    document = explain_document(arguments.model, object_, explanation, arguments.set)
    table = one_set_table if arguments.set else all_sets_table
    return DONE, _json(document) if arguments.json else table(document)


def _show(arguments: argparse.Namespace) -> tuple[int, str]:
    from drake_polygrasp.visualization.show import is_model, serve, write_page

    name, options = arguments.name, {"package_paths": arguments.package_path}
    kind = "model" if is_model(name) else "file"
    if kind == "model":
        options |= {"body_name": arguments.body, "mu": arguments.mu}
    elif arguments.body is not None or arguments.mu is not None:
        raise UsageError(f"{name}: a grasp file states its body and friction; leave them out")
    maker = f"drake_polygrasp.visualization.show:exhibit_{kind}"
    exhibit, _ = call_in_child(maker, name, **options)
    _warn(exhibit.object_.warnings)
    code = DONE
    if not exhibit.grasps:
        code = _complain(f"{name}: no grasp to show, only the object", FAILED)
    if arguments.html is not None:
        write_page(exhibit, arguments.html, PurePath(name).name)
        return code, f"wrote {arguments.html}"
    for line in serve(exhibit):
        code = _print(line, code)
    return code, ""


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, indent=2, allow_nan=False)
