"""Misses are drawn within the certified errors, land on the true surface and are held or not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex

from drake_polygrasp import (
    CertifiedGrasp,
    GraspForces,
    PlantReport,
    UsageError,
    certify_in_plant,
    certify_region,
    load_grasps,
    load_object,
    plan_grasps,
    verify_file,
)
from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.certify import prove
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.cli.main import main
from drake_polygrasp.files.region_block import region_document
from drake_polygrasp.grasp import Grasp, RegionCertificate, Verdict
from drake_polygrasp.plant import simulation
from drake_polygrasp.plant.load_test import REFINEMENT, simulate_loads
from drake_polygrasp.plant.loads import LoadPlan, plan_loads
from drake_polygrasp.plant.misses import check_misses, draw_miss
from drake_polygrasp.plant.scratch_plant import ScratchScene, make_scene
from drake_polygrasp.plant.simulation import SimulationOutcome
from drake_polygrasp.plant.surface_distance import SurfaceDistance
from tests.support.grasp_files import BOX_SDF, edit, write_box
from tests.support.plant_scenes import cube_grasp, cube_scene, model, top_grasp

X, Y, Z = np.eye(3)
NEEDED = 0.1512 * GRAVITY * float(np.hypot(1 / 0.3, 1))
"""Squeeze S [N] with which the cube's grasp just holds its weight W in every orientation.

With W at an angle a to the normals, each side bears W sin(a) / 2, and the side with less normal
force has (S - W cos(a)) / 2: S = W (sin(a) / mu + cos(a)), at most W sqrt(1 / mu^2 + 1). What
plans it has bounds 2 percent apart."""


@cache
def region(**errors: float) -> RegionCertificate:
    """What the cube's grasp bears; its contacts are at least 1 cm from edges."""
    asked = {
        "placement_error": 0.003,
        "tilt_error": 0.05,
        "friction_error": 0.2,
        "com_error": 0.002,
    }
    found = certify_region(model("cube"), cube_grasp(), **asked | errors)
    assert found is not None
    return found


def certified(region: RegionCertificate | None) -> CertifiedGrasp:
    return replace(top_grasp("cube")[0], grasp=cube_grasp(), tip_radius=0.002, region=region)


def checked(region: RegionCertificate | None, misses: int) -> PlantReport:
    x = prove(cube_grasp()).internal_force
    return certify_in_plant(model("cube"), certified(region), x, misses=misses)


def drawn(count: int, scene: ScratchScene | None = None, **errors: Any) -> list[ScratchScene]:
    scene = scene or cube_scene()
    surface = SurfaceDistance(scene.solid.parts)
    scenes = [draw_miss(scene, surface, region(**errors), k) for k in range(1, count + 1)]
    assert all(isinstance(found, ScratchScene) for found in scenes), scenes
    return [found for found in scenes if isinstance(found, ScratchScene)]


def test_misses_are_within_the_errors_and_every_third_has_the_greatest() -> None:
    scenes, given = drawn(30), cube_grasp()
    p_BC = np.array([scene.grasp.p_BC for scene in scenes])
    # The faces are in the planes x = 0.03 and x = -0.03.
    np.testing.assert_allclose(p_BC[:, :, 0], np.tile([0.03, -0.03, -0.03], (30, 1)), atol=1e-9)
    for scene in scenes:
        np.testing.assert_allclose(scene.grasp.nhat_TB_B, given.nhat_TB_B, atol=1e-9)
    off = np.linalg.norm(p_BC - given.p_BC, axis=2) / 0.003
    less = 1 - np.array([scene.grasp.mu for scene in scenes]) / 0.3
    com = np.array([scene.object_.p_BBcm for scene in scenes]) - model("cube").p_BBcm
    far = np.linalg.norm(com, axis=1) / 0.002
    extreme = np.arange(1, 31) % 3 == 0
    for share in (off, less / 0.2, far[:, None]):
        np.testing.assert_allclose(share[extreme], 1, rtol=1e-6)
        assert ((share[~extreme] > 0) & (share[~extreme] < 1)).all()
    # Uniform in discs: half of the contacts are farther than 0.71 of the radius.
    assert 0.3 < (off[~extreme] > 0.5**0.5).mean() < 0.7


def test_the_same_misses_are_drawn_again() -> None:
    for one, other in zip(drawn(3), drawn(6), strict=False):
        np.testing.assert_array_equal(one.grasp.p_BC, other.grasp.p_BC)
        np.testing.assert_array_equal(one.grasp.mu, other.grasp.mu)
        np.testing.assert_array_equal(one.object_.p_BBcm, other.object_.p_BBcm)


def test_the_body_keeps_its_mass_and_its_inertia_about_another_centre() -> None:
    (scene,), given = drawn(1), cube_scene()
    M, M_given = scene.solid.M_BBo_B, given.solid.M_BBo_B
    assert M.get_mass() == M_given.get_mass()
    shift = M.get_com() - M_given.get_com()
    np.testing.assert_allclose(shift, scene.object_.p_BBcm - given.object_.p_BBcm, atol=1e-15)
    for one, other in zip(
        M.Shift(M.get_com()).CalcRotationalInertia().get_moments(),
        M_given.Shift(M_given.get_com()).CalcRotationalInertia().get_moments(),
        strict=True,
    ):
        assert one == pytest.approx(other, rel=1e-9)


def landed(p_BC: Array, nhat_TB_B: Array, surface: SurfaceDistance, radius: float) -> list[Grasp]:
    """Where fingertips land of a grasp of contacts that are not the cube's."""
    scene = cube_scene()
    grasp = replace(scene.grasp, p_BC=frozen(p_BC), nhat_TB_B=frozen(nhat_TB_B))
    scene = replace(scene, grasp=grasp)
    errors = replace(region(), placement_error=frozen([radius] * 3))
    found = [draw_miss(scene, surface, errors, k) for k in range(1, 10)]
    return [miss.grasp for miss in found if isinstance(miss, ScratchScene)]


def test_fingertips_land_on_the_true_surface_along_the_normals_of_their_contacts() -> None:
    # On a sphere about the origin, off by d: at sqrt(R^2 - d^2), with the normal toward the centre.
    R, nhat = 0.03, np.array([-X, Y, -Z])
    grasps = landed(-R * nhat, nhat, SurfaceDistance([(Sphere(R), RigidTransform())]), 0.02)
    assert len(grasps) == 9
    for found in grasps:
        np.testing.assert_allclose(np.linalg.norm(found.p_BC, axis=1), R, rtol=1e-9)
        np.testing.assert_allclose(found.nhat_TB_B, -found.p_BC / R, atol=1e-6)
    on_rim = grasps[2]
    height = -np.einsum("ij,ij->i", on_rim.p_BC, nhat)
    np.testing.assert_allclose(height, np.sqrt(R**2 - 0.02**2), rtol=1e-4)


def test_fingertips_between_two_walls_land_on_the_wall_of_their_contact() -> None:
    # The walls are 2 cm apart; from outside, a fingertip would meet the other one first.
    walls = SurfaceDistance(
        [(Box(0.01, 0.2, 0.2), RigidTransform([x, 0.0, 0.0])) for x in (-0.015, 0.015)]
    )
    p_BC = np.array([[0.01, 0.0, 0.0], [-0.01, 0.02, 0.0], [-0.01, -0.02, 0.0]])
    grasps = landed(p_BC, np.array([X, -X, -X]), walls, 0.005)
    assert len(grasps) == 9
    for found in grasps:
        np.testing.assert_allclose(found.p_BC[:, 0], p_BC[:, 0], atol=1e-9)


def test_a_smaller_fingertip_stands_for_one_that_does_not_fit() -> None:
    # Off toward each other by up to 3 mm, two contacts 4 cm apart have no room for tips of 3.6 cm.
    scenes = drawn(6, replace(cube_scene(), tip_radius=0.0199))
    for scene in scenes:
        apart = float(np.linalg.norm(scene.p_BT[1] - scene.p_BT[2]))
        assert scene.tip_radius == 0.0199 / (1 if apart >= 2 * 0.0199 else 2)
    assert {scene.tip_radius for scene in scenes} == {0.0199, 0.0199 / 2}


def test_all_misses_of_a_certified_region_hold_and_are_the_same_again() -> None:
    report = checked(region(), misses=6)
    assert report.holds, report.verdicts
    last = report.verdicts[-1]
    assert (last.name, last.unit, last.reason) == ("misses", "1", "6 of 6 hold")
    assert last.margin is not None
    assert 0 < last.margin < 1
    assert report.settings["misses"] == 6
    assert checked(region(), misses=6).verdicts[-1] == last


@pytest.mark.parametrize(
    ("falsified", "reason"),
    [
        # The face ends 1 cm from two contacts.
        ({"placement_error": frozen([0.1] * 3)}, "meets no surface"),
        # 0.3 of mu are left, and the squeeze needs 1 / 1.2 of it.
        ({"friction_error": 0.95, "squeeze_force": NEEDED * 1.2}, "no contact forces hold"),
        # The grasp has no friction that bears torques about the line through two contacts.
        ({"com_error": 0.2, "squeeze_force": NEEDED * 1.2}, "no contact forces hold"),
    ],
)
def test_not_all_misses_of_a_falsified_region_hold(falsified: Any, reason: str) -> None:
    report = checked(replace(region(), **falsified), misses=3)
    assert report.verdict is Verdict.FAILS
    last = report.verdicts[-1]
    assert last.name == "misses"
    assert last.verdict is Verdict.FAILS
    assert " of 3 hold; miss " in last.reason
    assert not last.reason.startswith("3 of 3")
    assert reason in last.reason


def test_without_certified_errors_no_miss_is_drawn() -> None:
    report = checked(None, misses=3)
    assert report.holds
    assert report.verdicts[-1].name == "simulation"
    assert report.settings["misses"] == "no errors are certified"


def test_without_a_certified_squeeze_misses_are_undecided() -> None:
    report = checked(replace(region(), squeeze_force=None), misses=3)
    assert report.verdict is Verdict.UNDECIDED
    assert "no squeeze is certified" in report.verdicts[-1].reason


def test_misses_land_on_an_ellipsoid_with_its_normals_and_are_held(tmp_path: Path) -> None:
    file, radii = tmp_path / "egg.sdf", np.array([0.03, 0.04, 0.05])
    box = "<box><size>0.1 0.1 0.2</size></box>"
    egg = "<ellipsoid><radii>0.03 0.04 0.05</radii></ellipsoid>"
    assert box in BOX_SDF
    file.write_text(BOX_SDF.replace(box, egg).replace("mu>0.3<", "mu>0.6<"))
    object_ = load_object(file)
    (certified,) = plan_grasps(object_, top=1, placement_error=0.002).grasps
    found = certified.region
    assert found is not None and found.squeeze_force is not None
    scene = make_scene(object_, certified.grasp, tip_radius=0.004)
    surface = SurfaceDistance(scene.solid.parts)
    for number in range(1, 7):
        missed = draw_miss(scene, surface, found, number)
        assert isinstance(missed, ScratchScene)
        p_BC, nhat = missed.grasp.p_BC, missed.grasp.nhat_TB_B
        # x^2 / a^2 + ... = 1, and the normal is its gradient.
        np.testing.assert_allclose(np.square(p_BC / radii).sum(axis=1), 1, atol=1e-9)
        gradient = p_BC / radii**2
        np.testing.assert_allclose(-gradient / norms(gradient), nhat, atol=1e-6)
        assert (norms(p_BC - certified.grasp.p_BC) < 0.0025).all()
    assert check_misses(scene, found, found.squeeze_force, 2).verdict is Verdict.HOLDS


def norms(vectors: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors, axis=1, keepdims=True))


@pytest.mark.parametrize(("certified_squeeze", "used"), [(20.0, 20.0), (1.0, NEEDED / 0.8)])
def test_the_squeeze_is_the_certified_one_and_never_less_than_without_errors(
    certified_squeeze: float, used: float
) -> None:
    with_squeeze = replace(region(), squeeze_force=certified_squeeze)
    plan = plan_loads(cube_scene(), with_squeeze)
    assert isinstance(plan, LoadPlan)
    assert plan.holding.squeeze == pytest.approx(used, rel=0.02)
    nhat_TB_B = cube_grasp().nhat_TB_B
    pushed = (plan.holding.f_Bc_B * nhat_TB_B).sum(axis=(1, 2))
    np.testing.assert_allclose(pushed, used, rtol=0.02)
    forces = GraspForces(model("cube"), certified(with_squeeze), None, BodyIndex(1))
    context = forces.CreateDefaultContext()
    forces.GetInputPort("body_poses").FixValue(context, [RigidTransform()] * 2)
    applied = forces.GetOutputPort("applied_spatial_force").Eval(context)
    normal = [f.F_Bq_W.translational() @ n for f, n in zip(applied, nhat_TB_B, strict=True)]
    assert sum(normal) == pytest.approx(used, rel=0.02)


def test_a_squeeze_is_asked_for_where_none_is_known() -> None:
    weightless = replace(model("cube"), mass=None)
    with pytest.raises(UsageError, match="the model states no mass"):
        GraspForces(weightless, cube_grasp(), None, BodyIndex(1))


def test_what_does_not_hold_is_simulated_with_a_finer_step(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = cube_scene()
    plan = plan_loads(scene)
    assert isinstance(plan, LoadPlan)
    plan = replace(plan, holding=plan.holding.rows(slice(1)), labels=plan.labels[:1])
    outcomes = [SimulationOutcome(0.5, 0.5, -0.5, None), SimulationOutcome(0.5, 0.5, 0.4, None)]
    monkeypatch.setattr(simulation, "judge", lambda *_: outcomes.pop(0))
    test = simulate_loads(scene, plan)
    assert test.verdict.margin == 0.4
    assert test.time_step == simulation.MAX_TIME_STEP / REFINEMENT


def test_verify_draws_misses_of_grasps_with_a_region(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_box(tmp_path)
    assert main(["verify", str(file), "--plant", "--misses", "2"]) == 0
    assert "no errors are certified" in capsys.readouterr().out
    (stated,) = load_grasps(file).grasps
    found = certify_region(load_object(tmp_path / "box.sdf"), stated, placement_error=0.002)
    assert found is not None
    document = region_document(found, stated.grasp.nhat_TB_B)
    edit(file, lambda d: d["grasps"][0].update(region=document))
    assert main(["verify", str(file), "--plant", "--misses", "2"]) == 0
    assert "2 of 2 hold" in capsys.readouterr().out


def test_misses_are_refused_without_a_plant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_box(tmp_path)
    assert main(["verify", str(file), "--misses", "2"]) == 2
    error = capsys.readouterr().err
    assert error == "polygrasp: --misses: misses are simulated in the plant; add --plant\n"
    with pytest.raises(UsageError, match="add plant=True"):
        verify_file(file, misses=2)
