"""A hand of other geometry, with coupled joints, works by its description alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from drake_polygrasp import load_hand, load_object, plan_hand_grasps, save_grasps, verify_file
from tests.hands.test_hand_search import ACCURACY, apart
from tests.support.hand_judge import HandJudge
from tests.support.hands import CUBE, PATIENCE

HAND = Path(__file__).with_name("four_fingers.hand.yaml")
RADIUS = 0.011


def test_four_fingers_of_two_independent_joints_grasp_a_cube(tmp_path: Path) -> None:
    hand = load_hand(HAND)
    assert len(hand.independent) == 8
    assert len(hand.fingers) == 4
    cube = load_object(CUBE)
    plan = plan_hand_grasps(cube, hand, top=2, budget=PATIENCE)
    assert plan.grasps
    judge = HandJudge(hand, HAND.with_suffix("").with_suffix(".urdf"), CUBE)
    for found in plan.grasps:
        for finger in ("ne", "nw", "sw", "se"):
            follower = 0.6 * found.q[f"{finger}_flex"] + 0.3
            assert abs(found.q[f"{finger}_tip"] - follower) < 1e-6
        grasp = found.certified.grasp
        judge.place(found.X_BPalm, found.q)
        places = grasp.p_BC - RADIUS * grasp.nhat_TB_B
        off = np.linalg.norm(judge.tip_centres(found.fingers) - places, axis=1)
        assert off.max() <= 5e-4
        clearance, link, _ = apart(judge, found)
        assert clearance >= 1.5e-3 - ACCURACY
        assert link >= -ACCURACY
    file = tmp_path / "cube.grasp.yaml"
    save_grasps(file, cube, plan.grasps, plan.settings)
    assert verify_file(file).holds
