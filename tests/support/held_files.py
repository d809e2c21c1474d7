"""A grasp file whose first grasp a hand holds: the example's box, and a gripper of three joints."""

from __future__ import annotations

from pathlib import Path

import yaml

from tests.support.grasp_files import EXAMPLE, Document, write_box

HAND: Document = {
    "name": "gripper",
    "description_file": "gripper.hand.yaml",
    "sha256": 64 * "0",
    "palm_frame": "palm",
    "approach_P": [0.0, 0.0, 1.0],
}
HOLDING: Document = {
    "fingers": ["a", "b", "c"],
    # A quarter turn about Bz.
    "X_BPalm": {"p_BPalm": [0.0, 0.0, 0.15], "quaternion_wxyz": [0.5**0.5, 0.0, 0.0, 0.5**0.5]},
    "q": {"slide": 0.02, "turn": 0.5, "mimic": -0.5},
    "pregrasp": {
        "q": {"slide": 0.04, "turn": 0.1, "mimic": -0.1},
        "direction_B": [0.0, 0.0, 1.0],
        "distance": 0.1,
        "opening": 0.01,
    },
    "clearance": 0.002,
    "tip_error": 1e-5,
    "tip_angle": 0.1,
    "torque": {
        "share": 0.3,
        "mass": 1.0,
        "loads": "six",
        "friction_share": 0.8,
        "f_Bc_B": [[-6.0, 0.0, 0.0], [3.0, 1.0, 0.0], [3.0, -1.0, 0.0]],
        # The joint "mimic" is coupled to another, which carries its torque.
        "torque": {"slide": 5.0, "turn": 0.2},
    },
    "surroundings": [],
}


def write_held_box(folder: Path) -> Path:
    """The example's file with a second grasp, whose contacts no hand holds."""
    document = yaml.safe_load(EXAMPLE)
    first, second = document["grasps"][0], yaml.safe_load(EXAMPLE)["grasps"][0]
    del second["certificate"]["squeeze_force"]
    return write_box(
        folder,
        yaml.safe_dump(
            document | {"hand": HAND, "grasps": [first | {"hand": HOLDING}, second]},
            sort_keys=False,
        ),
    )
