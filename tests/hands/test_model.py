"""Hands load with the joints, limits, couplings and tips of their models, or say why not."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp import Hand, HandError, load_hand
from drake_polygrasp.arrays import Array

HANDS = Path(__file__).parents[2] / "models" / "hands"
THREE_FINGER = HANDS / "three_finger" / "three_finger.hand.yaml"
URDF = Path(__file__).with_name("coupled_hand.urdf")
COUPLED = """\
format: drake_polygrasp/hand
version: 1
name: coupled
model: {model}
palm: {{frame: palm, approach: [0, 0, 1]}}
tips:
- {{name: a, frame: a_far, p: [0, 0, 0.05], radius: 0.01, axis: [1, 0, 0], geometries: [a_tip]}}
- {{name: b, frame: b_far, p: [0, 0, 0.05], radius: 0.01, axis: [1, 0, 0], geometries: [b_tip]}}
- {{name: c, frame: c_far, p: [0, 0, 0.05], radius: 0.01, axis: [1, 0, 0], geometries: [c_tip]}}
"""


@pytest.fixture(scope="module")
def three_finger() -> Hand:
    return load_hand(THREE_FINGER)


def coupled(folder: Path, model: str | Path = URDF, more: str = "", **changes: str) -> Path:
    text = COUPLED.format(model=model) + more
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    file = folder / "coupled.hand.yaml"
    file.write_text(text)
    return file


def turned(axis: str, angle: float) -> Array:
    """The rotation matrix about an axis, by hand."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array(
        {"y": [[c, 0, s], [0, 1, 0], [-s, 0, c]], "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis]
    )


def chain(yaw: float, swing: float, bend: float, curl: float) -> tuple[Array, Array]:
    """Centre and axis of a tip of our own hand, from its dimensions alone."""
    up = np.array([0, 0, 1.0])
    base = turned("z", yaw) @ np.array([-0.045, 0, 0])
    R = turned("z", yaw + swing)
    near, far = R @ turned("y", bend), R @ turned("y", bend + curl)
    return base + 0.022 * up + 0.065 * near @ up + 0.055 * far @ up, far @ np.array([0.8, 0, 0.6])


def test_our_own_hand_is_where_its_dimensions_say(three_finger: Hand) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        q = rng.uniform(three_finger.lower, three_finger.upper)
        p_PT, axis_P = three_finger.tip_points(q)
        for i, yaw in enumerate((math.pi, -math.pi / 3, math.pi / 3)):
            p, axis = chain(yaw, *q[3 * i : 3 * i + 3])
            np.testing.assert_allclose(p_PT[i], p, atol=1e-12)
            np.testing.assert_allclose(axis_P[i], axis, atol=1e-12)


def test_jacobians_are_differences_of_positions(three_finger: Hand) -> None:
    q = np.linspace(-0.3, 0.9, 9)
    J = three_finger.tip_jacobians(q)
    step = 1e-6
    for j in range(9):
        ahead, behind = (three_finger.tip_points(q + s * step * np.eye(9)[j])[0] for s in (1, -1))
        # Central differences err by step^2 and rounding by 1e-16 / step.
        np.testing.assert_allclose(J[:, :, j], (ahead - behind) / (2 * step), atol=1e-8)


def test_our_own_hand_states_all_that_a_plan_needs(three_finger: Hand) -> None:
    assert three_finger.joints == tuple(
        f"{finger}_{joint}"
        for finger in ("first", "second", "third")
        for joint in ("swing", "bend", "curl")
    )
    assert three_finger.independent == three_finger.joints
    np.testing.assert_array_equal(three_finger.effort, [1.5, 1.5, 1.0] * 3)
    assert {*three_finger.effort_from} == {"model"}
    assert three_finger.fingers == ((0, 1, 2),)
    for tip in three_finger.tips:
        assert max(abs(value) for value in tip.fit) < 1e-9  # the tip's geometry is that sphere
        assert tip.mu == 1.0


def test_mimic_joints_follow(tmp_path: Path) -> None:
    hand = load_hand(coupled(tmp_path))
    assert hand.joints == (
        "a_near",
        "a_far_joint",
        "b_near",
        "b_far_joint",
        "c_near",
        "c_far_joint",
    )
    assert hand.independent == ("a_near", "b_near", "c_near", "c_far_joint")
    z = np.array([0.2, -0.1, 0.3, 0.4])
    expected = [0.2, 0.5 * 0.2 + 0.1, -0.1, 2 * -0.1, 0.3, 0.4]
    np.testing.assert_allclose(hand.E @ z + hand.e0, expected, atol=1e-15)
    np.testing.assert_array_equal(hand.effort, [2.0, 2.0, 2.0, 1.0])


def test_positions_are_by_name(three_finger: Hand) -> None:
    q = np.linspace(-0.3, 0.9, 9)
    by_name = three_finger.joint_dict(q)
    np.testing.assert_array_equal(three_finger.joint_array(dict(reversed(by_name.items()))), q)
    with pytest.raises(HandError, match="no joint 'elbow'"):
        three_finger.joint_array({**by_name, "elbow": 0.0})
    del by_name["first_bend"]
    with pytest.raises(HandError, match=r"'first_bend' .* missing"):
        three_finger.joint_array(by_name)


def test_a_hand_in_another_plant_is_at_the_same_posture(three_finger: Hand) -> None:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    found = three_finger.add_to(plant, scene_graph, weld_root=False)
    plant.Finalize()
    q = np.linspace(-0.3, 0.9, 9)
    values = three_finger.positions(plant, found.instance, three_finger.joint_dict(q))
    context = plant.GetMyContextFromRoot(builder.Build().CreateDefaultContext())
    positions = plant.GetPositions(context)
    positions[found.q_indices()] = q
    plant.SetPositions(context, positions)
    np.testing.assert_array_equal(values, q)
    p_PT, _ = three_finger.tip_points(q)
    again = three_finger.find_in(plant, scene_graph.model_inspector(), found.instance)
    for tip, frame, p in zip(three_finger.tips, again.tip_frames, p_PT, strict=True):
        X_PF = plant.CalcRelativeTransform(context, again.palm, frame)
        np.testing.assert_allclose(X_PF @ tip.p_FT, p, atol=1e-12)


def test_the_description_overrides_the_model(tmp_path: Path) -> None:
    hand = load_hand(coupled(tmp_path, more="effort: {c_near: 0.3}\nfriction: 0.4\n"))
    np.testing.assert_array_equal(hand.effort, [2.0, 2.0, 0.3, 1.0])
    assert hand.effort_from == ("model", "model", "description", "model")
    assert [tip.mu for tip in hand.tips] == [0.4] * 3


def model_with(folder: Path, old: str, new: str, count: int | None = None) -> Path:
    text = URDF.read_text()
    assert old in text
    file = folder / "changed.urdf"
    file.write_text(text.replace(old, new) if count is None else text.replace(old, new, count))
    return file


def without_transmissions(folder: Path) -> Path:
    text = URDF.read_text()
    file = folder / "changed.urdf"
    file.write_text(text[: text.index("<transmission")] + "</robot>\n")
    return file


def two_models(folder: Path) -> Path:
    file = folder / "two.dmd.yaml"
    adds = "".join(f"- add_model: {{name: {n}, file: file://{URDF}}}\n" for n in ("one", "two"))
    file.write_text("directives:\n" + adds)
    return file


def stl_link(folder: Path) -> Path:
    (folder / "palm.stl").write_text("solid palm\nendsolid palm\n")
    return model_with(folder, '<box size="0.1 0.1 0.02"/>', '<mesh filename="palm.stl"/>')


def test_bad_hands_are_one_line(tmp_path: Path) -> None:
    def refused(message: str, file: Path) -> None:
        with pytest.raises(HandError, match=message) as raised:
            load_hand(file)
        assert "\n" not in str(raised.value)
        assert "coupled.hand.yaml" in str(raised.value)

    refused("palm.frame is 'hand_base'", coupled(tmp_path, **{"frame: palm": "frame: hand_base"}))
    refused(r"tips\[1\].frame is 'b_end'", coupled(tmp_path, **{"frame: b_far": "frame: b_end"}))
    refused("no collision geometry of 'a_far'", coupled(tmp_path, a_tip="b_tip"))
    refused(
        "m from 'a_tip'", coupled(tmp_path, **{"a_far, p: [0, 0, 0.05]": "a_far, p: [0, 0, 0.1]"})
    )
    refused(
        "on one rigid body",
        coupled(
            tmp_path,
            **{"b_far, p: [0, 0, 0.05]": "a_far, p: [0, 0, 0.052]", "[b_tip]": "[a_tip_b]"},
        ),
    )
    refused(
        "moves with no joint",
        coupled(
            tmp_path, **{"b_far, p: [0, 0, 0.05]": "palm, p: [0, 0, 0.01]", "[b_tip]": "[palm_box]"}
        ),
    )
    refused("has no actuators", coupled(tmp_path, without_transmissions(tmp_path)))
    refused(
        "effort limit of 0", coupled(tmp_path, model_with(tmp_path, 'effort="2"', 'effort="0"', 1))
    )
    refused("names no joint", coupled(tmp_path, more="effort: {elbow: 1}\n"))
    refused("has 2 models", coupled(tmp_path, two_models(tmp_path)))
    refused("palm.stl", coupled(tmp_path, stl_link(tmp_path)))
    refused("there is no such model file", coupled(tmp_path, tmp_path / "none.urdf"))
    refused("which is no body", coupled(tmp_path, more="ignore_collisions: [[palm, nose]]\n"))
    ball = '<link name="nose"/><joint name="ball" type="planar"><parent link="palm"/><child link='
    model = model_with(tmp_path, "</robot>", ball + '"nose"/></joint></robot>')
    refused("joint 'ball' is planar", coupled(tmp_path, model))
    model = model_with(tmp_path, "</robot>", '<link name="loose"/></robot>')
    refused("2 parts that no joint connects: 'palm', 'loose'", coupled(tmp_path, model))
