"""Files that tests write."""

from __future__ import annotations

from pathlib import Path


def write_all(folder: Path, files: dict[str, str]) -> None:
    """Writes text to files below a folder, by their paths in it."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
