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
        "arguments",
        "arrays",
        "certification",
        "exporters",
        "files",
        "geometry",
        "grasp",
        "optimality",
        "paper",
        "pipeline",
        "plant",
        "search",
        "verification",
        "visualization",
        "wrenches",
    ),
    "drake_polygrasp.exporters": ("directives",),
    "drake_polygrasp.files": ("grasp_file", "stated_grasp"),
    "drake_polygrasp.geometry": ("polyhedron", "primitives", "regions"),
    "drake_polygrasp.optimality": ("gap",),
    "drake_polygrasp.pipeline": ("explain", "plan", "plant_ranking"),
    "drake_polygrasp.plant": ("certify_in_plant", "grasp_forces"),
    "drake_polygrasp.verification": ("plant_results", "report", "verify"),
    "drake_polygrasp.visualization": ("explanation", "figures", "palette", "scene", "sketch"),
    "drake_polygrasp.wrenches": ("contacts", "support"),
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
