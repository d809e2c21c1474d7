"""A cluster carries a batch from the command line, and is lost in one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from benchmarks.chaos_moments import descendants
from tests.support.batches import QUICK_OPTIONS, files_of, prism_file

pytest.importorskip("distributed", reason="Dask is optional: pip install '.[dask]'")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads the processes of /proc")
ROOT = Path(__file__).parents[2]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, int, int]]:
    """The address of a scheduler with a worker of two threads, and the processes of both."""
    file = tmp_path / "scheduler.json"
    where = ["--scheduler-file", str(file), "--no-dashboard"]
    started = []
    for program in ("scheduler", "worker"):
        command = [sys.executable, "-m", f"distributed.cli.dask_{program}", *where]
        options = ["--port=0"] if program == "scheduler" else ["--nthreads=2", "--no-nanny"]
        process = subprocess.Popen(
            [*command, *options],
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
        started.append(process)
    wait_for(file.exists)
    text = file.read_text()
    yield text.partition('"address": "')[2].partition('"')[0], started[0].pid, started[1].pid
    for process in started:
        process.kill()
        process.wait()


def test_a_cluster_gives_the_files_of_one_process_until_it_is_lost(
    tmp_path: Path, cluster: tuple[str, int, int]
) -> None:
    address, scheduler, worker = cluster
    for sides in range(4, 18, 2):
        prism_file(tmp_path / "parts", sides)
    command = [sys.executable, "-m", "drake_polygrasp", "batch", "parts", *QUICK_OPTIONS]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    deadline = time.monotonic() + 300
    while True:  # The worker may not have come yet.
        asked = [*command, "--out", "cluster", "--scheduler", address]
        driver = subprocess.Popen(
            asked, cwd=tmp_path, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        with suppress(AssertionError):
            wait_for(lambda: has_task(worker), driver)
            break
        assert "has no workers" in driver.communicate()[1]
        assert time.monotonic() < deadline
    # It is not to hear of all results before the scheduler is lost; the worker goes on.
    driver.send_signal(signal.SIGSTOP)
    wait_for(lambda: any((tmp_path / "cluster").glob("grasps/*.yaml")))
    os.kill(scheduler, signal.SIGKILL)
    driver.send_signal(signal.SIGCONT)
    _, said = driver.communicate(timeout=300)
    assert driver.returncode == 2
    assert said == (
        f"polygrasp: {address}: the Dask scheduler is lost; start it again and give the same "
        "command again, which goes on from here\n"
    )
    # The same command without the cluster goes on.
    for out in ("cluster", "alone"):
        subprocess.run([*command, "--out", out], cwd=tmp_path, env=env, check=True)
    assert files_of(tmp_path / "cluster") == files_of(tmp_path / "alone")


def has_task(worker: int) -> bool:
    """Whether a child of ours runs below it; a worker that starts runs others for a moment."""
    for process in descendants(worker):
        with suppress(OSError):
            if b"drake_polygrasp.batch.child" in Path(f"/proc/{process}/cmdline").read_bytes():
                return True
    return False


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[str] | None = None) -> None:
    deadline = time.monotonic() + 300
    while not condition():
        assert process is None or process.poll() is None, "it has ended"
        assert time.monotonic() < deadline
        time.sleep(0.02)
