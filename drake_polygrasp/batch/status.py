"""What an output holds so far: counts, the slowest, largest and worst objects, rate, time left."""

from __future__ import annotations

import sqlite3
import time
from dataclasses import dataclass
from pathlib import Path

from drake_polygrasp.batch.driver_lock import running_drivers
from drake_polygrasp.batch.outputs import state_folder
from drake_polygrasp.batch.reading import IS_CURRENT, IS_LATEST, open_rows, select_rows
from drake_polygrasp.batch.rows import STATUSES, BatchRow

_RATE_SECONDS = 600.0
"""Results of this time are counted for the rate [s]. Our choice."""


@dataclass(frozen=True)
class BatchStatus:
    """What an output holds.

    Attributes:
        out: the output as it was named.
        num_sources: number of models that the sources of the latest run named.
        num_objects: number of objects that the latest run has met so far.
        counts: number of these objects by the status of their results, all statuses named.
        num_waiting: number of objects that were met and have no result.
        num_earlier: number of results of earlier contents, options or versions of objects.
        drivers: who writes to it now.
        rate: results a second in the last ten minutes; None where there were none.
        seconds_left: time that the rest takes at that rate [s]; None where it is not known.
        slowest: objects that took longest.
        largest: objects that took the most memory.
        worst: objects whose best grasp has the least epsilon.
    """

    out: str
    num_sources: int
    num_objects: int
    counts: dict[str, int]
    num_waiting: int
    num_earlier: int
    drivers: tuple[str, ...]
    rate: float | None
    seconds_left: float | None
    slowest: tuple[BatchRow, ...]
    largest: tuple[BatchRow, ...]
    worst: tuple[BatchRow, ...]


def read_status(out: str | Path, most: int = 3) -> BatchStatus:
    """Reads what an output holds, also while drivers write to it.

    Args:
        out: the output, as for `plan_batch`.
        most: how many of the slowest, largest and worst objects are named.

    Returns:
        What it holds.

    Raises:
        BatchError: when it holds no results, or they cannot be read.
    """
    folder = state_folder(out)
    with open_rows(folder) as rows:
        joined = f"objects JOIN results USING (key) WHERE {IS_LATEST} GROUP BY status"
        counts = dict(rows.execute(f"SELECT status, count(*) FROM {joined}").fetchall())
        num_objects = _number(rows, f"SELECT count(*) FROM objects WHERE {IS_LATEST}")
        num_sources = _number(rows, "SELECT coalesce(max(value), 0) FROM facts")
        num_met = _number(rows, f"SELECT count(DISTINCT source) FROM objects WHERE {IS_LATEST}")
        num_earlier = _number(rows, f"SELECT count(*) FROM results WHERE NOT {IS_CURRENT}")
        rate = _rate(rows)
        slowest = tuple(select_rows(rows, "seconds DESC", most))
        largest = tuple(select_rows(rows, "peak_bytes DESC", most))
        worst = tuple(select_rows(rows, "epsilon", most, f"{IS_CURRENT} AND epsilon IS NOT NULL"))
    num_waiting = num_objects - sum(counts.values())
    left = num_waiting + max(0, num_sources - num_met)
    return BatchStatus(
        out=str(out),
        num_sources=num_sources,
        num_objects=num_objects,
        counts={status: counts.get(status, 0) for status in STATUSES},
        num_waiting=num_waiting,
        num_earlier=num_earlier,
        drivers=tuple(running_drivers(folder)),
        rate=rate,
        seconds_left=None if rate is None else left / rate,
        slowest=slowest,
        largest=largest,
        worst=worst,
    )


def _rate(rows: sqlite3.Connection) -> float | None:
    """Returns results a second in the last ten minutes of the results that there are."""
    query = "SELECT max(finished) FROM results"
    last = rows.execute(query).fetchone()[0]
    if last is None or last < time.time() - _RATE_SECONDS:
        return None
    query = "SELECT count(*), min(finished) FROM results WHERE finished > ?"
    count, first = rows.execute(query, (last - _RATE_SECONDS,)).fetchone()
    return None if last <= first else float(count / (last - first))


def _number(rows: sqlite3.Connection, query: str) -> int:
    return int(rows.execute(query).fetchone()[0])
