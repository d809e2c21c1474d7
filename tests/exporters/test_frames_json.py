"""Frames read back from plain JSON are where the file says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from drake_polygrasp import load_grasps
from drake_polygrasp.exporters import export_frames_json
from tests.support.held_files import HOLDING, write_held_box


def rotation(pose: dict[str, Any]) -> Rotation:
    w, x, y, z = pose["quaternion_wxyz"]
    return Rotation.from_quat([x, y, z, w])


def test_frames_are_at_contacts_and_tips_and_at_the_palm(tmp_path: Path) -> None:
    file = load_grasps(write_held_box(tmp_path))
    export_frames_json(file, tmp_path / "out.json")
    document = json.loads((tmp_path / "out.json").read_text())
    assert (document["format"], document["version"]) == ("drake_polygrasp/frames", 1)
    assert (document["model_name"], document["body_name"]) == ("box", "box")
    radius = document["tip_radius"]
    assert radius == 0.0049
    first, second = document["grasps"]
    for stated, grasp in zip(file.grasps, (first, second), strict=True):
        for i in range(3):
            p_BC, nhat = stated.grasp.p_BC[i], stated.grasp.nhat_TB_B[i]
            contact, tip = grasp["X_BC"][i], grasp["X_BT"][i]
            np.testing.assert_allclose(contact["p_BF"], p_BC, atol=1e-15)
            np.testing.assert_allclose(tip["p_BF"], p_BC - radius * nhat, atol=1e-15)
            for pose in (contact, tip):
                np.testing.assert_allclose(rotation(pose).as_matrix()[:, 2], nhat, atol=1e-12)
    palm = first["hand"]
    assert (palm["name"], palm["palm_frame"]) == ("gripper", "palm")
    assert palm["X_BPalm"]["p_BF"] == [0.0, 0.0, 0.15]
    turned = rotation(palm["X_BPalm"]).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], atol=1e-12)
    assert palm["q"] == HOLDING["q"]
    assert palm["pregrasp_q"] == HOLDING["pregrasp"]["q"]
    assert "hand" not in second
