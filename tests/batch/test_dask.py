"""A cluster carries a batch from the command line, and is lost in one line."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks.chaos import PATIENT
from benchmarks.chaos_moments import Progress
from tests.support.batches import QUICK_OPTIONS, files_of, prism_file
from tests.support.held_batch import held_command, held_environment

pytest.importorskip("distributed", reason="Dask is optional: pip install '.[dask]'")


class Cluster(NamedTuple):
    """A scheduler with a worker of two threads."""

    address: str
    scheduler: subprocess.Popen[bytes]
    worker: subprocess.Popen[bytes]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    file, started = tmp_path / "scheduler.json", []

    def start(program: str, *options: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{program}", "--no-dashboard"]
        environment = held_environment(tmp_path) | ENVIRONMENT
        process = subprocess.Popen([*command, *options], stderr=subprocess.DEVNULL, env=environment)
        started.append(process)
        return process

    try:
        scheduler = start("scheduler", "--port=0", "--scheduler-file", str(file))
        wait_for(lambda: written_address(file) != "", scheduler)
        address = written_address(file)
        worker = start("worker", address, "--nthreads=2", "--no-nanny")
        yield Cluster(address, scheduler, worker)
    finally:
        for process in started:
            process.kill()
            process.wait()


ENVIRONMENT = {
    f"DASK_{name.replace('.', '__').replace('-', '_').upper()}": value
    for name, value in PATIENT.items()
}
"""Variables that say what `PATIENT` does."""


def written_address(file: Path) -> str:
    """The scheduler's address; empty until its file is there and whole."""
    try:
        return str(json.loads(file.read_text())["address"])
    except (FileNotFoundError, ValueError):
        return ""


def test_a_cluster_gives_the_files_of_one_process_until_it_is_lost(
    tmp_path: Path, cluster: Cluster
) -> None:
    for sides in range(4, 18, 2):
        prism_file(tmp_path / "parts", sides)
    # Of seven objects, in chunks of four and three, so few are planned that no chunk is done.
    progress, said = Progress(tmp_path), tmp_path / "said"
    progress.allow(2)
    options = ("parts", *QUICK_OPTIONS, "--out", "cluster", "--scheduler", cluster.address)
    deadline = time.monotonic() + 600
    while True:
        with said.open("w") as stderr:
            driver = subprocess.Popen(
                held_command(*options),
                cwd=tmp_path,
                env=held_environment(tmp_path) | ENVIRONMENT,
                stderr=stderr,
            )
        wait_for(partial(is_held_or_over, progress, driver), cluster.worker)
        if driver.poll() is None:
            break
        # The worker may not have come yet, and the scheduler may be slow.
        assert "has no workers" in said.read_text() or "no Dask scheduler" in said.read_text()
        assert time.monotonic() < deadline
    wait_for(lambda: any((tmp_path / "cluster").glob("grasps/*.yaml")), driver)
    cluster.scheduler.kill()
    assert driver.wait() == 2
    assert said.read_text() == (
        f"polygrasp: {cluster.address}: the Dask scheduler is lost; start it again and give the "
        "same command again, which goes on from here\n"
    )
    assert len(files_of(tmp_path / "cluster")) < 7
    # The same command without the cluster goes on.
    cluster.worker.kill()
    command = [sys.executable, "-m", "drake_polygrasp", "batch", "parts", *QUICK_OPTIONS]
    for out in ("cluster", "alone"):
        environment = held_environment(tmp_path)
        subprocess.run([*command, "--out", out], cwd=tmp_path, env=environment, check=True)
    assert files_of(tmp_path / "cluster") == files_of(tmp_path / "alone")


def is_held_or_over(progress: Progress, driver: subprocess.Popen[bytes]) -> bool:
    return progress.is_held() or driver.poll() is not None


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + 600
    while not condition():
        assert process.poll() is None, "it has ended"
        assert time.monotonic() < deadline
        time.sleep(0.02)
