"""Writes text files whole: whoever reads the path finds the old file or the new one."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from drake_polygrasp.errors import GraspFileError


def followed(path: Path) -> Path:
    """Returns the file that a link leads to, whose folder relative paths in it are meant from.

    Args:
        path: a file or a link; what is neither stays as it is.
    """
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _is_open_file(path: Path) -> bool:
    """Returns whether a path, such as /dev/stdout, stands for an open file, which has no folder."""
    folder = os.path.realpath(path.parent)
    return folder in ("/dev", "/dev/fd") or folder.startswith("/proc/")


def write_whole(path: Path, text: str) -> None:
    """Writes a file beside the old one and then replaces that, so that it is never half written.

    Args:
        path: the file; a link stays, and what it leads to is written.
        text: what it will hold.

    Raises:
        GraspFileError: when it cannot be written.
    """
    if (path.exists() and not path.is_file()) or _is_open_file(path):
        raise GraspFileError(f"{path}: cannot be written: it is not a regular file")
    path = followed(path)
    scratch = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        scratch.write_text(text, encoding="utf-8")
        scratch.replace(path)
    except OSError as error:
        raise GraspFileError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)
