"""The site builds without a warning, and its links lead to pages and places that it has."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

for needed in ("furo", "myst_parser", "pdoc", "sphinx"):
    pytest.importorskip(needed, reason=f"{needed} builds the site: pip install -e '.[docs]'")
ROOT = Path(__file__).parents[1]


class Links(HTMLParser):
    """The links and the anchors of a page."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(page.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.anchors |= {value for key in ("id", "name") if (value := found.get(key))}
        if target := found.get("href" if tag == "a" else "src"):
            self.links.add(target)


def test_every_link_of_the_guide_leads_somewhere(site: Path) -> None:
    pages = {page.resolve(): Links(page) for page in site.rglob("*.html")}
    checked = 0
    for page, found in pages.items():
        if "reference" in page.parts and page.name != "index.html":
            continue  # pdoc's own
        for link in found.links:
            if re.match(r"\w+:", link):
                continue
            path, _, anchor = unquote(link).partition("#")
            there = (page.parent / path.partition("?")[0]).resolve() if path else page
            assert there.exists(), f"{page.name}: {link}"
            if anchor and there.suffix == ".html":
                assert anchor in pages[there].anchors, f"{page.name}: {link}"
            checked += 1
    assert checked > 300


def test_notebooks_are_there_with_their_figures(site: Path) -> None:
    for notebook in (ROOT / "notebooks").glob("*.ipynb"):
        page = Links(site / "notebooks" / f"{notebook.stem}.html")
        figures = notebook.read_text("utf-8").count('"image/png"')
        assert (
            len({link for link in page.links if notebook.stem in link and "png" in link}) == figures
        )
