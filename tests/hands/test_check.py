"""The report of a hand says what it can do, and each thing that is wrong in a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import HandReport, check_hand, load_hand
from tests.hands.test_model import URDF, coupled, model_with
from tests.support.hands import own_hand


def report(file: Path) -> HandReport:
    return check_hand(load_hand(file), num=300)


def test_our_own_hand_has_nothing_to_be_warned_of() -> None:
    found = check_hand(own_hand(), num=2000)
    assert found.errors == found.warnings == ()
    assert found.couplings == ()
    assert found.effort["first_curl"] == 1.0
    assert {*found.effort_from.values()} == {"model"}
    assert found.tip_ranks == {"first": 3, "second": 3, "third": 3}
    assert found.root == "palm"
    assert found.floats
    assert 0.4 < found.kept_share < 0.7
    # Tips of 10 mm radius that do not overlap; fingers of 12 cm whose bases are 78 mm apart.
    assert 0.02 <= found.span[0] < 0.03
    assert 0.2 < found.span[1] < 0.078 + 2 * 0.12
    assert found.sample.shape == (6, 9)


def test_joints_that_follow_others_are_said(tmp_path: Path) -> None:
    found = report(coupled(tmp_path))
    assert found.couplings == ("a_far_joint = 0.5 a_near + 0.1", "b_far_joint = 2 b_near")
    assert found.independent == ("a_near", "b_near", "c_near", "c_far_joint")
    # One joint moves a tip along a curve, and two whose axes are parallel in a plane.
    assert found.tip_ranks == {"a": 1, "b": 1, "c": 2}
    (warning,) = found.warnings
    assert "cannot move in all three directions" in warning
    assert "'a' 1, 'b' 1, 'c' 2" in warning


@pytest.mark.parametrize(("shift", "sign"), [(0.003, 1), (-0.003, -1)])
def test_a_sphere_that_is_off_its_geometry_is_measured(
    tmp_path: Path, shift: float, sign: int
) -> None:
    place = "a_far, p: [0, 0, 0.05]"
    moved = f"a_far, p: [{shift}, 0, 0.05]"
    found = report(coupled(tmp_path, **{place: moved}))
    fit = found.tip_fits["a"]
    # Two spheres of 10 mm, 3 mm apart along the axis: 3 mm on the axis, and 60 degrees off it
    # sqrt(10^2 + 3^2 +- 2 * 10 * 3 * cos 60) - 10.
    on_axis, off_axis = sign * 3e-3, 1e-3 * (np.sqrt(109 + sign * 30) - 10)
    assert fit.most == pytest.approx(max(on_axis, off_axis), abs=5e-5)
    assert fit.least == pytest.approx(min(on_axis, off_axis), abs=5e-5)
    assert any("tip 'a': its geometry is" in warning for warning in found.warnings)


def test_efforts_that_no_file_states_are_unknown(tmp_path: Path) -> None:
    model = model_with(tmp_path, 'upper="1.2" effort="2"', 'upper="1.2"')
    found = report(coupled(tmp_path, model))
    assert found.effort == {"a_near": None, "b_near": None, "c_near": None, "c_far_joint": 1.0}
    assert any("no effort limit of 'a_near', 'b_near', 'c_near'" in w for w in found.warnings)


def test_efforts_that_no_finger_has_are_doubted(tmp_path: Path) -> None:
    found = report(coupled(tmp_path, model_with(tmp_path, 'effort="2"', 'effort="30"')))
    assert any("efforts above 20 N m" in warning for warning in found.warnings)
    stated = report(
        coupled(tmp_path, model_with(tmp_path, 'effort="2"', 'effort="30"'), "effort: 1\n")
    )
    assert not any("efforts above" in warning for warning in stated.warnings)
    assert {*stated.effort.values()} == {1.0}


def test_bodies_that_always_overlap_are_named_and_may_be_ignored(tmp_path: Path) -> None:
    before, name, after = URDF.read_text().partition('<collision name="a_far_box">')
    model = tmp_path / "wide.urdf"
    model.write_text(before + name + after.replace("0.01 0.01 0.03", "2 2 1", 1))
    found = report(coupled(tmp_path, model))
    assert found.kept_share == 0
    (error,) = found.errors
    assert "none of 300 random postures is free of self-collision" in error
    assert found.collisions["a_far", "b_near"] > 0.9
    assert any("add [a_far, b_near] to `ignore_collisions`" in w for w in found.warnings)
    pairs = ["palm", "b_near", "b_far", "c_near", "c_far"]
    ignored = "ignore_collisions: [" + ", ".join(f"[a_far, {name}]" for name in pairs) + "]\n"
    assert report(coupled(tmp_path, model, ignored)).kept_share > 0
