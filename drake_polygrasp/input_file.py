"""Reads untrusted files: regular files only, of bounded size."""

from __future__ import annotations

import stat
from pathlib import Path

from drake_polygrasp.errors import PolygraspError


def read_bytes(path: Path, kind: str, max_bytes: int, error: type[PolygraspError]) -> bytes:
    """Returns the content of a regular file; a pipe or a device, which may never end, is refused.

    Args:
        path: the file.
        kind: what messages call it: "model", "mesh".
        max_bytes: greatest size.
        error: type of the error to raise.

    Raises:
        PolygraspError: of type `error`, when there is no such file, it is not a regular file,
            larger than `max_bytes`, or cannot be read.
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
    except ValueError as failure:  # A null character in the path.
        raise error(f"{str(path)!r}: is no path: {failure}") from None
