"""Whether a grasp holds the real object: five verdicts, of mathematics and of Drake's plant.

The mathematics assumes points, normals and friction. In scratch plants with the object from its
own file and fingertips of the plan's radius, SceneGraph confirms them (`contact_geometry`),
`statics` has the plant hold the weight along every axis, and `simulation` does so through time.
What disagrees is reported as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat

from drake_polygrasp.arguments import check_array, check_instance, check_length, check_paths
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification import exact
from drake_polygrasp.certification.certify import Proof, prove
from drake_polygrasp.certification.holding_forces import Holding, hold
from drake_polygrasp.certification.robustness import GRAVITY, epsilon_interval, squeeze_force
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.body_identity import check_same_body
from drake_polygrasp.grasp import (
    AnyGrasp,
    Grasp,
    GraspObject,
    PlantRecord,
    PlantVerdict,
    Verdict,
    grasp_of,
)
from drake_polygrasp.loading.object_model import Solid
from drake_polygrasp.loading.surroundings import Surroundings
from drake_polygrasp.plant import simulation, statics
from drake_polygrasp.plant.clearance import check_clearance
from drake_polygrasp.plant.contact_geometry import check_geometry
from drake_polygrasp.plant.drake_calls import Refusal, ask_drake
from drake_polygrasp.plant.scratch_plant import ScratchScene, make_scene

LOAD_SHARE = 0.8
"""Ours: of what the squeeze bears in the worst direction. The hand squeezes with the squeeze force
over this; disturbances, the weight included, are this times squeeze times epsilon."""
LABELS = (
    *(f"weight along {sign}{axis}" for sign in "+-" for axis in "xyz"),
    *(
        f"{kind} {sign}{axis}"
        for sign in "+-"
        for kind in ("force along", "torque about")
        for axis in "xyz"
    ),
    "the wrench that the grasp bears least",
)
"""The loads of every plan, in order."""
_NUM_WEIGHTS = 6
PADS = "on flat pads at the contacts"
"""What stood for the object's surface, where that is worth saying."""


@dataclass(frozen=True, eq=False)
class PlantReport(PlantRecord):
    """The verdicts of `certify_in_plant` on a grasp, with the simulation behind them.

        report = certify_in_plant(bracket, plan.grasps[0])
        print(report.verdict, {check.name: str(check.verdict) for check in report.verdicts})

    `verdicts` has a `PlantVerdict` for each check; `verdict` and `holds` sum them up.

    Attributes:
        equilibria: how the weight along +x, +y, +z, -x, -y, -z of B is held; empty if statics were
            not computed.
        trace: the simulation, sample by sample; None if it was not run.
        loads: names of the simulated loads, in their order.
    """

    equilibria: tuple[statics.Equilibrium, ...] = ()
    trace: simulation.SimulationRecord | None = None
    loads: tuple[str, ...] = ()


def certify_in_plant(
    object_: GraspObject,
    grasp: AnyGrasp,
    internal_force: Array | None = None,
    *,
    tip_radius: float | None = None,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    surroundings: Surroundings | None = None,
    meshcat: Meshcat | None = None,
) -> PlantReport:
    """Checks a grasp by its certificate, and in a `MultibodyPlant` with the object's own model.

    The five checks: the internal force in exact arithmetic; the best internal force that a solver
    finds; contacts and fingertips by SceneGraph's signed distance; the weight along each axis of B
    by Drake's statics; and a simulation of force-controlled fingertips under the weight and
    disturbances.

        report = certify_in_plant(bracket, plan.grasps[0])
        kept = dataclasses.replace(plan.grasps[0], plant=report)  # save_grasps writes it too

    Args:
        object_: object that is grasped, loaded from a file.
        grasp: three contacts; a grasp of a plan or of a file has its proof and tip radius.
        internal_force: the proof x_12, x_13, x_23 [1/m], shape (3,) (default: the grasp's, if any).
        tip_radius: radius of the spherical fingertips [m]; 0 for points, which small spheres stand
            for (default: the radius for which the grasp was planned).
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
        surroundings: other bodies of the user's scene, which no fingertip may penetrate; see
            `surroundings_from_plant`. Only the geometry check uses them: the simulation turns
            gravity about the object, and a table would hold what the grasp should.
        meshcat: Meshcat in which a recording of the simulation is published (default: none).

    Returns:
        The verdicts, each with its margin and reason.

    Raises:
        UsageError: when the tip radius is unknown, an argument has the wrong type or value, or the
            surroundings are those of another body.
        ModelError: when the object came from no file, or the file cannot be read again.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    contacts = grasp_of(grasp)
    if internal_force is not None:
        internal_force = check_array("internal_force", internal_force, (3,))
    package_paths = check_paths("package_paths", package_paths)
    if surroundings is not None:
        check_instance("surroundings", surroundings, Surroundings)
        check_same_body("surroundings", surroundings.body, object_.body)
    if meshcat is not None:
        check_instance("meshcat", meshcat, Meshcat)
    if internal_force is None and not isinstance(grasp, Grasp):
        internal_force = grasp.certificate.internal_force
    scene = make_scene(object_, contacts, _tip_radius(grasp, tip_radius), package_paths, packages)
    proof = prove(contacts)
    mathematics = _exact(contacts, internal_force, proof), _convex(proof)
    geometry = _geometry(scene, surroundings or Surroundings(()))
    settings: dict[str, Any] = {
        "drake": metadata.version("drake"),
        "tip_radius": scene.tip_radius,
        "simulated_on": "surface" if scene.solid.is_hulls else "pads",
        "pad_width": scene.pad_width,
        "load_share": LOAD_SHARE,
        **simulation.settings(),
    }
    if surroundings is not None:
        settings |= {"surroundings": surroundings.names, "surroundings_used_in": "geometry"}
    if geometry.verdict is Verdict.HOLDS:
        plan = _plan(scene)
    else:
        said = "does not hold" if geometry.verdict is Verdict.FAILS else "is undecided"
        plan = LoadsUnavailable(Verdict.UNDECIDED, f"not run: the geometry {said}")
    if isinstance(plan, LoadsUnavailable):
        rest = (
            PlantVerdict("statics", plan.verdict, None, "N", plan.reason),
            PlantVerdict("simulation", plan.verdict, None, "1", plan.reason),
        )
        return PlantReport((*mathematics, geometry, *rest), settings)
    squeeze = plan.holding.squeeze
    equilibria = ask_drake(lambda: statics.find_equilibria(scene, plan.weight))
    trace = _simulated(scene, plan, meshcat)
    held = _statics(plan, equilibria), _simulation(scene, plan, trace)
    return PlantReport(
        (*mathematics, geometry, *held),
        settings | {"squeeze": squeeze, "time_step": simulation.time_step(scene, squeeze)},
        () if isinstance(equilibria, Refusal) else equilibria,
        trace if isinstance(trace, simulation.SimulationRecord) else None,
        plan.labels,
    )


def _tip_radius(grasp: AnyGrasp, asked: float | None) -> float:
    """The fingertips' radius [m]: as asked for, or else of the plan that the grasp is from."""
    radius = asked
    if radius is None and not isinstance(grasp, Grasp):
        radius = grasp.tip_radius
    if radius is None:
        raise UsageError(
            "nothing says how large the fingertips are: give tip_radius [m], or a grasp of "
            "plan_grasps, which brings it"
        )
    return check_length("tip_radius", radius)


def _exact(grasp: Grasp, internal_force: Array | None, proof: Proof) -> PlantVerdict:
    if internal_force is None:
        return replace(_convex(proof), name="exact")
    numbers = grasp.p_BC.tolist(), grasp.nhat_TB_B.tolist(), grasp.mu.tolist()
    check = exact.check_force_closure(*numbers, internal_force.tolist())
    margin = exact.attained_margin(*numbers, internal_force.tolist())
    stated = margin if math.isfinite(margin) else None
    return PlantVerdict("exact", _verdict(check.ok), stated, "1", check.reason)


def _convex(proof: Proof) -> PlantVerdict:
    margin = proof.margin if proof.verdict is Verdict.HOLDS else None
    return PlantVerdict("convex", proof.verdict, margin, "1", proof.reason)


def _verdict(holds: bool) -> Verdict:
    return Verdict.HOLDS if holds else Verdict.FAILS


def _undecided(name: str, unit: str, refusal: Refusal) -> PlantVerdict:
    """What a check says that Drake refused to run."""
    return PlantVerdict(name, Verdict.UNDECIDED, None, unit, f"Drake refuses it: {refusal.reason}")


def _geometry(scene: ScratchScene, surroundings: Surroundings) -> PlantVerdict:
    fit = ask_drake(lambda: check_geometry(scene))
    if isinstance(fit, Refusal):
        return _undecided("geometry", "m", fit)
    clear = ask_drake(lambda: check_clearance(scene, surroundings))
    if isinstance(clear, Refusal):
        return _undecided("geometry", "m", clear)
    reason = f"measured on triangles, for Drake refuses: {fit.refusal}" if fit.refusal else ""
    faults = fit.faults + clear.faults
    if clear.margin < fit.margin:  # The first is of what the margin is of.
        faults = clear.faults + fit.faults
    reason = faults[0] if faults else reason
    margin = min(fit.margin, clear.margin)
    return PlantVerdict("geometry", _verdict(not faults), margin, "m", reason)


@dataclass(frozen=True)
class LoadsUnavailable:
    """Why no loads can be planned, or those planned are not simulated."""

    verdict: Verdict
    reason: str


@dataclass(frozen=True, eq=False)
class LoadPlan:
    """A squeeze, the loads that it should bear, and the forces that bear them.

    Attributes:
        squeeze_f_B: forces on B without a load [N], shape (3, 3).
        holding: contact forces that hold the object under each load.
        labels: what each load is.
    """

    squeeze_f_B: Array
    holding: Holding
    labels: tuple[str, ...]

    @property
    def weight(self) -> Holding:
        """The loads that are the weight along an axis."""
        return self.holding.rows(slice(_NUM_WEIGHTS))


def plan_loads(scene: ScratchScene) -> LoadPlan | LoadsUnavailable:
    """The weight along each axis, and disturbances along each axis and where W is narrowest.

    A disturbance is a whole load, the weight included: a force [N] along an axis of B or a torque
    over rho about one, or both along the normal of W's nearest facet.
    """
    object_, grasp = scene.object_, scene.grasp
    if object_.mass is None:
        return LoadsUnavailable(Verdict.UNDECIDED, "not run: the model states no mass")
    if not _has_inertia(scene.solid):
        return LoadsUnavailable(
            Verdict.UNDECIDED, "not run: about some axis the model states no rotational inertia"
        )
    contacts = grasp.p_BC, grasp.nhat_TB_B, grasp.mu
    needed = squeeze_force(*contacts, object_.p_BBcm, object_.rho, object_.mass)
    if needed is None:
        return LoadsUnavailable(Verdict.FAILS, "no squeeze holds the weight in every orientation")
    squeeze = needed / LOAD_SHARE
    axes = np.concatenate([np.eye(6), -np.eye(6)])
    weight = object_.mass * GRAVITY * np.concatenate([np.eye(3, 6), -np.eye(3, 6)])
    epsilon = epsilon_interval(*contacts, object_.p_BBcm, object_.rho)
    narrowest = -epsilon.normals[epsilon.offsets.argmin()]
    disturbances = LOAD_SHARE * squeeze * epsilon.lower * np.vstack([axes, narrowest])
    disturbances[:, 3:] *= object_.rho
    loads = np.vstack([np.zeros(6), weight, disturbances])
    holding = hold(grasp, object_.p_BBcm, object_.rho, loads, squeeze)
    if holding is None:
        return LoadsUnavailable(Verdict.FAILS, "no contact forces hold the loads")
    return LoadPlan(holding.f_Bc_B[0], holding.rows(slice(1, None)), LABELS)


def _plan(scene: ScratchScene) -> LoadPlan | LoadsUnavailable:
    """`plan_loads`, or that Drake refuses to."""
    plan = ask_drake(lambda: plan_loads(scene))
    if isinstance(plan, Refusal):
        return LoadsUnavailable(Verdict.UNDECIDED, f"not run: Drake plans no forces: {plan.reason}")
    return plan


def _has_inertia(solid: Solid) -> bool:
    """Whether the body resists turning about every axis, without which Drake moves nothing."""
    M = solid.M_BBo_B
    central = M.Shift(M.get_com()).CalcRotationalInertia()
    return bool(min(central.CalcPrincipalMomentsOfInertia()) > 0)


def _simulated(
    scene: ScratchScene, plan: LoadPlan, meshcat: Meshcat | None
) -> simulation.SimulationRecord | Refusal | LoadsUnavailable:
    """What happens under the loads, or why that is not simulated."""
    squeeze = plan.holding.squeeze
    step = simulation.time_step(scene, squeeze)
    if step < simulation.MIN_TIME_STEP:
        return LoadsUnavailable(
            Verdict.UNDECIDED,
            f"not run: to simulate a squeeze of {squeeze:.2g} N on this mass and inertia takes "
            f"time steps of {step:.1g} s, which are too many",
        )
    return ask_drake(lambda: simulation.simulate(scene, plan.squeeze_f_B, plan.holding, meshcat))


def _statics(plan: LoadPlan, equilibria: Sequence[statics.Equilibrium] | Refusal) -> PlantVerdict:
    if isinstance(equilibria, Refusal):
        return _undecided("statics", "N", equilibria)
    faults = [
        f"{label}: {equilibrium.fault}"
        for label, equilibrium in zip(plan.labels, equilibria, strict=False)
        if equilibrium.fault
    ]
    spare = float(plan.weight.spare_friction.min())
    reason = faults[0] if faults else PADS
    return PlantVerdict("statics", _verdict(not faults and spare > 0), spare, "N", reason)


def _simulation(
    scene: ScratchScene,
    plan: LoadPlan,
    trace: simulation.SimulationRecord | Refusal | LoadsUnavailable,
) -> PlantVerdict:
    if isinstance(trace, LoadsUnavailable):
        return PlantVerdict("simulation", trace.verdict, None, "1", trace.reason)
    if isinstance(trace, Refusal):
        return _undecided("simulation", "1", trace)
    outcome = simulation.judge(trace, len(plan.labels), scene.object_.polyhedron.diameter)
    reason = "" if scene.solid.is_hulls else PADS
    if outcome.lost is not None:
        under = plan.labels[outcome.lost] if outcome.lost >= 0 else "squeeze"
        reason = f"a fingertip loses the object: {under}"
    elif outcome.margin < 0:
        left = {"slip": outcome.slip, "creep": outcome.creep, "force": outcome.force}
        reason = f"the bound of {min(left, key=lambda name: left[name])} is exceeded"
    return PlantVerdict("simulation", _verdict(outcome.margin >= 0), outcome.margin, "1", reason)
