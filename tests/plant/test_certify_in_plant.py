"""Mathematics and plant agree on every model, and each verdict refuses what it is there to see."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from drake_polygrasp import (
    Grasp,
    GraspFileError,
    ModelError,
    PlantReport,
    UsageError,
    certify_in_plant,
    load_grasps,
    load_object,
    save_grasps,
    verify_file,
)
from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.holding_forces import HoldingProgram, hold, spare_friction
from drake_polygrasp.cli.main import main
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.grasp import Verdict
from drake_polygrasp.plant.contact_geometry import check_geometry
from drake_polygrasp.plant.loads import LABELS, LoadPlan, plan_loads
from drake_polygrasp.plant.scratch_plant import make_scene
from drake_polygrasp.plant.statics import find_equilibria
from drake_polygrasp.verification.plant_results import save_plant_results
from tests.support.common import grasp
from tests.support.grasp_files import edit, write_box
from tests.support.plant_scenes import (
    GRASPABLE,
    cube_forces,
    cube_grasp,
    cube_scene,
    model,
    top_grasp,
    top_scene,
)

X, Y, Z = np.eye(3)
HOLDS, FAILS, UNDECIDED = Verdict.HOLDS, Verdict.FAILS, Verdict.UNDECIDED


def verdicts(report: PlantReport) -> dict[str, Verdict]:
    return {verdict.name: verdict.verdict for verdict in report.verdicts}


@pytest.mark.parametrize("name", GRASPABLE)
def test_the_best_grasp_of_every_model_holds_by_all_five_verdicts(name: str) -> None:
    certified, tip_radius = top_grasp(name)
    x = certified.certificate.internal_force
    report = certify_in_plant(model(name), certified.grasp, x, tip_radius=tip_radius)
    assert [v.name for v in report.verdicts] == [
        "exact",
        "convex",
        "geometry",
        "statics",
        "simulation",
    ]
    assert report.holds, report.verdicts
    assert [v.unit for v in report.verdicts] == ["1", "1", "m", "N", "1"]
    assert all(v.margin is not None and v.margin > 0 for v in report.verdicts)
    assert report.settings["simulated_on"] == (
        "pads" if name in ("concave_mesh", "plate_with_hole", "u_channel") else "surface"
    )
    assert report.loads == LABELS


def cube_report(grasp_: Grasp, **options: Any) -> PlantReport:
    return certify_in_plant(model("cube"), grasp_, **({"tip_radius": 0.002} | options))


def test_a_report_repeats_to_the_last_bit() -> None:
    first, second = (cube_report(cube_grasp()) for _ in range(2))
    assert first.verdicts == second.verdicts
    assert first.settings == second.settings


def test_contacts_on_one_face_fail_by_mathematics_and_statics() -> None:
    one_face = grasp([[-0.03, 0.0, -0.01], [-0.03, 0.02, 0.01], [-0.03, -0.02, 0.01]], [X] * 3, 0.3)
    assert verdicts(cube_report(one_face)) == {
        "exact": FAILS,
        "convex": FAILS,
        "geometry": HOLDS,
        "statics": FAILS,
        "simulation": FAILS,
    }


def test_a_false_proof_fails_the_exact_verdict_alone() -> None:
    report = cube_report(cube_grasp(), internal_force=frozen([-1.0, -1.0, 0.5]))
    assert [name for name, v in verdicts(report).items() if v is not HOLDS] == ["exact"]


def test_where_the_geometry_fails_nothing_is_run_on_it() -> None:
    report = cube_report(replace(cube_grasp(), p_BC=cube_grasp().p_BC + 1e-4 * X))
    assert verdicts(report)["geometry"] is FAILS
    assert verdicts(report)["statics"] is verdicts(report)["simulation"] is UNDECIDED
    assert report.trace is None
    assert not report.holds


def test_without_a_mass_there_is_no_weight_to_hold() -> None:
    weightless = replace(model("cube"), mass=None)
    report = certify_in_plant(weightless, cube_grasp(), tip_radius=0.002)
    assert verdicts(report)["statics"] is verdicts(report)["simulation"] is UNDECIDED
    assert "mass" in report.verdicts[-1].reason
    assert not report.holds


def test_a_body_that_does_not_resist_turning_is_not_simulated(tmp_path: Path) -> None:
    urdf = """<robot name="box"><link name="box">
      <inertial><mass value="1"/></inertial>
      <collision><geometry><box size="0.06 0.06 0.06"/></geometry></collision>
    </link></robot>"""
    (tmp_path / "box.urdf").write_text(urdf)
    report = certify_in_plant(load_object(tmp_path / "box.urdf"), cube_grasp(), tip_radius=0.002)
    assert verdicts(report)["geometry"] is HOLDS
    assert verdicts(report)["statics"] is verdicts(report)["simulation"] is UNDECIDED
    assert "inertia" in report.verdicts[-1].reason


def test_what_takes_too_many_time_steps_is_not_simulated() -> None:
    slippery = replace(cube_grasp(), mu=frozen([1e-5] * 3))
    report = cube_report(slippery)
    assert verdicts(report)["geometry"] is HOLDS
    assert verdicts(report)["simulation"] is UNDECIDED
    assert "time steps" in report.verdicts[-1].reason
    assert report.trace is None


def test_points_are_small_probes() -> None:
    report = cube_report(cube_grasp(), tip_radius=0.0)
    assert report.holds
    # Half as wide as the narrowest gap that the planner takes for open.
    assert report.settings["tip_radius"] == pytest.approx(5e-4 * 0.06 * np.sqrt(3))


def test_an_object_of_no_file_has_nothing_to_put_into_a_plant() -> None:
    with pytest.raises(ModelError, match="own file"):
        certify_in_plant(replace(model("cube"), source=None), cube_grasp(), tip_radius=0.0)


def moved(i: int, by: Array) -> Grasp:
    p_BC = cube_grasp().p_BC.copy()
    p_BC[i] += by
    return replace(cube_grasp(), p_BC=p_BC)


def tilted(i: int, angle: float) -> Grasp:
    nhat_TB_B = cube_grasp().nhat_TB_B.copy()
    nhat_TB_B[i] = np.cos(angle) * nhat_TB_B[i] + np.sin(angle) * Y
    return replace(cube_grasp(), nhat_TB_B=nhat_TB_B)


@pytest.mark.parametrize(
    ("bad", "fault"),
    [
        (moved(0, 1e-6 * X), "does not touch"),
        (moved(0, -1e-6 * X), "penetrates"),
        (moved(1, 0.02 * Y), "touches elsewhere"),
        (tilted(2, 1e-3), "touches elsewhere"),
        (tilted(2, 1e-3), "no facet"),
        (moved(1, 0.01 * Y), "on an edge"),
        (moved(1, -0.037 * Y), "overlap"),
        (cube_grasp(0.31), "its face 0.3"),
    ],
)
def test_each_fault_of_the_geometry_is_seen(bad: Grasp, fault: str) -> None:
    fit = check_geometry(make_scene(model("cube"), bad, tip_radius=0.002))
    assert any(fault in found for found in fit.faults), fit.faults


def test_a_true_contact_uses_no_part_of_the_tolerance() -> None:
    fit = check_geometry(cube_scene())
    assert fit.faults == ()
    assert fit.margin == pytest.approx(1e-6 * 0.06 * np.sqrt(3), rel=1e-6)


@pytest.mark.parametrize(("tip_radius", "fits"), [(0.004, True), (0.012, False)])
def test_a_fingertip_in_the_corner_of_the_bracket_needs_room(tip_radius: float, fits: bool) -> None:
    # 1 cm above the foot of the L, on the inner side of its upright.
    corner = grasp([[0.02, 0.03, 0.03], [0.0, 0.02, 0.03], [0.0, 0.04, 0.03]], [-X, X, X], 0.3)
    fit = check_geometry(make_scene(model("l_bracket"), corner, tip_radius))
    assert any("fingertip 1 penetrates" in fault for fault in fit.faults) is not fits


def test_a_pair_may_have_less_friction_than_its_face() -> None:
    weaker = replace(cube_grasp(), mu=frozen([0.1, 0.2, 0.3]))
    assert check_geometry(make_scene(model("cube"), weaker, tip_radius=0.002)).faults == ()


def test_forces_of_a_squeeze_alone_are_known_by_hand() -> None:
    cube = model("cube")
    forces = HoldingProgram(cube_grasp(), cube.p_BBcm, cube.rho).forces(np.zeros(6), 8.0)
    assert forces is not None
    np.testing.assert_allclose(forces, [[-4, 0, 0], [2, 0, 0], [2, 0, 0]], atol=1e-6)
    assert spare_friction(cube_grasp(), forces) == pytest.approx(0.6)


@pytest.mark.parametrize(("load", "holds"), [(0.299, True), (0.301, False)])
def test_friction_bears_mu_times_the_squeeze_and_no_more(load: float, holds: bool) -> None:
    cube = model("cube")
    forces = HoldingProgram(cube_grasp(), cube.p_BBcm, cube.rho).forces(
        np.array([0, 0, load, 0, 0, 0]), 1.0
    )
    assert (forces is not None) == holds


def test_planned_forces_balance_every_load_inside_the_cones() -> None:
    scene = top_scene("skewed_block")
    plan = plan_loads(scene)
    assert isinstance(plan, LoadPlan)
    arms = scene.grasp.p_BC - scene.object_.p_BBcm
    for wrench, forces in zip(plan.holding.wrench_B, plan.holding.f_Bc_B, strict=True):
        np.testing.assert_allclose(forces.sum(axis=0), -wrench[:3], atol=1e-6)
        np.testing.assert_allclose(np.cross(arms, forces).sum(axis=0), -wrench[3:], atol=1e-7)
        push = (forces * scene.grasp.nhat_TB_B).sum(axis=1)
        sideways = np.sqrt((forces**2).sum(axis=1) - push**2)
        assert (sideways < scene.grasp.mu * push).all()
        assert push.sum() == pytest.approx(plan.holding.squeeze)


def test_a_load_that_nothing_holds_leaves_nothing_planned() -> None:
    cube = model("cube")
    loads = np.array([[0, 0, 0.1, 0, 0, 0], [0, 0, 0.4, 0, 0, 0.0]])
    assert hold(cube_grasp(), cube.p_BBcm, cube.rho, loads[:1], 1.0) is not None
    assert hold(cube_grasp(), cube.p_BBcm, cube.rho, loads, 1.0) is None


@pytest.mark.parametrize("name", ["cube", "triangular_prism", "l_bracket"])
def test_drakes_contact_wrenches_are_those_planned(name: str) -> None:
    scene = top_scene(name)
    plan = plan_loads(scene)
    assert isinstance(plan, LoadPlan)
    equilibria = find_equilibria(scene, plan.weight)
    for equilibrium, planned in zip(equilibria, plan.weight.f_Bc_B, strict=True):
        assert equilibrium.fault == ""
        assert equilibrium.residual < 1e-6
        np.testing.assert_allclose(equilibrium.p_BC, scene.grasp.p_BC, atol=1e-9)
        np.testing.assert_allclose(equilibrium.f_Bc_B, planned, atol=1e-4 * plan.holding.squeeze)


def test_forces_that_do_not_balance_the_weight_leave_a_residual() -> None:
    holding = cube_forces(8.0, 0.1512 * 9.81 * Z)
    (good,) = find_equilibria(cube_scene(), holding)
    assert good.fault == ""
    (bad,) = find_equilibria(cube_scene(), replace(holding, f_Bc_B=1.01 * holding.f_Bc_B))
    assert bad.residual == pytest.approx(0.01)
    assert "unbalanced" in bad.fault


def test_without_friction_enough_drake_finds_no_equilibrium() -> None:
    holding = cube_forces(4.0, 0.1512 * 9.81 * Z)  # needs 0.37
    (equilibrium,) = find_equilibria(cube_scene(0.3), holding)
    assert "finds no contact forces" in equilibrium.fault
    (equilibrium,) = find_equilibria(cube_scene(0.4), holding)
    assert equilibrium.fault == ""


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return write_box(tmp_path)


def test_verify_asks_a_plant_about_grasps_that_are_borne_out(box: Path) -> None:
    before = box.read_bytes()
    report = verify_file(box, plant=True)
    assert report.holds
    assert report.plant_checked
    assert box.read_bytes() == before
    assert not verify_file(box).plant_checked


def test_verify_asks_no_plant_about_a_grasp_that_is_refused(box: Path) -> None:
    def lift(document: dict[str, Any]) -> None:
        document["grasps"][0]["contacts"][0]["p_BC"][0] += 1e-4

    report = verify_file(edit(box, lift), plant=True)
    assert report.grasps[0].plant is None
    assert not report.holds


def test_a_tip_radius_is_a_length(box: Path) -> None:
    with pytest.raises(GraspFileError, match=r"plan\.tip_radius"):
        verify_file(edit(box, lambda d: d["plan"].update(tip_radius=-0.01)))


def test_the_copy_holds_the_results_and_finds_the_model(
    box: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (box.parent / "results").mkdir()
    copy = box.parent / "results" / "new.grasp.yaml"
    before = box.read_bytes()
    assert main(["verify", str(box), "--plant", "-o", str(copy)]) == 0
    assert "simulation  holds" in capsys.readouterr().out
    assert box.read_bytes() == before
    assert verify_file(copy).holds
    assert verify_file(copy).model_checked
    block = yaml.safe_load(copy.read_text())["grasps"][0]["plant"]
    assert [v["verdict"] for v in block["verdicts"]] == ["holds"] * 5
    assert len(block["equilibria"]) == 6
    assert all(len(e["contact_wrenches"]) == 3 for e in block["equilibria"])
    assert block["settings"]["time_step"] == 1e-3
    original, copied = (load_grasps(file).grasps[0] for file in (box, copy))
    np.testing.assert_array_equal(original.grasp.p_BC, copied.grasp.p_BC)
    np.testing.assert_array_equal(
        original.certificate.internal_force, copied.certificate.internal_force
    )


def test_the_copy_is_never_the_file_itself(box: Path) -> None:
    before = box.read_bytes()
    with pytest.raises(UsageError, match="not changed"):
        save_plant_results(box, box, [None])
    assert box.read_bytes() == before


def test_results_without_a_plant_are_a_mistake(
    box: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(box), "-o", "new.yaml"]) == 2
    assert "--plant" in capsys.readouterr().err


def test_a_plant_that_was_asked_for_and_has_no_model_does_not_hold(
    box: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (box.parent / "box.sdf").unlink()
    assert main(["verify", str(box)]) == 0
    assert main(["verify", str(box), "--plant"]) == 1
    assert "plant" in capsys.readouterr().err


def test_a_grasp_of_a_plan_brings_its_proof_and_its_fingertips() -> None:
    certified, tip_radius = top_grasp("cube")
    assert certified.tip_radius == tip_radius
    alone = certify_in_plant(model("cube"), certified)
    told = certify_in_plant(
        model("cube"),
        certified.grasp,
        certified.certificate.internal_force,
        tip_radius=tip_radius,
    )
    assert alone.verdicts == told.verdicts
    assert alone.settings == told.settings
    other = certify_in_plant(model("cube"), certified, tip_radius=2 * tip_radius)
    assert other.settings["tip_radius"] == 2 * tip_radius


def test_without_a_plan_somebody_has_to_say_how_large_fingertips_are() -> None:
    with pytest.raises(UsageError, match="tip_radius"):
        certify_in_plant(model("cube"), cube_grasp())


def test_what_a_plant_said_is_saved_read_and_saved_again(tmp_path: Path) -> None:
    certified, _ = top_grasp("cube")
    report = certify_in_plant(model("cube"), certified)
    settings = StatedPlan({"tip_radius": certified.tip_radius})
    first, second = tmp_path / "first.grasp.yaml", tmp_path / "second.grasp.yaml"
    save_grasps(first, model("cube"), [replace(certified, plant=report)], settings)
    file = load_grasps(first)
    (stated,) = file.grasps
    assert stated.plant is not None
    assert stated.plant.holds
    assert stated.plant.verdicts == report.verdicts
    assert stated.plant.settings == report.settings
    for read, made in zip(stated.plant.equilibria, report.equilibria, strict=True):
        np.testing.assert_array_equal(read.weight_B, made.weight_B)
        np.testing.assert_array_equal(read.f_Bc_B, made.f_Bc_B)
    save_grasps(second, model("cube"), file.grasps, file.plan)
    assert first.read_bytes() == second.read_bytes()
    # A file's grasp is enough, too: it states its proof, and its plan the fingertips.
    assert certify_in_plant(model("cube"), stated).verdicts == report.verdicts


def test_a_plant_block_is_stated_and_not_proved_again(
    box: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    block = {"verdicts": [{"name": "simulation", "verdict": "does not hold", "margin": -0.1}]}
    edit(box, lambda d: d["grasps"][0].update(plant=block))
    (grasp_report,) = verify_file(box).grasps
    assert grasp_report.plant is None
    assert grasp_report.stated_plant is not None
    assert grasp_report.stated_plant.verdict is FAILS
    assert verify_file(box).holds  # what is checked here holds
    assert main(["verify", str(box)]) == 0
    assert "stated: does not hold" in capsys.readouterr().out
    assert main(["export", str(box), "--directives", str(box.parent / "out.dmd.yaml")]) == 0
    comment = (box.parent / "out.dmd.yaml").read_text().splitlines()[0]
    assert comment == "# grasp_1 in a plant, as box.grasp.yaml states: does not hold"


@pytest.mark.parametrize(
    ("block", "place"),
    [
        (3, r"plant"),
        ({}, r"plant\.verdicts is missing"),
        ({"verdicts": [{"name": "exact", "verdict": "yes"}]}, r"verdicts\[0\]\.verdict"),
        ({"verdicts": [], "equilibria": [{"weight_B": [1, 2]}]}, r"equilibria\[0\]"),
    ],
)
def test_a_plant_block_that_is_none_is_refused_with_its_place(
    box: Path, block: object, place: str
) -> None:
    with pytest.raises(GraspFileError, match=place):
        load_grasps(edit(box, lambda d: d["grasps"][0].update(plant=block)))


def test_what_a_plant_cannot_decide_neither_holds_nor_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A model without a mass has no weight to hold: exit status 1, and not "does not hold"."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.urdf").write_text(
        '<robot name="box"><link name="box"><collision><geometry><box size="0.1 0.1 0.2"/>'
        "</geometry></collision></link></robot>"
    )
    assert main(["plan", "box.urdf", "--top", "1"]) == 0
    report = verify_file("box.grasp.yaml", plant=True)
    assert report.holds is None
    assert not report.plant_decided
    capsys.readouterr()
    assert main(["verify", "box.grasp.yaml", "--plant"]) == 1
    said = capsys.readouterr().out
    assert said.endswith("all that was checked holds; some grasps are undecided in the plant\n")
    assert main(["verify", "box.grasp.yaml"]) == 0


def test_the_page_says_what_a_plant_said(tmp_path: Path) -> None:
    certified, tip_radius = top_grasp("cube")
    record = certify_in_plant(model("cube"), certified)
    settings = StatedPlan({"tip_radius": tip_radius})
    file = tmp_path / "x.grasp.yaml"
    save_grasps(file, model("cube"), [replace(certified, plant=record)], settings)
    page = tmp_path / "x.html"
    assert main(["show", str(file), "--html", str(page)]) == 0
    assert '["in a plant", "holds"]' in page.read_text()
