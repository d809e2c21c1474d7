"""On noisy scans the planner puts fingertips where Drake finds that they fit, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import load_object
from drake_polygrasp.geometry.surface_contact import TIP_SLACK, fingertip_fits, project_contacts
from drake_polygrasp.geometry.tolerances import ON_SURFACE
from drake_polygrasp.plant.contact_geometry import check_geometry
from drake_polygrasp.plant.scratch_plant import make_scene
from tests.support.common import grasp
from tests.support.convex_polyhedra import write_obj
from tests.support.planned import exact_plan
from tests.support.plant_scenes import GRASPABLE, model
from tests.support.scanned import Radius, blob, bottle, can, rounded_box, scan
from tests.support.solids import random_contacts
from tests.support.surface_judge import distances

SHAPES: dict[str, Radius] = {
    "box": rounded_box(np.array([0.03, 0.04, 0.05]), 0.006),
    "blob": blob(0.04, seed=0),
    "can": can(0.03, 0.045, 0.003),
    "bottle": bottle(0.03, 0.045, 0.004),
}


@pytest.mark.parametrize(
    ("shape", "noise"), [("box", 2e-4), ("blob", 1e-4), ("can", 3e-4), ("bottle", 0.0)]
)
def test_drake_finds_no_fault_with_any_ranked_grasp_of_a_scan(
    tmp_path: Path, shape: str, noise: float
) -> None:
    write_obj(tmp_path / "scan.obj", scan(SHAPES[shape], 2000, noise, seed=1))
    object_ = load_object(tmp_path / "scan.obj", mu=0.3)
    plan = exact_plan(object_, top=20, effort="quick")
    assert len(plan.grasps) == 20
    scene = make_scene(object_, plan.grasps[0].grasp, plan.settings.tip_radius)
    for found in plan.grasps:
        fit = check_geometry(replace(scene, grasp=found.grasp))
        assert fit.faults == ()
        # The planner leaves half of the tolerance to what its numbers may differ from Drake's by.
        assert fit.margin >= 0.4 * ON_SURFACE * object_.polyhedron.diameter


@pytest.mark.parametrize("shape", SHAPES)
def test_planner_and_drake_agree_on_which_tips_fit(tmp_path: Path, shape: str) -> None:
    triangles = scan(SHAPES[shape], 2000, 4e-4, seed=2)
    write_obj(tmp_path / "scan.obj", triangles)
    object_ = load_object(tmp_path / "scan.obj", mu=0.3)
    polyhedron = object_.polyhedron
    L, radius = polyhedron.diameter, 0.04 * polyhedron.diameter
    p_BC, _, face = random_contacts(polyhedron, 90, seed=0)
    projected = project_contacts(polyhedron, p_BC, face)
    p_BC, nhat_TB_B = (x[projected.ok][:60] for x in projected[:2])
    fits = fingertip_fits(polyhedron, p_BC, nhat_TB_B, radius)
    room = distances(p_BC - radius * nhat_TB_B, triangles).min(axis=1)
    assert (fits == (radius - room <= TIP_SLACK * L)).all()
    assert 3 <= fits.sum() <= 57
    scene = make_scene(object_, grasp(p_BC[:3], nhat_TB_B[:3], 0.3), radius)
    for rows in np.arange(len(p_BC)).reshape(-1, 3):
        three = grasp(p_BC[rows], nhat_TB_B[rows], 0.3)
        faults = check_geometry(replace(scene, grasp=three)).faults
        for i, row in enumerate(rows):
            deep = radius - room[row] > ON_SURFACE * L
            said = f"fingertip {i + 1} penetrates the object by {radius - room[row]:.2g} m"
            assert (said in faults) == deep
            assert deep or not any(f"fingertip {i + 1} " in fault for fault in faults)


@pytest.mark.parametrize("name", GRASPABLE)
def test_fingertips_of_a_ranked_grasp_never_overlap(name: str) -> None:
    plan = exact_plan(model(name), top=10)
    p_BC = np.array([found.grasp.p_BC for found in plan.grasps])
    nhat_TB_B = np.array([found.grasp.nhat_TB_B for found in plan.grasps])
    p_BT = p_BC - plan.settings.tip_radius * nhat_TB_B
    apart = [np.linalg.norm(p_BT[:, i] - p_BT[:, j], axis=1) for i, j in ((0, 1), (1, 2), (2, 0))]
    assert np.min(apart) >= 2 * plan.settings.tip_radius - 1e-6 * model(name).polyhedron.diameter
