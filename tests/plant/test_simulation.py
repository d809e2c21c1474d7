"""Fingertips in a simulation hold what can be held, and drop what cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Meshcat
from pydrake.multibody.tree import SpatialInertia

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.holding_forces import Holding, normal_forces
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.plant import simulation
from drake_polygrasp.plant.loads import LoadPlan, plan_loads
from drake_polygrasp.plant.scratch_plant import ScratchScene, make_scene
from drake_polygrasp.plant.simulation import SimulationOutcome, SimulationRecord, judge, simulate
from tests.support.common import grasp
from tests.support.planned import exact_plan
from tests.support.plant_scenes import cube_forces, cube_scene, model, top_grasp, top_scene

X, Y, Z = np.eye(3)
WEIGHT = GRAVITY * 0.1512
"""Of the cube [N]."""


def outcome(scene: ScratchScene, squeeze_f_B: Array, holding: Holding) -> SimulationOutcome:
    trace = simulate(scene, squeeze_f_B, holding)
    return judge(trace, len(holding.wrench_B), scene.object_.polyhedron.diameter)


def cube_outcome(mu: float, squeeze: float = 4 * WEIGHT, along: Array = -Z) -> SimulationOutcome:
    squeeze_f_B = cube_forces(squeeze, np.zeros(3)).f_Bc_B[0]
    return outcome(cube_scene(mu), squeeze_f_B, cube_forces(squeeze, WEIGHT * along))


def planned(name: str, mu: float | None = None) -> SimulationOutcome:
    """The best grasp of a model with forces planned for it, on friction that may be another."""
    scene = top_scene(name)
    plan = plan_loads(scene)
    assert isinstance(plan, LoadPlan)
    if mu is not None:
        scene = replace(scene, grasp=replace(scene.grasp, mu=frozen([mu] * 3)))
    return outcome(scene, plan.squeeze_f_B, plan.weight)


def test_the_weight_of_the_cube_is_what_is_assumed_here() -> None:
    assert model("cube").mass == 0.1512


@pytest.mark.parametrize("along", [Y, -Y, Z, -Z])
def test_a_squeeze_of_weight_over_mu_is_the_limit_of_friction(along: Array) -> None:
    # All friction is along the weight: mu S = W, with S = 4 W at mu = 0.25.
    assert cube_outcome(0.25 * 1.02, along=along).margin > 0
    assert cube_outcome(0.25 * 0.98, along=along).margin < 0


@pytest.mark.parametrize("along", [X, -X])
def test_normal_forces_bear_the_weight_along_them_with_hardly_any_friction(along: Array) -> None:
    assert cube_outcome(0.02, along=along).margin > 0.5


def test_a_larger_squeeze_makes_up_for_less_friction() -> None:
    assert cube_outcome(0.15).margin < 0 < cube_outcome(0.15, squeeze=8 * WEIGHT).margin


def test_fingers_on_one_face_push_the_object_away() -> None:
    one_face = grasp(
        [[-0.03, 0.0, -0.01], [-0.03, 0.02, 0.01], [-0.03, -0.02, 0.01]], [X, X, X], 0.3
    )
    scene = make_scene(model("cube"), one_face, tip_radius=0.002)
    pushes = 4 * WEIGHT / 3 * one_face.nhat_TB_B
    holding = Holding(
        4 * WEIGHT, np.append(-WEIGHT * Z, np.zeros(3))[None], pushes[None], np.zeros(1)
    )
    lost = outcome(scene, pushes, holding)
    assert lost.margin == -1
    assert lost.lost is not None


def test_half_of_the_least_friction_drops_what_the_friction_of_the_plan_holds() -> None:
    mu_min = top_grasp("skewed_block")[0].certificate.mu_min
    assert mu_min > 0.05
    assert planned("skewed_block").margin > 0
    assert planned("skewed_block", mu_min / 2).margin < 0


def test_what_is_squeezed_hard_creeps_no_more_for_it() -> None:
    # Friction of a tenth takes ten times the squeeze; both use the same share of it.
    creep = [cube_outcome(mu, 1 / mu * 1.1 * WEIGHT).creep for mu in (0.2, 0.02)]
    assert min(creep) > 0.5


@pytest.mark.parametrize(("name", "rank"), [("octahedron", 10), ("frustum", 9)])
def test_near_the_limit_of_friction_it_holds_until_it_is_not_enough(name: str, rank: int) -> None:
    plan = exact_plan(model(name), top=10)
    certified = plan.grasps[rank - 1]
    mu_min = certified.certificate.mu_min
    assert mu_min > 0.7 * certified.grasp.mu.max()
    scene = make_scene(model(name), certified.grasp, plan.settings.tip_radius)
    loads = plan_loads(scene)
    assert isinstance(loads, LoadPlan)
    assert outcome(scene, loads.squeeze_f_B, loads.holding).margin > 0.5
    weaker = replace(scene, grasp=replace(scene.grasp, mu=frozen([0.97 * mu_min] * 3)))
    assert outcome(weaker, loads.squeeze_f_B, loads.holding).margin < 0


def test_the_time_step_is_short_where_the_squeeze_is_hard() -> None:
    scene = cube_scene()
    slow = 0.1512 * 0.06 * np.sqrt(3)  # [kg m]: the squeeze over this, in 1/s^2
    assert simulation.time_step(scene, 900 * slow) == 1e-3
    assert simulation.time_step(scene, 2000 * slow) == pytest.approx(5e-4)
    # It divides the time between samples.
    assert simulation.time_step(scene, 2100 * slow) == pytest.approx(0.01 / 21)


def light_to_turn(share: float) -> ScratchScene:
    """The cube with a share of its inertia about the centre, which a model may state too small."""
    scene = cube_scene()
    side = 0.06 * np.sqrt(share)
    lighter = SpatialInertia.SolidBoxWithMass(0.1512, side, side, side)
    return replace(scene, solid=replace(scene.solid, M_BBo_B=lighter))


def test_what_turns_easily_takes_steps_as_a_lesser_mass() -> None:
    # At (a/2, a/6, 0) on a cube's face: 1/m + r^2 / I, with r^2 = 5/18 a^2 and I = share m a^2 / 6.
    squeeze, share = 1.0, 1e-3
    p_y, mass, side = 0.02, 0.1512, 0.06
    mobility = 1 + (0.03**2 + p_y**2) / (share * side**2 / 6)  # times the mass
    longest = 7 / mobility * mass * side * np.sqrt(3) / squeeze
    expected = 0.01 / np.ceil(0.01 / longest)
    assert simulation.time_step(light_to_turn(share), squeeze) == pytest.approx(expected)
    assert simulation.time_step(light_to_turn(0.5), squeeze) == 1e-3


def test_a_small_stated_inertia_makes_no_grasp_creep() -> None:
    # With steps for the mass alone, the bound of creep is exceeded.
    loads = plan_loads(cube_scene())
    assert isinstance(loads, LoadPlan)
    assert outcome(light_to_turn(0.01), loads.squeeze_f_B, loads.weight).margin > 0.5


def test_a_grasp_without_least_friction_needs_what_bears_the_weight() -> None:
    certified, _ = top_grasp("brick")
    assert certified.certificate.mu_min == 0
    # The squeeze is planned to use 0.8 of mu = 0.3.
    assert planned("brick").margin > 0
    assert planned("brick", 0.2).margin < 0


def test_fingertips_inside_a_hole_stay_there() -> None:
    # By its convex hull the plate would have no hole.
    plate = model("plate_with_hole")
    inside = grasp(
        [[0.035, 0.005, 0.01], [-0.015, 0.02, 0.01], [-0.015, -0.01, 0.01]], [X, -X, -X], 0.3
    )
    scene = make_scene(plate, inside, tip_radius=0.003)
    assert not scene.solid.is_hulls
    plan = plan_loads(scene)
    assert isinstance(plan, LoadPlan)
    assert outcome(scene, plan.squeeze_f_B, plan.holding).margin > 0


@pytest.mark.parametrize("name", ["cube", "triangular_prism", "l_bracket"])
def test_settled_normal_forces_are_those_planned(name: str) -> None:
    scene = top_scene(name)
    plan = plan_loads(scene)
    assert isinstance(plan, LoadPlan)
    trace = simulate(scene, plan.squeeze_f_B, plan.weight)
    forces = normal_forces(scene.grasp, plan.weight.f_Bc_B)
    for load, expected in enumerate(forces):
        settled = trace.normal_force[trace.load == load][-1]
        np.testing.assert_allclose(settled, expected, atol=0.02 * expected.sum())


def test_the_same_simulation_gives_the_same_numbers() -> None:
    squeeze_f_B = cube_forces(8.0, np.zeros(3)).f_Bc_B[0]
    first, second = (
        simulate(cube_scene(), squeeze_f_B, cube_forces(8.0, WEIGHT * Z)) for _ in range(2)
    )
    for name in ("time", "slip_W", "normal_force"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_a_trace_tells_every_sample_of_the_settling_and_of_each_load() -> None:
    trace = simulate(
        cube_scene(), cube_forces(8.0, np.zeros(3)).f_Bc_B[0], cube_forces(8.0, WEIGHT * Z)
    )
    np.testing.assert_allclose(np.diff(trace.time), simulation.SAMPLE)
    assert trace.load.tolist() == [-1] * 20 + [0] * 15
    assert trace.slip_W.shape == (35, 3, 3)
    np.testing.assert_allclose(trace.planned_force[-1], [4.0, 2.0, 2.0])


def test_a_recording_is_published() -> None:
    meshcat = Meshcat()
    squeeze_f_B = cube_forces(8.0, np.zeros(3)).f_Bc_B[0]
    simulate(cube_scene(), squeeze_f_B, cube_forces(8.0, WEIGHT * Z), meshcat)
    assert meshcat.HasPath("/drake/visualizer/object")
    assert meshcat.HasPath("/drake/visualizer/fingertips/tip_3")
    assert "set_animation" in meshcat.StaticHtml()


def still(num_loads: int = 1) -> SimulationRecord:
    """A trace in which nothing moves and all is as planned."""
    load = np.repeat(np.arange(-1, num_loads), 20)
    forces = np.full((len(load), 3), 2.0)
    slip = np.zeros((len(load), 3, 3))
    return SimulationRecord(frozen(0.01 * np.arange(len(load))), load, slip, forces, forces.copy())


def test_what_does_not_move_leaves_every_bound_whole() -> None:
    assert judge(still(), 1, diameter=0.1) == SimulationOutcome(1.0, 1.0, 1.0, None)


def test_each_bound_is_used_in_its_measure() -> None:
    trace = still()
    trace.slip_W[20:, 1, 2] = 1e-4
    assert judge(trace, 1, diameter=0.1).slip == pytest.approx(0.5)
    trace = still()
    trace.slip_W[35:, 0] = 0.05 * 1.5e-4 * Y
    assert judge(trace, 1, diameter=0.1).creep == pytest.approx(0.5)
    trace = still()
    trace.normal_force[-1, 0] -= 0.05
    assert judge(trace, 1, diameter=0.1).force == pytest.approx(0.5)


def test_a_tip_that_lets_go_even_once_has_lost_the_object() -> None:
    trace = still(2)
    trace.normal_force[45, 2] = 0.0
    assert judge(trace, 2, diameter=0.1).lost == 1
    assert judge(still(1), 2, diameter=0.1).margin == -1  # It broke down before the second load.
