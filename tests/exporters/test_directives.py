"""Frames of a grasp file in a plant are where the file says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import LoadModelDirectives, Parser, ProcessModelDirectives
from pydrake.multibody.plant import MultibodyPlant

from drake_polygrasp import contact_poses, load_grasps
from drake_polygrasp.cli.main import main
from tests.support.common import grasp, random_contacts
from tests.support.grasp_files import BOX_SDF, write_box


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return write_box(tmp_path)


def test_frames_of_the_directives_are_at_contacts_and_tips(box: Path) -> None:
    output = box.parent / "box.dmd.yaml"
    assert main(["export", str(box), "--directives", str(output)]) == 0
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.AddModels(str(box.parent / "box.sdf"))
    ProcessModelDirectives(LoadModelDirectives(str(output)), parser)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    body = plant.GetBodyByName("box").body_frame()
    file = load_grasps(box)
    radius = file.plan.tip_radius
    assert radius is not None
    for i, (p_BC, nhat_TB_B) in enumerate(
        zip(file.grasps[0].grasp.p_BC, file.grasps[0].grasp.nhat_TB_B, strict=True), start=1
    ):
        X_BC, X_BT = (
            plant.GetFrameByName(f"grasp_1_{kind}_{i}").CalcPose(context, body)
            for kind in ("contact", "tip")
        )
        np.testing.assert_allclose(X_BC.translation(), p_BC, atol=1e-12)
        np.testing.assert_allclose(X_BC.rotation().col(2), nhat_TB_B, atol=1e-12)
        np.testing.assert_allclose(X_BT.translation(), p_BC - radius * nhat_TB_B, atol=1e-12)
        np.testing.assert_allclose(X_BT.rotation().matrix(), X_BC.rotation().matrix(), atol=1e-12)


def test_contact_frames_push_into_the_object() -> None:
    p_BC, nhat_TB_B, mu = random_contacts(50)
    for k in range(50):
        contacts = grasp(p_BC[k], nhat_TB_B[k], mu[k])
        for X_BC, p, nhat in zip(contact_poses(contacts), p_BC[k], nhat_TB_B[k], strict=True):
            assert X_BC.rotation().IsValid()
            np.testing.assert_allclose(X_BC.translation(), p)
            np.testing.assert_allclose(X_BC.rotation().col(2), nhat, atol=1e-12)


def test_frames_are_added_to_a_model_that_the_plant_renamed(box: Path) -> None:
    output = box.parent / "box.dmd.yaml"
    assert (
        main(["export", str(box), "--to", "directives", "-o", str(output), "--instance", "b"]) == 0
    )
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    first, second = (
        parser.AddModelsFromString(text, "sdf")[0]
        for text in (BOX_SDF, BOX_SDF.replace('model name="box"', 'model name="b"'))
    )
    ProcessModelDirectives(LoadModelDirectives(str(output)), parser)
    plant.Finalize()
    assert plant.HasFrameNamed("grasp_1_contact_1", second)
    assert not plant.HasFrameNamed("grasp_1_contact_1", first)
