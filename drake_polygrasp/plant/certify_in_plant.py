"""Certifies a grasp by five checks: two of the certificate and three in Drake's plant.

The certificate assumes contact points, normals and friction coefficients. In temporary plants with
the object from its own file and fingertips of the planned radius, `contact_geometry` and
`clearance` confirm them, `statics` balances the weight along every axis, and `simulation` holds
it and disturbances over time. A check that disagrees with another is reported as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydrake.geometry import Meshcat

from drake_polygrasp._version import drake_version
from drake_polygrasp.arguments import (
    check_array,
    check_count,
    check_instance,
    check_length,
    check_paths,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification import exact
from drake_polygrasp.certification.certify import Proof, prove
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
from drake_polygrasp.loading.surroundings import Surroundings
from drake_polygrasp.plant import simulation, statics
from drake_polygrasp.plant.clearance import check_clearance
from drake_polygrasp.plant.contact_geometry import check_geometry
from drake_polygrasp.plant.drake_calls import Refusal, ask_drake
from drake_polygrasp.plant.load_test import PADS, ask_for_loads, simulate_loads
from drake_polygrasp.plant.loads import LOAD_SHARE, LoadPlan, LoadsUnavailable, plan_loads
from drake_polygrasp.plant.misses import NO_REGION, check_misses
from drake_polygrasp.plant.scratch_plant import ScratchScene, make_scene


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
    misses: int | None = None,
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
        misses: how many misses within the errors of the grasp's region certificate to simulate as
            well, for a verdict "misses" (default: none). Without such a certificate there is no
            such verdict, and `settings["misses"]` says so.
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
    if misses is not None:
        misses = check_count("misses", misses)
    if meshcat is not None:
        check_instance("meshcat", meshcat, Meshcat)
    if internal_force is None and not isinstance(grasp, Grasp):
        internal_force = grasp.certificate.internal_force
    scene = make_scene(object_, contacts, _tip_radius(grasp, tip_radius), package_paths, packages)
    region = None if isinstance(grasp, Grasp) else grasp.region
    proof = prove(contacts)
    mathematics = _exact(contacts, internal_force, proof), _convex(proof)
    geometry = _geometry(scene, surroundings or Surroundings(()))
    settings: dict[str, Any] = {
        "drake": drake_version(),
        "tip_radius": scene.tip_radius,
        "simulated_on": "surface" if scene.solid.is_hulls else "pads",
        "pad_width": scene.pad_width,
        "load_share": LOAD_SHARE,
        **simulation.settings(),
    }
    if surroundings is not None:
        settings |= {"surroundings": surroundings.names, "surroundings_used_in": "geometry"}
    if misses is not None:
        settings["misses"] = NO_REGION if region is None else misses
    if geometry.verdict is Verdict.HOLDS:
        plan = ask_for_loads(lambda: plan_loads(scene, region))
    else:
        said = "does not hold" if geometry.verdict is Verdict.FAILS else "is undecided"
        plan = LoadsUnavailable(Verdict.UNDECIDED, f"not run: the geometry {said}")
    if isinstance(plan, LoadsUnavailable):
        rest: tuple[PlantVerdict, ...] = (
            PlantVerdict("statics", plan.verdict, None, "N", plan.reason),
            PlantVerdict("simulation", plan.verdict, None, "1", plan.reason),
        )
        if misses and region:
            rest += (PlantVerdict("misses", plan.verdict, None, "1", plan.reason),)
        return PlantReport((*mathematics, geometry, *rest), settings)
    squeeze = plan.holding.squeeze
    equilibria = ask_drake(lambda: statics.find_equilibria(scene, plan.weight))
    test = simulate_loads(scene, plan, meshcat)
    held: tuple[PlantVerdict, ...] = (_statics(plan, equilibria), test.verdict)
    if misses and region:
        held += (check_misses(scene, region, squeeze, misses),)
    return PlantReport(
        (*mathematics, geometry, *held),
        settings | {"squeeze": squeeze, "time_step": test.time_step},
        () if isinstance(equilibria, Refusal) else equilibria,
        test.trace,
        plan.labels,
    )


def _tip_radius(grasp: AnyGrasp, asked: float | None) -> float:
    """Returns the fingertips' radius [m]: the one asked for, else the one planned for."""
    radius = asked
    if radius is None and not isinstance(grasp, Grasp):
        radius = grasp.tip_radius
    if radius is None:
        raise UsageError(
            "the radius of the fingertips is unknown: give tip_radius [m], or a grasp of "
            "plan_grasps, which states it"
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
    """Returns the verdict of a check in which Drake raised an error."""
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
    if clear.margin < fit.margin:  # The reason is to explain the margin.
        faults = clear.faults + fit.faults
    reason = faults[0] if faults else reason
    margin = min(fit.margin, clear.margin)
    return PlantVerdict("geometry", _verdict(not faults), margin, "m", reason)


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
