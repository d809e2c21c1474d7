"""`polygrasp hand check`: its options and its call."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.options import add_command, add_common_options
from drake_polygrasp.cli.reporting import DONE, FAILED, as_json, print_error, print_warnings

if TYPE_CHECKING:
    from drake_polygrasp.hands.check import HandReport


def add_hand_check(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(
        commands, "hand check", "Check a hand's description and model, and say what it can do."
    )
    parser.add_argument("hand", metavar="HAND.yaml", help="description of a hand")
    parser.add_argument(
        "--html",
        metavar="OUT.html",
        type=Path,
        help="also write a page with some postures of the hand, which opens offline",
    )
    add_common_options(parser)


def run_hand_check(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_hand_check`.

    Returns:
        The exit code, 1 if the hand cannot grasp, and what to print.

    Raises:
        HandError: when the description or the model cannot be used.
        UsageError: when the page cannot be written.
    """
    from drake_polygrasp.hands.check import check_hand
    from drake_polygrasp.hands.model import load_hand

    hand = load_hand(
        arguments.hand,
        package_paths=arguments.package_path,
        packages=dict(arguments.packages),
    )
    report = check_hand(hand)
    code = FAILED if report.errors else DONE
    for error in report.errors:
        print_error(f"{arguments.hand}: {error}", FAILED)
    if arguments.html is not None:
        from pydrake.geometry import Meshcat

        from drake_polygrasp.visualization.hand import draw_hand_postures
        from drake_polygrasp.visualization.page import save_html

        meshcat = Meshcat()
        draw_hand_postures(meshcat, hand, report.sample)
        save_html(arguments.html, meshcat, title=hand.name)
    if arguments.json:
        return code, as_json(_document(report))
    print_warnings(f"{arguments.hand}: {warning}" for warning in report.warnings)
    written = [f"wrote {arguments.html}"] if arguments.html is not None else []
    return code, "\n".join([*_lines(report), *written])


def _lines(report: HandReport) -> list[str]:
    """Returns the report as lines of text."""
    root = "floats" if report.floats else "is fixed to the world in the model"
    low, high = (1e3 * distance for distance in report.span)
    lines = [
        f"{report.name}: {len(report.joints)} joints, {len(report.independent)} independent; its "
        f"root '{report.root}' {root}",
    ]
    for name in report.independent:
        effort = report.effort[name]
        known = "effort unknown" if effort is None else f"effort {effort:g}"
        lines.append(f"  {name}: {known} ({report.effort_from[name]})")
    lines += [f"  {coupling}" for coupling in report.couplings]
    for name, fit in report.tip_fits.items():
        millimetres = " / ".join(f"{round(1e3 * value, 2) + 0.0:.2f}" for value in fit)
        lines.append(
            f"tip {name}: moves in {report.tip_ranks[name]} of 3 directions; geometry is "
            f"{millimetres} mm from its sphere (least, median, most)"
        )
    lines.append(
        f"{100 * report.kept_share:.0f} percent of random postures are free of self-collision; "
        f"{report.num_pairs} pairs of geometries may collide"
    )
    if report.kept_share:
        lines.append(f"tips that grasp together are {low:.0f} to {high:.0f} mm apart")
    if not report.errors:
        lines.append("it can grasp")
    return lines


def _document(report: HandReport) -> dict[str, Any]:
    """Returns the report as plain data."""
    return {
        "name": report.name,
        "joints": list(report.joints),
        "independent": list(report.independent),
        "couplings": list(report.couplings),
        "root": report.root,
        "floats": report.floats,
        "effort": report.effort,
        "effort_from": report.effort_from,
        "tip_ranks": report.tip_ranks,
        "tip_fits": {name: fit._asdict() for name, fit in report.tip_fits.items()},
        "kept_share": report.kept_share,
        "collisions": [
            {"bodies": list(pair), "share": share} for pair, share in report.collisions.items()
        ],
        "num_pairs": report.num_pairs,
        "span": list(report.span) if report.kept_share else None,
        "errors": list(report.errors),
        "warnings": list(report.warnings),
    }
