"""The output of `polygrasp batch` and `polygrasp batch status`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from drake_polygrasp.cli.table import align_columns, counted

if TYPE_CHECKING:
    from drake_polygrasp.batch.rows import BatchRow
    from drake_polygrasp.batch.run import BatchReport
    from drake_polygrasp.batch.status import BatchStatus

_MEANING = {
    "ok": "a grasp file",
    "no_grasp": "no grasp was found",
    "bad_model": "the model, or an option for it, is refused",
    "crash": "its process crashed",
    "timeout": "it took too long",
    "out_of_memory": "it took too much memory",
}


def report_lines(report: BatchReport) -> list[str]:
    """Returns the lines that a run ends with.

    Args:
        report: what it did.
    """
    objects, models = counted(report.num_objects, "object"), counted(report.num_sources, "model")
    return [
        f"{report.out}: {objects} of {models}, {report.num_planned:,} planned in "
        f"{report.seconds:.1f} s",
        *_count_lines(report.counts),
    ]


def _count_lines(counts: Mapping[str, int]) -> list[str]:
    rows = [(status, f"{n:,}", _MEANING[status]) for status, n in counts.items() if n]
    ordered = sorted(rows, key=lambda row: list(_MEANING).index(row[0]))
    return [f"  {line}" for line in align_columns(ordered)] if ordered else []


def status_lines(status: BatchStatus) -> list[str]:
    """Returns what an output holds, in lines.

    Args:
        status: what it holds.
    """
    named = counted(status.num_sources, "model")
    lines = [
        f"{status.out}: {status.num_objects - status.num_waiting:,} of {status.num_objects:,} "
        f"objects that were met have a result; sources name {named}",
        *_count_lines(status.counts),
    ]
    if status.num_earlier:
        lines.append(f"  {status.num_earlier:,} results of earlier contents or options are kept")
    for driver in status.drivers:
        lines.append(f"running: {driver}")
    if status.rate is not None:
        left = "" if not status.seconds_left else f", {duration(status.seconds_left)} left"
        lines.append(f"{status.rate:.1f} results a second{left}")
    lines += _ranked("slowest", status.slowest, lambda row: f"{row.seconds:.1f} s")
    lines += _ranked("largest", status.largest, lambda row: f"{row.peak_bytes / 2**20:.0f} MiB")
    lines += _ranked("worst", status.worst, lambda row: f"epsilon {row.epsilon:.4f}")
    return lines


def _ranked(
    name: str, rows: Sequence[BatchRow], number: Callable[[BatchRow], str]
) -> Iterator[str]:
    if rows:
        listed = [
            f"{row.source}{f' ({row.body})' if row.body else ''} {number(row)}" for row in rows
        ]
        yield f"{name}: {', '.join(listed)}"


def duration(seconds: float) -> str:
    """Returns a time in words: "45 s", "12 min", "3.4 h".

    Args:
        seconds: the time [s].
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
