"""The hand in a scene of grasps: where its bodies are drawn, and what moves it."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform

from drake_polygrasp import save_grasps
from drake_polygrasp.cli.main import main
from drake_polygrasp.cli.shown_scene import _draw, load_file_scene
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.visualization import draw_grasps, draw_hands, move_hand
from tests.support.hand_judge import HandJudge
from tests.support.hands import (
    CUBE,
    OWN_HAND,
    OWN_MODEL,
    own_hand,
    own_hand_grasps,
    planned,
)


@pytest.fixture(scope="module")
def meshcat() -> Meshcat:
    return Meshcat()


def drawn_pose(meshcat: Meshcat, path: str) -> RigidTransform:
    """The pose that Meshcat was told for a path: sixteen doubles of a msgpack array, by columns."""
    packed = meshcat._GetPackedTransform(path)
    _, _, rest = packed.partition(b"matrix\xdc\x00\x10")
    numbers = [struct.unpack(">d", rest[9 * k + 1 : 9 * k + 9])[0] for k in range(16)]
    return RigidTransform(np.reshape(numbers, (4, 4)).T)


def test_bodies_are_drawn_where_the_hand_is(meshcat: Meshcat) -> None:
    object_, _ = planned(CUBE)
    grasps = own_hand_grasps(CUBE)
    draw_grasps(meshcat, object_, [each.certified for each in grasps])
    draw_hands(meshcat, own_hand(), grasps)
    judge, each = HandJudge(own_hand(), OWN_MODEL, CUBE), grasps[0]
    for share, along, q in (
        (1.0, 0.0, each.q),
        (0.5, 0.0, each.pregrasp.q),
        (0.0, each.pregrasp.distance, each.pregrasp.q),
    ):
        move_hand(meshcat, own_hand(), each, 1, share)
        moved = RigidTransform(np.asarray(along * each.pregrasp.direction_B)) @ each.X_BPalm
        judge.place(moved, q)
        for body in ("palm", "first_distal", "third_proximal"):
            found = judge.plant.GetBodyByName(body, judge.hand_instance)
            X_BL = judge.plant.EvalBodyPoseInWorld(judge.context, found)
            shown = drawn_pose(meshcat, f"polygrasp/grasps/1/hand/{body}")
            assert X_BL.IsNearlyEqualTo(shown, 1e-9)
    before = drawn_pose(meshcat, "polygrasp/grasps/1/pregrasp/first_distal")
    move_hand(meshcat, own_hand(), each, 1, 0.5)
    after = drawn_pose(meshcat, "polygrasp/grasps/1/hand/first_distal")
    assert before.IsNearlyEqualTo(after, 1e-12)


def test_show_draws_the_hand_of_each_grasp_that_has_one(tmp_path: Path) -> None:
    object_, grasps = planned(CUBE)
    file, page = tmp_path / "cube.grasp.yaml", tmp_path / "cube.html"
    save_grasps(file, object_, [own_hand_grasps(CUBE)[0], grasps[1]], StatedPlan())
    meshcat, hand = _draw(load_file_scene(file))
    assert hand is not None
    for name in ("hand", "pregrasp"):
        path = "polygrasp/grasps/{}/{}/palm/0"
        assert meshcat._GetPackedObject(path.format(1, name))
        assert not meshcat._GetPackedObject(path.format(2, name))
    assert main(["show", str(file), "--html", str(page)]) == 0
    assert page.stat().st_size > 10_000


def test_a_hand_that_is_gone_or_changed_is_said_and_the_rest_shown(tmp_path: Path) -> None:
    for model in (CUBE, OWN_HAND, OWN_MODEL):
        shutil.copy(model, tmp_path)
    object_, _ = planned(CUBE)
    file = tmp_path / "cube.grasp.yaml"
    save_grasps(file, object_, own_hand_grasps(CUBE)[:1], StatedPlan())
    document = yaml.safe_load(file.read_text())
    document["hand"]["description_file"] = OWN_HAND.name
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    scene = load_file_scene(file)
    assert scene.hand is not None
    assert scene.hand.samefile(tmp_path / OWN_HAND.name)
    model = tmp_path / OWN_MODEL.name
    model.write_text(model.read_text().replace("<effort>1.5", "<effort>1.4"))
    scene = load_file_scene(file)
    assert scene.hand is not None
    assert "has changed since" in scene.object_.warnings[-1]
    (tmp_path / OWN_HAND.name).unlink()
    scene = load_file_scene(file)
    assert scene.hand is None
    assert "the hand is not shown" in scene.object_.warnings[-1]
    assert scene.grasps
