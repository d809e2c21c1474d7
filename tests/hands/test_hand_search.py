"""Postures, their way and their refusals, against a plant that knows nothing of the search."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.hand_grasp import HandGrasp
from drake_polygrasp.hands.hand_search import HandSearch, HoldOptions, hand_grasp
from drake_polygrasp.hands.library import make_reach
from drake_polygrasp.hands.model import load_hand
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.hands.starts import best_starts, fit_palms, start_overlaps
from drake_polygrasp.loading.surroundings import Surroundings
from tests.support.hand_judge import HandJudge
from tests.support.hands import (
    CUBE,
    MODELS,
    OWN_HAND,
    OWN_MODEL,
    PATIENCE,
    TIP_RADIUS,
    own_hand,
    own_hand_grasps,
    own_reach,
    planned,
)

SIX_MODELS = [
    *(CUBE, MODELS / "hexagonal_prism" / "hexagonal_prism.urdf"),
    *(MODELS / "t_block" / "t_block.urdf", MODELS / "l_bracket" / "l_bracket.sdf"),
    *(MODELS / "wedge" / "wedge.urdf", MODELS / "octagonal_prism" / "octagonal_prism.sdf"),
]

ACCURACY = 1e-4
"""Accuracy of Drake's distances between capsules and boxes, which it finds by iteration [m]."""


def short(model: Path) -> str:
    return model.stem


def contact_errors(judge: HandJudge, found: HandGrasp) -> tuple[float, float]:
    """Greatest distance [m] and angle [deg] of tips from where the contacts ask for them."""
    grasp = found.certified.grasp
    places = grasp.p_BC - TIP_RADIUS * grasp.nhat_TB_B
    off = np.linalg.norm(judge.tip_centres(found.fingers) - places, axis=1).max()
    cosines = (judge.tip_axes(found.fingers) * grasp.nhat_TB_B).sum(axis=1)
    return float(off), float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).max())


def apart(judge: HandJudge, found: HandGrasp) -> tuple[float, float, float]:
    """Least distances [m]: of the hand, of the links of its used tips, and of these tips."""
    by_name = {tip.name: tip for tip in judge.hand.tips}
    bodies = {by_name[name].body for name in found.fingers}
    tips = {f"{by_name[n].body}/{g}" for n in found.fingers for g in by_name[n].geometries}
    hand, link, tip = [np.inf], [np.inf], [np.inf]
    for pair, distance in judge.distances().items():
        at_object = [name for name in pair if not name.startswith("object/")]
        if len(at_object) == 1 and at_object[0] in tips:
            tip.append(distance)
        elif len(at_object) == 1 and at_object[0].partition("/")[0] in bodies:
            link.append(distance)
        else:
            hand.append(distance)
    return min(hand), min(link), min(tip)


@pytest.mark.parametrize("model", SIX_MODELS, ids=short)
def test_postures_touch_the_contacts_and_are_clear_of_everything_else(model: Path) -> None:
    found = own_hand_grasps(model)
    assert len(found) >= 2
    judge = HandJudge(own_hand(), OWN_MODEL, model)
    for each in found:
        judge.place(each.X_BPalm, each.q)
        off, degrees = contact_errors(judge, each)
        assert off <= 3e-4
        assert off <= each.tip_error + 1e-9
        assert degrees <= 80
        assert degrees == pytest.approx(np.degrees(each.tip_angle), abs=1e-3)
        hand, link, tip = apart(judge, each)
        assert hand >= 1.5e-3
        assert each.clearance <= min(hand, 0.05) + ACCURACY
        assert link >= 0
        assert each.tip_link_clearance <= min(link, 0.05) + ACCURACY
        # The spheres are at most as deep in the flat faces as they are off.
        assert tip >= -off - 1e-6


@pytest.mark.parametrize("model", SIX_MODELS[:3], ids=short)
def test_the_hand_comes_opens_and_closes_without_an_overlap(model: Path) -> None:
    judge = HandJudge(own_hand(), OWN_MODEL, model)
    for each in own_hand_grasps(model):
        before = each.pregrasp
        # Seven times as many samples as the search has looked at.
        for along in np.linspace(0, before.distance, 80):
            moved = RigidTransform(np.asarray(along * before.direction_B)) @ each.X_BPalm
            judge.place(moved, before.q)
            assert min(judge.distances().values(), default=1.0) > -1e-4
        judge.place(each.X_BPalm, before.q)
        grasp = each.certified.grasp
        away = (judge.tip_centres(each.fingers) - grasp.p_BC) @ grasp.nhat_TB_B.T
        assert (-np.diag(away) - TIP_RADIUS).min() >= before.opening - 4e-4
        for share in np.linspace(0, 1, 40):
            q = {name: before.q[name] + share * (each.q[name] - before.q[name]) for name in each.q}
            judge.place(each.X_BPalm, q)
            assert min(judge.distances().values(), default=1.0) > -4e-4


def test_the_same_input_gives_the_same_bits() -> None:
    first = own_hand_grasps(CUBE)
    again = own_hand_grasps.__wrapped__(CUBE)  # type: ignore[attr-defined]
    assert len(first) == len(again) > 0
    for one, other in zip(first, again, strict=True):
        assert one.q == other.q
        assert one.pregrasp.q == other.pregrasp.q
        assert one.torque.torque == other.torque.torque
        assert (one.p_BPalm == other.p_BPalm).all()
        assert (one.quaternion_BPalm == other.quaternion_BPalm).all()


def test_torques_are_those_of_virtual_work() -> None:
    # The power of the joints is that of the forces: tau . dq = f . v, by finite differences.
    judge = HandJudge(own_hand(), OWN_MODEL, CUBE)
    each = own_hand_grasps(CUBE)[0]
    names, step = [*each.torque.torque], 1e-6
    moved = np.empty((len(names), 3, 3))
    for j, name in enumerate(names):
        for sign in (1, -1):
            judge.place(each.X_BPalm, {**each.q, name: each.q[name] + sign * step})
            # A tip's point at the contact moves with its frame.
            frames = [
                judge.plant.GetFrameByName(f"{finger}_tip", judge.hand_instance)
                for finger in each.fingers
            ]
            poses = [frame.CalcPoseInWorld(judge.context) for frame in frames]
            if sign == 1:
                ahead = poses
        judge.place(each.X_BPalm, each.q)
        now = [frame.CalcPoseInWorld(judge.context) for frame in frames]
        for i, p_BC in enumerate(each.certified.grasp.p_BC):
            p_FC = now[i].inverse() @ p_BC
            moved[j, i] = (ahead[i] @ p_FC - poses[i] @ p_FC) / (2 * step)
    work = np.einsum("jik,ik->j", moved, each.torque.f_Bc_B)
    assert [*each.torque.torque.values()] == pytest.approx(work, abs=1e-6)


def test_tips_wider_than_their_spheres_do_not_penetrate(tmp_path: Path) -> None:
    # A box on the tip's body beside the sphere, as wide as fingertips of an Allegro hand.
    box = "<geometry><box><size>0.026 0.03 0.02</size></box></geometry>"
    pad = f"<pose>0 0 0.046 0 0 0</pose>{box}"
    text = OWN_MODEL.read_text()
    for finger in ("first", "second", "third"):
        marker = f'<collision name="{finger}_tip">'
        text = text.replace(marker, f'<collision name="{finger}_pad">{pad}</collision>\n{marker}')
    (tmp_path / OWN_MODEL.name).write_text(text)
    description = tmp_path / OWN_HAND.name
    description.write_text(OWN_HAND.read_text())
    wide = load_hand(description)
    object_, grasps = planned(CUBE)
    scene, reach = HandScene(wide, object_), make_reach(wide, num=2000)
    judge = HandJudge(wide, tmp_path / OWN_MODEL.name, CUBE)
    search = HandSearch(scene, reach, grasps, HoldOptions(mass=0.15))
    found = [hand_grasp(scene, grasps[k], held) for k, held in search.run(PATIENCE)]
    assert found
    for each in found:
        judge.place(each.X_BPalm, each.q)
        _, link, _ = apart(judge, each)
        assert link >= 0
        assert contact_errors(judge, each)[0] <= 3e-4
    # Postures of the hand without pads would press them into the cube.
    narrow = []
    for each in own_hand_grasps(CUBE):
        judge.place(each.X_BPalm, each.q)
        narrow.append(apart(judge, each)[1])
    assert min(narrow) < -1e-3


def test_the_margin_is_what_is_left_of_the_nearest_bound() -> None:
    limits = {"swing": (-1.2, 1.2), "bend": (-1.3, 1.5), "curl": (-0.4, 1.9)}  # of the model
    for each in own_hand_grasps(CUBE):
        left = [1 - np.degrees(each.tip_angle) / 80, each.clearance / 0.0015 - 1, 1.0]
        for name, q in each.q.items():
            lower, upper = limits[name.partition("_")[2]]
            left.append(min(q - lower, upper - q) / ((upper - lower) / 2))
        assert each.torque.share is not None
        left.append(1 - each.torque.share)
        assert 0 < each.margin == pytest.approx(min(left), rel=1e-4)


def table_under(model_height: float, thickness: float = 0.05) -> Surroundings:
    """A table of 60 cm whose top is at a height in B."""
    X_BG = RigidTransform(np.array([0.0, 0.0, model_height - thickness / 2]))
    return Surroundings((("table", Box(0.6, 0.6, thickness), X_BG),))


def test_a_hand_keeps_clear_of_a_table(tmp_path: Path) -> None:
    object_, grasps = planned(CUBE)
    bottom = float(object_.polyhedron.triangles_B[..., 2].min())
    high = [g for g in grasps if g.grasp.p_BC[:, 2].min() > bottom + TIP_RADIUS + 0.0025]
    assert high
    scene = HandScene(own_hand(), object_, surroundings=table_under(bottom))
    search = HandSearch(scene, own_reach(), high, HoldOptions(mass=0.15))
    found = [hand_grasp(scene, high[k], held) for k, held in search.run(PATIENCE)]
    assert found
    table = tmp_path / "table.sdf"
    table.write_text(
        f"""<sdf version="1.9"><model name="table"><static>true</static>
        <pose>0 0 {bottom - 0.025} 0 0 0</pose><link name="table"><collision name="table"><geometry>
        <box><size>0.6 0.6 0.05</size></box></geometry></collision></link></model></sdf>"""
    )
    judge = HandJudge(own_hand(), OWN_MODEL, CUBE, table)
    for each in found:
        assert each.surroundings == ("table",)
        judge.place(each.X_BPalm, each.q)
        near = [
            distance
            for pair, distance in judge.distances().items()
            if any(name.startswith("table/") for name in pair)
            if not any(name.startswith("object/") for name in pair)
        ]
        assert min(near, default=1.0) >= 1.5e-3


def refused(
    grasps: list[Grasp], scene: HandScene, options: HoldOptions, budget: float = PATIENCE
) -> set[str]:
    search = HandSearch(scene, own_reach(), grasps, options)
    assert not list(search.run(budget))
    assert {*search.refusals} == {*range(len(grasps))}
    return {refusal.reason for refusal in search.refusals.values()}


def test_each_refusal_has_its_cause() -> None:
    object_, certified = planned(CUBE)
    scene, light = HandScene(own_hand(), object_), HoldOptions(mass=0.15)
    grasp = certified[0].grasp
    wide = replace(grasp, p_BC=20.0 * grasp.p_BC)
    assert refused([wide], scene, light) == {"out_of_reach"}
    assert refused([grasp], scene, HoldOptions(mass=100.0)) == {"torque"}
    slippery = replace(grasp, mu=np.full(3, 1e-3))
    assert refused([slippery], scene, light) <= {"friction", "torque"}
    assert refused([grasp], scene, light, budget=-1.0) == {"budget"}
    around = [
        (f"wall {k}", Box(0.01, 2.0, 2.0), RigidTransform(R, R @ np.array([0.19, 0.0, 0.0])))
        for k, R in enumerate(faces_of_a_cube())
    ]
    caged = HandScene(own_hand(), object_, surroundings=Surroundings(tuple(around)))
    assert refused([grasp], caged, light) <= {"no_approach", "ik_failed", "collision"}
    solid = Surroundings((("block", Box(0.5, 0.5, 0.5), RigidTransform()),))
    buried = HandScene(own_hand(), object_, surroundings=solid)
    assert refused([grasp], buried, light) == {"collision"}


def faces_of_a_cube() -> list[RotationMatrix]:
    """Rotations that take the x axis to each of the six directions of the axes."""
    return [
        RotationMatrix.MakeFromOneVector(sign * axis, 0) for axis in np.eye(3) for sign in (1, -1)
    ]


def test_a_posture_of_the_library_is_its_own_start() -> None:
    # Contacts at the tips of a posture, seen from any palm pose, are matched by that posture.
    hand, reach = own_hand(), own_reach()
    object_, certified = planned(CUBE)
    scene = HandScene(hand, object_)
    X_BP = RigidTransform(RotationMatrix.MakeXRotation(0.7), np.array([0.3, -0.2, 0.5]))
    p_BT = np.array([X_BP @ p for p in reach.p_PT[17]])
    nhat = np.array([X_BP.rotation() @ a for a in reach.axis_P[17]])
    grasp = replace(certified[0].grasp, p_BC=p_BT + TIP_RADIUS * nhat, nhat_TB_B=nhat)
    start = best_starts(scene, reach, grasp)[0]
    assert start.score == pytest.approx(0, abs=1e-6)
    assert (start.q == reach.q[17]).all()
    assert start.X_BPalm.IsNearlyEqualTo(X_BP, 1e-6)
    assert start_overlaps(scene, reach, [grasp]) == pytest.approx([start.overlap], abs=1e-12)


def fit_cost(X_BP: RigidTransform, p_PT: Array, axis_P: Array, p_BT: Array, nhat: Array) -> float:
    tips = (X_BP @ p_PT.T).T - p_BT
    ends = (X_BP @ (p_PT + 0.03 * axis_P).T).T - p_BT - 0.03 * nhat
    return float((tips**2).sum() + 0.3 * (ends**2).sum())


def test_palms_are_fitted_by_proper_rotations() -> None:
    rng = np.random.default_rng(5)
    p_PT, axis_P = rng.normal(0, 0.05, (20, 3, 3)), rng.normal(size=(20, 3, 3))
    axis_P /= np.linalg.norm(axis_P, axis=-1, keepdims=True)
    p_BT, nhat = rng.normal(0, 0.05, (20, 3, 3)), axis_P[0]
    poses = fit_palms(p_PT, axis_P, p_BT, nhat)
    for X_BP, *points in zip(poses, p_PT, axis_P, p_BT, strict=True):
        assert np.linalg.det(X_BP.rotation().matrix()) == pytest.approx(1)
        cost = fit_cost(X_BP, *points, nhat)
        # No small motion improves the fit.
        for _ in range(20):
            moved = RigidTransform(rng.normal(0, 1e-4, 3)) @ X_BP
            turn = RotationMatrix(RollPitchYaw(rng.normal(0, 1e-3, 3)))
            turned = X_BP @ RigidTransform(turn)
            assert cost <= fit_cost(moved, *points, nhat) + 1e-12
            assert cost <= fit_cost(turned, *points, nhat) + 1e-12
