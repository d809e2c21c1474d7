"""Reads files from anyone: whole, of bounded size, and only what is a file."""

from __future__ import annotations

import stat
from pathlib import Path

from drake_polygrasp.errors import PolygraspError


def read_bytes(path: Path, kind: str, max_bytes: int, error: type[PolygraspError]) -> bytes:
    """The content of a file of some kind ("model", "mesh"), or `error` saying why there is none.

    A pipe or a device is refused, for reading it may never end.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise error(f"{path}: is a folder; name a {kind} file")
        if not stat.S_ISREG(status.st_mode):
            raise error(f"{path}: is not a regular file; name a {kind} file")
        if status.st_size > max_bytes:
            raise error(
                f"{path}: is larger than {max_bytes // 1_000_000} MB, the most a {kind} file may "
                "be; simplify it"
            )
        return path.read_bytes()
    except FileNotFoundError:
        raise error(f"{path}: there is no such {kind} file; mend the path") from None
    except OSError as failure:
        raise error(f"{path}: cannot be read: {failure.strerror}; mend the path") from None
    except ValueError as failure:  # A null character.
        raise error(f"{str(path)!r}: is no path: {failure}") from None
