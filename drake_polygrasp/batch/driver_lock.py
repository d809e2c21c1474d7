"""Locks an output, so that one driver writes to it: one in all, or one for each shard."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, Self

from drake_polygrasp.errors import BatchError

_ALL = "driver.lock"
_TRIES = 10
_RETRY_SECONDS = 0.05
"""Who asks which drivers run has their locks for a moment, which is no reason to be refused."""


class DriverLock:
    """The right to write results to a folder; a context manager that gives it back.

    The system frees it when its process dies.

    Args:
        folder: the folder, which is there.
        shard: name of the driver's shard; empty for all objects.
    """

    def __init__(self, folder: Path, shard: str = "") -> None:
        self._folder, self._shard = folder, shard
        self._files: list[IO[str]] = []

    def __enter__(self) -> Self:
        """Takes the lock.

        Raises:
            BatchError: when another driver has it.
        """
        try:
            if self._shard:
                # Shards do not hinder each other, but they do hinder a driver of all objects.
                self._take(_ALL, fcntl.LOCK_SH)
                self._sign(self._take(f"driver-{self._shard}.lock", fcntl.LOCK_EX))
            else:
                self._sign(self._take(_ALL, fcntl.LOCK_EX))
        except BlockingIOError:
            self.__exit__()
            holder = next(iter(running_drivers(self._folder)), "")
            raise BatchError(
                f"{self._folder}: another driver writes there{holder and f' ({holder})'}; wait "
                "for its end, stop it, or name another --out"
            ) from None
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Gives the lock back."""
        for file in self._files:
            file.close()
        self._files.clear()

    def _take(self, name: str, kind: int) -> IO[str]:
        file = (self._folder / name).open("a+", encoding="utf-8")
        self._files.append(file)
        for _ in range(_TRIES - 1):
            with suppress(BlockingIOError):
                fcntl.flock(file, kind | fcntl.LOCK_NB)
                return file
            time.sleep(_RETRY_SECONDS)
        fcntl.flock(file, kind | fcntl.LOCK_NB)
        return file

    def _sign(self, file: IO[str]) -> None:
        file.truncate(0)
        json.dump({"host": socket.gethostname(), "pid": os.getpid(), "shard": self._shard}, file)
        file.flush()


def running_drivers(folder: Path) -> list[str]:
    """Returns who writes to a folder now: host, process and shard of each driver.

    Args:
        folder: the output's folder.
    """
    drivers = []
    for path in sorted(folder.glob("driver*.lock")):
        with suppress(OSError), path.open(encoding="utf-8") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                drivers.append(_holder(file.read()))
    return drivers


def _holder(text: str) -> str:
    try:
        who = json.loads(text)
        shard = f", shard {who['shard']}" if who["shard"] else ""
        return f"host {who['host']}, process {who['pid']}{shard}"
    except (ValueError, KeyError, TypeError):
        return "it has not signed yet"
