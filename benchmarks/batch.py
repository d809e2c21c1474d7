"""How fast a batch is, what the supervisor costs, and how much memory the driver takes.

    python -m benchmarks.batch [--objects 60] [--rows 1000 10000 100000] [--dask] [--repeat 3]

Objects a second: a plain loop in one warm process (load, plan, certify, write), one slot, two
slots and, with `--dask`, a LocalCluster of two workers, interleaved and each the best of `--repeat`
runs; slots without the time in which their first child imports. Overhead: what a task that does
nothing costs. Memory: peak of the driver's process, with a planner that does nothing.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import drake_polygrasp as polygrasp  # which imports Drake where it is used, as a driver does not
from drake_polygrasp.batch.request import make_batch_request
from drake_polygrasp.batch.run import BatchRun

ROOT = Path(__file__).resolve().parents[1]
FACES = 40
"""The most faces that the promise on speed is about."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.batch", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--objects", type=int, default=60, help="to plan (default: 60)")
    parser.add_argument("--rows", type=int, nargs="*", default=[1_000, 10_000, 100_000])
    parser.add_argument("--repeat", type=int, default=3, help="runs of each (default: 3)")
    parser.add_argument("--dask", action="store_true", help="also on a LocalCluster")
    parser.add_argument("--drive", type=int, metavar="ROWS", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.drive is not None:
        print(peak_of_driver(arguments.drive))
        return
    os.environ.update(dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1"))
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        parts = Path(folder) / "parts"
        write_parts(parts, arguments.objects)
        ways: dict[str, Callable[[Path], float]] = {
            "plain loop": lambda out: loop(parts, out),
            "1 slot": lambda out: slots(parts, out, 1),
            "2 slots": lambda out: slots(parts, out, 2),
        }
        if arguments.dask:
            distributed = import_module("distributed")
            cluster = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
                )
            )
            executor = stack.enter_context(distributed.Client(cluster)).get_executor()
            ways["Dask, 2 workers"] = lambda out: slots(parts, out, 2, executor=executor)
        best: dict[str, float] = {}
        for turn in range(arguments.repeat):
            for name, way in ways.items():
                seconds = way(Path(folder) / f"{name} {turn}")
                best[name] = min(seconds, best.get(name, seconds))
        print("| way | objects/s | of the plain loop |\n|---|---|---|")
        for name, seconds in best.items():
            ratio = best["plain loop"] / seconds
            print(f"| {name} | {arguments.objects / seconds:.2f} | {ratio:.2f} |")
        print(f"\na task that does nothing takes {1e3 * overhead(Path(folder)):.2f} ms")
    print("\n| rows | peak memory of the driver [MB] |\n|---|---|")
    for rows in arguments.rows:
        command = [sys.executable, "-m", "benchmarks.batch", "--drive", str(rows)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        print(f"| {rows:,} | {done.stdout.strip()} |", flush=True)


def write_parts(folder: Path, number: int) -> None:
    """Writes polyhedra of 12 to 40 faces."""
    from tests.support.convex_polyhedra import tangent_polyhedron, write_obj

    folder.mkdir()
    for seed in range(number):
        faces = 12 + seed % (FACES - 11)
        write_obj(folder / f"{seed:04}.obj", tangent_polyhedron(faces, seed))


def loop(parts: Path, out: Path) -> float:
    """Time of the same calls, one after the other in this process [s]."""
    out.mkdir()
    start = 0.0
    for i, part in enumerate([*sorted(parts.iterdir())[:1], *sorted(parts.iterdir())]):
        if i == 1:  # The first is planned twice, so that all are planned in a warm process.
            start = time.perf_counter()
        object_ = polygrasp.load_object(part)
        plan = polygrasp.plan_grasps(object_)
        settings = replace(plan.settings, mu=None)
        polygrasp.save_grasps(out / f"{part.stem}.grasp.yaml", object_, plan.grasps, settings)
    return time.perf_counter() - start


def slots(parts: Path, out: Path, workers: int, **engine: Any) -> float:
    """Time of a batch, from when its children are warm [s]."""
    request = make_batch_request(parts, out, workers=workers, **engine)
    run, start = BatchRun(request), time.perf_counter()
    seconds: list[float] = []
    for row in run.rows():
        # Each child's first object ends after its imports; what they took is not counted.
        if engine or len(seconds) >= workers:
            seconds.append(time.perf_counter())
        else:
            start = time.perf_counter() - row.seconds
            seconds.append(start)
    assert run.report().counts == {"ok": len(list(parts.iterdir()))}
    return time.perf_counter() - start


def nothing(**_: Any) -> dict[str, Any]:
    """A planner that does nothing."""
    return {"status": "no_grasp", "reason": "nothing was planned", "num_faces": 6}


def run_nothing(folder: Path, rows: int) -> float:
    """Time of a batch whose planner does nothing [s]; its models are lines of a list."""
    models = folder / "models.txt"
    models.write_text("".join(f"package://none/{i}.obj\n" for i in range(rows)))
    request = make_batch_request(
        models, folder / "out", workers=2, function="benchmarks.batch:nothing"
    )
    start = time.perf_counter()
    for _ in BatchRun(request).rows():
        pass
    return time.perf_counter() - start


def overhead(folder: Path) -> float:
    """Time of a task that does nothing [s], from the difference of two batches."""
    short, long = 500, 2500
    times = []
    for rows in (short, long):
        (folder / str(rows)).mkdir()
        times.append(run_nothing(folder / str(rows), rows))
    return (times[1] - times[0]) / (long - short)


def peak_of_driver(rows: int) -> int:
    """Peak memory of this process when it drives a batch of so many rows [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        run_nothing(Path(folder), rows)
    # Not getrusage's: a process starts with the peak of the one that forked it.
    (line,) = re.findall(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())
    return int(line) // 1000


if __name__ == "__main__":
    main()
