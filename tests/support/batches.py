"""Small libraries of objects for batches, among them some that end badly."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from drake_polygrasp.batch.reading import read_rows
from drake_polygrasp.batch.rows import BatchRow
from drake_polygrasp.settings import NO_ERRORS
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.solids import regular_polygon

QUICK: dict[str, Any] = {
    "effort": "quick",
    "top": 2,
    "workers": 2,
    "timeout": 3600.0,  # No machine is too slow.
    **NO_ERRORS,
}
"""Arguments of batches whose grasps do not matter."""
QUICK_OPTIONS = [
    *("--effort=quick", "--top=2", "--workers=2", "--timeout=3600"),
    *(f"--{name.replace('_', '-')}=0" for name in NO_ERRORS),
]
"""The same as options of the command."""
LINK = """\
<link name="{name}"><pose>0 0 {z} 0 0 0</pose><collision name="c"><geometry><box>
<size>0.1 0.1 {height}</size></box></geometry></collision></link>
"""


def prism_file(folder: Path, sides: int, height: float = 0.06) -> Path:
    """Writes a regular prism, an object that is planned in tenths of a second."""
    file = folder / f"prism_{sides}.obj"
    folder.mkdir(exist_ok=True)
    write_obj(file, prism(regular_polygon(sides, 0.04), height))
    return file


def two_bodies(folder: Path) -> Path:
    """Writes a model of two bodies, "low" and "high"."""
    file = folder / "two.sdf"
    folder.mkdir(exist_ok=True)
    links = LINK.format(name="low", z=0, height=0.1) + LINK.format(name="high", z=1, height=0.2)
    file.write_text(f'<sdf version="1.9"><model name="two">{links}</model></sdf>')
    return file


def rows_of(out: Path) -> dict[str, BatchRow]:
    """Rows by the names of their sources, with bodies where there are several of a source."""
    rows = list(read_rows(out))
    sources = [row.source for row in rows]
    return {
        Path(row.source).name + (f":{row.body}" if sources.count(row.source) > 1 else ""): row
        for row in rows
    }


def files_of(out: Path) -> dict[str, bytes]:
    """What each grasp file holds; anything else in the folder is a fault."""
    return {path.name: path.read_bytes() for path in (out / "grasps").iterdir()}
