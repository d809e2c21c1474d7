"""Results as tables for people: ratios first, for seconds are of one machine."""

from __future__ import annotations

import itertools
from collections import defaultdict
from typing import Any

import numpy as np

Results = list[dict[str, Any]]

PEERS = ("random", "antipodal", "paper", "best")
_ROW = "{:<20}{:>6}{:>8}{:>9}{:>9}{:>7}{:>9}{:>11}{:>10}{:>10}{:>9}{:>9}"
HEADER = _ROW.format(
    "object", "faces", "load s", "plan s", "certify", "MB", "epsilon",
    "/random", "/antipod", "/paper", "/best", "t/random",
)
_KIND = "{:<16}{:>4}  {:<10}{:>8}{:>8}{:>8}{:>9}"


def value(result: dict[str, Any], *path: str) -> float:
    """A number deep in a result; nan where it was not measured."""
    found: Any = result
    for key in path:
        if not isinstance(found, dict) or key not in found:
            return float("nan")
        found = found[key]
    return float(found)


def ratio(result: dict[str, Any], peer: str) -> float:
    """Our epsilon over a peer's; nan where it has none."""
    theirs = value(result, peer, "epsilon")
    return value(result, "ours", "epsilon") / theirs if theirs > 0 else float("nan")


def time_ratio(result: dict[str, Any]) -> float:
    """Our seconds to plan ten grasps over the random search's for its one."""
    return value(result, "ours", "seconds", "plan") / value(result, "random", "seconds", "total")


def row(result: dict[str, Any]) -> str:
    """One object."""
    seconds = (value(result, "ours", "seconds", stage) for stage in ("load", "plan", "certify"))
    line = _ROW.format(
        result["name"],
        f"{value(result, 'ours', 'faces'):.0f}",
        *(f"{s:.3f}" for s in seconds),
        f"{value(result, 'ours', 'megabytes'):.0f}",
        f"{value(result, 'ours', 'epsilon'):.4f}",
        *(f"{ratio(result, peer):.2f}" for peer in PEERS),
        f"{time_ratio(result):.1f}",
    )
    errors = [f"  {k}: {v['error']}" for k, v in result.items() if "error" in v and k != "error"]
    return "\n".join([line, *errors])
