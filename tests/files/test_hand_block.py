"""The hand in a grasp file: written as planned, read as written, refused where it is spoiled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from drake_polygrasp import load_grasps, save_grasps
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.hand_grasp import HandPlacement
from tests.support.hands import CUBE, OWN_HAND, own_hand, own_hand_grasps, planned


@pytest.fixture
def written(tmp_path: Path) -> Path:
    file = tmp_path / "cube.grasp.yaml"
    object_, _ = planned(CUBE)
    save_grasps(file, object_, own_hand_grasps(CUBE, up=True), StatedPlan())
    return file


def assert_same(one: HandPlacement, other: HandPlacement) -> None:
    for name in HandPlacement.__dataclass_fields__:
        if name not in ("pregrasp", "torque", "hand"):
            assert np.all(getattr(one, name) == getattr(other, name)), name
    for part in ("pregrasp", "torque"):
        mine, theirs = getattr(one, part), getattr(other, part)
        for name in type(mine).__dataclass_fields__:
            assert np.all(getattr(mine, name) == getattr(theirs, name)), name


def test_what_is_written_is_read_bit_by_bit(written: Path) -> None:
    file = load_grasps(written)
    planned_grasps = own_hand_grasps(CUBE, up=True)
    assert len(file.grasps) == len(planned_grasps) > 0
    for stated, planned_grasp in zip(file.grasps, planned_grasps, strict=True):
        assert stated.hand is not None
        assert_same(stated.hand, planned_grasp)
        assert stated.hand.X_BPalm.IsExactlyEqualTo(planned_grasp.X_BPalm)
    assert file.hand is not None
    assert file.hand.name == "three_finger"
    assert file.hand.sha256 == own_hand().sha256
    assert file.hand.description_file is not None
    assert file.hand.description_file.samefile(OWN_HAND)


def test_a_file_that_was_read_is_written_again_elsewhere(written: Path) -> None:
    file = load_grasps(written)
    object_, _ = planned(CUBE)
    (written.parent / "inner").mkdir()
    moved = written.parent / "inner" / written.name
    save_grasps(moved, object_, file.grasps, file.plan)
    again = load_grasps(moved)
    assert again.hand is not None
    assert again.hand.description_file is not None
    assert again.hand.description_file.samefile(OWN_HAND)
    before, after = yaml.safe_load(written.read_text()), yaml.safe_load(moved.read_text())
    assert before["grasps"] == after["grasps"]
    assert not Path(after["hand"]["description_file"]).is_absolute()


def spoil(document: dict[str, Any], path: str, value: Any) -> None:
    *outer, last = path.split(".")
    for key in outer:
        document = document[key]
    document[last] = value


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("fingers", ["first", "first", "third"], "fingers"),
        ("fingers", ["first", "second"], "fingers"),
        ("X_BPalm.quaternion_wxyz", [1, 0, 0, 0.1], "quaternion_wxyz"),
        ("X_BPalm.p_BPalm", [0, 0], "p_BPalm"),
        ("q", {"first_swing": "much"}, "first_swing"),
        ("q", [0.1, 0.2], "q"),
        ("pregrasp.direction_B", [0, 0, 2], "direction_B"),
        ("pregrasp.distance", -0.1, "distance"),
        ("torque.loads", "seven", "loads"),
        ("torque.up_B", [0, 0, 0], "up_B"),
        ("torque.friction_share", 1.5, "friction_share"),
        ("torque.f_Bc_B", [[0, 0, 1]], "f_Bc_B"),
        ("torque.mass", 0, "mass"),
        ("surroundings", [1], "surroundings"),
    ],
)
def test_a_spoiled_block_is_refused_by_its_place(
    written: Path, path: str, value: Any, message: str
) -> None:
    document = yaml.safe_load(written.read_text())
    spoil(document["grasps"][0]["hand"], path, value)
    written.write_text(yaml.safe_dump(document))
    with pytest.raises(GraspFileError, match=rf"grasps\[0\]\.hand\..*{message}"):
        load_grasps(written)


def test_a_hand_without_a_description_file_cannot_be_written(tmp_path: Path) -> None:
    object_, _ = planned(CUBE)
    grasp = own_hand_grasps(CUBE)[0]
    bare = replace(grasp, hand=replace(grasp.hand, description_file=None, sha256=None))
    with pytest.raises(GraspFileError, match="names its hand's description"):
        save_grasps(tmp_path / "cube.grasp.yaml", object_, [bare], StatedPlan())
    other = replace(grasp, hand=replace(grasp.hand, name="other"))
    with pytest.raises(GraspFileError, match="of two hands, 'three_finger' and 'other'"):
        save_grasps(tmp_path / "cube.grasp.yaml", object_, [grasp, other], StatedPlan())
