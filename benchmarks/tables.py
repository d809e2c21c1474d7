"""Results as tables for people: ratios first, for seconds are of one machine."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import numpy as np

from drake_polygrasp.arrays import Array

Results = list[dict[str, Any]]

PEERS = ("quick", "random", "random_x4", "antipodal", "paper", "best")
TIMED = ("random", "random_x4")
COMPARED = [
    *(("ours", peer) for peer in PEERS),
    *(("quick", peer) for peer in (*TIMED, "best")),
    *(("default", peer) for peer in ("random_inside", "ours")),
]
"""Whose epsilon is divided by whose."""
_ROW = "{:<20}{:>6}{:>8}{:>9}{:>9}{:>9}{:>7}{:>9}{:>8}{:>9}{:>9}{:>10}{:>8}{:>8}{:>10}{:>10}"
HEADER = _ROW.format(
    "object",
    "faces",
    "load s",
    "plan s",
    "certify",
    "quick s",
    "MB",
    "epsilon",
    "/quick",
    "/random",
    "/rnd x4",
    "/antipod",
    "/paper",
    "/best",
    "t/random",
    "tq/random",
)
_KIND = "{:<16}{:>4}  {:<18}{:>8}{:>8}{:>8}{:>9}"


def value(result: dict[str, Any], *path: str) -> float:
    """A number deep in a result; nan where it was not measured."""
    found: Any = result
    for key in path:
        if not isinstance(found, dict) or key not in found:
            return float("nan")
        found = found[key]
    return float(found)


def ratio(result: dict[str, Any], peer: str, ours: str = "ours") -> float:
    """Our epsilon over a peer's; nan where it has none."""
    theirs = value(result, peer, "epsilon")
    return value(result, ours, "epsilon") / theirs if theirs > 0 else float("nan")


def time_ratio(result: dict[str, Any], peer: str, ours: str = "ours") -> float:
    """Our seconds to plan, ten grasps or quickly one, over a random search's for its one."""
    return value(result, ours, "seconds", "plan") / value(result, peer, "seconds", "total")


def row(result: dict[str, Any]) -> str:
    """One object."""
    seconds = (value(result, "ours", "seconds", stage) for stage in ("load", "plan", "certify"))
    line = _ROW.format(
        result["name"],
        f"{value(result, 'ours', 'faces'):.0f}",
        *(f"{s:.3f}" for s in seconds),
        f"{value(result, 'quick', 'seconds', 'plan'):.3f}",
        f"{value(result, 'ours', 'megabytes'):.0f}",
        f"{value(result, 'ours', 'epsilon'):.4f}",
        *(f"{ratio(result, peer):.2f}" for peer in PEERS),
        *(f"{time_ratio(result, 'random', ours):.1f}" for ours in ("ours", "quick")),
    )
    errors = [
        f"  {method}: {found['error']}"
        for method, found in result.items()
        if isinstance(found, dict) and "error" in found
    ]
    return "\n".join([line, *errors])


def kinds_table(results: Results) -> str:
    """Ratios of epsilon by kind of object, and over all that are generated."""
    lines = [_KIND.format("kind", "n", "ours over", "median", "2nd %", "worst", "share>=1")]
    groups = defaultdict(list)
    for result in results:
        groups[result["kind"]].append(result)
        if result["kind"] != "models":
            groups["all others"].append(result)
    for kind, members in groups.items():
        for ours, peer in COMPARED:
            ratios = _known(ratio(result, peer, ours) for result in members)
            if len(ratios):
                spread = (np.median(ratios), np.percentile(ratios, 2), ratios.min())
                share = f"{100 * (ratios >= 1).mean():.0f} %"
                numbers = (f"{r:.3f}" for r in spread)
                name = peer if ours == "ours" else f"{ours[0]} / {peer}"
                lines.append(_KIND.format(kind, len(ratios), name, *numbers, share))
        for stage in ("plan", "certify"):
            seconds = _known(value(result, "default", "seconds", stage) for result in members)
            if len(seconds):
                spread = (np.median(seconds), np.percentile(seconds, 98), seconds.max())
                numbers = (f"{s:.3f}" for s in spread)
                lines.append(_KIND.format(kind, len(seconds), f"d {stage} s", *numbers, ""))
        for ours, peer in itertools.product(("ours", "quick"), TIMED):
            times = _known(time_ratio(result, peer, ours) for result in members)
            if len(times):
                slow = (np.median(times), np.percentile(times, 98), times.max())
                numbers = (f"{t:.2f}" for t in slow)
                share = f"{100 * (times >= 1).mean():.0f} %"
                name = f"t({peer})" if ours == "ours" else f"tq({peer})"
                lines.append(_KIND.format(kind, len(times), name, *numbers, share))
    return "\n".join(
        [
            *lines,
            "(s, t: of seconds; median, 98th percentile, most. q: quick, one grasp. d: default)",
            "",
        ]
    )


def stages_table(results: Results) -> str:
    """Medians of what the peers' seconds went to."""
    lines = []
    for peer in (*TIMED, "antipodal"):
        runs = [result[peer]["seconds"] for result in results if "seconds" in result.get(peer, ())]
        if runs:
            medians = (f"{s} {np.median([run[s] for run in runs]):.4f}" for s in runs[0])
            lines.append(f"{peer}, median seconds: {', '.join(medians)}")
    return "\n".join([*lines, ""])


def growth_table(results: Results) -> str:
    """How seconds and memory grow with faces: medians of sizes, exponents between them."""
    sizes: dict[str, dict[int, Results]] = defaultdict(lambda: defaultdict(list))
    for result in results:
        family, _, rest = result["name"].partition("_")
        if family in ("ellipsoid", "tangent") and "sets" in result["ours"]:
            sizes[family][int(rest.partition("_")[0])].append(result["ours"])
    form = "{:<12}{:>6}{:>10}{:>9}{:>9}{:>9}{:>8}{:>10}"
    heads = ("growth", "faces", "plan s", "exponent", "certify", "quick s", "MB", "random s")
    lines = [form.format(*heads)]
    for family, members in sizes.items():
        plans = {n: np.median([r["seconds"]["plan"] for r in runs]) for n, runs in members.items()}
        exponents = {
            n: f"{np.log(plans[n] / plans[m]) / np.log(n / m):.2f}"
            for m, n in itertools.pairwise(sorted(plans))
        }
        for n, runs in sorted(members.items()):
            certify = np.median([r["seconds"]["certify"] for r in runs])
            memory = np.median([r["megabytes"] for r in runs])
            same = [r for r in results if r["name"].startswith(f"{family}_{n}_")]
            quick = _known(value(r, "quick", "seconds", "plan") for r in same)
            searched = _known(value(r, "random", "seconds", "total") for r in same)
            lines.append(
                form.format(
                    family,
                    n,
                    f"{plans[n]:.3f}",
                    exponents.get(n, ""),
                    f"{certify:.3f}",
                    f"{np.median(quick):.3f}" if len(quick) else "",
                    f"{memory:.0f}",
                    f"{np.median(searched):.3f}" if len(searched) else "",
                )
            )
    return "\n".join(lines)


def _known(values: Iterable[float]) -> Array:
    """Without nan."""
    array = np.array(list(values), dtype=float)
    known: Array = array[~np.isnan(array)]
    return known
