"""`polygrasp explain`: its options and its call."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.calls import child_limits, load_model, planning_options
from drake_polygrasp.cli.child_process import call_in_child
from drake_polygrasp.cli.options import add_command, add_common_options, add_object_options
from drake_polygrasp.cli.reporting import DONE, as_json
from drake_polygrasp.cli.values import read_face_set


def add_explain(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(
        commands,
        "explain",
        "Tell for every set of two or three faces whether it has a certified grasp, or which step "
        "rejects it.",
    )
    add_object_options(parser)
    parser.add_argument(
        "--set",
        metavar="I,J,K",
        type=read_face_set,
        help="only the sets of these two or three faces (default: count all sets by reason)",
    )
    parser.add_argument(
        "--figure",
        metavar="OUT",
        type=Path,
        help="draw a chart of the counts or, with --set, what the paper's steps compute for that "
        "set, as .png, .pdf or .svg",
    )
    add_common_options(parser)


def run_explain(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_explain`.

    Returns:
        The exit code and what to print.

    Raises:
        ModelError: when the model cannot be loaded.
        UsageError: when an option does not fit the object, or the figure cannot be written.
    """
    object_, _ = load_model(arguments)

    from drake_polygrasp.cli.explain_table import all_sets_table, explain_document, one_set_table

    explanation, _ = call_in_child(
        "drake_polygrasp.pipeline.explain:explain_sets",
        object_,
        limits=child_limits(arguments, f"explaining {arguments.model}", "sets"),
        **planning_options(arguments),
    )
    document = explain_document(arguments.model, object_, explanation, arguments.set)
    if arguments.figure is not None:
        from drake_polygrasp.visualization.explanation import draw_explanation
        from drake_polygrasp.visualization.figures import save_figure

        save_figure(draw_explanation(object_, explanation, arguments.set), arguments.figure)
    table = one_set_table if arguments.set else all_sets_table
    return DONE, as_json(document) if arguments.json else table(document)
