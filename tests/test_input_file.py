"""Only what is a file, and of bounded size, is read."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from drake_polygrasp.errors import GraspFileError, ModelError
from drake_polygrasp.input_file import read_bytes


def test_a_file_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "å b"
    path.write_bytes(b"\0\r\n" * 1000)
    assert read_bytes(path, "model", 3000, ModelError) == b"\0\r\n" * 1000


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("gone", "gone: there is no such mesh file; mend the path"),
        ("file/below", "below: cannot be read: Not a directory"),
        ("loop", "loop: cannot be read: Too many levels of symbolic links"),
        (300 * "x", "cannot be read: File name too long"),
        ("null\0", r"null\\x00': is no path: embedded null"),
        (".", "is a folder; name a mesh file"),
        ("pipe", "pipe: is not a regular file"),
        ("large", "large: is larger than 1 MB, the most a mesh file may be; simplify it"),
    ],
)
def test_anything_else_is_named_with_its_fault(tmp_path: Path, name: str, fault: str) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "large").write_bytes(bytes(1_000_001))
    with pytest.raises(GraspFileError, match=fault):
        read_bytes(tmp_path / name, "mesh", 1_000_000, GraspFileError)


def test_a_file_that_may_not_be_read_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path) -> bytes:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    (tmp_path / "secret").write_text("")
    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(ModelError, match="secret: cannot be read: Permission denied"):
        read_bytes(tmp_path / "secret", "model", 1_000_000, ModelError)
