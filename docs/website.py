"""Builds the documentation as a site: `python -m docs.website [DIRECTORY]`, then open index.html.

Sphinx makes pages of the README, of the Markdown of docs/, models/ and benchmarks/ and of the
notebooks with their outputs; pdoc makes the reference of the API from docstrings. A warning of
either ends it. Needs `pip install '.[docs]'`.
"""

from __future__ import annotations

import base64
import json
import logging
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path, PurePosixPath
from typing import Any

from sphinx.application import Sphinx

from docs.reference import PAGES as REFERENCE
from docs.reference import build
from drake_polygrasp import __version__

ROOT = Path(__file__).parents[1]
GUIDE = ("usage", "hands", "grasp-file", "certificate", "paper", "glossary", "gallery")
"""Pages of docs/ for users, in the order of the menu."""
PAGES = (
    *("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/architecture.md"),
    *(f"docs/{name}.md" for name in GUIDE),
    *("models/README.md", "benchmarks/README.md"),
)
PICTURES = ("docs/*.png", "docs/gallery/*")
SETTINGS: dict[str, Any] = {
    "project": "drake_polygrasp",
    "release": __version__,
    "extensions": ["myst_parser"],
    "root_doc": "index",
    "html_theme": "furo",
    "html_title": f"drake_polygrasp {__version__}",
    "html_show_copyright": False,
    "html_copy_source": False,
    "myst_heading_anchors": 4,
    "nitpicky": True,
}
_LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")


def _menu(title: str, pages: list[str]) -> str:
    """Returns a part of the menu on the left."""
    return "\n".join([f"```{{toctree}}\n:hidden:\n:caption: {title}\n", *pages, "```\n"])


def _write_sources(folder: Path) -> None:
    """Copies all pages and pictures in their folders, with links that hold in the site."""
    pages = [file for pattern in PAGES for file in sorted(ROOT.glob(pattern))]
    notebooks = sorted((ROOT / "notebooks").glob("*.ipynb"))
    known = {file.relative_to(ROOT).as_posix() for file in (*pages, *notebooks)}
    for file in (file for pattern in PICTURES for file in ROOT.glob(pattern)):
        copy = folder / file.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, copy)
    for file in pages:
        name = file.relative_to(ROOT)
        text = _with_links(file.read_text("utf-8"), name.as_posix(), known)
        copy = folder / ("index.md" if name.name == str(name) == "README.md" else name)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(text, "utf-8")
    (folder / "notebooks").mkdir()
    for file in notebooks:
        page = folder / "notebooks" / f"{file.stem}.md"
        text = _notebook_text(file, page.parent)
        page.write_text(_with_links(text, f"notebooks/{file.name}", known), "utf-8")
    with (folder / "index.md").open("a", encoding="utf-8") as index:
        index.write(_menu("Guide", [f"docs/{name}" for name in GUIDE]))
        index.write(_menu("Notebooks", [f"notebooks/{file.stem}" for file in notebooks]))
        inside = [
            "models/README",
            "docs/architecture",
            "CONTRIBUTING",
            "benchmarks/README",
            "CHANGELOG",
        ]
        index.write(_menu("Project", ["Reference of the API <reference/index>", *inside]))
    (folder / "reference").mkdir()
    (folder / "reference" / "index.md").write_text(
        "# Reference of the API\n\nEvery public name, from the docstrings: "
        '<a href="drake_polygrasp.html">drake_polygrasp</a>.\n',
        "utf-8",
    )


def _with_links(text: str, page: str, known: set[str]) -> str:
    """Returns a page whose links lead to pages of the site, or to the reference; others are text.

    Args:
        text: the page, in Markdown.
        page: its path in the repository.
        known: paths of all pages.
    """

    def moved(match: re.Match[str]) -> str:
        label, target = match.groups()
        path, _, anchor = target.partition("#")
        if re.match(r"https?:", target) or not path:
            return match[0]
        there = os.path.normpath(PurePosixPath(page).parent / path)
        if there in known:
            if there == "README.md":
                path = os.path.relpath("index.md", PurePosixPath(page).parent)
            path = path.removesuffix(".ipynb") + ".md" * path.endswith(".ipynb")
            return f"[{label}]({path}{'#' * bool(anchor)}{anchor})"
        if module := _described_in(there):
            up = os.path.relpath(f"reference/{module}.html", PurePosixPath(page).parent)
            return f'<a href="{up}">{label}</a>'
        return label

    # Code is left as it is.
    parts = re.split(r"(^```.*?^```$)", text, flags=re.DOTALL | re.MULTILINE)
    return "".join(part if k % 2 else _LINK.sub(moved, part) for k, part in enumerate(parts))


def _described_in(file: str) -> str:
    """Returns the module of the reference that describes a file, as a path; empty if none does."""
    path = PurePosixPath(file.removesuffix("/__init__.py").removesuffix(".py"))
    if path.parts[0] != "drake_polygrasp":
        return ""
    if path.parts[1:] and path.parts[1] not in REFERENCE["drake_polygrasp"]:
        return ""
    package = ".".join(path.parts[:-1])
    if len(path.parts) == 3 and path.name not in REFERENCE.get(package, (path.name,)):
        path = path.parent  # only what users meet has a page of its own
    return str(path)


def _notebook_text(file: Path, folder: Path) -> str:
    """Returns a notebook with its outputs in Markdown, and writes its pictures to a folder."""
    lines: list[str] = []
    for k, cell in enumerate(json.loads(file.read_text("utf-8"))["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines.append(source)
            continue
        lines.append(f"```ipython\n{source}\n```")
        for i, output in enumerate(cell["outputs"]):
            data = output.get("data", {})
            if "image/png" in data:
                picture = f"{file.stem}_{k}_{i}.png"
                (folder / picture).write_bytes(base64.b64decode("".join(data["image/png"])))
                lines.append(f"![Figure]({picture})")
            else:
                text = "".join(output.get("text") or data.get("text/plain", ""))
                lines.append(f"```text\n{text.rstrip()}\n```")
    return "\n\n".join(lines) + "\n"


def make_site(directory: Path) -> int:
    """Writes the site.

    Args:
        directory: folder to write; what it holds may be replaced.

    Returns:
        0, or 1 if Sphinx warned.
    """
    with tempfile.TemporaryDirectory() as folder:
        sources, trees = Path(folder) / "sources", Path(folder) / "trees"
        sources.mkdir()
        _write_sources(sources)
        app = Sphinx(
            sources,
            None,
            directory,
            trees,
            "html",
            SETTINGS,
            status=None,
            freshenv=True,
            warningiserror=True,
        )
        app.build()
    # The first use of matplotlib on a machine says that it lists the fonts, which is no warning.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    # pdoc's own index only leads to this page; the site has one.
    index = (directory / "reference" / "index.html").read_bytes()
    build(directory / "reference")
    (directory / "reference" / "index.html").write_bytes(index)
    return app.statuscode


if __name__ == "__main__":
    sys.exit(make_site(Path(sys.argv[1] if len(sys.argv) > 1 else "build/site")))
