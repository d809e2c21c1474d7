"""Exports postures of a hand as an isaac_grasp file, which NVIDIA's Isaac Sim and Isaac ROS read.

The format states for each grasp the pose of the gripper's frame in the object's, the positions of
joints before and after closing, and a confidence from 0 to 1, for which the margin of the proof is
written. It has no place for contacts, friction, forces, torques, certificates, or the way by which
the hand comes; grasps without a hand are left out. Frames are named as Drake names them, for
people: readers of the format do not use the names.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from drake_polygrasp.exporters.holding import GraspInHand, held_grasps, independent
from drake_polygrasp.exporters.writing import write_export
from drake_polygrasp.files.stated_grasp import GraspFile


def export_isaac_grasp(file: GraspFile, output: Path | str, *, instance: str | None = None) -> None:
    """Writes the grasps that a hand holds as an isaac_grasp file, format version 1.0.

    Positions are of joints that are not coupled to others, in radians and metres.

        export_isaac_grasp(load_grasps("cube.grasp.yaml"), "cube.isaac.yaml")

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file to write.
        instance: name of the object's model in the other program; None for the file's.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when no grasp states how a hand holds it, or when `output` cannot be written
            or is the grasp file.
    """
    write_export(file, output, instance, _render)


def _render(file: GraspFile, instance: str) -> str:
    held = held_grasps(file)
    frames = f"{instance}::{file.object_.body_name}", held[0].hand.hand.palm_frame
    document = {
        "format": "isaac_grasp",
        "format_version": 1.0,
        # Versions of Isaac disagree on the names of these two keys.
        "object_frame": frames[0],
        "gripper_frame": frames[1],
        "object_frame_link": frames[0],
        "gripper_frame_link": frames[1],
        "grasps": {grasp.name: _grasp_document(grasp) for grasp in held},
    }
    return str(yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=10**6))


def _grasp_document(grasp: GraspInHand) -> dict[str, Any]:
    hand = grasp.hand
    w, *xyz = hand.quaternion_BPalm.tolist()
    return {
        "confidence": grasp.quality,
        "position": hand.p_BPalm.tolist(),
        "orientation": {"w": w, "xyz": xyz},
        "cspace_position": independent(hand, hand.q),
        "pregrasp_cspace_position": independent(hand, hand.pregrasp.q),
    }
