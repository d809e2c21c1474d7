"""The reference builds from docstrings without a warning, and leaves none of them out."""

from __future__ import annotations

import re
from html import unescape
from importlib import import_module
from pathlib import Path

import pytest

import drake_polygrasp

for needed in ("furo", "myst_parser", "pdoc", "sphinx"):
    pytest.importorskip(needed, reason=f"{needed} builds the site: pip install -e '.[docs]'")


@pytest.fixture
def pages(site: Path) -> Path:
    return site / "reference"


def described(page: Path) -> dict[str, str]:
    """The text under each name of a page."""
    _, *sections = re.split(r'<(?:section|div) id="', page.read_text())
    texts = {}
    for section in sections:
        _, begun, text = section.partition('<div class="docstring">')
        words = re.sub(r"<[^>]*>", " ", text.partition("</div>")[0])
        if begun:
            texts[section.partition('"')[0]] = " ".join(unescape(words).split())
    return texts


def test_every_public_name_is_described_and_has_its_signature(pages: Path) -> None:
    page = pages / "drake_polygrasp.html"
    texts = described(page)
    for name in drake_polygrasp.__all__:
        if name == "NO_ERRORS":  # a value, whose docstring is in its module
            settings = described(pages / "drake_polygrasp" / "settings.html")
            assert settings[name].startswith("Arguments of plan_grasps")
        if name == "NO_ERRORS" or name.startswith("__"):
            continue
        doc = getattr(drake_polygrasp, name).__doc__
        first = " ".join(doc.partition("\n\n")[0].replace("`", "").split())
        assert texts[name].replace(" .", ".").startswith(first), name
    html = page.read_text()
    for parameter in ("edge_clearance", "package_paths", "model_file"):
        assert f'<span class="n">{parameter}</span>' in html


def test_no_docstring_is_lost_on_its_way_to_the_page(pages: Path) -> None:
    found = 0
    for page in pages.rglob("*.html"):
        for name, text in described(page).items():
            assert text, f"{page.name}: {name}"
            found += 1
    assert found > 300


def test_the_paper_and_the_proof_have_a_page_for_each_module(pages: Path) -> None:
    for name in ("paper", "search", "certification"):
        package = import_module(f"drake_polygrasp.{name}")
        modules = {path.stem for path in Path(package.__path__[0]).glob("[!_]*.py")}
        assert {path.stem for path in (pages / "drake_polygrasp" / name).glob("*.html")} == modules
