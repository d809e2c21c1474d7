"""The region block of a grasp file: what is written is read, and what cannot be is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.grasp_file import grasp_document, load_grasps
from tests.support.grasp_files import Document, edit, write_box
from tests.support.grasp_regions import box_region, in_pieces


@pytest.fixture(params=[False, True], ids=["polygons", "pieces"])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    region = in_pieces(box_region()) if request.param else box_region()
    return edit(write_box(tmp_path), lambda d: d["grasps"][0].update(region=region))


def test_a_region_is_written_as_it_was_read(file: Path) -> None:
    stated = load_grasps(file).grasps[0]
    assert (
        grasp_document(stated)["region"] == yaml.safe_load(file.read_text())["grasps"][0]["region"]
    )


def test_a_region_has_the_numbers_of_the_file(file: Path) -> None:
    region = load_grasps(file).grasps[0].region
    assert region is not None
    assert region.placement_error.tolist() == [0.999 * 0.002] * 3
    assert (region.tilt_error, region.friction_error, region.com_error) == (0.0873, 0.2, 0.0)
    assert region.internal_force.tolist() == [2.5, 2.5, -1.25]
    assert [len(pieces) for pieces in region.pieces] == [1, 1, 1]
    assert region.pieces[1][0].p_BV.tolist()[0] == [-0.05, 0.022, 0.002]
    assert region.pieces[1][0].nhat_TB_B.tolist() == [1.0, 0.0, 0.0]
    assert (region.epsilon_lower, region.epsilon_upper, region.squeeze_force) == (None, None, None)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda r: r.pop("internal_force"), "region.internal_force is missing"),
        (lambda r: r.pop("p_BV"), "region.p_BV and pieces are missing"),
        (lambda r: r["p_BV"].pop(), "region.p_BV is .*, not a list for each of the three contacts"),
        (lambda r: r["p_BV"][2].append([1.0, 2.0]), r"region.p_BV\[2\]\[4\] is"),
        (
            lambda r: r["p_BV"].__setitem__(1, []),
            r"region.p_BV\[1\] is \[\], not a list of 1 to 100",
        ),
        (
            lambda r: r.update(pieces=[[{"p_BV": [], "nhat_TB_B": [1.0, 0.0, 0.0]}], [], []]),
            r"region.pieces\[0\]\[0\].p_BV is \[\], not a list of 1 to 100",
        ),
        (
            lambda r: r["p_BV"][0].extend([1.0, 2.0, 3.0] for _ in range(97)),
            "not a list of 1 to 100 corners",
        ),
        (
            lambda r: r.update(pieces=[[], [{} for _ in range(201)], []]),
            r"pieces\[1\] .* at most 200 pieces",
        ),
        (lambda r: r.update(placement_error=[0.1, -0.1, 0.1]), "not a list of three lengths"),
        (lambda r: r.update(tilt_error=1.6), "below pi / 2"),
        (lambda r: r.update(friction_error=1.0), "below 1"),
        (lambda r: r.update(com_error=-1.0), "com_error is -1.0, not zero or positive"),
        (lambda r: r.update(epsilon_lower="much"), "epsilon_lower is 'much', not a finite number"),
        (lambda r: r.update(pieces=[[], [], 3]), r"region.pieces\[2\] is 3, not a list"),
    ],
)
def test_what_is_no_region_is_refused_by_place(
    change: Callable[[Document], Any], says: str, tmp_path: Path
) -> None:
    region = box_region()
    change(region)
    file = edit(write_box(tmp_path), lambda d: d["grasps"][0].update(region=region))
    with pytest.raises(GraspFileError) as refused:
        load_grasps(file)
    assert str(refused.value).startswith(f"{file}: grasps[0].region")
    assert re.search(says, str(refused.value))
