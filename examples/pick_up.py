"""Picks an object up from a table, shakes it and holds it, in a plant with honest contact.

    python -m examples.pick_up models/l_bracket/l_bracket.sdf --html pick_up.html
    python -m examples.pick_up models/l_bracket/l_bracket.sdf --mu 0.1   # drops it

The object settles on the table. A grasp is planned for it where it lies, the table being an
obstacle. Three fingertips approach along the normals of their contacts, squeeze, lift, shake and
hold. Each pushes with the normal part of the force that the planned friction cones ask for against
weight and inertia; friction has to bear the rest. The exit status is 0 when the object was held, 1
when not, and 2 when there was nothing to try.

The hand does not feel what happens and corrects nothing. A grasp with little friction to spare then
creeps, though forces exist that would hold it: models/frustum, whose weight alone takes nearly all
of its friction, shows it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from drake_polygrasp import (
    CertifiedGrasp,
    GraspObject,
    PolygraspError,
    UsageError,
    object_from_plant,
    obstacles_from_plant,
    plan_grasps,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.holding_forces import HoldingProgram, hold, normal_forces
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.visualization import look_at, save_html
from examples.fingertips import TIP_MASS, Commands, Fingertips, Scene, build_scene
from examples.motion import Motion, Task, Z, plan_motion
from examples.report import Record, Report, judge

MODEL = Path(__file__).parents[1] / "models" / "l_bracket" / "l_bracket.sdf"
STANDOFF = 0.02
"""[m] from the contacts, where the fingertips start."""
LOAD_SHARE = 0.8
"""Of what the squeeze bears in any direction: the most that weight and inertia ask of it."""
TIP_TRAVEL = 0.5
"""Times L: how far the whole squeeze would push a tip against its spring."""
TILT = RotationMatrix(RollPitchYaw(0.03, 0.03, 0.0))
"""At which objects are put down, lest they balance on a corner."""
TASK = Task()


@dataclass(frozen=True, eq=False)
class Target:
    """An object at rest, and how it is to be squeezed."""

    object_: GraspObject
    X_WB: RigidTransform
    found: CertifiedGrasp
    tip_radius: float
    """[m]"""
    squeeze: float
    """Total normal force [N]."""

    @property
    def nhat_W(self) -> Array:
        """Inward normals, shape (3, 3)."""
        return np.asarray(self.found.grasp.nhat_TB_B @ self.X_WB.rotation().matrix().T)

    def loads(self, a_WH: Array) -> Array:
        """Weight and inertia under accelerations [m/s^2], shape (N, 3), as `hold` takes them."""
        assert self.object_.mass is not None
        f_W = -self.object_.mass * (GRAVITY * Z + a_WH)
        return np.hstack([f_W @ self.X_WB.rotation().matrix(), np.zeros_like(f_W)])


def settle(model_file: Path) -> tuple[Scene, Context]:
    """An object that has come to rest on the table, and the plant's context."""
    scene = build_scene(model_file)
    simulator = Simulator(scene.diagram)
    context = scene.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    object_ = object_from_plant(scene.plant, scene.body, context)
    p_WV = object_.polyhedron.triangles_B.reshape(-1, 3) @ TILT.matrix().T
    X_WB = RigidTransform(TILT, [0.0, 0.0, 1e-3 - p_WV[:, 2].min()])
    scene.plant.SetFreeBodyPose(context, scene.body, X_WB)
    quiet = 0
    for k in range(1, 51):
        simulator.AdvanceTo(0.1 * k)
        V_WB = scene.plant.EvalBodySpatialVelocityInWorld(context, scene.body)
        quiet = quiet + 1 if np.abs(V_WB.get_coeffs()).max() < 1e-3 else 0
        if quiet == 3:
            return scene, context
    raise UsageError(f"{model_file}: it does not come to rest on a table")


def choose(scene: Scene, context: Context, task: Task = TASK) -> Target:
    """The best grasp of the object where it lies that fingertips reach along their normals.

    Its squeeze holds weight and inertia whichever way they point.
    """
    object_ = object_from_plant(scene.plant, scene.body, context)
    if object_.mass is None:
        raise UsageError("the model states no mass, and without it there is no weight to hold")
    obstacles = obstacles_from_plant(scene.plant, scene.body, context)
    plan = plan_grasps(object_, top=20, obstacles=obstacles)
    most = np.linalg.norm(GRAVITY * Z + plan_motion(task).a_WH, axis=1).max() / GRAVITY
    for found in plan.grasps:
        if found.certificate.squeeze_force is not None:
            squeeze = float(found.certificate.squeeze_force * most / LOAD_SHARE)
            tip_radius = plan.settings["tip_radius"]
            target = Target(object_, obstacles.X_WB, found, tip_radius, squeeze)
            if _reachable(scene, context, target):
                return target
    raise UsageError("there is no grasp that fingertips reach along the normals of its contacts")


def _reachable(scene: Scene, context: Context, target: Target) -> bool:
    """Whether nothing is in the way of the tips from their standoff."""
    tips = fingertips(target)
    if any(np.linalg.norm(p - q) < 2 * tips.radius for p, q in combinations(tips.p_WT, 2)):
        return False
    query = scene.plant.get_geometry_query_input_port().Eval(context)
    steps = np.linspace(0.0, STANDOFF, 21)[:, None, None]
    return all(
        near.distance > 0.99 * tips.radius
        for p_WT in (tips.p_WT - steps * tips.nhat_W).reshape(-1, 3)
        for near in query.ComputeSignedDistanceToPoint(p_WT, 2 * tips.radius)
    )


def fingertips(target: Target, mu: float | None = None) -> Fingertips:
    """Tips that find the friction planned with, or `mu` where that is less."""
    if mu is not None and not mu > 0:
        raise UsageError(f"the friction is {mu}; it must be above 0")
    grasp = target.found.grasp
    pair = grasp.mu if mu is None else np.minimum(grasp.mu, mu)
    return Fingertips(
        p_WT=target.X_WB.multiply(grasp.p_BC.T).T - target.tip_radius * target.nhat_W,
        nhat_W=target.nhat_W,
        # Drake makes 2 mu_T mu_B / (mu_T + mu_B) of the two surfaces.
        mu=1.0 / (2.0 / pair - 1.0 / grasp.mu),
        radius=target.tip_radius,
        mean_force=target.squeeze / 3.0,
        stiffness=target.squeeze / (TIP_TRAVEL * target.object_.polyhedron.diameter),
    )


def least_friction(target: Target) -> float:
    """The friction below which no forces of this squeeze bear the weight."""
    grasp, object_ = target.found.grasp, target.object_
    weight = target.loads(np.zeros((1, 3)))[0]
    low, high = 0.0, float(grasp.mu.max())
    while high - low > 1e-3:
        mu = (low + high) / 2
        weaker = replace(grasp, mu=np.minimum(grasp.mu, mu))
        program = HoldingProgram(weaker, object_.p_BBcm, object_.rho)
        low, high = (mu, high) if program.forces(weight, target.squeeze) is None else (low, mu)
    return high


def command(target: Target, motion: Motion) -> Commands:
    """Positions, and the forces that planned friction asks for, from first to last."""
    object_, grasp = target.object_, target.found.grasp
    loads = target.loads(motion.a_WH)
    holding = hold(grasp, object_.p_BBcm, object_.rho, loads, target.squeeze)
    if holding is None:
        raise UsageError(f"no squeeze of {target.squeeze:.1f} N bears weight and inertia")
    grip = motion.progress_in("squeeze")[:, None] * normal_forces(grasp, holding.f_Bc_B)
    return Commands(
        motion.time,
        motion.p_WH,
        STANDOFF * (1.0 - motion.progress_in("approach")),
        # The tips' own inertia is no force on the object.
        grip + TIP_MASS * motion.a_WH @ target.nhat_W.T,
    )


def run(scene: Scene, target: Target, commands: Commands) -> Record:
    """Follow commands until they end, or until the object is lost."""
    simulator, plant = Simulator(scene.diagram), scene.plant
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    hand = plant.GetModelInstanceByName("hand")
    plant.SetPositions(context, hand, commands.positions[0])
    plant.SetFreeBodyPose(context, scene.body, target.X_WB)
    carriage = plant.GetBodyByName("carriage", hand)
    if scene.visualizer is not None:
        scene.visualizer.StartRecording()
    X_HB, height, push = [], [], []
    for t in commands.time:
        simulator.AdvanceTo(t)
        X_WB = scene.X_WB(context)
        X_HB.append(plant.EvalBodyPoseInWorld(context, carriage).InvertAndCompose(X_WB))
        height.append(X_WB.multiply(target.object_.p_BBcm)[2])
        push.append(scene.pushes(context, target.nhat_W))
        strayed = np.linalg.norm(X_HB[-1].translation() - X_HB[0].translation())
        if strayed > target.object_.polyhedron.diameter / 2:
            break
    if scene.visualizer is not None:
        scene.visualizer.StopRecording()
        scene.visualizer.PublishRecording()
    return Record(tuple(X_HB), np.array(height), np.array(push), commands.push[: len(push)])


def pick_up(
    model_file: Path,
    target: Target,
    mu: float | None = None,
    *,
    task: Task = TASK,
    meshcat: Meshcat | None = None,
) -> Report:
    """Approach, squeeze, lift, shake and hold.

    Args:
        model_file: of the object.
        target: the object where it lies, and its grasp.
        mu: friction that the fingertips find where more was planned with.
        task: what to do, that of `choose`.
        meshcat: where a recording is published.
    """
    motion = plan_motion(task)
    commands = command(target, motion)
    scene = build_scene(model_file, fingertips(target, mu), commands, meshcat)
    record = run(scene, target, commands)
    return judge(
        record,
        motion,
        target.found.grasp.p_BC,
        target.nhat_W,
        target.object_.p_BBcm,
        target.object_.polyhedron.diameter,
    )


def describe(target: Target, mu: float | None) -> str:
    """The grasp that is tried."""
    grasp, certificate = target.found.grasp, target.found.certificate
    planned = float(grasp.mu.min())
    there = planned if mu is None else min(mu, planned)
    return "\n".join(
        [
            f"grasp                  {grasp.kind} {grasp.faces}",
            f"epsilon                {certificate.epsilon_lower:.4f}",
            f"squeeze                {target.squeeze:.1f} N",
            f"friction               {there:.3g}, planned {planned:.3g}; "
            f"the weight needs {least_friction(target):.3f}",
        ]
    )


def film(target: Target) -> Meshcat:
    """A Meshcat that looks at the object."""
    meshcat, object_ = Meshcat(), target.object_
    look_at(meshcat, object_)
    centre = target.X_WB.multiply(object_.p_BBcm) + TASK.lift / 2 * Z
    eye = 4.0 * object_.polyhedron.diameter * np.array([0.6, -0.7, 0.4])
    meshcat.SetCameraPose(centre + eye, centre)
    return meshcat


def main(arguments: Sequence[str] | None = None) -> int:
    """Report on one model."""
    parser = argparse.ArgumentParser(prog="python -m examples.pick_up", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("model", type=Path, nargs="?", default=MODEL, help="default: L bracket")
    parser.add_argument(
        "--mu", type=float, help="friction that the fingertips find, if it is less than the model's"
    )
    parser.add_argument("--html", type=Path, help="page to write, with the recording")
    options = parser.parse_args(arguments)
    try:
        target = choose(*settle(options.model))
        meshcat = film(target) if options.html else None
        report = pick_up(options.model, target, options.mu, meshcat=meshcat)
        print(describe(target, options.mu), report, sep="\n")
        if meshcat is not None:
            save_html(options.html, meshcat, title=f"Picking up {options.model.stem}")
    except PolygraspError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0 if report.held else 1


if __name__ == "__main__":
    sys.exit(main())
