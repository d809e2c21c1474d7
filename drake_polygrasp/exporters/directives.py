"""Exports the contact and fingertip frames of a grasp file as Drake's model directives.

The directives add frames to a model that is in the plant already, under the name that the grasp
file gives it: add the model first, then these.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pydrake.common.schema import Transform
from pydrake.common.yaml import yaml_dump_typed
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import AddFrame, ModelDirective, ModelDirectives

from drake_polygrasp.exporters.writing import write_export
from drake_polygrasp.files.stated_grasp import GraspFile
from drake_polygrasp.grasp import AnyGrasp, Grasp, grasp_of
from drake_polygrasp.wrenches.contacts import contact_frames


def contact_poses(grasp: AnyGrasp) -> tuple[RigidTransform, RigidTransform, RigidTransform]:
    """Returns the pose X_BC of each contact frame C in body frame B.

    C's origin is the contact point. Cz is the inward normal, along which the fingertip pushes; Cx
    is normal to the grasp plane, as far as Cz allows.

        X_WC = [X_WB @ X_BC for X_BC in contact_poses(plan.grasps[0])]

    Args:
        grasp: three contacts, alone or with their certificate.

    Returns:
        The poses of contacts 1, 2 and 3.

    Raises:
        UsageError: when it is no grasp.
    """
    grasp = grasp_of(grasp)
    frames = contact_frames(grasp.p_BC[None], grasp.nhat_TB_B[None])[0]
    poses = [
        RigidTransform(RotationMatrix(R_CB[[1, 2, 0]].T), p_BC)
        for R_CB, p_BC in zip(frames, grasp.p_BC, strict=True)
    ]
    return poses[0], poses[1], poses[2]


def export_directives(file: GraspFile, output: Path | str) -> None:
    """Writes the contact and fingertip frames of a grasp file as model directives.

    For the grasp of rank R (from 1) and its contact I (1 to 3) they add frame `grasp_R_contact_I`,
    as `contact_poses` has it, and `grasp_R_tip_I`, the same frame at the centre of a fingertip of
    the plan's radius, to the body that the file names. Its model must be in the plant already:

        export_directives(load_grasps("box.grasp.yaml"), "box.dmd.yaml")
        parser.AddModels("box.sdf")
        ProcessModelDirectives(LoadModelDirectives("box.dmd.yaml"), parser)

    Verdicts of a plant that the file states are written as comments, for directives have no place
    for them.

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file of model directives to write.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `output` cannot be written, or is the grasp file.
    """
    write_export(file, output, _render)


def _render(file: GraspFile) -> str:
    radius = file.plan.tip_radius or 0.0
    directives = ModelDirectives(
        directives=[
            ModelDirective(add_frame=frame)
            for rank, stated in enumerate(file.grasps, start=1)
            for frame in _grasp_frames(file, f"grasp_{rank}", stated.grasp, radius)
        ]
    )
    comments = "".join(_plant_comments(file))
    return f"{comments}{yaml_dump_typed(directives)}"


def _grasp_frames(file: GraspFile, name: str, grasp: Grasp, radius: float) -> Iterator[AddFrame]:
    body = f"{file.object_.model_name}::{file.object_.body_name}"
    for i, X_BC in enumerate(contact_poses(grasp), start=1):
        X_BT = X_BC.multiply(RigidTransform([0.0, 0.0, -radius]))
        for kind, X_BF in (("contact", X_BC), ("tip", X_BT)):
            X_PF = Transform(X_BF)
            X_PF.base_frame = body
            yield AddFrame(name=f"{name}_{kind}_{i}", X_PF=X_PF)


def _plant_comments(file: GraspFile) -> Iterator[str]:
    for rank, stated in enumerate(file.grasps, start=1):
        if stated.plant is not None:
            yield f"# grasp_{rank} in a plant, as {file.path.name} states: {stated.plant.verdict}\n"
