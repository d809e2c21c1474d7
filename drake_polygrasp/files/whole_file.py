"""Writes text files whole: whoever reads the path finds the old file or the new one."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from drake_polygrasp.errors import GraspFileError


def write_whole(path: Path, text: str) -> None:
    """Writes a file beside the old one and then replaces that, so that it is never half written.

    Args:
        path: the file.
        text: what it will hold.

    Raises:
        GraspFileError: when it cannot be written.
    """
    if path.exists() and not path.is_file():
        raise GraspFileError(f"{path}: cannot be written: it is not a regular file")
    scratch = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        scratch.write_text(text, encoding="utf-8")
        scratch.replace(path)
    except OSError as error:
        raise GraspFileError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)
