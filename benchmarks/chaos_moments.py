"""When `benchmarks.chaos` kills: at events of the batch, which it lets go on only so far."""

from __future__ import annotations

import random
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path


class Progress:
    """What a batch has done, in a folder that its processes share, and how far it may go on."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def starts(self) -> int:
        """How often children have started to plan an object."""
        return len(lines_of(self.folder / "starts"))

    @property
    def killed_workers(self) -> int:
        """How many workers of Dask were killed."""
        return len(lines_of(self.folder / "killed"))

    def allow(self, starts: int | None) -> None:
        """Lets children start objects until there are so many starts; None lets them start all."""
        scratch = self.folder / "allowed.tmp"
        scratch.write_text("" if starts is None else str(starts))
        scratch.replace(self.folder / "allowed")

    def is_held(self) -> bool:
        """Whether a child waits to be allowed to start."""
        allowed = (self.folder / "allowed").read_text()
        return allowed != "" and self.starts > int(allowed)

    def add_start(self, name: str) -> None:
        """Says that a child starts to plan an object."""
        add_line(self.folder / "starts", name)

    def add_killed_worker(self) -> None:
        """Says that a worker of Dask was killed."""
        add_line(self.folder / "killed", "worker")


def add_line(path: Path, line: str) -> None:
    with path.open("a") as file:  # One write, which is atomic.
        file.write(f"{line}\n")


def lines_of(path: Path) -> list[str]:
    with suppress(FileNotFoundError):
        return path.read_text().split()
    return []


def await_moment(
    progress: Progress, share: int, chance: random.Random, driver: subprocess.Popen[bytes]
) -> str:
    """Waits for an event of the batch, chosen at random, and for a moment more; returns which."""

    def wait_for(event: Callable[[], bool]) -> None:
        while not (event() or progress.is_held()) and driver.poll() is None:
            time.sleep(0.001)

    # Most are killed when children work; some while they start, or before there are any.
    if chance.random() < 0.2:
        wait_for(chance.choice((lambda: True, lambda: bool(descendants(driver.pid)))))
        time.sleep(chance.uniform(0.0, 1.0))
        return "before objects"
    await_starts(progress, share, chance, wait_for)
    out = progress.folder / "out"
    written = chance.choice((None, out / "grasps", out / "results.sqlite-wal"))
    if written is not None:
        before = modified(written)
        wait_for(lambda: modified(written) != before)
    time.sleep(chance.choice((0.0, 0.002, 0.3)) * chance.random())
    return "at work" if written is None else f"at {written.name}"


def await_starts(
    progress: Progress,
    share: int,
    chance: random.Random,
    wait_for: Callable[[Callable[[], bool]], None],
) -> None:
    """Waits until children have started some objects, chosen at random within a kill's share."""
    wanted = progress.starts + chance.randint(1, share)
    wait_for(lambda: progress.starts >= wanted)


def modified(path: Path) -> int:
    """When a file or folder was changed last [ns]; 0 where there is none."""
    with suppress(FileNotFoundError):
        return path.stat().st_mtime_ns
    return 0


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
