"""Kills a batch again and again, and asks whether its promise holds: one result for each object.

    python -m benchmarks.chaos [--objects 500] [--kills 20] [--engine local | threads | dask]

A fifth of the objects abort their process, hang, take all memory or are malformed. The driver is
killed with signal 9 at random moments, and resumed each time; so are children, now and then. With
`--engine dask` the driver goes on, and three workers of its LocalCluster are killed instead.
Moments follow events of the batch, not the clock: so many objects started, a file or a row being
written. Between two kills the children start no more than a share of the objects, so that there is
work left for the last kill on any machine. Then every key has one result, every sound object a
grasp file that verifies, no process has outlived a kill by two seconds, and sound objects were
planned again at most as often as kills can explain.
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
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

from benchmarks.chaos_moments import Progress, await_moment, await_starts, descendants, lines_of
from drake_polygrasp import verify_file
from drake_polygrasp.batch.reading import read_rows
from drake_polygrasp.batch.request import make_batch_request
from drake_polygrasp.batch.run import BatchRun
from drake_polygrasp.batch.worker import plan_model
from drake_polygrasp.settings import NO_ERRORS
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.solids import regular_polygon

ROOT = Path(__file__).resolve().parents[1]
FOLDER = "CHAOS_FOLDER"
"""Environment variable that names the folder in which children say what they start."""
BAD = {"abort": "crash", "hang": "timeout", "hog": "out_of_memory", "broken": "bad_model"}
"""Kinds of objects that end badly, and the status of their results."""
KINDS = ("abort", "hog", "broken", "abort", "hang", "broken", "hog", "abort")
"""Kinds of every fifth object: few hang, for while they do no others are killed at work."""
SLOTS = 2
TIMEOUT = 15.0
"""Time for an object [s], which a sound one is far from taking unless the machine stands still."""
KILLED_WORKERS = 3
ALIVE_SECONDS = 2.0
PATIENCE = 60.0
"""Time for an object after which the driver is taken to hang [s]."""


PATIENT = {
    "distributed.deploy.lost-worker-timeout": "1 hour",
    "distributed.scheduler.worker-ttl": "1 hour",
    "distributed.comm.timeouts.connect": "10 minutes",
    "distributed.comm.timeouts.tcp": "10 minutes",
}
"""Settings by which Dask takes no process of a busy machine for a lost one."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.chaos", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--objects", type=int, default=500, help="how many (default: 500)")
    parser.add_argument("--kills", type=int, help="of drivers (default: 20) or Dask's workers (3)")
    parser.add_argument("--engine", choices=("local", "threads", "dask"), default="local")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--timeout", type=float, default=TIMEOUT, help="of an object [s]")
    parser.add_argument("--drive", metavar="FOLDER", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    num_objects, engine, seed = arguments.objects, arguments.engine, arguments.seed
    timeout = arguments.timeout
    num_kills = arguments.kills or (KILLED_WORKERS if engine == "dask" else 20)
    if share_of_kill(num_objects, num_kills) < 1:
        parser.error(f"{num_kills} kills need more --objects than {num_objects}")
    if arguments.drive is not None:
        drive(arguments.drive, num_objects, num_kills, engine, seed, timeout)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        faults = chaos(Path(folder), num_objects, num_kills, engine, seed, timeout=timeout)
    print(*faults or ["the promise holds"], sep="\n")
    return 1 if faults else 0


def share_of_kill(num_objects: int, num_kills: int) -> int:
    """How many objects may be started before each kill, so that some are left after the last.

    Those that wait to be allowed have started too, one in each slot.
    """
    return (num_objects - 1 - SLOTS * (num_kills - 1)) // num_kills


def chaos(
    folder: Path,
    num_objects: int,
    num_kills: int,
    engine: str,
    seed: int,
    alive_seconds: float = ALIVE_SECONDS,
    timeout: float = TIMEOUT,
) -> list[str]:
    """Runs a batch to its end through kills, and returns how its promise is broken."""
    write_library(folder / "parts", num_objects)
    progress, share = Progress(folder), share_of_kill(num_objects, num_kills)
    chance, moments = random.Random(seed), Counter[str]()
    faults, kills = [], 0
    options = ["--objects", str(num_objects), "--kills", str(num_kills), "--engine", engine]
    options += ["--timeout", str(timeout)]
    start = time.monotonic()
    while engine != "dask" and kills < num_kills:
        progress.allow(progress.starts + share)
        driver = start_driver(folder, [*options, "--seed", str(seed + kills)])
        moments[await_moment(progress, share, chance, driver)] += 1
        if driver.poll() is not None:
            return [f"the driver ended before kill {kills + 1}: {said_by(folder)}"]
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
        faults += outlived(below, alive_seconds)
    if engine != "dask":
        progress.allow(None)
    driver = start_driver(folder, [*options, "--seed", str(seed + kills)])
    try:
        code = driver.wait(PATIENCE * num_objects)
    except subprocess.TimeoutExpired:
        driver.kill()
        code = driver.wait()
    if code != 0:
        return [*faults, f"the driver ended with {code}: {said_by(folder)}"]
    kills += progress.killed_workers
    if kills < num_kills:
        faults.append(f"only {kills} kills")
    seconds = time.monotonic() - start
    when = ", ".join(f"{count} {moment}" for moment, count in sorted(moments.items()))
    print(f"{engine}: {num_objects} objects, {kills} kills, {seconds:.0f} s; drivers: {when or 0}")
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
    name, progress = Path(request["model"]).stem, Progress(Path(os.environ[FOLDER]))
    adopts = bool(request.get("file"))
    if not adopts:
        progress.add_start(name)
        while progress.is_held():
            time.sleep(0.01)
    match name.partition("_")[2]:
        case "abort":
            os.abort()
        case "hang":
            time.sleep(1000)
        case "hog":
            blocks = [bytearray(os.urandom(1 << 20)) * 64 for _ in range(10_000)]
            return {"status": "ok", "blocks": len(blocks)}
    print("a library that prints", name)
    row = plan_model(**request)
    if adopts and "text" in row:  # It was planned again, for the file did not hold.
        progress.add_start(name)
    return row


def start_driver(folder: Path, options: list[str]) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "benchmarks.chaos", "--drive", str(folder), *options]
    with (folder / "said").open("wb") as said:
        return subprocess.Popen(
            command,
            cwd=ROOT,
            env=os.environ | {FOLDER: str(folder)},
            stdout=said,
            stderr=said,
        )


def said_by(folder: Path) -> str:
    """The last lines that the last driver printed."""
    return " | ".join((folder / "said").read_text(errors="replace").splitlines()[-10:])


def drive(
    folder: Path, num_objects: int, num_kills: int, engine: str, seed: int, timeout: float
) -> None:
    """Runs the batch, as the process that is killed."""
    with ExitStack() as stack:
        executor: Executor | None = None
        if engine == "threads":
            executor = stack.enter_context(ThreadPoolExecutor(SLOTS))
        elif engine == "dask":
            share = share_of_kill(num_objects, num_kills)
            executor = stack.enter_context(dask_under_fire(folder, share, num_kills, seed))
        request = make_batch_request(
            folder / "parts",
            folder / "out",
            executor=executor,
            workers=SLOTS,
            timeout=timeout,
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


@contextmanager
def dask_under_fire(folder: Path, share: int, num_kills: int, seed: int) -> Iterator[Executor]:
    """A LocalCluster's executor; workers are killed while it runs."""
    distributed = import_module("distributed")
    import_module("dask").config.set(PATIENT)
    progress, chance = Progress(folder), random.Random(seed)

    def wait_for(event: Callable[[], bool]) -> None:
        while not (event() or progress.is_held()):
            time.sleep(0.01)

    def fire() -> None:
        for _ in range(num_kills):
            progress.allow(progress.starts + share)
            await_starts(progress, share, chance, wait_for)
            time.sleep(chance.uniform(0.0, 0.3))
            while not kill_worker():  # One that starts has no process yet.
                time.sleep(0.01)
            progress.add_killed_worker()
        progress.allow(None)

    def kill_worker() -> bool:
        with suppress(Exception):
            worker = chance.choice(list(cluster.workers.values()))
            os.kill(worker.process.process.pid, signal.SIGKILL)
            return True
        return False

    progress.allow(0)
    with (
        distributed.LocalCluster(
            n_workers=SLOTS, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        Thread(target=fire, daemon=True).start()
        yield client.get_executor()


def is_alive(process: int) -> bool:
    """Whether a process runs; one that ended, and that nobody has waited for, does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def outlived(processes: list[int], seconds: float) -> list[str]:
    deadline = time.monotonic() + seconds
    while any(map(is_alive, processes)) and time.monotonic() < deadline:
        time.sleep(0.02)
    alive = [process for process in processes if is_alive(process)]
    return [f"{len(alive)} processes outlived a kill by {seconds:g} s"] if alive else []


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
    starts = Counter(lines_of(folder / "starts"))
    again = sum(n - 1 for name, n in starts.items() if name.endswith("_sound"))
    print(f"sound objects were planned again {again} times in {kills} kills", flush=True)
    if again > SLOTS * kills:
        faults.append(f"sound objects were planned again {again} times, in {kills} kills")
    return faults


if __name__ == "__main__":
    sys.exit(main())
