"""Kills a batch again and again, and asks whether its promise holds: one result for each object.

    python -m benchmarks.chaos [--objects 500] [--kills 20] [--engine local | threads | dask]

A fifth of the objects abort their process, hang, take all memory or are malformed. The driver is
killed with signal 9 at random moments, and resumed each time; so are children, now and then. With
`--engine dask` the driver goes on, and three workers of its LocalCluster are killed instead. Then
every key has one result, every sound object a grasp file that verifies, no process has outlived a
kill by two seconds, and sound objects were started twice at most as often as kills can explain.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

from drake_polygrasp import verify_file
from drake_polygrasp.batch.reading import read_rows
from drake_polygrasp.batch.request import make_batch_request
from drake_polygrasp.batch.run import BatchRun
from drake_polygrasp.batch.worker import plan_model
from drake_polygrasp.settings import NO_ERRORS
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.solids import regular_polygon

ROOT = Path(__file__).resolve().parents[1]
LOG = "CHAOS_LOG"
"""Environment variable that names the file in which children say what they start."""
BAD = {"abort": "crash", "hang": "timeout", "hog": "out_of_memory", "broken": "bad_model"}
"""Kinds of objects that end badly, and the status of their results."""
KINDS = ("abort", "hog", "broken", "abort", "hang", "broken", "hog", "abort")
"""Kinds of every fifth object: few hang, for while they do no others are killed at work."""
SLOTS = 2
TIMEOUT = 15.0
KILLED_WORKERS = 3
ALIVE_SECONDS = 2.0
PATIENCE = 20.0
"""Time for an object after which the driver is taken to hang [s]."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.chaos", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--objects", type=int, default=500, help="how many (default: 500)")
    parser.add_argument("--kills", type=int, default=20, help="kills of drivers (default: 20)")
    parser.add_argument("--engine", choices=("local", "threads", "dask"), default="local")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--drive", metavar="FOLDER", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.drive is not None:
        drive(arguments.drive, arguments.engine, arguments.seed)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        faults = chaos(
            Path(folder), arguments.objects, arguments.kills, arguments.engine, arguments.seed
        )
    print(*faults or ["the promise holds"], sep="\n")
    return 1 if faults else 0


def chaos(folder: Path, num_objects: int, num_kills: int, engine: str, seed: int) -> list[str]:
    """Runs a batch to its end through kills, and returns how its promise is broken."""
    write_library(folder / "parts", num_objects)
    (folder / "log").touch()
    chance, faults, kills = random.Random(seed), [], 0
    start = time.monotonic()
    while True:
        driver = start_driver(folder, engine, seed + kills)
        if engine == "dask" or kills >= num_kills:
            try:
                code = driver.wait(PATIENCE * num_objects)
            except subprocess.TimeoutExpired:
                driver.kill()
                code = driver.wait()
            break
        # Most are killed when children work; some while they start, or before there are any.
        if chance.random() < 0.8:
            await_start(folder / "log", driver)
        with suppress(subprocess.TimeoutExpired):
            code = driver.wait(chance.uniform(0.05, 2.0))
            break
        below = descendants(driver.pid)
        if below and chance.random() < 0.3:
            with suppress(ProcessLookupError):
                os.kill(chance.choice(below), signal.SIGKILL)
            kills += 1
            time.sleep(chance.uniform(0.0, 1.0))
            below += descendants(driver.pid)
        driver.kill()
        driver.wait()
        kills += 1
        faults += outlived(below)
    if code != 0:
        faults.append(f"the driver ended with {code}")
    if engine != "dask" and kills < num_kills:
        faults.append(f"only {kills} kills: give more --objects")
    kills += KILLED_WORKERS if engine == "dask" else 0
    seconds = time.monotonic() - start
    print(f"{engine}: {num_objects} objects, {kills} kills, {seconds:.0f} s", flush=True)
    return faults + broken_promises(folder, num_objects, kills)


def write_library(folder: Path, num_objects: int) -> None:
    """Writes sound prisms, each another, and one bad object in five."""
    folder.mkdir()
    for i in range(num_objects):
        kind = KINDS[i // 5 % len(KINDS)] if i % 5 == 0 else "sound"
        file = folder / f"{i:04}_{kind}.obj"
        if kind == "broken":
            file.write_text(f"# {i}\nv 0 0 0\nf 1 2 3\n")
        else:
            write_obj(file, prism(regular_polygon(4 + 2 * (i % 3), 0.03), 0.04 + 1e-4 * i))


def plan_or_misbehave(**request: Any) -> dict[str, Any]:
    """What children run: the planner, or what becomes of a bad object."""
    name = Path(request["model"]).stem
    with open(os.environ[LOG], "a") as log:  # noqa: PTH123 - one write, which is atomic
        log.write(f"{name}\n")
    match name.partition("_")[2]:
        case "abort":
            os.abort()
        case "hang":
            time.sleep(1000)
        case "hog":
            blocks = [bytearray(os.urandom(1 << 20)) * 64 for _ in range(10_000)]
            return {"status": "ok", "blocks": len(blocks)}
    print("a library that prints", name)
    return plan_model(**request)


def start_driver(folder: Path, engine: str, seed: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "benchmarks.chaos", "--drive", str(folder)]
    return subprocess.Popen(
        [*command, "--engine", engine, "--seed", str(seed)],
        cwd=ROOT,
        env=os.environ | {LOG: str(folder / "log")},
    )


def drive(folder: Path, engine: str, seed: int) -> None:
    """Runs the batch, as the process that is killed."""
    with ExitStack() as stack:
        executor: Executor | None = None
        if engine == "threads":
            executor = stack.enter_context(ThreadPoolExecutor(SLOTS))
        elif engine == "dask":
            executor = stack.enter_context(dask_under_fire(seed))
        request = make_batch_request(
            folder / "parts",
            folder / "out",
            executor=executor,
            workers=SLOTS,
            timeout=TIMEOUT,
            memory=1 << 30,
            function="benchmarks.chaos:plan_or_misbehave",
            effort="quick",
            top=3,
            **NO_ERRORS,
        )
        run = BatchRun(request)
        for _ in run.rows():
            pass
        if not run.report().complete:
            sys.exit(3)


def dask_under_fire(seed: int) -> Any:
    """A LocalCluster's executor; workers are killed while it runs."""
    distributed = import_module("distributed")
    cluster = distributed.LocalCluster(
        n_workers=SLOTS, threads_per_worker=1, dashboard_address=None, silence_logs=50
    )

    def fire() -> None:
        chance = random.Random(seed)
        for _ in range(KILLED_WORKERS):
            time.sleep(chance.uniform(4.0, 8.0))
            with suppress(Exception):
                worker = chance.choice(list(cluster.workers.values()))
                os.kill(worker.process.process.pid, signal.SIGKILL)

    Thread(target=fire, daemon=True).start()
    return distributed.Client(cluster).get_executor()


def await_start(log: Path, driver: subprocess.Popen[bytes]) -> None:
    """Waits until a child starts an object, or there is nothing left to start."""
    size = log.stat().st_size
    while log.stat().st_size == size and driver.poll() is None:
        time.sleep(0.01)


def descendants(process: int) -> list[int]:
    """The processes below one, as /proc has them."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError, IndexError):
                parents[int(entry.name)] = int(
                    (entry / "stat").read_text().rpartition(")")[2].split()[1]
                )
    found, waiting = [], [process]
    while waiting:
        parent = waiting.pop()
        below = [child for child, its in parents.items() if its == parent]
        found += below
        waiting += below
    return found


def is_alive(process: int) -> bool:
    """Whether a process runs; one that ended, and that nobody has waited for, does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def outlived(processes: list[int]) -> list[str]:
    deadline = time.monotonic() + ALIVE_SECONDS
    while any(map(is_alive, processes)) and time.monotonic() < deadline:
        time.sleep(0.02)
    alive = [process for process in processes if is_alive(process)]
    return [f"{len(alive)} processes outlived a kill by 2 s"] if alive else []


def broken_promises(folder: Path, num_objects: int, kills: int) -> list[str]:
    """What the results lack, and what was started too often."""
    faults: list[str] = []
    rows = {Path(row.source).stem: row for row in read_rows(folder / "out")}
    keys = {row.key for row in rows.values()}
    if len(keys) != num_objects or len(rows) != num_objects:
        faults.append(f"{len(rows)} rows of {len(keys)} keys for {num_objects} objects")
    for name, row in rows.items():
        expected = BAD.get(name.partition("_")[2], "ok")
        if row.status != expected:
            faults.append(f"{name}: {row.status} ({row.reason}), not {expected}")
        elif row.status == "ok":
            file = folder / "out" / "grasps" / f"{row.key}.grasp.yaml"
            if not verify_file(file).holds:
                faults.append(f"{name}: its file does not hold")
    sound = {row.key for row in rows.values() if row.status == "ok"}
    files = {path.name for path in (folder / "out" / "grasps").iterdir()}
    expected_files = {f"{key}.grasp.yaml" for key in sound}
    if files != expected_files:
        faults.append(
            f"files of no row: {files - expected_files}; missing: {expected_files - files}"
        )
    starts = Counter((folder / "log").read_text().split())
    again = sum(n - 1 for name, n in starts.items() if name.endswith("_sound"))
    print(f"sound objects were started again {again} times in {kills} kills", flush=True)
    if again > SLOTS * kills:
        faults.append(f"sound objects were started again {again} times, in {kills} kills")
    return faults


if __name__ == "__main__":
    sys.exit(main())
