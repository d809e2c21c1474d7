"""The YAML of a hand: read, written and read again; what is wrong is one line that names it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import HandError
from drake_polygrasp.hands.description import description_text, read_description

WHOLE = """\
format: drake_polygrasp/hand
version: 1
name: gripper
model: gripper.sdf
palm: {frame: palm_face, approach: [0, 0, 2]}
tips:
- {name: thumb, frame: a, p: [0, 0, 0.01], radius: 0.01, axis: [3, 0, 4], geometries: [a_tip]}
- {name: index, frame: b, p: [0, 0, 0.01], radius: 0.012, axis: [1, 0, 0], geometries: [b1, b2]}
- {name: ring, frame: c, p: [0, 0, 1.0e-05], radius: 0.01, axis: [1, 0, 0], geometries: [c_tip]}
- {name: "4", frame: d, p: [0, 0, 0.01], radius: 0.01, axis: [1, 0, 0], geometries: [d_tip]}
friction: 0.8
effort: {joint_a: 0.7, joint_b: 1.1}
limit_margin: 0.05
max_angle: 75
gains: {p: 2.0, d: 0.1}
ignore_collisions: [[link_a, link_b]]
fingers: [[thumb, index, ring], [thumb, ring, "4"]]
"""
SHORT = WHOLE[: WHOLE.index("friction")]


def written(folder: Path, text: str) -> Path:
    file = folder / "gripper.hand.yaml"
    file.write_text(text)
    return file


def test_a_description_is_what_its_file_states(tmp_path: Path) -> None:
    hand = read_description(written(tmp_path, WHOLE))
    assert (hand.name, hand.model, hand.palm_frame) == ("gripper", "gripper.sdf", "palm_face")
    np.testing.assert_array_equal(hand.approach_P, [0, 0, 1])
    np.testing.assert_allclose(hand.tips[0].axis_F, [0.6, 0, 0.8], atol=1e-15)
    assert [tip.name for tip in hand.tips] == ["thumb", "index", "ring", "4"]
    assert hand.tips[1].geometries == ("b1", "b2")
    assert hand.effort == {"joint_a": 0.7, "joint_b": 1.1}
    assert hand.max_angle == math.radians(75)
    assert (hand.kp, hand.kd, hand.friction, hand.limit_margin) == (2.0, 0.1, 0.8, 0.05)
    assert hand.ignore_collisions == (("link_a", "link_b"),)
    assert hand.fingers == (("thumb", "index", "ring"), ("thumb", "ring", "4"))


def test_defaults_are_those_of_the_documentation(tmp_path: Path) -> None:
    hand = read_description(written(tmp_path, SHORT))
    assert (hand.limit_margin, hand.max_angle) == (0.03, math.radians(80))
    assert (hand.kp, hand.kd) == (4.0, 0.05)
    assert (hand.friction, hand.effort) == (None, None)
    assert (hand.ignore_collisions, hand.fingers) == ((), ())


@pytest.mark.parametrize("text", [WHOLE, SHORT, SHORT + "effort: 0.7\n"])
def test_a_description_that_is_written_reads_the_same(tmp_path: Path, text: str) -> None:
    first = read_description(written(tmp_path, text))
    once = description_text(first)
    second = read_description(written(tmp_path, once))
    assert description_text(second) == once
    for name in ("name", "model", "effort", "max_angle", "kp", "kd", "fingers", "friction"):
        assert getattr(first, name) == getattr(second, name)
    for one, other in zip(first.tips, second.tips, strict=True):
        np.testing.assert_array_equal(one.p_FT, other.p_FT)
        np.testing.assert_allclose(one.axis_F, other.axis_F, atol=1e-15)


BAD = {
    "no YAML": ("name: gripper", "name: [", "is not plain YAML"),
    "another format": ("drake_polygrasp/hand", "drake_polygrasp/grasps", "not a hand file"),
    "a later version": ("version: 1", "version: 2", "reads version 1"),
    "a misspelt key": ("effort: {", "efort: {", "efort is no key of the format"),
    "a key of a tip": ("radius: 0.012", "radius: 0.012, colour: 1", r"tips\[1\].colour is no key"),
    "no model": ("model: gripper.sdf", "", "model is missing"),
    "no palm": ("palm: {frame: palm_face, approach: [0, 0, 2]}", "", "palm is missing"),
    "a palm without a frame": ("frame: palm_face, ", "", "palm.frame is missing"),
    "no direction": ("approach: [0, 0, 2]", "approach: [0, 0, 0]", "not a direction"),
    "not three numbers": ("axis: [3, 0, 4]", "axis: [3, 0]", r"tips\[0\].axis is \[3, 0\]"),
    "not finite": ("p: [0, 0, 1.0e-05]", "p: [0, 0, .nan]", r"tips\[2\].p is .* finite"),
    "a radius below zero": ("radius: 0.012", "radius: -0.012", r"radius is -0.012, not positive"),
    "a radius in millimetres": ("radius: 0.012", "radius: 12", "at most 1 m"),
    "no geometries": ("[b1, b2]", "[]", r"tips\[1\].geometries is \[\]"),
    "two tips of a name": ("name: index", "name: thumb", "two tips 'thumb'"),
    "a geometry of two tips": (
        "frame: c, p: [0, 0, 1.0e-05], radius: 0.01, axis: [1, 0, 0], geometries: [c_tip]",
        "frame: a, p: [0, 0, 0], radius: 0.01, axis: [1, 0, 0], geometries: [a_tip]",
        "'a_tip' of frame 'a' twice",
    ),
    "an effort of zero": ("joint_b: 1.1", "joint_b: 0", "effort.joint_b is 0, not positive"),
    "an effort in words": ("effort: {joint_a: 0.7, joint_b: 1.1}", "effort: strong", "effort is"),
    "friction of zero": ("friction: 0.8", "friction: 0", "friction is 0, not positive"),
    "an angle beyond a half turn": ("max_angle: 75", "max_angle: 200", "at most 180 degrees"),
    "one gain": ("gains: {p: 2.0, d: 0.1}", "gains: {p: 2.0}", "gains.d is missing"),
    "a pair of one": ("[[link_a, link_b]]", "[[link_a]]", "ignore_collisions is"),
    "an unknown finger": ("[thumb, index, ring]", "[thumb, index, pinky]", "'pinky', .* no tip"),
    "a finger twice": ("[thumb, index, ring]", "[thumb, thumb, ring]", "fingers is"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_description_is_one_line_that_names_the_place(tmp_path: Path, case: str) -> None:
    old, new, message = BAD[case]
    assert WHOLE.count(old) == 1
    with pytest.raises(HandError, match=message) as raised:
        read_description(written(tmp_path, WHOLE.replace(old, new)))
    assert "gripper.hand.yaml" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_two_tips_are_too_few(tmp_path: Path) -> None:
    lines = SHORT.splitlines(keepends=True)
    fault = "tips has 2 fingertips; three hold an object, so list 3 to 20"
    with pytest.raises(HandError, match=fault):
        read_description(written(tmp_path, "".join(lines[:-2])))


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(HandError, match="there is no such hand file"):
        read_description(tmp_path / "none.hand.yaml")
