"""Exports postures of a hand as a YAML list of MoveIt's moveit_msgs/Grasp messages.

Each message has all fields of its type. Poses and directions are in the object's frame, named as
its model: the frame of a collision object of that name in MoveIt's planning scene, if that is added
with body frame B as its pose. `grasp_pose` is of the hand's palm frame, which must be that of the
end effector's parent link. `grasp_quality` is the margin of the proof. The message has no place for
contacts, friction and certificates, and the file says nothing of retreats, whose distance is 0;
grasps without a hand are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from drake_polygrasp.exporters.holding import GraspInHand, held_grasps, independent
from drake_polygrasp.exporters.writing import write_export
from drake_polygrasp.files.stated_grasp import GraspFile


def export_moveit(file: GraspFile, output: Path | str, *, instance: str | None = None) -> None:
    """Writes the grasps that a hand holds as moveit_msgs/Grasp messages, best first.

    The posture of the grasp has the torques that the file states as its efforts, and
    `max_contact_force` is the greatest of the forces that these exert [N].

        export_moveit(load_grasps("cube.grasp.yaml"), "cube.moveit.yaml")

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
    messages = [_message(grasp, instance) for grasp in held_grasps(file)]
    return str(yaml.safe_dump(messages, sort_keys=False, default_flow_style=None, width=10**6))


def _message(grasp: GraspInHand, frame: str) -> dict[str, Any]:
    hand = grasp.hand
    w, x, y, z = hand.quaternion_BPalm.tolist()
    return {
        "id": grasp.name,
        "pre_grasp_posture": _posture(independent(hand, hand.pregrasp.q), {}),
        "grasp_posture": _posture(independent(hand, hand.q), hand.torque.torque),
        "grasp_pose": {
            "header": _header(frame),
            "pose": {
                "position": _vector(hand.p_BPalm.tolist()),
                "orientation": {"x": x, "y": y, "z": z, "w": w},
            },
        },
        "grasp_quality": grasp.quality,
        "pre_grasp_approach": _translation(
            frame, (0.0 - hand.pregrasp.direction_B).tolist(), hand.pregrasp.distance
        ),
        "post_grasp_retreat": _translation(frame, [0.0, 0.0, 0.0], 0.0),
        "post_place_retreat": _translation(frame, hand.pregrasp.direction_B.tolist(), 0.0),
        "max_contact_force": float(np.linalg.norm(hand.torque.f_Bc_B, axis=1).max()),
        "allowed_touch_objects": [frame],
    }


def _posture(positions: Mapping[str, float], efforts: Mapping[str, float]) -> dict[str, Any]:
    """Returns a trajectory_msgs/JointTrajectory of one point."""
    return {
        "header": _header(""),
        "joint_names": [*positions],
        "points": [
            {
                "positions": [*positions.values()],
                "velocities": [],
                "accelerations": [],
                "effort": [float(efforts[name]) for name in positions] if efforts else [],
                "time_from_start": {"sec": 0, "nanosec": 0},
            }
        ],
    }


def _translation(frame: str, direction: Sequence[float], distance: float) -> dict[str, Any]:
    """Returns a moveit_msgs/GripperTranslation."""
    return {
        "direction": {"header": _header(frame), "vector": _vector(direction)},
        "desired_distance": float(distance),
        "min_distance": float(distance),
    }


def _header(frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}


def _vector(xyz: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", xyz, strict=True))
