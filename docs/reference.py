"""Builds the reference from docstrings: `python docs/reference.py [DIRECTORY]`.

Needs pdoc: `pip install '.[docs]'`.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import pdoc

import drake_polygrasp
from drake_polygrasp import arrays

PAGES = {
    "drake_polygrasp": (
        "arrays",
        "certification",
        "geometry",
        "grasp",
        "grasp_file",
        "planning",
        "plant_results",
        "plant_verdicts",
        "progress",
        "stated_grasp",
        "verification",
        "visualization",
        "wrench",
    ),
    "drake_polygrasp.geometry": ("polyhedron", "primitives"),
    "drake_polygrasp.visualization": ("explanation", "figures", "palette", "scene", "sketch"),
}
"""Of each package the modules that users meet; of other packages, all."""


def build(directory: Path) -> None:
    """Writes the pages; open `index.html`."""
    for name in ("Array", "Bools", "Ints"):
        # Before anything refers to them: signatures then have the name, not what NumPy spells out.
        meaning = {"__module__": arrays.__name__, "__doc__": f"`{getattr(arrays, name)}`"}
        setattr(arrays, name, type(name, (), meaning))
    for name in drake_polygrasp.__all__:
        # pdoc takes no notice of __getattr__.
        setattr(drake_polygrasp, name, getattr(drake_polygrasp, name))
    for name, modules in PAGES.items():
        package = import_module(name)
        package.__all__ = [*getattr(package, "__all__", ()), *modules]
    pdoc.render.configure(docformat="google", show_source=False)
    pdoc.pdoc("drake_polygrasp", output_directory=directory)


if __name__ == "__main__":
    build(Path(sys.argv[1] if len(sys.argv) > 1 else "build/reference"))
