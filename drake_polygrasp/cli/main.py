"""The `polygrasp` command: parses the arguments, runs a subcommand and returns its exit code.

Subcommands import the library's modules where they use them, so that `verify` loads no planner.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable, Sequence

from drake_polygrasp._version import __version__, drake_version
from drake_polygrasp.cli.batch import add_batch, run_batch
from drake_polygrasp.cli.batch_results import (
    add_batch_results,
    run_batch_export,
    run_batch_status,
)
from drake_polygrasp.cli.calls import child_limits
from drake_polygrasp.cli.child_process import READ_SECONDS, call_in_child
from drake_polygrasp.cli.explain import add_explain, run_explain
from drake_polygrasp.cli.export import add_export, run_export
from drake_polygrasp.cli.hand import add_hand_check, run_hand_check
from drake_polygrasp.cli.plan import add_plan, run_plan
from drake_polygrasp.cli.reporting import BAD_INPUT, INTERRUPTED, print_error, print_result
from drake_polygrasp.cli.show import add_show, run_show
from drake_polygrasp.cli.verify import add_verify, run_verify
from drake_polygrasp.errors import PolygraspError


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the `polygrasp` command, with one line on standard error where something is wrong.

    Args:
        argv: the command's arguments, by default those of this process.

    Returns:
        The exit code: 0 when all that was asked for holds, 1 when something does not or no
        certified grasp was found, 2 when the input is wrong, 130 when interrupted.

    Raises:
        SystemExit: with code 2 when the arguments are wrong, with 0 after `--help`.
    """
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            # File names may hold characters that the terminal's encoding lacks.
            sys.stdout.reconfigure(errors="backslashreplace")
        arguments = make_parser().parse_args(_joined(sys.argv[1:] if argv is None else argv))
        return print_result(*_run_command(arguments))
    except PolygraspError as error:
        return print_error(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return print_error("interrupted", INTERRUPTED)
    except OSError as error:
        return print_error(f"{error.filename or 'system'}: {error.strerror}", BAD_INPUT)
    except Exception as error:
        return print_error(
            f"internal error ({type(error).__name__}: {error}); please report it", BAD_INPUT
        )


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser of all subcommands, whose result's `command` is the subcommand's name."""
    parser = argparse.ArgumentParser(
        prog="polygrasp",
        description="Plans grasps of three frictional point contacts on two or three faces of an "
        "object, and proves each one.",
        epilog="Exit status: 0 when all that was asked for holds, 1 when there is no certified "
        "grasp or something does not hold, 2 when the input or the usage is wrong.",
    )
    parser.add_argument(
        "--version", action=_PrintVersions, nargs=0, help="print the version, and Drake's, and exit"
    )
    commands = parser.add_subparsers(metavar="COMMAND", dest="command", required=True)
    add_plan(commands)
    add_verify(commands)
    add_explain(commands)
    add_show(commands)
    add_export(commands)
    add_hand_check(commands)
    add_batch(commands)
    add_batch_results(commands)
    return parser


class _PrintVersions(argparse.Action):
    """Prints the versions of this package and of Drake, which is looked up only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"polygrasp {__version__}, Drake {drake_version()}")
        parser.exit(0)


def _joined(argv: Sequence[str]) -> list[str]:
    """Returns the arguments with a subcommand of two words as one."""
    words = list(argv)
    pair = " ".join(words[:2])
    return [pair, *words[2:]] if pair in COMMANDS else words


def _run_command(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs a subcommand, whole in a child process unless it serves the user from this one."""
    name = arguments.command
    if name in _HERE:
        return COMMANDS[name](arguments)
    run = COMMANDS[name]
    result, _ = call_in_child(
        f"{run.__module__}:{run.__name__}",
        arguments,
        limits=child_limits(arguments, f"polygrasp {name}", seconds=READ_SECONDS),
    )
    code, text = result
    return code, text


COMMANDS: dict[str, Callable[[argparse.Namespace], tuple[int, str]]] = {
    "plan": run_plan,
    "verify": run_verify,
    "explain": run_explain,
    "show": run_show,
    "export": run_export,
    "hand check": run_hand_check,
    "batch": run_batch,
    "batch status": run_batch_status,
    "batch export": run_batch_export,
}
"""What runs each subcommand: takes its arguments, returns its exit code and what to print."""
_HERE = {"show", "export", "batch", "batch status", "batch export"}
"""Subcommands that run in this process: `show` serves until Ctrl-C, `batch` has children of its
own, and the others have Drake read no model."""
