"""The results of a batch: one row for each object, in SQLite, beside the grasp files.

A grasp file is committed before its row. Where a driver dies between the two, the next one finds a
file without a row, and adopts it.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import astuple
from pathlib import Path
from typing import Any, Self

from drake_polygrasp.batch.driver_lock import DriverLock
from drake_polygrasp.batch.reading import TABLES, connect_to_rows, has_rows, row_files
from drake_polygrasp.batch.rows import BatchRow
from drake_polygrasp.errors import BatchError


class Store:
    """The rows of an output, for the one driver that writes them; a context manager.

    Args:
        folder: folder of the rows, made where it is not there.
        shard: name of the driver's shard; empty for all objects.
    """

    def __init__(self, folder: Path, shard: str = "") -> None:
        self._folder, self._shard = folder, shard
        self._lock = DriverLock(folder, shard)
        self._others: list[sqlite3.Connection] = []

    def __enter__(self) -> Self:
        """Takes the output's lock and opens the rows.

        Raises:
            BatchError: when another driver writes there, or the folder cannot be written.
        """
        with self._failing():
            (self._folder / "grasps").mkdir(parents=True, exist_ok=True)
        with self._failing():
            self._lock.__enter__()
        try:
            with self._failing():
                self._open()
        except BaseException:
            self._lock.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Closes the rows and gives the lock back."""
        for connection in (self._rows, *self._others):
            with suppress(sqlite3.Error):
                connection.commit()
            with suppress(sqlite3.Error):
                connection.close()
        self._lock.__exit__()

    def _open(self) -> None:
        own = self._folder / _file_name(self._shard)
        self._rows = sqlite3.connect(own, isolation_level=None, check_same_thread=False)
        self._rows.execute("PRAGMA journal_mode=WAL")
        # Rows that a power failure takes are made again of their files.
        self._rows.execute("PRAGMA synchronous=NORMAL")
        self._rows.executescript(TABLES)
        asked = "SELECT coalesce(max(run), 0) + 1 FROM objects"
        self._run = self._rows.execute(asked).fetchone()[0]
        others = [path for path in row_files(self._folder) if path != own and has_rows(path)]
        self._others = [connect_to_rows(path) for path in others]

    def status_of(self, key: str) -> str | None:
        """Returns the status of a key's result, of this driver or another; None where none is.

        Args:
            key: the key.
        """
        found = self._find("SELECT status FROM results WHERE key = ?", key)
        return None if found is None else str(found[0])

    def attempts_of(self, key: str) -> int:
        """Returns how often planning of a key's object was started for the result that there is.

        Args:
            key: the key.
        """
        found = self._find("SELECT attempts FROM results WHERE key = ?", key)
        return 0 if found is None else int(found[0])

    def bodies_of(self, key: str) -> list[str]:
        """Returns the bodies of a model that is known to have several; empty for others.

        Args:
            key: the model's key.
        """
        found = self._find("SELECT bodies FROM models WHERE key = ?", key)
        return [] if found is None else list(json.loads(found[0]))

    def _find(self, query: str, key: str) -> tuple[Any, ...] | None:
        with self._failing():
            for connection in (self._rows, *self._others):
                if (row := connection.execute(query, (key,)).fetchone()) is not None:
                    found: tuple[Any, ...] = row
                    return found
        return None

    def keep_bodies(self, key: str, bodies: list[str], source: str) -> None:
        """Keeps that a model has several bodies, each an object of its own.

        Args:
            key: the model's key.
            bodies: their names.
            source: the model as it was named.
        """
        with self._failing(), self._transaction():
            self._rows.execute("REPLACE INTO models VALUES (?, ?)", (key, json.dumps(bodies)))
            self._rows.execute("DELETE FROM objects WHERE source = ?", (_plain(source),))

    def keep_object(self, source: str, body: str, key: str) -> None:
        """Keeps which key an object has now.

        Args:
            source: the model as it was named.
            body: name of the body where the model has several; empty otherwise.
            key: the key.
        """
        values = (_plain(source), body, key, self._run)
        with self._failing():
            # It is committed with the next row, or at the end: thousands may have their results.
            if not self._rows.in_transaction:
                self._rows.execute("BEGIN")
            self._rows.execute("REPLACE INTO objects VALUES (?, ?, ?, ?)", values)

    def keep_row(self, row: BatchRow) -> None:
        """Commits a result.

        Args:
            row: the result, in place of an earlier one of its key.
        """
        values = [_plain(value) for value in astuple(row)]
        marks = ", ".join("?" * len(values))
        with self._failing(), self._transaction():
            self._rows.execute(f"REPLACE INTO results VALUES ({marks})", values)

    def keep_fact(self, name: str, value: float) -> None:
        """Keeps a number about the batch.

        Args:
            name: what it is.
            value: the number.
        """
        with self._failing():
            self._rows.execute("REPLACE INTO facts VALUES (?, ?)", (name, value))

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        if not self._rows.in_transaction:
            self._rows.execute("BEGIN")
        try:
            yield
            self._rows.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                self._rows.execute("ROLLBACK")
            raise

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """Turns errors of files and of SQLite into one line."""
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            raise BatchError(
                f"{self._folder}: results cannot be written: {reason}; mend that and give the same "
                "command again, which goes on from here"
            ) from error


def _file_name(shard: str) -> str:
    return f"results-{shard}.sqlite" if shard else "results.sqlite"


def _plain(value: Any) -> Any:
    """Returns text that SQLite takes: file names may hold bytes that are no text."""
    if isinstance(value, str):
        return value.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    return value
