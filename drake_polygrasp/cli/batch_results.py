"""`polygrasp batch status` and `polygrasp batch export`: what a batch's output holds."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from drake_polygrasp.cli.batch_table import status_lines
from drake_polygrasp.cli.options import add_command
from drake_polygrasp.cli.reporting import DONE, as_json


def add_batch_results(commands: Any) -> None:
    """Adds the two subcommands and their options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    status = add_command(
        commands,
        "batch status",
        "Print what a batch's output holds: counts, slowest and worst objects, time left.",
    )
    status.add_argument("out", metavar="OUT", help="the --out of a batch")
    status.add_argument(
        "--json", action="store_true", help="print one JSON object instead of a table"
    )
    export = add_command(
        commands, "batch export", "Write all grasps of a batch to one file, a row for each grasp."
    )
    export.add_argument("out", metavar="OUT", help="the --out of a batch")
    export.add_argument(
        "--parquet",
        metavar="FILE",
        type=Path,
        required=True,
        help="Parquet file to write, for pandas, polars or DuckDB (extra [query])",
    )


def run_batch_status(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs `polygrasp batch status`.

    Args:
        arguments: those of `add_batch_results`.

    Returns:
        The exit code and what to print.

    Raises:
        BatchError: when the output has no results, or they cannot be read.
    """
    from drake_polygrasp.batch.status import read_status

    status = read_status(arguments.out)
    if arguments.json:
        return DONE, as_json(asdict(status))
    return DONE, "\n".join(status_lines(status))


def run_batch_export(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs `polygrasp batch export`.

    Args:
        arguments: those of `add_batch_results`.

    Returns:
        The exit code and what to print.

    Raises:
        BatchError: when the output has no results, or the file cannot be written.
    """
    from drake_polygrasp.batch.parquet import export_parquet

    count = export_parquet(arguments.out, arguments.parquet)
    return DONE, f"wrote {count:,} grasps to {arguments.parquet}"
