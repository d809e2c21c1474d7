"""Builds the reference from docstrings: `python docs/reference.py [DIRECTORY]`.

Needs pdoc: `pip install '.[docs]'`.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pdoc

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
        "region_bounds",
        "search",
        "settings",
        "verification",
        "visualization",
        "wrenches",
    ),
    "drake_polygrasp.files": ("grasp_file", "stated_grasp"),
    "drake_polygrasp.geometry": ("polyhedron", "primitives", "regions"),
    "drake_polygrasp.optimality": ("gap",),
    "drake_polygrasp.pipeline": ("explain", "plan", "plant_ranking"),
    "drake_polygrasp.plant": (
        *("approach", "certify_in_plant", "fingertips", "grasp_forces", "grasp_report", "harness"),
    ),
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
    rooms = {f"drake_polygrasp.{room}": () for room in PAGES["drake_polygrasp"]}
    for name, modules in (rooms | PAGES).items():
        package = import_module(name)
        if not hasattr(package, "__path__"):
            continue
        package.__all__ = list(getattr(package, "__all__", ()))
        for offered in package.__all__:
            # pdoc takes no notice of __getattr__, and looks types up in the module of __new__.
            value = getattr(package, offered)
            setattr(package, offered, value)
            if hasattr(value, "_fields"):
                value.__new__.__module__ = value.__module__
        package.__all__ += modules or sorted(m.name for m in iter_modules(package.__path__))
    pdoc.render.configure(docformat="google", show_source=False)
    pdoc.pdoc("drake_polygrasp", output_directory=directory)


if __name__ == "__main__":
    build(Path(sys.argv[1] if len(sys.argv) > 1 else "build/reference"))
