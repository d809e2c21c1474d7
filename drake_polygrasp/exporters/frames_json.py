"""Exports the frames of a grasp file as plain JSON, for programs without Drake or YAML.

Poses are in body frame B: a position [m] and a unit quaternion. Friction, forces, proofs and
numbers of the certificate are left to the grasp file.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from drake_polygrasp.exporters.poses import contact_poses, pose_document, tip_poses
from drake_polygrasp.exporters.writing import write_export
from drake_polygrasp.files.stated_grasp import GraspFile, StatedGrasp
from drake_polygrasp.hand_grasp import HandPlacement

FRAMES_FORMAT = "drake_polygrasp/frames"
"""Value of the key `format`."""
_VERSION = 1


def export_frames_json(file: GraspFile, output: Path | str, *, instance: str | None = None) -> None:
    """Writes poses of contact frames, fingertips and, where a hand holds them, palms as JSON.

    Contact frames are those of `contact_poses`: Cz is the inward normal. Tips are parallel to them,
    at the centres of fingertips of the plan's radius. Palms come with the joints' positions.

        export_frames_json(load_grasps("cube.grasp.yaml"), "cube.json")

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file to write.
        instance: name of the object's model in the other program; None for the file's.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `output` cannot be written, or is the grasp file.
    """
    write_export(file, output, instance, _render)


def _render(file: GraspFile, instance: str) -> str:
    document = {
        "format": FRAMES_FORMAT,
        "version": _VERSION,
        "model_name": instance,
        "body_name": file.object_.body_name,
        "tip_radius": file.plan.tip_radius,
        "grasps": [_grasp_document(stated, file.plan.tip_radius or 0.0) for stated in file.grasps],
    }
    return f"{json.dumps(document, indent=1)}\n"


def _grasp_document(stated: StatedGrasp, radius: float) -> dict[str, Any]:
    document = {
        "kind": stated.grasp.kind,
        "X_BC": [pose_document(X_BC) for X_BC in contact_poses(stated.grasp)],
        "X_BT": [pose_document(X_BT) for X_BT in tip_poses(stated.grasp, radius)],
    }
    return document if stated.hand is None else document | {"hand": _hand_document(stated.hand)}


def _hand_document(hand: HandPlacement) -> dict[str, Any]:
    return {
        "name": hand.hand.name,
        "palm_frame": hand.hand.palm_frame,
        "X_BPalm": pose_document(hand.X_BPalm),
        "q": dict(hand.q),
        "pregrasp_q": dict(hand.pregrasp.q),
    }
