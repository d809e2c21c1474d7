"""Executes the notebooks and stores their outputs: `python notebooks/execute.py [NAME ...]`.

Text stays as it is printed; figures become small pictures of few colours. Nothing is stored that
differs from run to run.
"""

from __future__ import annotations

import base64
import io
import os
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import nbclient
import nbformat
from PIL import Image
from traitlets.config import Config

HERE = Path(__file__).parent
_COLOURS = 48
_PATIENCE = 1200
"""Longest time of a cell, of the kernel's start and of what it still has to print [s]."""


def execute(path: Path) -> Any:
    """Returns a notebook as executed in an empty folder, which it leaves empty.

    Args:
        path: the notebook.

    Raises:
        RuntimeError: when it leaves files.
    """
    # What it imports is what stands here, wherever its kernel starts.
    os.environ["PYTHONPATH"] = f"{HERE.parent}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    notebook = nbformat.read(path, as_version=4)
    patience = dict.fromkeys(("timeout", "startup_timeout", "iopub_timeout"), _PATIENCE)
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as sockets:
        # Files as sockets: a port that is free may be taken before the kernel takes it.
        kernel = {"transport": "ipc", "ip": f"{sockets}/kernel"}
        config = Config({"KernelManager": kernel})
        resources = {"metadata": {"path": folder}}
        nbclient.NotebookClient(notebook, config=config, resources=resources, **patience).execute()
        if left := sorted(file.name for file in Path(folder).iterdir()):
            raise RuntimeError(f"{path.name} leaves {', '.join(left)}")
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # when it ran
        if cell.cell_type == "code":
            cell.outputs = _joined(filter(_is_shown, cell.outputs))
            cell.outputs = [_stored(output) for output in cell.outputs]
    return notebook


def text_of(notebook: Any) -> list[list[str]]:
    """Returns the text of each code cell's outputs; pictures are not compared.

    Args:
        notebook: an executed notebook.
    """
    return [
        [output.get("text") or output["data"].get("text/plain", "") for output in cell.outputs]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def _is_shown(output: Any) -> bool:
    """Returns whether an output is for readers: what is logged is not, and names ports."""
    return output.get("name") != "stderr"


def _joined(outputs: Iterable[Any]) -> list[Any]:
    """Joins what is printed in a row, since the kernel cuts it where it happens to."""
    joined: list[Any] = []
    for output in outputs:
        if joined and output.output_type == joined[-1].output_type == "stream":
            joined[-1].text += output.text
        else:
            joined.append(output)
    return joined


def _stored(output: Any) -> Any:
    """Makes an output small: plain text, and pictures of few colours without a description."""
    data = output.get("data")
    if data is None:
        return output
    data.pop("text/html", None)
    output.get("metadata", {}).clear()
    if "image/png" in data:
        data.pop("text/plain", None)
        picture = Image.open(io.BytesIO(base64.b64decode(data["image/png"]))).convert("RGB")
        small = io.BytesIO()
        picture.quantize(_COLOURS, dither=Image.Dither.NONE).save(small, "png", optimize=True)
        data["image/png"] = base64.b64encode(small.getvalue()).decode()
    return output


def main(names: list[str]) -> None:
    """Executes and stores notebooks.

    Args:
        names: their names without suffix; all if there are none.
    """
    for path in sorted(HERE.glob("*.ipynb")):
        if not names or path.stem in names:
            nbformat.write(execute(path), path)
            print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
