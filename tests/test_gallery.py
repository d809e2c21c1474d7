"""The gallery shows every model and a scan, as they are planned now."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.gallery import COLUMNS, FOLDER, PAGE, SCAN, Exhibit
from drake_polygrasp import example_models, load_object, plan_grasps

TEXT = PAGE.read_text("utf-8")


def test_every_model_and_the_scan_have_a_small_picture() -> None:
    shown = re.findall(r"!\[([\w ]+)\]\(gallery/(\w+\.png)\)", TEXT)
    assert [name for name, _ in shown] == [*example_models(), SCAN]
    assert {file for _, file in shown} == {path.name for path in FOLDER.iterdir()}
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 1e6
    rows = [line for line in TEXT.splitlines() if line.startswith("| ")]
    assert {line.count("|") for line in rows} == {COLUMNS + 1}


@pytest.mark.parametrize("name", ["cube", "tetrahedron"])
def test_a_caption_says_what_is_planned(name: str) -> None:
    exhibit = Exhibit(name, plan_grasps(load_object(example_models()[name])))
    assert exhibit.caption in TEXT
    assert Path(exhibit.picture).is_file()
