"""Exports the frames of contacts, fingertips and palms of a grasp file as Drake's model directives.

The directives add frames to a model that is in the plant already, under the name that the grasp
file gives it or another: add the model first, then these. They carry neither friction, forces,
certificates nor a hand's model; its joint positions and verdicts of checks in a plant are comments.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pydrake.common.schema import Transform
from pydrake.common.yaml import yaml_dump_typed
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import AddFrame, ModelDirective, ModelDirectives

from drake_polygrasp.exporters.poses import contact_poses, tip_poses
from drake_polygrasp.exporters.writing import write_export
from drake_polygrasp.files.stated_grasp import GraspFile
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.hand_grasp import HandPlacement


def export_directives(file: GraspFile, output: Path | str, *, instance: str | None = None) -> None:
    """Writes the frames of contacts, fingertips and palms of a grasp file as model directives.

    For the grasp of rank R (from 1) and its contact I (1 to 3) they add frame `grasp_R_contact_I`,
    as `contact_poses` has it, and `grasp_R_tip_I`, the same frame at the centre of a fingertip of
    the plan's radius, to the body that the file names. Its model must be in the plant already:

        export_directives(load_grasps("box.grasp.yaml"), "box.dmd.yaml")
        parser.AddModels("box.sdf")
        ProcessModelDirectives(LoadModelDirectives("box.dmd.yaml"), parser)

    Where a hand holds the grasp, `grasp_R_palm` is where the palm's frame is to be, and
    `grasp_R_pregrasp_palm` where its straight way begins: weld the hand's palm there, or give its
    root that pose.

    Joint positions of the hand and verdicts of a plant are written as comments, for directives have
    no place for them.

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file of model directives to write.
        instance: name of the model's instance in the plant; None for the one in the file.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `output` cannot be written, or is the grasp file.
    """
    write_export(file, output, instance, _render)


def _render(file: GraspFile, instance: str) -> str:
    body = f"{instance}::{file.object_.body_name}"
    radius = file.plan.tip_radius or 0.0
    directives = ModelDirectives(
        directives=[
            ModelDirective(add_frame=frame)
            for rank, stated in enumerate(file.grasps, start=1)
            for frame in (
                *_grasp_frames(body, f"grasp_{rank}", stated.grasp, radius),
                *_palm_frames(body, f"grasp_{rank}", stated.hand),
            )
        ]
    )
    comments = "".join([*_plant_comments(file), *_joint_comments(file)])
    return f"{comments}{yaml_dump_typed(directives)}"


def _grasp_frames(body: str, name: str, grasp: Grasp, radius: float) -> Iterator[AddFrame]:
    poses = zip(contact_poses(grasp), tip_poses(grasp, radius), strict=True)
    for i, (X_BC, X_BT) in enumerate(poses, start=1):
        for kind, X_BF in (("contact", X_BC), ("tip", X_BT)):
            yield _frame(body, f"{name}_{kind}_{i}", X_BF)


def _palm_frames(body: str, name: str, hand: HandPlacement | None) -> Iterator[AddFrame]:
    if hand is None:
        return
    before = hand.pregrasp
    back = RigidTransform(np.asarray(before.distance * before.direction_B))
    poses = {"palm": hand.X_BPalm, "pregrasp_palm": back @ hand.X_BPalm}
    for kind, X_BPalm in poses.items():
        yield _frame(body, f"{name}_{kind}", X_BPalm)


def _frame(body: str, name: str, X_BF: RigidTransform) -> AddFrame:
    X_PF = Transform(X_BF)
    X_PF.base_frame = body
    return AddFrame(name=name, X_PF=X_PF)


def _joint_comments(file: GraspFile) -> Iterator[str]:
    for rank, stated in enumerate(file.grasps, start=1):
        if (hand := stated.hand) is not None:
            for kind, q in (("", hand.q), (" before the fingers close", hand.pregrasp.q)):
                positions = ", ".join(f"{joint}: {value!r}" for joint, value in q.items())
                yield f"# grasp_{rank}, joints of {hand.hand.name}{kind}: {{{positions}}}\n"


def _plant_comments(file: GraspFile) -> Iterator[str]:
    for rank, stated in enumerate(file.grasps, start=1):
        if stated.plant is not None:
            yield f"# grasp_{rank} in a plant, as {file.path.name} states: {stated.plant.verdict}\n"
