"""`polygrasp batch`: its options and its call."""

from __future__ import annotations

import argparse
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from time import monotonic
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.batch_table import duration, report_lines
from drake_polygrasp.cli.calls import load_options, planning_options
from drake_polygrasp.cli.hand_plan import (
    HAND_TOP,
    SHARED_OPTIONS,
    add_hand_options,
    check_hand_options,
)
from drake_polygrasp.cli.options import add_command, add_common_options, add_planning_options
from drake_polygrasp.cli.plan import DEFAULT_TOP, add_choice_options
from drake_polygrasp.cli.progress_line import ProgressLine
from drake_polygrasp.cli.reporting import (
    DONE,
    FAILED,
    INTERRUPTED,
    as_json,
    print_error,
    print_line,
)
from drake_polygrasp.cli.values import (
    read_count,
    read_memory,
    read_seconds,
    read_shard,
    read_statuses,
)

if TYPE_CHECKING:
    from drake_polygrasp.batch.run import BatchReport, BatchRun


def add_batch(commands: Any) -> None:
    """Adds the subcommand and its options.

    Args:
        commands: the subparsers of `polygrasp`.
    """
    parser = add_command(
        commands,
        "batch",
        "Plan grasps of many objects; the same command again plans only those without a result.",
    )
    parser.add_argument(
        "sources",
        metavar="SRC",
        nargs="+",
        help="a model, a folder of models, a quoted pattern such as 'parts/**/*.urdf', a text file "
        "(.txt) with a path in each line, or a package:// URI",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        required=True,
        help="folder of the results, made if it is not there; or s3://BUCKET/NAME or "
        "gs://BUCKET/NAME for the grasp files, with rows in the folder NAME (extras [s3], [gcs])",
    )
    parser.add_argument(
        "-j",
        "--workers",
        metavar="N",
        type=read_count,
        help="objects planned at once (default: number of processors)",
    )
    parser.add_argument(
        "--timeout",
        metavar="S",
        type=read_seconds,
        default=60.0,
        help="time for an object [s] (default: 60)",
    )
    parser.add_argument(
        "--memory",
        metavar="SIZE",
        type=read_memory,
        default=4 << 30,
        help="memory for an object, libraries included: 500MB, 4GiB (default: 4GiB)",
    )
    parser.add_argument(
        "--shard",
        metavar="I/N",
        type=read_shard,
        default=(1, 1),
        help="plan the I-th of N parts of the objects; the N commands may share DIR",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDR",
        help="plan on the Dask cluster of this scheduler, whose workers see the models and DIR "
        "(extra [dask])",
    )
    parser.add_argument(
        "--retry",
        metavar="STATUS,...",
        type=read_statuses,
        default=(),
        help="plan again objects of these results: no_grasp, bad_model, crash, timeout, "
        "out_of_memory",
    )
    parser.add_argument(
        "--fail-on",
        metavar="STATUS,...",
        type=read_statuses,
        default=(),
        help="exit with 1 if an object has one of these results (default: a result without grasps "
        "is a result)",
    )
    parser.add_argument(
        "--limit", metavar="N", type=read_count, help="plan N objects at most (default: all)"
    )
    add_planning_options(parser)
    add_choice_options(parser)
    parser.set_defaults(top=None)
    add_hand_options(parser)
    add_common_options(parser)


def run_batch(arguments: argparse.Namespace) -> tuple[int, str]:
    """Runs the subcommand.

    Args:
        arguments: those of `add_batch`.

    Returns:
        The exit code and what to print.

    Raises:
        UsageError: when an option is wrong or a source is not there.
        BatchError: when results cannot be written, another driver writes there, or a cluster is
            lost.
    """
    check_hand_options(arguments)
    from drake_polygrasp.batch.dask_cluster import dask_executor
    from drake_polygrasp.batch.request import make_batch_request
    from drake_polygrasp.batch.run import BatchRun

    with ExitStack() as stack:
        engine: dict[str, Any] = {"executor": None, "workers": arguments.workers}
        check: dict[str, Any] = {}
        if arguments.scheduler is not None:
            executor, threads, alive = stack.enter_context(dask_executor(arguments.scheduler))
            engine = {"executor": executor, "workers": arguments.workers or threads}
            check = {"check": alive}
        request = make_batch_request(
            arguments.sources,
            arguments.out,
            timeout=arguments.timeout,
            memory=arguments.memory,
            shard=arguments.shard,
            retry=arguments.retry,
            limit=arguments.limit,
            **engine,
            **load_options(arguments),
            **_asked(arguments),
        )
        line = stack.enter_context(ProgressLine("batch", quiet=arguments.json))
        stop = stack.enter_context(_stopping(line))
        run = BatchRun(request, stop.is_asked, lambda text: print_line(f"note: {text}"), **check)
        stop.run = run
        for _ in run.rows():
            pass
    report = run.report()
    code = _exit_code(arguments, report, run)
    if arguments.json:
        return code, as_json(asdict(report))
    return code, "\n".join(report_lines(report))


def _asked(arguments: argparse.Namespace) -> dict[str, Any]:
    """Returns the options of planning, with a hand or without."""
    asked = planning_options(arguments)
    asked["top"] = arguments.top or (DEFAULT_TOP if arguments.hand is None else HAND_TOP)
    if arguments.hand is None:
        return asked | {"plant": arguments.plant}
    own = {"up_B": arguments.up, "load_mass": arguments.mass}
    own |= {"budget": arguments.budget, "seed": arguments.seed, "hand": arguments.hand}
    return {name: asked[name] for name in (*SHARED_OPTIONS, "top")} | own


def _exit_code(arguments: argparse.Namespace, report: BatchReport, run: BatchRun) -> int:
    """Returns the exit code, and says on standard error why it is not 0."""
    if not report.complete and not run.is_limited:
        return print_error(
            f"{report.out}: stopped; the same command goes on from here", INTERRUPTED
        )
    failed = {name: report.counts[name] for name in arguments.fail_on if report.counts.get(name)}
    if failed:
        text = ", ".join(f"{count} {name}" for name, count in failed.items())
        return print_error(f"{report.out}: {text}", FAILED)
    return DONE


class _Stop:
    """Whether a run is to stop, asked for by Ctrl-C or SIGTERM; it also refreshes the progress."""

    def __init__(self, line: ProgressLine) -> None:
        self._line, self._is_asked, self._start = line, False, monotonic()
        self.run: BatchRun | None = None

    def ask(self, *_: object) -> None:
        """Asks the run to stop; a second time ends it."""
        if self._is_asked:
            raise KeyboardInterrupt
        self._is_asked = True
        self._line.erase()
        print_error("stopping: objects in flight have 5 s; once more kills them", INTERRUPTED)

    def is_asked(self) -> bool:
        """Returns whether to stop."""
        if self.run is not None:
            self._line.show(self._progress(self.run))
        return self._is_asked

    def _progress(self, run: BatchRun) -> str:
        done, ok = sum(run.counts.values()), run.counts["ok"]
        rate = run.num_planned / max(monotonic() - self._start, 1e-3)
        left = max(0, run.num_expected - done) / rate if rate else None
        text = f"{done:,} of {run.num_expected:,} objects: {ok:,} ok, {done - ok:,} without grasps"
        text += f", {rate:.1f}/s" if rate else ""
        return text + (f", {duration(left)} left" if left else "")


@contextmanager
def _stopping(line: ProgressLine) -> Iterator[_Stop]:
    """Has Ctrl-C and SIGTERM ask for a stop."""
    stop = _Stop(line)
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, stop.ask) for number in signals]
    try:
        yield stop
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)
