"""Connects to a Dask cluster, whose executor then carries chunks (extra [dask])."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from importlib import import_module

from drake_polygrasp.errors import BatchError

_CONNECT_SECONDS = 10
"""Time to connect to a scheduler [s]. Our choice."""


@contextmanager
def dask_executor(address: str) -> Iterator[tuple[Executor, int, Callable[[], None]]]:
    """Connects to a scheduler.

    Args:
        address: the scheduler's address: "tcp://host:8786".

    Yields:
        An executor, its number of worker threads, and a function that raises BatchError where the
        scheduler is lost.

    Raises:
        BatchError: when Dask is not installed, no scheduler answers, or it has no workers.
    """
    try:
        distributed = import_module("distributed")
    except ImportError:
        raise BatchError("--scheduler needs Dask: pip install 'drake_polygrasp[dask]'") from None
    # What lost connections log, errors say in one line; each of its loggers has a level of its own.
    for name in [
        name for name in logging.root.manager.loggerDict if name.startswith("distributed")
    ]:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=_CONNECT_SECONDS)
    except Exception as error:
        raise BatchError(
            f"{address}: no Dask scheduler answers: {' '.join(str(error).split())[:200]}; start "
            "one, or mend the address"
        ) from error

    def check() -> None:
        if client.status != "running":
            raise BatchError(
                f"{address}: the Dask scheduler is lost; start it again and give the same command "
                "again, which goes on from here"
            )

    try:
        threads = sum(client.nthreads().values())
        if threads == 0:
            raise BatchError(f"{address}: the Dask scheduler has no workers; start some")
        yield client.get_executor(), threads, check
    finally:
        with suppress(Exception):
            client.close(timeout=2)
