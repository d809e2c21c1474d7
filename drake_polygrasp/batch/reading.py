"""Reads the rows of an output, of all its drivers together."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import fields
from pathlib import Path

from drake_polygrasp.batch.rows import BatchRow
from drake_polygrasp.errors import BatchError

_COLUMNS = tuple(field.name for field in fields(BatchRow))
TABLES = f"""
CREATE TABLE IF NOT EXISTS results ({", ".join(_COLUMNS)}, PRIMARY KEY (key));
CREATE INDEX IF NOT EXISTS by_status ON results (status);
CREATE INDEX IF NOT EXISTS by_epsilon ON results (epsilon);
CREATE TABLE IF NOT EXISTS objects (source, body, key, run, PRIMARY KEY (source, body));
CREATE INDEX IF NOT EXISTS by_key ON objects (key);
CREATE TABLE IF NOT EXISTS models (key PRIMARY KEY, bodies);
CREATE TABLE IF NOT EXISTS facts (name PRIMARY KEY, value);
"""
"""Results by key; what each object's key is now, and which run met it last; the bodies of models
that have several; numbers about the batch."""
IS_CURRENT = "key IN (SELECT key FROM objects)"
"""Leaves out results of earlier contents, options and versions of objects."""

IS_LATEST = "run = (SELECT max(run) FROM objects)"
"""Leaves out objects that the latest run has not met."""


def row_files(folder: Path) -> list[Path]:
    """Returns the files of rows in a folder: that of all objects and those of shards.

    Args:
        folder: the output's folder.
    """
    return sorted(folder.glob("results*.sqlite"))


def connect_to_rows(path: Path) -> sqlite3.Connection:
    """Opens a file of rows for reading only, where the folder cannot be written too.

    Args:
        path: the file.

    Returns:
        The connection; sqlite3.Error is raised where it cannot be read.
    """
    connection = sqlite3.connect(_uri(path), uri=True, check_same_thread=False)
    try:
        connection.execute("SELECT 1 FROM results LIMIT 1").fetchone()
    except sqlite3.OperationalError:
        connection.close()
        uri = f"{_uri(path)}&immutable=1"
        connection = sqlite3.connect(uri, uri=True, check_same_thread=False)
        connection.execute("SELECT 1 FROM results LIMIT 1").fetchone()
    return connection


def has_rows(path: Path) -> bool:
    """Returns whether a file of rows can be read; that of a driver which just starts cannot yet.

    Args:
        path: the file.
    """
    try:
        connect_to_rows(path).close()
    except sqlite3.Error:
        return False
    return True


@contextmanager
def open_rows(folder: Path) -> Iterator[sqlite3.Connection]:
    """Opens the rows of an output for reading, also while drivers write.

    Args:
        folder: the output's folder.

    Yields:
        A connection to all rows, gathered from the files of shards where there are several.

    Raises:
        BatchError: when there are none, or they cannot be read.
    """
    files = row_files(folder)
    if not files:
        raise BatchError(f"{folder}: has no results of a batch; name the --out of one")
    try:
        with closing(connect_to_rows(files[0]) if len(files) == 1 else _gather(files)) as rows:
            yield rows
    except sqlite3.Error as error:
        raise BatchError(
            f"{folder}: its results cannot be read: {error}; copy them where they can be written"
        ) from error


def _gather(files: list[Path]) -> sqlite3.Connection:
    """Copies the rows of several files to a temporary one; what was written last counts."""
    rows = sqlite3.connect("", isolation_level=None, uri=True)
    rows.executescript(TABLES)
    for path in sorted(filter(has_rows, files), key=lambda file: file.stat().st_mtime):
        rows.execute("ATTACH ? AS file", (_uri(path),))
        rows.execute("BEGIN")
        for table in ("results", "facts"):
            rows.execute(f"REPLACE INTO {table} SELECT * FROM file.{table}")
        # Of each file, its own last run counts.
        latest = "run = (SELECT max(run) FROM file.objects)"
        objects = f"SELECT source, body, key, {latest} FROM file.objects"
        rows.execute(f"REPLACE INTO objects {objects}")
        rows.execute("COMMIT")
        rows.execute("DETACH file")
    return rows


def _uri(path: Path) -> str:
    return f"{path.absolute().as_uri()}?mode=ro"


def select_rows(
    rows: sqlite3.Connection, order: str, most: int = -1, condition: str = IS_CURRENT
) -> Iterator[BatchRow]:
    """Selects results.

    Args:
        rows: the rows, as `open_rows` yields them.
        order: SQL of their order.
        most: greatest number of rows; -1 for all.
        condition: SQL of what they satisfy.

    Yields:
        The rows.
    """
    columns = ", ".join(_COLUMNS)
    query = f"SELECT {columns} FROM results WHERE {condition} ORDER BY {order} LIMIT {most}"
    with closing(rows.execute(query)) as found:
        for values in found:
            yield BatchRow(**dict(zip(_COLUMNS, values, strict=True)))


def read_rows(out_folder: Path) -> Iterator[BatchRow]:
    """Reads the results of an output, without those of earlier contents and options.

    Args:
        out_folder: the output's folder.

    Yields:
        Rows, by source and body.
    """
    with open_rows(out_folder) as rows:
        yield from select_rows(rows, "source, body")
