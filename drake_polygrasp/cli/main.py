"""The `polygrasp` command: reads its arguments, runs a subcommand and returns its exit code.

Modules are imported where they are used, so that `verify` runs with no planner loaded.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable, Sequence

from drake_polygrasp.cli.explain import add_explain, run_explain
from drake_polygrasp.cli.export import add_export, run_export
from drake_polygrasp.cli.plan import add_plan, run_plan
from drake_polygrasp.cli.reporting import BAD_INPUT, INTERRUPTED, complain, print_result
from drake_polygrasp.cli.show import add_show, run_show
from drake_polygrasp.cli.verify import add_verify, run_verify
from drake_polygrasp.errors import PolygraspError


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code; usage errors leave through argparse with 2."""
    try:
        if isinstance(sys.stdout, io.TextIOWrapper):
            # A file's name need not be text in the terminal's encoding.
            sys.stdout.reconfigure(errors="backslashreplace")
        arguments = make_parser().parse_args(argv)
        return print_result(*COMMANDS[arguments.command](arguments))
    except PolygraspError as error:
        return complain(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        return complain("interrupted", INTERRUPTED)
    except OSError as error:
        return complain(f"{error.filename or 'system'}: {error.strerror}", BAD_INPUT)
    except Exception as error:
        return complain(
            f"internal error ({type(error).__name__}: {error}); please report it", BAD_INPUT
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
    add_plan(commands)
    add_verify(commands)
    add_explain(commands)
    add_show(commands)
    add_export(commands)
    return parser


COMMANDS: dict[str, Callable[[argparse.Namespace], tuple[int, str]]] = {
    "plan": run_plan,
    "verify": run_verify,
    "explain": run_explain,
    "show": run_show,
    "export": run_export,
}
"""Each returns its exit code and what it prints."""
