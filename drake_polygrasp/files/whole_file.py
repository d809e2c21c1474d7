"""Writes text files whole: whoever reads the path finds the old file or the new one."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from drake_polygrasp.errors import GraspFileError


def followed(path: Path) -> Path:
    """Returns the file that a link leads to; relative paths in it start at that file's folder.

    Args:
        path: a file or a link; what is neither stays as it is.
    """
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def is_regular(path: Path) -> bool:
    """Returns whether a path is a regular file, or free to become one.

    Pipes and devices are none, nor is what stands for an open file, such as /dev/stdout.

    Args:
        path: a path, or a link to one.
    """
    folder = os.path.realpath(path.parent)
    if folder in ("/dev", "/dev/fd") or folder.startswith("/proc/"):
        return False
    return path.is_file() or not path.exists()


def write_whole(path: Path, text: str) -> None:
    """Writes a file beside the old one and then replaces that, so that it is never half written.

    Args:
        path: the file; a link stays, and what it leads to is written.
        text: what it will hold.

    Raises:
        GraspFileError: when it cannot be written.
    """
    if not is_regular(path):
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
