"""Postures of a hand, read back as readers of isaac_grasp and of ROS messages read them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydrake.multibody.parsing import LoadModelDirectives, Parser, ProcessModelDirectives
from pydrake.multibody.plant import MultibodyPlant
from scipy.spatial.transform import Rotation

from drake_polygrasp import export_directives, load_grasps
from drake_polygrasp.exporters import export_isaac_grasp, export_moveit
from tests.support.held_files import write_held_box

MESSAGES = """
moveit_msgs/Grasp: string id; JointTrajectory pre_grasp_posture; JointTrajectory grasp_posture;
PoseStamped grasp_pose; float64 grasp_quality; GripperTranslation pre_grasp_approach;
GripperTranslation post_grasp_retreat; GripperTranslation post_place_retreat;
float32 max_contact_force; string[] allowed_touch_objects
GripperTranslation: Vector3Stamped direction; float32 desired_distance; float32 min_distance
JointTrajectory: Header header; string[] joint_names; JointTrajectoryPoint[] points
JointTrajectoryPoint: float64[] positions; float64[] velocities; float64[] accelerations;
float64[] effort; Duration time_from_start
PoseStamped: Header header; Pose pose
Pose: Vector3 position; Quaternion orientation
Vector3Stamped: Header header; Vector3 vector
Header: Time stamp; string frame_id
Time: int32 sec; uint32 nanosec
Duration: int32 sec; uint32 nanosec
Vector3: float64 x; float64 y; float64 z
Quaternion: float64 x; float64 y; float64 z; float64 w
"""
"""Fields of the ROS 2 messages, a type a paragraph; a Point has the fields of a Vector3."""
BASIC = {"string": str, "float32": float, "float64": float, "int32": int, "uint32": int}


def test_directives_have_the_palm_at_the_grasp_and_before(tmp_path: Path) -> None:
    file = load_grasps(write_held_box(tmp_path))
    output = tmp_path / "box.dmd.yaml"
    export_directives(file, output)
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.AddModels(str(tmp_path / "box.sdf"))
    ProcessModelDirectives(LoadModelDirectives(str(output)), parser)
    plant.Finalize()
    context, body = plant.CreateDefaultContext(), plant.GetBodyByName("box").body_frame()
    hand = file.grasps[0].hand
    assert hand is not None
    before = hand.pregrasp
    for kind, moved in (("palm", 0.0), ("pregrasp_palm", before.distance)):
        X_BPalm = plant.GetFrameByName(f"grasp_1_{kind}").CalcPose(context, body)
        p_BPalm = hand.p_BPalm + moved * before.direction_B
        np.testing.assert_allclose(X_BPalm.translation(), p_BPalm, atol=1e-12)
        w, *xyz = hand.quaternion_BPalm
        R_BPalm = Rotation.from_quat([*xyz, w]).as_matrix()
        np.testing.assert_allclose(X_BPalm.rotation().matrix(), R_BPalm, atol=1e-9)
    assert not plant.HasFrameNamed("grasp_2_palm")  # No hand holds the second grasp.
    comments = [line for line in output.read_text().splitlines() if "joints of" in line]
    q = yaml.safe_load(comments[0].partition(": ")[2])
    assert q == dict(hand.q)


def fields() -> dict[str, dict[str, str]]:
    types: dict[str, dict[str, str]] = {}
    for line in MESSAGES.replace(";\n", "; ").strip().splitlines():
        name, _, rest = line.partition(": ")
        pairs = (field.split() for field in rest.split("; "))
        types[name] = {field: kind for kind, field in pairs}
    return types


def assert_is_message(value: Any, kind: str) -> None:
    if kind.endswith("[]"):
        assert isinstance(value, list)
        for item in value:
            assert_is_message(item, kind.removesuffix("[]"))
    elif kind in BASIC:
        assert type(value) is BASIC[kind], (value, kind)
    else:
        expected = fields()[kind]
        assert list(value) == list(expected)
        for name, inner in expected.items():
            assert_is_message(value[name], inner)


def test_moveit_s_messages_have_the_fields_and_types_of_theirs(tmp_path: Path) -> None:
    export_moveit(load_grasps(write_held_box(tmp_path)), tmp_path / "out.yaml")
    messages = yaml.safe_load((tmp_path / "out.yaml").read_text())
    (message,) = messages  # No hand holds the second grasp.
    assert_is_message(message, "moveit_msgs/Grasp")
    assert (message["id"], message["grasp_quality"]) == ("grasp_1", 0.75)
    pose, posture = message["grasp_pose"], message["grasp_posture"]
    assert pose["header"]["frame_id"] == "box"
    assert pose["pose"]["position"] == {"x": 0.0, "y": 0.0, "z": 0.15}
    turn = Rotation.from_quat([pose["pose"]["orientation"][axis] for axis in "xyzw"])
    np.testing.assert_allclose(turn.apply([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], atol=1e-12)
    assert posture["joint_names"] == ["slide", "turn"]
    assert posture["points"][0]["positions"] == [0.02, 0.5]
    assert posture["points"][0]["effort"] == [5.0, 0.2]
    assert message["pre_grasp_posture"]["points"][0]["positions"] == [0.04, 0.1]
    # The palm comes from above, where it leaves along +z.
    approach = message["pre_grasp_approach"]
    assert approach["direction"]["vector"] == {"x": 0.0, "y": 0.0, "z": -1.0}
    assert (approach["desired_distance"], approach["min_distance"]) == (0.1, 0.1)
    assert message["max_contact_force"] == pytest.approx(6.0)
    assert message["allowed_touch_objects"] == ["box"]


def test_an_isaac_grasp_has_the_pose_of_the_palm_and_its_independent_joints(
    tmp_path: Path,
) -> None:
    export_isaac_grasp(load_grasps(write_held_box(tmp_path)), tmp_path / "out.yaml")
    document = yaml.safe_load((tmp_path / "out.yaml").read_text())
    assert (document["format"], document["format_version"]) == ("isaac_grasp", 1.0)
    for ending in ("", "_link"):
        assert document[f"object_frame{ending}"] == "box::box"
        assert document[f"gripper_frame{ending}"] == "palm"
    assert [*document["grasps"]] == ["grasp_1"]
    grasp = document["grasps"]["grasp_1"]
    assert grasp["confidence"] == 0.75
    assert grasp["position"] == [0.0, 0.0, 0.15]
    turn = Rotation.from_quat([*grasp["orientation"]["xyz"], grasp["orientation"]["w"]])
    np.testing.assert_allclose(turn.apply([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], atol=1e-12)
    assert grasp["cspace_position"] == {"slide": 0.02, "turn": 0.5}
    assert grasp["pregrasp_cspace_position"] == {"slide": 0.04, "turn": 0.1}
