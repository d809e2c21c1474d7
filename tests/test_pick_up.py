"""Objects picked up from a table are held by the planned grasp, and slip without its friction."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.plant import GraspReport
from drake_polygrasp.wrenches.contacts import edge_forces
from examples.choose_grasp import Target, choose_grasp
from examples.motion import SAMPLE, Task, plan_motion
from examples.pick_up import main, pick_up
from examples.table_top import settle
from tests.support.planned import exact_plan
from tests.support.plant_scenes import MODELS

SHORT = Task(lift=0.05, rounds=1, hold=0.1)
SLIPPERY = 0.7
LIFTED = ["cube", "l_bracket", "u_channel"]
X, _, Z = np.eye(3)


def file_of(name: str) -> Path:
    return MODELS / name / f"{name}.sdf"


@cache
def target(name: str) -> Target:
    return choose_grasp(*settle(file_of(name)), SHORT)


@cache
def held(name: str) -> GraspReport:
    return pick_up(file_of(name), target(name), task=SHORT)


@cache
def slippery(name: str) -> GraspReport:
    """On less friction than any forces with the squeeze need for the weight."""
    mu = SLIPPERY * target(name).least_friction
    return pick_up(file_of(name), target(name), mu, task=SHORT)


def friction_of_squeeze(target: Target) -> float:
    grasp, x = target.found.grasp, target.found.certificate.internal_force
    f_Bc_B = edge_forces(grasp.p_BC[None], x[None])[0]
    push = np.einsum("ci,ci->c", f_Bc_B, grasp.nhat_TB_B)
    along = np.linalg.norm(f_Bc_B - push[:, None] * grasp.nhat_TB_B, axis=1)
    return float((along / push).max())


@pytest.mark.parametrize("name", LIFTED)
def test_an_object_is_lifted_shaken_and_held(name: str) -> None:
    report = held(name)
    assert report.held
    assert report.raised == pytest.approx(SHORT.lift, abs=2e-4)
    assert max(report.slip) < 1e-4
    assert report.drift < 2e-4
    assert report.turn < 2e-3


@pytest.mark.parametrize("name", LIFTED)
def test_without_friction_for_its_weight_it_slips_down_as_it_is_lifted(name: str) -> None:
    report = slippery(name)
    assert not report.held
    assert report.slipped is not None
    assert report.slipped.phase == "lift"
    assert all(event is None or report.slipped <= event for event in report.lost)
    assert min(report.slip) > report.max_slip
    assert report.raised < SHORT.lift / 2  # On its edge a cube stands higher, on the table still.


@pytest.mark.parametrize("name", LIFTED)
def test_tips_squeeze_as_planned_and_do_not_move_the_object(name: str) -> None:
    reports = [held(name)]
    # With less friction than the squeeze alone needs, it would move the object.
    if friction_of_squeeze(target(name)) < SLIPPERY * target(name).least_friction:
        reports.append(slippery(name))
    for report in reports:
        assert report.disturbance < 1e-4
        assert report.force_error < 0.02


def test_opposed_on_upright_faces_the_least_friction_is_the_weight_over_the_squeeze() -> None:
    weight = 0.1512 * GRAVITY
    np.testing.assert_allclose(target("cube").spheres().nhat_H[:, 2], 0.0, atol=1e-6)
    expected = weight / target("cube").squeeze
    assert target("cube").least_friction == pytest.approx(expected, abs=2e-3)


def test_the_table_is_planned_around() -> None:
    cube = target("cube")
    freely = exact_plan(cube.object_, top=1).grasps[0]
    assert replace(cube, found=freely).spheres().p_HT[:, 2].min() < cube.tip_radius
    assert cube.spheres().p_HT[:, 2].min() > cube.tip_radius


def test_fingertips_make_the_friction_of_the_pair() -> None:
    planned = target("cube").found.grasp.mu
    for mu in (0.1, 0.3, 0.5):
        mu_T = target("cube").spheres(mu).mu
        pair = 2 * mu_T * planned / (mu_T + planned)
        np.testing.assert_allclose(pair, np.minimum(planned, mu))


def test_the_hand_moves_as_accelerated_and_comes_to_rest_above_where_it_started() -> None:
    task = Task(lift=0.1, shake=3.0, rounds=2, hold=0.5)
    motion = plan_motion(task)
    np.testing.assert_allclose(motion.p_WH[-1], task.lift * Z, atol=1e-12)
    v_WH = np.cumsum(motion.a_WH, axis=0) * SAMPLE
    np.testing.assert_allclose(v_WH[-1], 0.0, atol=1e-12)
    measured = np.diff(motion.p_WH, n=2, axis=0) / SAMPLE**2
    np.testing.assert_allclose(measured, motion.a_WH[1:-1], atol=0.1 * task.shake)
    assert np.abs(motion.a_WH[:, :2]).max(axis=0) == pytest.approx(task.shake, rel=0.02)
    for phase in ("approach", "squeeze"):
        assert motion.progress_in(phase)[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-3)


def test_the_command_says_what_happened_and_records_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    assert main([str(file_of("cube")), "--mu", "0.1", "--html", str(page)]) == 1
    assert "DROPPED: it slips" in capsys.readouterr().out
    assert "set_animation" in page.read_text()


def test_what_cannot_be_tried_is_said_and_is_no_failure_of_a_grasp(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["missing.sdf"]) == 2
    assert main([str(file_of("cube")), "--mu", "-0.1"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "missing.sdf: there is no such model file" in said.err
    assert "the friction is -0.1" in said.err


BOX = "<collision name='c'><geometry><box><size>.1 .1 .1</size></box></geometry></collision>"
ONE = f"<link name='carriage'>{BOX}</link>"
NONE = "<inertia><ixx>0</ixx><iyy>0</iyy><izz>0</izz></inertia>"


@pytest.mark.parametrize(
    ("links", "fault"),
    [
        (ONE + f"<link name='lid'>{BOX}</link>", "several bodies to pick up: 'carriage', 'lid'"),
        ("<static>true</static>" + ONE, "'carriage' is fixed"),
        (ONE.replace("><", f"><inertial><mass>0</mass>{NONE}</inertial><", 1), "no mass"),
        ("<link name='bare'/>", "no collision geometry"),
    ],
)
def test_what_is_not_one_free_body_with_mass_is_said(
    links: str, fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model.sdf"
    model.write_text(f"<sdf version='1.7'><model name='hand'>{links}</model></sdf>")
    assert main([str(model)]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert fault in said[0]


def test_names_that_the_hand_has_too_are_no_trouble(tmp_path: Path) -> None:
    model, text = tmp_path / "model.sdf", file_of("cube").read_text()
    text = text.replace('model name="cube"', 'model name="hand"')
    model.write_text(text.replace('link name="cube"', 'link name="carriage"'))
    assert pick_up(model, choose_grasp(*settle(model), SHORT), task=SHORT).held
