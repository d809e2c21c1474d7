"""Torques that hold an object, against linear programs and numbers by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.grasp import Grasp, GraspPlane, RegionCertificate
from drake_polygrasp.hand_grasp import HandRefusal, HandTorque
from drake_polygrasp.hands.squeeze import squeeze_remark
from drake_polygrasp.hands.torque import HandForces, Load, friction_refusal, holding_torque

GRAVITY = 9.81
RHO = 0.05


def grasp_at(p_BC: Array, nhat_TB_B: Array, mu: float) -> Grasp:
    plane = GraspPlane(np.array([0.0, 0.0, 1.0]), p_BC[0])
    return Grasp(p_BC, nhat_TB_B, np.full(3, mu), "three_faces", (0, 1, 2), plane)


def round_grasp(mu: float = 0.5) -> Grasp:
    """Contacts on the circle of radius RHO in the plane z = 0, 120 degrees apart."""
    angles = 2 * np.pi * np.arange(3) / 3
    outward = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    return grasp_at(frozen(RHO * outward), frozen(-outward), mu)


def random_hand(seed: int, num_joints: int = 9) -> Array:
    """Jacobians of three fingers of three joints each, of about 5 cm a rad."""
    rng = np.random.default_rng(seed)
    J = np.zeros((3, 3, num_joints))
    for i in range(3):
        J[i, :, 3 * i : 3 * i + 3] = rng.normal(0.0, 0.05, (3, 3))
    return J


def linear_share(grasp: Grasp, J: Array, effort: Array, weight_B: Array, grow: float) -> float:
    """The least share with pyramids of 64 edges, in the cones or (grow > 1) around them."""
    angles = 2 * np.pi * np.arange(64) / 64
    edges, owner = [], []
    for i, (n, mu) in enumerate(zip(grasp.nhat_TB_B, grasp.mu, strict=True)):
        u = np.cross(n, [0.3, 0.5, 0.8])
        u /= np.linalg.norm(u)
        across = np.outer(np.cos(angles), u) + np.outer(np.sin(angles), np.cross(n, u))
        edges += list(n + grow * mu * across)
        owner += [i] * len(angles)
    f = np.array(edges)
    wrench = np.hstack([f, np.cross(grasp.p_BC[owner], f)]).T
    torque = np.einsum("eij,ei->je", J[owner], f) / effort[:, None]
    bound = np.hstack([np.vstack([torque, -torque]), -np.ones((2 * len(effort), 1))])
    solved = linprog(
        np.append(np.zeros(len(f)), 1.0),
        A_ub=bound,
        b_ub=np.zeros(len(bound)),
        A_eq=np.hstack([wrench, np.zeros((6, 1))]),
        b_eq=np.append(-weight_B, np.zeros(3)),
    )
    assert solved.status == 0, solved.message
    return float(solved.fun)


@pytest.mark.parametrize("seed", range(5))
def test_the_least_share_is_that_of_linear_programs_within_their_pyramids(seed: int) -> None:
    grasp, J = round_grasp(), random_hand(seed)
    effort = np.random.default_rng(seed + 100).uniform(0.3, 1.5, 9)
    weight_B = 0.4 * GRAVITY * np.array([0.6, 0.0, -0.8])
    forces = HandForces(grasp, J, effort, np.zeros(3), RHO, friction_share=1.0)
    found = forces.least_share(weight_B)
    assert found is not None
    share, f_Bc_B = found
    within = linear_share(grasp, J, effort, weight_B, 1.0)
    # A pyramid of 64 edges around a cone is wider by the cosine of half the angle between edges.
    around = linear_share(grasp, J, effort, weight_B, 1.0 / np.cos(np.pi / 64))
    assert around * (1 - 1e-6) <= share <= within * (1 + 1e-6)
    assert within - around <= 0.05 * within
    assert np.abs(f_Bc_B.sum(axis=0) + weight_B).max() <= 1e-6
    assert np.abs(np.cross(grasp.p_BC, f_Bc_B).sum(axis=0)).max() <= 1e-7
    used = np.abs(np.einsum("ikj,ik->j", J, f_Bc_B)) / effort
    assert used.max() == pytest.approx(share, rel=1e-5)


def test_the_share_of_a_weight_along_the_axis_is_known_in_closed_form() -> None:
    # Each contact bears a third of the weight by friction; its one joint pushes along the normal.
    mu, mass, effort = 0.5, 0.3, 2.0
    grasp, J = round_grasp(mu), np.zeros((3, 3, 3))
    for i in range(3):
        J[i, :, i] = 0.05 * grasp.nhat_TB_B[i]
    load = Load(mass, np.zeros(3), RHO, up_B=np.array([0.0, 0.0, 1.0]))
    efforts = dict.fromkeys(("a", "b", "c"), effort)
    torque = holding_torque(grasp, J, efforts, load, friction_share=0.8)
    assert isinstance(torque, HandTorque)
    push = 1.2 * mass * GRAVITY / 3 / (0.8 * mu)
    assert torque.share == pytest.approx(0.05 * push / effort, rel=1e-5)  # six digits
    assert torque.loads == "up"
    # The squeeze carries the weight itself, and pushes with 6 times the weight over friction.
    assert torque.f_Bc_B.sum(axis=0) == pytest.approx([0, 0, mass * GRAVITY], abs=1e-6)
    normal = (torque.f_Bc_B * grasp.nhat_TB_B).sum()
    assert normal == pytest.approx(max(10.0, 6 * mass * GRAVITY / mu), rel=1e-6)
    assert [*torque.torque] == ["a", "b", "c"]
    assert [*torque.torque.values()] == pytest.approx([0.05 * normal / 3] * 3, rel=1e-5)


def test_the_squeeze_of_every_orientation_balances_itself_within_the_cones() -> None:
    grasp, J = round_grasp(), random_hand(3)
    torque = holding_torque(
        grasp, J, {f"j{k}": 1.5 for k in range(9)}, Load(0.2, np.zeros(3), RHO), 0.8
    )
    assert isinstance(torque, HandTorque)
    assert torque.loads == "six"
    assert torque.up_B is None
    f = torque.f_Bc_B
    assert np.abs(f.sum(axis=0)).max() <= 1e-6
    assert np.abs(np.cross(grasp.p_BC, f).sum(axis=0)).max() <= 1e-7
    normal = (f * grasp.nhat_TB_B).sum(axis=1)
    tangential = np.linalg.norm(f - normal[:, None] * grasp.nhat_TB_B, axis=1)
    assert (tangential <= 0.8 * grasp.mu * normal + 1e-6).all()
    assert normal.sum() <= max(10.0, 6 * 0.2 * GRAVITY / 0.5) * (1 + 1e-6)
    assert [*torque.torque.values()] == pytest.approx(np.einsum("ikj,ik->j", J, f), abs=1e-9)


def test_the_greatest_share_of_six_loads_is_returned() -> None:
    grasp, J, effort = round_grasp(), random_hand(7), np.full(9, 1.0)
    torque = holding_torque(
        grasp, J, {f"j{k}": 1.0 for k in range(9)}, Load(0.2, np.zeros(3), RHO), 1.0
    )
    assert isinstance(torque, HandTorque)
    shares = [
        linear_share(grasp, J, effort, sign * 0.2 * GRAVITY * axis, 1.0)
        for axis in np.eye(3)
        for sign in (1, -1)
    ]
    assert torque.share == pytest.approx(max(shares), rel=0.01)


def test_a_region_squeeze_is_reached_where_the_efforts_allow_it() -> None:
    grasp, J = round_grasp(), random_hand(3)
    strong = {f"j{k}": 20.0 for k in range(9)}
    load = Load(0.2, np.zeros(3), RHO, squeeze=60.0)
    torque = holding_torque(grasp, J, strong, load)
    assert isinstance(torque, HandTorque)
    assert (torque.f_Bc_B * grasp.nhat_TB_B).sum() == pytest.approx(60.0, rel=1e-6)


def test_a_squeeze_beyond_the_efforts_uses_all_of_them() -> None:
    grasp, J, effort = round_grasp(), random_hand(3), {f"j{k}": 2.0 for k in range(9)}
    usual, less, most = (
        holding_torque(grasp, J, effort, Load(0.2, np.zeros(3), RHO, squeeze=squeeze))
        for squeeze in (None, 5.0, 1e6)
    )
    assert isinstance(usual, HandTorque)
    assert isinstance(less, HandTorque)
    assert isinstance(most, HandTorque)
    np.testing.assert_array_equal(less.f_Bc_B, usual.f_Bc_B)
    assert max(map(abs, usual.torque.values())) < 2.0
    assert max(map(abs, most.torque.values())) == pytest.approx(2.0, rel=1e-5)


def test_a_squeeze_that_is_less_than_errors_ask_for_is_said() -> None:
    grasp = round_grasp()
    hold = holding_torque(
        grasp, random_hand(3), {f"j{k}": 20.0 for k in range(9)}, Load(0.2, np.zeros(3), RHO)
    )
    assert isinstance(hold, HandTorque)
    # 0.2 kg at friction 0.5 is squeezed with 6 times its weight over friction.
    assert 6 * 0.2 * GRAVITY / 0.5 == pytest.approx(23.5, abs=0.05)
    nothing = frozen(np.zeros(3))
    region = RegionCertificate(nothing, 0.1, 0.0, 0.0, nothing, ((), (), ()), None, None)
    for squeeze, said in ((46.0, ""), (48.0, "a squeeze of 23.5 N"), (None, "")):
        # The object weighs 0.4 kg and the load half of that.
        asked = replace(region, squeeze_force=squeeze)
        remark = squeeze_remark(grasp, asked, 0.4, hold)
        assert said in remark if said else not remark
        assert "the 24 N that hold" in remark or not said
    assert not squeeze_remark(grasp, None, 0.4, hold)
    assert not squeeze_remark(grasp, region, None, hold)


def test_a_weak_hand_is_refused_with_its_share_and_joint() -> None:
    grasp, J = round_grasp(), np.zeros((3, 3, 3))
    for i in range(3):
        J[i, :, i] = 0.05 * grasp.nhat_TB_B[i]
    load = Load(1.0, np.zeros(3), RHO, up_B=np.array([0.0, 0.0, 1.0]))
    refusal = holding_torque(grasp, J, {"a": 0.1, "b": 5.0, "c": 5.0}, load)
    assert isinstance(refusal, HandRefusal)
    assert refusal.reason == "torque"
    push = 1.2 * GRAVITY / 3 / (0.8 * 0.5)
    assert refusal.numbers["share"] == pytest.approx(0.05 * push / 0.1, rel=1e-6)
    assert "joint 'a'" in refusal.sentence


def test_what_no_friction_holds_is_refused_before_any_hand_is_asked() -> None:
    load = Load(0.2, np.zeros(3), RHO)
    assert friction_refusal(round_grasp(mu=1e-3), load) is None
    # Three contacts on one side push the object away.
    beside = frozen([[0.05, 0.0, 0.0], [0.05, 0.01, 0.0], [0.05, -0.01, 0.0]])
    refusal = friction_refusal(grasp_at(beside, frozen([[-1.0, 0.0, 0.0]] * 3), 0.5), load)
    assert refusal is not None
    assert refusal.reason == "friction"
    assert refusal.numbers["load"] == pytest.approx(0.2 * GRAVITY)


def test_unknown_efforts_or_masses_leave_the_share_unchecked_but_plan_a_squeeze() -> None:
    grasp, J = round_grasp(), random_hand(1)
    names = [f"j{k}" for k in range(9)]
    for effort, mass in ((np.nan, 0.2), (1.0, None)):
        torque = holding_torque(
            grasp, J, dict.fromkeys(names, effort), Load(mass, np.zeros(3), RHO)
        )
        assert isinstance(torque, HandTorque)
        assert torque.share is None
        assert (torque.f_Bc_B * grasp.nhat_TB_B).sum() > 5.0
