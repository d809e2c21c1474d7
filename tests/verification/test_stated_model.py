"""The object of a grasp file: the one that its grasps were planned on, or a reason why not."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import load_object, load_planned_object, plan_grasps, save_grasps, verify_file
from drake_polygrasp.errors import GraspFileError, ModelError
from drake_polygrasp.loading.examples import example_models
from drake_polygrasp.settings import NO_ERRORS


@pytest.fixture
def planned(tmp_path: Path) -> tuple[Path, Path]:
    """A model with another friction than it states, and the file of its grasps."""
    model = tmp_path / "cube.sdf"
    shutil.copy(example_models()["cube"], model)
    cube = load_object(model, mu=0.7)
    plan = plan_grasps(cube, effort="quick", top=2, **NO_ERRORS)
    file = tmp_path / "cube.grasp.yaml"
    save_grasps(file, cube, plan.grasps, plan.settings)
    return model, file


def test_the_object_is_the_one_that_was_planned_on(planned: tuple[Path, Path]) -> None:
    model, file = planned
    cube, again = load_object(model, mu=0.7), load_planned_object(file)
    assert (again.mass, again.rho) == (cube.mass, cube.rho)
    np.testing.assert_array_equal(again.polyhedron.mu, np.full(6, 0.7))
    np.testing.assert_array_equal(again.p_BBcm, cube.p_BBcm)
    # The file says whose friction it is, so that it is not compared with the model's.
    assert verify_file(file).holds


def test_a_model_that_has_changed_is_not_that_object(planned: tuple[Path, Path]) -> None:
    model, file = planned
    model.write_text(model.read_text().replace("0.06", "0.05") + "\n")
    with pytest.raises(ModelError, match=r"has changed since the grasps of .* were planned"):
        load_planned_object(file)
    model.unlink()
    with pytest.raises(ModelError, match="there is no such model file"):
        load_planned_object(file)


def test_a_grasp_file_is_no_model(planned: tuple[Path, Path]) -> None:
    _, file = planned
    with pytest.raises(ModelError, match="load_planned_object loads its object"):
        load_object(file)
    file.write_text("grasps: 3")
    with pytest.raises(GraspFileError):
        load_planned_object(file)
