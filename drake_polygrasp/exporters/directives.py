"""Contact and fingertip frames of a grasp file as Drake's model directives.

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

from drake_polygrasp.arguments import check_instance, check_path
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.stated_grasp import GraspFile
from drake_polygrasp.grasp import AnyGrasp, Grasp, grasp_of
from drake_polygrasp.wrenches.contacts import contact_frames


def contact_poses(grasp: AnyGrasp) -> tuple[RigidTransform, RigidTransform, RigidTransform]:
    """Returns X_BC of each contact frame C: Cz pushes into the object, Cx crosses the grasp plane.

    Args:
        grasp: three contacts; of a plan or of a file, with their certificate, too.

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


def grasp_directives(file: GraspFile) -> ModelDirectives:
    """Frames `grasp_R_contact_I`, and `grasp_R_tip_I` at the centre of the plan's fingertip.

    Of the grasp of rank R, from 1, and its contacts I from 1 to 3, on the body that the file names.
    """
    radius = file.plan.get("tip_radius", 0.0)
    return ModelDirectives(
        directives=[
            ModelDirective(add_frame=frame)
            for rank, stated in enumerate(file.grasps, start=1)
            for frame in _grasp_frames(file, f"grasp_{rank}", stated.grasp, radius)
        ]
    )


def _grasp_frames(file: GraspFile, name: str, grasp: Grasp, radius: float) -> Iterator[AddFrame]:
    body = f"{file.object_.model_name}::{file.object_.body_name}"
    for i, X_BC in enumerate(contact_poses(grasp), start=1):
        X_BT = X_BC.multiply(RigidTransform([0.0, 0.0, -radius]))
        for kind, X_BF in (("contact", X_BC), ("tip", X_BT)):
            X_PF = Transform(X_BF)
            X_PF.base_frame = body
            yield AddFrame(name=f"{name}_{kind}_{i}", X_PF=X_PF)


def export_directives(file: GraspFile, output: Path | str) -> None:
    """Writes `grasp_directives` to a file for `LoadModelDirectives`.

    What a plant said of the grasps stands above them in comments, for directives have no place
    for it.

    Args:
        file: from `load_grasps`.
        output: the model directives.

    Raises:
        UsageError: when an argument is not what it may be.
        GraspFileError: when `output` cannot be written, or would be the grasp file.
    """
    check_instance("file", file, GraspFile, "as load_grasps returns it")
    output = Path(check_path("output", output))
    if output.exists() and output.samefile(file.path):
        raise GraspFileError(f"{output}: is the grasp file; name another for the directives")
    try:
        text = "".join(_plant_comments(file)) + yaml_dump_typed(grasp_directives(file))
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise GraspFileError(f"{output}: cannot be written: {error.strerror}") from error


def _plant_comments(file: GraspFile) -> Iterator[str]:
    for rank, stated in enumerate(file.grasps, start=1):
        if stated.plant is not None:
            yield f"# grasp_{rank} in a plant, as {file.path.name} states: {stated.plant.verdict}\n"
