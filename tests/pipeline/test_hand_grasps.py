"""A plan of a hand has proved grasps that it can make, the same each time, or says why none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.geometry import Box, HalfSpace
from pydrake.math import RigidTransform

from drake_polygrasp import (
    NO_ERRORS,
    GraspObject,
    HandGrasp,
    HandPlan,
    HandRefusal,
    Surroundings,
    UsageError,
    hand_grasp_for,
    load_hand,
    load_object,
    plan_grasps,
    plan_hand_grasps,
)
from drake_polygrasp.certification.exact import check_force_closure
from drake_polygrasp.hands.hand_search import HandSearch, HoldOptions
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.pipeline.hand_errors import hand_grasp_under_errors
from drake_polygrasp.pipeline.region_certificates import Errors
from tests.hands.test_hand_search import ACCURACY, apart, contact_errors
from tests.support.hand_judge import HandJudge
from tests.support.hands import (
    CUBE,
    MODELS,
    OWN_HAND,
    OWN_MODEL,
    PATIENCE,
    TIP_RADIUS,
    own_hand,
    own_reach,
)
from tests.support.hands import planned as planned_without_hand

MASS = 0.15
SIX = [
    *("cube/cube.sdf", "l_bracket/l_bracket.sdf", "octagonal_prism/octagonal_prism.sdf"),
    *("t_block/t_block.urdf", "rod/rod.urdf", "two_materials/two_materials.urdf"),
]


def model(name: str) -> Path:
    (file,) = (MODELS / name).parent.glob(Path(name).stem + ".*df")
    return file


@cache
def loaded(name: str) -> GraspObject:
    return load_object(model(name), mu=0.5)


@cache
def planned(name: str) -> HandPlan:
    return plan_hand_grasps(loaded(name), own_hand(), load_mass=MASS, budget=PATIENCE, **NO_ERRORS)


TABLE = """\
<sdf version="1.9"><model name="table"><static>true</static><link name="slab">
  <pose>0 0 -0.13 0 0 0</pose>
  <collision name="top"><geometry><box><size>2 2 0.2</size></box></geometry></collision>
</link></model></sdf>
"""
"""A slab under the cube of models/, whose centre is the origin."""


@pytest.mark.parametrize("name", SIX)
def test_grasps_are_proved_and_the_hand_makes_them(name: str) -> None:
    plan = planned(name)
    assert len(plan.grasps) == 3
    judge = HandJudge(own_hand(), OWN_MODEL, model(name))
    for found in plan.grasps:
        grasp = found.certified.grasp
        lists = (values.tolist() for values in (grasp.p_BC, grasp.nhat_TB_B, grasp.mu))
        assert check_force_closure(*lists, found.certified.certificate.internal_force.tolist()).ok
        judge.place(found.X_BPalm, found.q)
        tip_error, angle = contact_errors(judge, found)
        clearance, link, _ = apart(judge, found)
        assert tip_error <= 5e-4
        assert angle <= 80
        assert clearance >= 1.5e-3 - ACCURACY
        assert link >= -ACCURACY
        assert found.torque.share is not None
        assert found.torque.share < 1
    assert len({found.certified.grasp.faces for found in plan.grasps}) == 3
    epsilons = [found.certified.certificate.epsilon_lower for found in plan.grasps]
    assert epsilons == sorted(epsilons, reverse=True)


def test_the_same_input_gives_the_same_plan() -> None:
    again = plan_hand_grasps(
        loaded(SIX[0]), load_hand(OWN_HAND), load_mass=MASS, budget=PATIENCE, **NO_ERRORS
    )
    for one, other in zip(planned(SIX[0]).grasps, again.grasps, strict=True):
        np.testing.assert_array_equal(one.certified.grasp.p_BC, other.certified.grasp.p_BC)
        np.testing.assert_array_equal(one.p_BPalm, other.p_BPalm)
        assert one.q == other.q
        assert one.torque.torque == other.torque.torque


def test_default_errors_are_proved_of_the_same_grasps() -> None:
    object_ = loaded(SIX[0])
    plan = plan_hand_grasps(object_, own_hand(), load_mass=MASS, budget=PATIENCE)
    exact = {found.certified.grasp.faces: found for found in planned(SIX[0]).grasps}
    assert {found.certified.grasp.faces for found in plan.grasps} == {*exact}
    least = []
    for found in plan.grasps:
        same, region = exact[found.certified.grasp.faces], found.certified.region
        np.testing.assert_array_equal(found.certified.grasp.p_BC, same.certified.grasp.p_BC)
        assert found.q == same.q
        # The cube's faces are wide enough for all default errors, and so is its friction.
        assert region is not None
        assert region.epsilon_lower is not None
        assert region.squeeze_force is not None
        # Stated errors are rounded down.
        assert region.placement_error == pytest.approx(np.full(3, 0.02 * 0.06 * 3**0.5), rel=1e-5)
        assert (region.tilt_error, region.friction_error) == (np.radians(5), 0.2)
        least.append(region.epsilon_lower)
        # The squeeze is as hard as the errors ask for, for the load in place of the cube.
        assert object_.mass is not None
        total = (found.torque.f_Bc_B * found.certified.grasp.nhat_TB_B).sum()
        assert total >= region.squeeze_force * MASS / object_.mass * (1 - 1e-6)
    assert least == sorted(least, reverse=True)
    assert plan.settings.placement_error == pytest.approx(0.02 * 0.06 * 3**0.5)


def test_a_grasp_is_tried_for_less_and_returned_if_it_bears_nothing() -> None:
    object_, grasps = planned_without_hand(CUBE)
    scene, hold = HandScene(own_hand(), object_), HoldOptions(mass=MASS)
    search = HandSearch(scene, own_reach(), [grasps[0].grasp], hold)
    (_, held) = next(search.run(PATIENCE))
    nothing = np.zeros(len(object_.polyhedron.faces))
    # No tilt of 1.4 rad leaves any friction; a hundredth of the friction may go.
    too_much, little = Errors(nothing, 1.4, 0.0, 0.0), Errors(nothing, 0.0, 0.01, 0.0)
    exact = replace(grasps[0], region=None)
    level, found = hand_grasp_under_errors(object_, scene, exact, held, (too_much, little), hold)
    assert level == 1
    assert found.certified.region is not None
    assert found.certified.region.friction_error == 0.01
    level, found = hand_grasp_under_errors(object_, scene, exact, held, (too_much,), hold)
    assert level == 1
    assert found.certified.region is None
    assert found.torque is held.torque


def test_on_a_table_hand_and_tips_keep_clear_of_it(tmp_path: Path) -> None:
    (tmp_path / "table.sdf").write_text(TABLE)
    slab = Surroundings((("table", HalfSpace(), RigidTransform([0.0, 0.0, -0.03])),))
    plan = plan_hand_grasps(
        loaded(SIX[0]),
        own_hand(),
        surroundings=slab,
        up_B=(0, 0, 2),
        load_mass=MASS,
        budget=PATIENCE,
    )
    assert plan.grasps
    assert plan.settings.obstacles == ("table",)
    judge = HandJudge(own_hand(), OWN_MODEL, CUBE, tmp_path / "table.sdf")
    for found in plan.grasps:
        assert found.surroundings == ("table",)
        assert found.torque.loads == "up"
        judge.place(found.X_BPalm, found.q)
        assert any("slab/top" in pair for pair in judge.distances())
        clearance, link, _ = apart(judge, found)
        assert clearance >= 1.5e-3 - ACCURACY
        assert link >= -ACCURACY
        # A tip rises by its radius above the table, and 2 mm.
        assert (found.certified.grasp.p_BC[:, 2] >= -0.03 + TIP_RADIUS + 0.0015).all()


def test_an_object_that_is_far_too_large_is_out_of_reach(tmp_path: Path) -> None:
    file = tmp_path / "crate.sdf"
    file.write_text(CUBE.read_text().replace("0.06", "0.6"))
    plan = plan_hand_grasps(load_object(file), own_hand())
    assert not plan.grasps
    ((reason, count),) = plan.refusals.items()
    assert reason in ("no_candidate", "out_of_reach")
    assert count == 1
    assert "600 x 600 x 600 mm" in plan.sentences[reason]
    assert "'three_finger' are " in plan.sentences[reason]


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets 100 s pass with each posture that is tried, on every machine."""
    clock = SimpleNamespace(monotonic=count(step=100).__next__)
    monkeypatch.setattr("drake_polygrasp.hands.hand_search.time", clock)


@pytest.mark.usefixtures("counted")
def test_a_load_that_is_too_heavy_is_refused_with_the_share_of_torque() -> None:
    plan = plan_hand_grasps(loaded(SIX[0]), own_hand(), load_mass=20.0, budget=PATIENCE)
    assert not plan.grasps
    assert plan.refusals["torque"] >= 1
    assert sum(plan.refusals.values()) == plan.tried == plan.candidates
    assert "20 kg" in plan.sentences["torque"]


@pytest.mark.usefixtures("counted")
def test_a_table_all_around_leaves_no_way() -> None:
    object_ = loaded(SIX[0])
    box = Box(1.0, 1.0, 0.02)
    lids = [RigidTransform([0, 0, z]) for z in (-0.05, 0.05)]
    between = Surroundings(tuple((f"lid {k}", box, X_BG) for k, X_BG in enumerate(lids)))
    plan = plan_hand_grasps(
        object_, own_hand(), surroundings=between, load_mass=MASS, budget=PATIENCE
    )
    assert not plan.grasps
    assert {*plan.refusals} <= {"collision", "ik_failed", "no_approach", "no_opening", "budget"}


def test_errors_are_borne_by_the_grasps_that_are_returned() -> None:
    plan = plan_hand_grasps(
        loaded(SIX[0]),
        own_hand(),
        top=1,
        load_mass=MASS,
        placement_error=0.002,
        tilt_error=0.05,
        friction_error=0.1,
        budget=PATIENCE,
    )
    (found,) = plan.grasps
    region = found.certified.region
    assert region is not None
    assert (region.placement_error >= 0.002).all()
    assert plan.settings.edge_clearance == pytest.approx(0.3 * TIP_RADIUS)


def test_the_friction_of_tips_bounds_that_of_contacts() -> None:
    hand = own_hand()
    tips = tuple(replace(tip, mu=0.4) for tip in hand.tips)
    plan = plan_hand_grasps(
        loaded(SIX[0]), replace(hand, tips=tips), top=1, load_mass=MASS, budget=PATIENCE
    )
    # Drake combines 0.5 and 0.4 to 2 * 0.5 * 0.4 / 0.9.
    np.testing.assert_allclose(plan.grasps[0].certified.grasp.mu, 4 / 9, rtol=1e-12)


def test_ranking_by_torque_puts_the_least_share_first() -> None:
    plan = plan_hand_grasps(
        loaded("l_bracket/l_bracket.sdf"),
        own_hand(),
        rank="torque",
        load_mass=MASS,
        budget=PATIENCE,
    )
    shares = [found.torque.share for found in plan.grasps]
    assert shares == sorted(shares)
    by_epsilon = [found.torque.share for found in planned("l_bracket/l_bracket.sdf").grasps]
    assert shares[-1] < max(by_epsilon)


def test_fingers_are_named() -> None:
    with pytest.raises(UsageError, match="three different tips of the hand: first, second, third"):
        plan_hand_grasps(loaded(SIX[0]), own_hand(), fingers=[("first", "second", "thumb")])
    with pytest.raises(UsageError, match="fingers is empty"):
        plan_hand_grasps(loaded(SIX[0]), own_hand(), fingers=[])


def test_a_grasp_that_is_there_already_is_made_or_refused() -> None:
    object_ = loaded(SIX[0])
    plan = plan_grasps(
        object_, top=1, tip_radius=TIP_RADIUS, edge_clearance=0.003, effort="quick", **NO_ERRORS
    )
    found = hand_grasp_for(object_, plan.grasps[0], own_hand(), load_mass=MASS, budget=PATIENCE)
    assert isinstance(found, HandGrasp)
    assert found.certified is plan.grasps[0]
    judge = HandJudge(own_hand(), OWN_MODEL, CUBE)
    judge.place(found.X_BPalm, found.q)
    assert contact_errors(judge, found)[0] <= 5e-4
    refused = hand_grasp_for(object_, plan.grasps[0], own_hand(), load_mass=50.0, budget=PATIENCE)
    assert isinstance(refused, HandRefusal)
    assert refused.reason == "torque"
    assert "50 kg" in refused.sentence
