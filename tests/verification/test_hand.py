"""The line HAND: honest files are recomputed, each spoiled one fails with its reason."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from drake_polygrasp import save_grasps, verify_file
from drake_polygrasp.cli.main import main
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.verification.report import CheckResult, Status, VerificationReport
from tests.support.hands import CUBE, OWN_HAND, OWN_MODEL, own_hand_grasps, planned
from tests.test_architecture import loaded_by, room_of

Spoil = Callable[[dict[str, Any]], None]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A grasp file beside copies of its models."""
    for model in (CUBE, OWN_HAND, OWN_MODEL):
        shutil.copy(model, tmp_path)
    path = tmp_path / "cube.grasp.yaml"
    object_, _ = planned(CUBE)
    save_grasps(path, object_, own_hand_grasps(CUBE), StatedPlan())
    document = yaml.safe_load(path.read_text())
    document["object"]["model_file"] = CUBE.name
    document["hand"]["description_file"] = OWN_HAND.name
    path.write_text(yaml.safe_dump(document, sort_keys=False))
    return path


def hand_lines(report: VerificationReport) -> list[CheckResult]:
    return [line for grasp in report.grasps if (line := grasp.hand) is not None]


def test_an_honest_file_is_recomputed(file: Path) -> None:
    report = verify_file(file)
    assert report.holds
    lines = hand_lines(report)
    assert len(lines) == len(own_hand_grasps(CUBE)) > 0
    assert {line.status for line in lines} == {Status.RECOMPUTED}
    assert main(["verify", str(file), "--require-model"]) == 0


def test_a_file_for_one_way_up_is_recomputed(tmp_path: Path) -> None:
    object_, _ = planned(CUBE)
    path = tmp_path / "up.grasp.yaml"
    save_grasps(path, object_, own_hand_grasps(CUBE, up=True), StatedPlan())
    assert verify_file(path).holds


def first_hand(document: dict[str, Any]) -> dict[str, Any]:
    hand: dict[str, Any] = document["grasps"][0]["hand"]
    return hand


def move_joint(document: dict[str, Any]) -> None:
    first_hand(document)["q"]["first_bend"] += 0.02


def move_palm(document: dict[str, Any]) -> None:
    first_hand(document)["X_BPalm"]["p_BPalm"][0] += 0.002


def halve_share(document: dict[str, Any]) -> None:
    first_hand(document)["torque"]["share"] *= 0.5


def rename_joint(document: dict[str, Any]) -> None:
    q = first_hand(document)["q"]
    q["first_twist"] = q.pop("first_bend")


def change_digest(document: dict[str, Any]) -> None:
    document["hand"]["sha256"] = "0" * 64


def swap_fingers(document: dict[str, Any]) -> None:
    hand = first_hand(document)
    hand["fingers"] = [hand["fingers"][1], hand["fingers"][0], hand["fingers"][2]]


def name_no_tip(document: dict[str, Any]) -> None:
    first_hand(document)["fingers"][0] = "fourth"


def praise_clearance(document: dict[str, Any]) -> None:
    first_hand(document)["clearance"] += 0.001


def praise_tips(document: dict[str, Any]) -> None:
    first_hand(document)["tip_error"] *= 0.5


def praise_angle(document: dict[str, Any]) -> None:
    first_hand(document)["tip_angle"] *= 0.9


def weaken_torque(document: dict[str, Any]) -> None:
    torque = first_hand(document)["torque"]["torque"]
    torque["second_bend"] += 1e-3


def lean_force(document: dict[str, Any]) -> None:
    hand = first_hand(document)
    f = np.array(hand["torque"]["f_Bc_B"])
    n = np.array([contact["nhat_TB_B"] for contact in document["grasps"][0]["contacts"]])
    f[0] += 100 * np.cross(n[0], [0.3, 0.4, 0.5])
    hand["torque"]["f_Bc_B"] = f.tolist()


def unbalance(document: dict[str, Any]) -> None:
    torque = first_hand(document)["torque"]
    torque["f_Bc_B"][0] = (1.01 * np.array(torque["f_Bc_B"][0])).tolist()


def lift_more(document: dict[str, Any]) -> None:
    first_hand(document)["torque"]["mass"] *= 2


def squeeze_too_much(document: dict[str, Any]) -> None:
    torque = first_hand(document)["torque"]
    torque["f_Bc_B"] = (20 * np.array(torque["f_Bc_B"])).tolist()
    torque["torque"] = {name: 20 * value for name, value in torque["torque"].items()}


def come_from_below(document: dict[str, Any]) -> None:
    before = first_hand(document)["pregrasp"]
    before["direction_B"] = (-np.array(before["direction_B"])).tolist()


def open_more(document: dict[str, Any]) -> None:
    first_hand(document)["pregrasp"]["opening"] += 0.005


def leave_limits(document: dict[str, Any]) -> None:
    first_hand(document)["pregrasp"]["q"]["first_bend"] = 2.0


def turn_palm(document: dict[str, Any]) -> None:
    document["hand"]["approach_P"] = [1.0, 0.0, 0.0]


def rename_palm(document: dict[str, Any]) -> None:
    document["hand"]["palm_frame"] = "palm"


def claim_friction(document: dict[str, Any]) -> None:
    # The file's own friction, which SURFACE checks; HAND regards the fingertips'.
    document["grasps"][0]["contacts"][0]["mu"] = 5.0


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (move_joint, "mm off its place"),
        (move_palm, "mm off its place"),
        (halve_share, r"torque\.share is .*, and loads need"),
        (rename_joint, "no joint 'first_twist'"),
        (change_digest, "has changed since: sha256 differs"),
        (swap_fingers, "mm off its place"),
        (name_no_tip, "'fourth', which is no tip"),
        (praise_clearance, "clearance is .*, more than"),
        (praise_tips, "tip_error is .*, less than"),
        (praise_angle, "tip_angle is .*, less than"),
        (weaken_torque, "torque is not what f_Bc_B makes it"),
        (lean_force, "outside its friction cone"),
        (unbalance, "not in balance"),
        (lift_more, r"torque\.share is .*, and loads need"),
        (squeeze_too_much, "its effort is"),
        (come_from_below, "on its straight way"),
        (open_more, "opening is .*, more than"),
        (leave_limits, "its limits"),
        (turn_palm, "approach_P"),
        (rename_palm, "palm_frame"),
        (claim_friction, "claims friction"),
    ],
)
def test_a_spoiled_file_fails_with_the_reason(file: Path, spoil: Spoil, reason: str) -> None:
    document = yaml.safe_load(file.read_text())
    spoil(document)
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    report = verify_file(file)
    assert report.holds is False
    line = hand_lines(report)[0]
    assert line.status is Status.FAILED
    assert re.search(reason, line.reason), line.reason


def test_a_hand_that_changed_or_is_gone_is_said(file: Path, capsys: Any) -> None:
    model = file.with_name(OWN_MODEL.name)
    model.write_text(model.read_text().replace("<effort>1.5</effort>", "<effort>1.4</effort>"))
    assert "sha256 differs" in hand_lines(verify_file(file))[0].reason
    file.with_name(OWN_HAND.name).unlink()
    report = verify_file(file)
    assert report.holds is None
    assert {line.status for line in hand_lines(report)} == {Status.NOT_CHECKED}
    assert main(["verify", str(file)]) == 0
    assert "HAND was not checked" in capsys.readouterr().out
    assert main(["verify", str(file), "--require-model"]) == 1


def test_numbers_beyond_measure_fail_and_do_not_abort(file: Path) -> None:
    for key, value in (("p_BPalm", [1e200, 0.0, 0.0]), ("p_BPalm", [1e9, 0.0, 0.0])):
        document = yaml.safe_load(file.read_text())
        first_hand(document)["X_BPalm"][key] = value
        file.write_text(yaml.safe_dump(document, sort_keys=False))
        assert hand_lines(verify_file(file))[0].status is Status.FAILED


def test_what_was_around_is_said_not_to_be_checked(file: Path) -> None:
    document = yaml.safe_load(file.read_text())
    first_hand(document)["surroundings"] = ["table", "mug"]
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    line = hand_lines(verify_file(file))[0]
    assert line.status is Status.RECOMPUTED
    assert "clearance from table, mug is not checked" in line.reason


def write_scene(folder: Path, height: float) -> Path:
    """Directives with the cube and a table whose top is at a height in its frame."""
    (folder / "table.sdf").write_text(
        """<sdf version="1.9"><model name="table"><link name="table"><collision name="table">
        <geometry><box><size>1 1 0.02</size></box></geometry></collision></link></model></sdf>"""
    )
    scene = folder / "scene.dmd.yaml"
    scene.write_text(
        f"""directives:
- add_model: {{name: cube, file: file://{folder / CUBE.name}}}
- add_model: {{name: table, file: file://{folder / "table.sdf"}}}
- add_weld:
    parent: world
    child: table::table
    X_PC: {{translation: [0, 0, {height - 0.01}]}}
"""
    )
    return scene


def test_a_scene_is_checked_too_where_it_is_given(file: Path) -> None:
    document = yaml.safe_load(file.read_text())
    document["grasps"] = document["grasps"][:1]
    first_hand(document)["surroundings"] = ["table::table"]
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    far = hand_lines(verify_file(file, plant=True, scene=write_scene(file.parent, -1.0)))[0]
    assert far.status is Status.RECOMPUTED
    assert "table" not in far.reason
    # This grasp was planned in the air, and its fingers reach below the cube.
    near = hand_lines(verify_file(file, plant=True, scene=write_scene(file.parent, -0.03)))[0]
    assert near.status is Status.FAILED
    assert re.search("overlaps|clearance", near.reason)


def test_verifying_a_hand_loads_no_planner(file: Path) -> None:
    code = f"from drake_polygrasp.verification.verify import verify_file as v; v({str(file)!r})"
    loaded, result = loaded_by("-c", code)
    rooms = {room_of(name.removeprefix("drake_polygrasp.")) for name in loaded}
    assert "hands" in rooms, result.stderr[-1000:]
    assert not rooms & {"paper", "search", "pipeline"}
