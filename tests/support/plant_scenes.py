"""Objects, grasps and forces known by hand, for what is tried in a plant."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from drake_polygrasp import CertifiedGrasp, Grasp, GraspObject, load_object
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.holding_forces import Holding, spare_friction
from drake_polygrasp.plant.scratch_plant import ScratchScene, make_scene
from tests.support.common import grasp
from tests.support.planned import exact_plan

MODELS = Path(__file__).parents[2] / "models"
GRASPABLE = sorted(
    path.name
    for path in MODELS.iterdir()
    if path.is_dir() and path.name not in ("hands", "tetrahedron")
)


@cache
def model(name: str) -> GraspObject:
    (file,) = (path for path in (MODELS / name).iterdir() if path.suffix in {".sdf", ".urdf"})
    return load_object(file)


@cache
def top_grasp(name: str) -> tuple[CertifiedGrasp, float]:
    """The best grasp of a model, and the tip radius of its plan [m]."""
    plan = exact_plan(model(name), top=1)
    return plan.grasps[0], plan.settings.tip_radius


@cache
def top_scene(name: str) -> ScratchScene:
    certified, tip_radius = top_grasp(name)
    return make_scene(model(name), certified.grasp, tip_radius)


def cube_grasp(mu: float = 0.3) -> Grasp:
    """One finger against two, level with the centre of a cube of 6 cm."""
    return grasp(
        [[0.03, 0.0, 0.0], [-0.03, 0.02, 0.0], [-0.03, -0.02, 0.0]],
        [[-1, 0, 0], [1, 0, 0], [1, 0, 0]],
        mu,
    )


def cube_scene(mu: float = 0.3) -> ScratchScene:
    """With its geometry as it is, whatever friction the grasp claims."""
    return make_scene(model("cube"), cube_grasp(mu), tip_radius=0.002)


def cube_forces(squeeze: float, weight: Array) -> Holding:
    """Half of the squeeze against two quarters, and friction in the same shares."""
    share = np.array([0.5, 0.25, 0.25])[:, None]
    f_Bc_B = squeeze * share * cube_grasp().nhat_TB_B - share * weight
    wrench_B = np.append(weight, np.zeros(3))[None]
    spare = spare_friction(cube_grasp(), f_Bc_B[None])
    return Holding(squeeze, wrench_B, f_Bc_B[None], spare)
