"""Writes and reads the hand of a grasp file, and the optional `hand` block of each grasp."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.object_block import relative_to
from drake_polygrasp.files.plain_yaml import Block
from drake_polygrasp.hand_grasp import (
    HandPlacement,
    HandSource,
    HandTorque,
    Loads,
    Pregrasp,
)

_MOST_JOINTS = 200
"""Our choice: several times what hands have."""


def hand_document(placements: Sequence[HandPlacement], folder: Path) -> dict[str, Any]:
    """Returns the hand of a file as it stands there.

    Args:
        placements: how the hand holds the grasps of the file, at least one.
        folder: the grasp file's folder, to which the description's path is made relative.

    Raises:
        GraspFileError: when they are of different hands, or of one without a description file.
    """
    source = placements[0].hand
    for placement in placements:
        if (placement.hand.name, placement.hand.sha256) != (source.name, source.sha256):
            raise GraspFileError(
                f"the grasps are of two hands, '{source.name}' and '{placement.hand.name}'; write "
                "a grasp file for each"
            )
    if source.description_file is None or source.sha256 is None:
        raise GraspFileError(
            f"a grasp file names its hand's description, and hand '{source.name}' has none; write "
            "it to a file, and load the hand from there"
        )
    return {
        "name": source.name,
        "description_file": relative_to(source.description_file, folder),
        "sha256": source.sha256,
        "palm_frame": source.palm_frame,
        "approach_P": source.approach_P,
    }


def read_hand(block: Block, folder: Path) -> HandSource:
    """Reads which hand a file is for.

    Args:
        block: the `hand` block of the file.
        folder: the grasp file's folder.

    Returns:
        The hand, the path of its description made absolute.

    Raises:
        GraspFileError: when it breaks the format.
    """
    sha256 = block.text("sha256")
    if not re.fullmatch("[0-9a-f]{64}", sha256):
        raise block.refuse("sha256", "64 hexadecimal digits")
    return HandSource(
        name=block.text("name"),
        description_file=folder.absolute() / block.text("description_file"),
        sha256=sha256,
        palm_frame=block.text("palm_frame"),
        approach_P=block.vector("approach_P"),
    )


def placement_document(placement: HandPlacement) -> dict[str, Any]:
    """Returns the `hand` block of a grasp as it stands in the file.

    Args:
        placement: how the hand holds the grasp.
    """
    before, torque = placement.pregrasp, placement.torque
    stated_torque: dict[str, Any] = {"share": torque.share, "mass": torque.mass}
    stated_torque["loads"] = torque.loads
    if torque.up_B is not None:
        stated_torque["up_B"] = torque.up_B
    return {
        "fingers": placement.fingers,
        "X_BPalm": {
            "p_BPalm": placement.p_BPalm,
            "quaternion_wxyz": placement.quaternion_BPalm,
        },
        "q": dict(placement.q),
        "pregrasp": {
            "q": dict(before.q),
            "direction_B": before.direction_B,
            "distance": before.distance,
            "opening": before.opening,
        },
        "clearance": placement.clearance,
        "tip_error": placement.tip_error,
        "tip_angle": placement.tip_angle,
        "torque": {
            **stated_torque,
            "friction_share": torque.friction_share,
            "f_Bc_B": torque.f_Bc_B,
            "torque": dict(torque.torque),
        },
        "surroundings": placement.surroundings,
    }


def read_placement(block: Block, hand: HandSource) -> HandPlacement:
    """Reads how a hand holds a grasp, without checking that it does.

    Args:
        block: the `hand` block of a grasp.
        hand: the file's hand.

    Returns:
        What the file states.

    Raises:
        GraspFileError: when it breaks the format.
    """
    fingers = _read_names(block, "fingers")
    if len(set(fingers)) != 3 or len(fingers) != 3:
        raise block.refuse("fingers", "a list of the names of three different tips")
    pose = block.block("X_BPalm")
    quaternion = pose.vector("quaternion_wxyz", 4)
    if not abs(quaternion @ quaternion - 1) <= 1e-6:
        raise pose.refuse("quaternion_wxyz", "a unit quaternion")
    return HandPlacement(
        fingers=(fingers[0], fingers[1], fingers[2]),
        p_BPalm=pose.vector("p_BPalm"),
        quaternion_BPalm=quaternion,
        q=_read_joints(block, "q"),
        pregrasp=_read_pregrasp(block.block("pregrasp")),
        clearance=block.number("clearance"),
        tip_error=block.number("tip_error", "zero or positive"),
        tip_angle=block.number("tip_angle", "zero or positive"),
        torque=_read_torque(block.block("torque")),
        surroundings=_read_names(block, "surroundings") if "surroundings" in block.data else (),
        hand=hand,
    )


def _read_pregrasp(block: Block) -> Pregrasp:
    direction_B = block.vector("direction_B")
    if not abs(direction_B @ direction_B - 1) <= 1e-6:
        raise block.refuse("direction_B", "a unit vector")
    return Pregrasp(
        q=_read_joints(block, "q"),
        direction_B=direction_B,
        distance=block.number("distance", "positive"),
        opening=block.number("opening", "zero or positive"),
    )


def _read_torque(block: Block) -> HandTorque:
    f_Bc_B = block.vectors("f_Bc_B")
    if len(f_Bc_B) != 3:
        raise block.refuse("f_Bc_B", "a list of three forces")
    loads: Loads = block.text("loads", get_args(Loads))
    up_B = None
    if loads == "up":
        up_B = block.vector("up_B")
        if not abs(up_B @ up_B - 1) <= 1e-6:
            raise block.refuse("up_B", "a unit vector")
    friction_share = block.number("friction_share", "positive")
    if friction_share > 1:
        raise block.refuse("friction_share", "at most 1")
    return HandTorque(
        share=_read_optional(block, "share", "zero or positive"),
        mass=_read_optional(block, "mass", "positive"),
        loads=loads,
        up_B=up_B,
        friction_share=friction_share,
        f_Bc_B=f_Bc_B,
        torque=_read_joints(block, "torque"),
    )


def _read_optional(block: Block, key: str, sign: Any) -> float | None:
    return None if block.get(key) is None else block.number(key, sign)


def _read_names(block: Block, key: str) -> tuple[str, ...]:
    names = block.items(key)
    if not all(isinstance(name, str) and name for name in names):
        raise block.refuse(key, "a list of names")
    return tuple(names)


def _read_joints(block: Block, key: str) -> Mapping[str, float]:
    """Reads numbers by the names of joints."""
    joints = block.block(key)
    if len(joints.data) > _MOST_JOINTS:
        raise block.refuse(key, f"a mapping of at most {_MOST_JOINTS} joints")
    return {name: joints.number(name) for name in joints.data}
