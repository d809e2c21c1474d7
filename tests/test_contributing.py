"""What docs/architecture.md and CONTRIBUTING.md say of the house is so, and can be followed."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from drake_polygrasp import load_grasps
from tests.support.grasp_files import write_box
from tests.test_architecture import MAY_IMPORT, PACKAGE, ROOT

ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text()
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()


def test_the_table_of_rooms_is_the_one_that_is_tested() -> None:
    rows = re.findall(r"^\| `(\w+)(?:\.py)?` \| .* \|(.*)\|$", ARCHITECTURE, re.MULTILINE)
    assert {room: set(re.findall(r"`(\w+)`", cell)) for room, cell in rows} == MAY_IMPORT


@pytest.mark.parametrize("page", [ARCHITECTURE, CONTRIBUTING], ids=["architecture", "contributing"])
def test_files_and_functions_that_are_named_are_there(page: str) -> None:
    files = {file for file in re.findall(r"`((?:\w+/)+\w*\.py)`", page) if "NAME" not in file}
    assert len(files) > 5
    assert not [file for file in files if not any((r / file).is_file() for r in (PACKAGE, ROOT))]


def test_an_exporter_as_the_page_has_it_is_one_file_and_one_line(tmp_path: Path) -> None:
    module, line = re.findall(
        r"^```python\n(.*?)^```", ARCHITECTURE.replace("NAME", "points"), re.DOTALL | re.MULTILINE
    )
    room = shutil.copytree(PACKAGE, tmp_path / PACKAGE.name) / "exporters"
    (room / "points.py").write_text(module)
    formats = (room / "__init__.py").read_text()
    start = "FORMATS: dict[str, tuple[str, str]] = {\n"
    assert start in formats
    (room / "__init__.py").write_text(formats.replace(start, start + line))
    box = write_box(tmp_path)
    command = [sys.executable, "-m", PACKAGE.name, "export", str(box), "--points", "box.txt"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    points = [f"box {stated.grasp.p_BC.tolist()}\n" for stated in load_grasps(box).grasps]
    assert (tmp_path / "box.txt").read_text() == "".join(points)
