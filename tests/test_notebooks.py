"""Every notebook is stored with small outputs, and executing it anew gives the same text."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))

pytest.importorskip("nbclient", reason="nbclient runs notebooks: pip install -e '.[test]'")
pytest.importorskip("ipykernel", reason="notebooks need a kernel: pip install -e '.[test]'")
import nbformat  # noqa: E402 - comes with nbclient

NEEDS = {"07_a_data_set": ("pandas", "pyarrow")}
"""What a notebook needs beside the package, by its name."""
OF_ONE_RUN = r"localhost|127\.0\.0\.1|/tmp/|/home/|/root/|0x[0-9a-f]{6,}|<script|<iframe"


@pytest.fixture(scope="module")
def execute() -> Any:
    spec = importlib.util.spec_from_file_location("execute", ROOT / "notebooks" / "execute.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_is_stored_with_outputs_that_a_code_host_shows(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    outputs = [o for c in notebook.cells if c.cell_type == "code" for o in c.outputs]
    kinds = {kind for output in outputs for kind in output.get("data", {"stream": None})}
    assert "stream" in kinds and kinds <= {"stream", "text/plain", "image/png"}
    texts = [o.get("text") or o["data"].get("text/plain", "") for o in outputs]
    assert not [text for text in texts if re.search(OF_ONE_RUN, text)]
    assert not [output for output in outputs if output.output_type == "error"]
    assert path.stat().st_size < 500_000


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_executed_anew_a_notebook_prints_the_same_and_leaves_nothing(
    path: Path, execute: Any
) -> None:
    for package in NEEDS.get(path.stem, ()):
        pytest.importorskip(package, reason=f"it uses {package}: pip install -e '.[test]'")
    stored = execute.text_of(nbformat.read(path, as_version=4))
    assert execute.text_of(execute.execute(path)) == stored
