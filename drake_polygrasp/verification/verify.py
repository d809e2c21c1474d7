"""Checks a grasp file without the planner: each claim is proved, recomputed or not checked.

FORCES needs only the file: the internal force proves force closure in exact arithmetic. SURFACE
needs the model, unchanged since it was planned on: each contact lies on its exposed surface, along
its normal, with at most its friction. NUMBERS recomputes the certificate; a number that is more
favourable than the recomputed one is rejected.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drake_polygrasp.arguments import (
    Progress,
    check_count,
    check_flag,
    check_path,
    check_paths,
    check_progress,
)
from drake_polygrasp.errors import MissingPackageError, ModelError, UsageError
from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.files.stated_grasp import GraspFile, StatedGrasp, StatedObject
from drake_polygrasp.geometry.exclusion import Exclusion
from drake_polygrasp.geometry.surface_contact import edge_distance, locate_contacts
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.model_source import model_digest
from drake_polygrasp.loading.packages import find_packages
from drake_polygrasp.verification.numbers import (
    ROUNDING,
    force_violations,
    number_violations,
)
from drake_polygrasp.verification.region import (
    region_number_violations,
    region_surface_violations,
    region_violations,
)
from drake_polygrasp.verification.stated_model import find_stated_model, load_stated_object

if TYPE_CHECKING:
    from drake_polygrasp.loading.surroundings import Surroundings
    from drake_polygrasp.verification.hand import HandCheck
from drake_polygrasp.verification.report import (
    CheckResult,
    GraspVerification,
    Status,
    VerificationReport,
)
from drake_polygrasp.verification.surface import surface_violations


@dataclass(frozen=True)
class _Model:
    """The model that a file names, or why SURFACE cannot be checked against it."""

    object_: GraspObject | None
    line: CheckResult
    warnings: tuple[str, ...] = ()


def verify_file(
    path: Path | str,
    package_paths: Sequence[Path | str] = (),
    packages: Mapping[str, str | Path] | None = None,
    *,
    plant: bool = False,
    scene: Path | str | None = None,
    misses: int | None = None,
    progress: Progress | None = None,
) -> VerificationReport:
    """Checks all claims of a grasp file, without the planner.

    For each grasp, FORCES proves force closure in exact arithmetic, SURFACE compares contacts,
    normals and friction with the model that the file names, and NUMBERS recomputes the certificate.
    Where the file states how a hand holds a grasp, HAND poses the hand's model and computes tips,
    clearance, torques and the way again.

        report = verify_file("box.grasp.yaml")
        if not report.holds:
            print([check for grasp in report.grasps for check in grasp.lines.values()])

    Args:
        path: the grasp file, which is not changed.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
        plant: whether to check each grasp whose other checks hold in a MultibodyPlant too, like
            `certify_in_plant`.
        scene: for `plant`: model directives with the object and other bodies, which no fingertip
            and no hand may penetrate at their default poses; see `load_surroundings`.
        misses: for `plant`: how many misses to simulate of each grasp, drawn within the errors that
            its `region` states (default: none).
        progress: called with the number of grasps that are checked and the number of all.

    Returns:
        The results. `holds` is True if all checks hold, False if one fails, and None if none fails
        but a model was not found or a plant leaves a grasp undecided.

    Raises:
        UsageError: when an argument has the wrong type, or there is a scene, or misses, without
            `plant`.
        GraspFileError: when the file cannot be read or breaks the format.
        ModelError: when one of `package_paths` or `packages` is no folder, or the scene cannot be
            loaded or does not hold the object.
    """
    package_paths = check_paths("package_paths", package_paths)
    plant = check_flag("plant", plant)
    tell = check_progress("progress", progress)
    if scene is not None:
        check_path("scene", scene)
    if scene is not None and not plant:
        raise UsageError("a scene is for the plant that grasps are checked in: add plant=True")
    if misses is not None:
        misses = check_count("misses", misses)
    if misses is not None and not plant:
        raise UsageError("misses are simulated in the plant: add plant=True")
    file = load_grasps(path)
    model, avoided = _find_model(file, package_paths, packages), file.plan.exclusion
    around = _surroundings(scene, model.object_, file, package_paths, packages)
    hand = _hand_check(file, model, package_paths, packages, around)
    # A file may state numbers of any size; every comparison below fails if one overflows.
    with np.errstate(all="ignore"):
        grasps: list[GraspVerification] = []
        clearances: list[float | None] = []
        for stated in file.grasps:
            tell(len(grasps), len(file.grasps))
            verification, clearance = _verify_grasp(stated, model, avoided, hand)
            grasps.append(verification)
            clearances.append(clearance)
        grasps = _with_regions(_with_numbers(grasps, clearances, file), file)
    if plant and model.object_ is not None:
        for i, stated in enumerate(file.grasps):
            tell(i, len(file.grasps))
            grasps[i] = _with_plant(
                grasps[i], stated, model.object_, package_paths, packages, around, misses
            )
            if hand is not None and (record := grasps[i].plant) is not None:
                verdicts = (*record.verdicts, *hand.verdicts(stated))
                grasps[i] = replace(grasps[i], plant=replace(record, verdicts=verdicts))
    return VerificationReport(
        file.path, tuple(grasps), model.line.status is not Status.NOT_CHECKED, model.warnings
    )


def _hand_check(
    file: GraspFile,
    model: _Model,
    package_paths: Sequence[Path | str],
    packages: Mapping[str, str | Path] | None,
    surroundings: Surroundings | None,
) -> HandCheck | None:
    """Returns the check of the file's hand, if there are a hand and an object to hold."""
    if file.hand is None or model.object_ is None:
        return None
    # Kinematics and solvers are loaded only for files with a hand.
    from drake_polygrasp.verification.hand import HandCheck

    return HandCheck(file.hand, model.object_, surroundings, package_paths, packages)


def _verify_grasp(
    stated: StatedGrasp, model: _Model, avoided: Exclusion, hand: HandCheck | None
) -> tuple[GraspVerification, float | None]:
    """Checks a grasp but for NUMBERS, and returns the clearance of `_check_surface` [m]."""
    surface, clearance = model.line, None
    if model.object_ is not None:
        surface, clearance = _check_surface(stated, model.object_, avoided)
    forces = _line(Status.PROVED, chain(force_violations(stated), region_violations(stated)))
    numbers = CheckResult(Status.NOT_CHECKED, "the grasp is not proved")
    held = None
    if stated.hand is not None:
        reason = "the object's model is not there, or not as stated"
        held = hand.check(stated) if hand else CheckResult(Status.NOT_CHECKED, reason)
    bears = None if stated.region is None else stated.region.least_placement_error
    checks = GraspVerification(
        forces, surface, numbers, stated_plant=stated.plant, hand=held, bears=bears
    )
    return checks, clearance


def _surroundings(
    scene: Path | str | None,
    object_: GraspObject | None,
    file: GraspFile,
    package_paths: Sequence[Path | str],
    packages: Mapping[str, str | Path] | None,
) -> Surroundings | None:
    if scene is None or object_ is None:
        return None
    from drake_polygrasp.loading.surroundings import load_surroundings

    mu = file.plan.mu
    return load_surroundings(scene, object_, mu=mu, package_paths=package_paths, packages=packages)


def _with_plant(
    report: GraspVerification,
    stated: StatedGrasp,
    object_: GraspObject,
    package_paths: Sequence[Path | str],
    packages: Mapping[str, str | Path] | None,
    surroundings: Surroundings | None,
    misses: int | None,
) -> GraspVerification:
    """Adds the verdicts of a plant to a report in which no check fails."""
    # Simulation is loaded only if it is asked for.
    from drake_polygrasp.plant.certify_in_plant import certify_in_plant

    if any(line.status is Status.FAILED for line in report.lines.values()):
        return report
    verdicts = certify_in_plant(
        object_,
        stated,
        tip_radius=stated.tip_radius or 0.0,
        package_paths=package_paths,
        packages=packages,
        surroundings=surroundings,
        misses=misses,
    )
    return replace(report, plant=verdicts)


def _line(passed: Status, faults: Iterable[str], left_out: str = "") -> CheckResult:
    """Returns the status `passed` with what is left out, or FAILED with the first fault."""
    fault = next(iter(faults), None)
    return CheckResult(passed, left_out) if fault is None else CheckResult(Status.FAILED, fault)


def _find_model(
    file: GraspFile,
    package_paths: Sequence[Path | str],
    packages: Mapping[str, str | Path] | None,
) -> _Model:
    """Loads the model that a file names, or finds it missing, changed or not as stated."""
    stated, mu = file.object_, file.plan.mu
    package_map = find_packages(file.path, package_paths, packages)
    try:
        model_file = find_stated_model(file, package_map)
    except ModelError as error:
        return _missing(str(error))
    name = stated.model_file
    try:
        if model_digest(model_file, package_paths, packages) != stated.sha256:
            return _Model(
                None, CheckResult(Status.FAILED, f"{name} has changed since: sha256 differs")
            )
        object_ = load_stated_object(file, model_file, package_paths, packages)
    except MissingPackageError as error:
        return _missing(str(error))
    except ModelError as error:
        return _Model(None, CheckResult(Status.FAILED, str(error)))
    line = _line(Status.RECOMPUTED, _object_violations(stated, object_))
    if line.status is Status.FAILED:
        return _Model(None, line)
    asked = (
        () if mu is None else (f"friction {mu} was asked for in the plan, not read from {name}",)
    )
    return _Model(object_, line, (*object_.warnings, *asked))


def _missing(reason: str) -> _Model:
    return _Model(
        None, CheckResult(Status.NOT_CHECKED, reason), (f"SURFACE is not checked: {reason}",)
    )


def _object_violations(stated: StatedObject, object_: GraspObject) -> Iterator[str]:
    """Yields one message for each number in which the file's object differs from the model's."""
    num_faces = len(object_.polyhedron.faces)
    if stated.num_faces != num_faces:
        yield f"num_faces is {stated.num_faces}, the model has {num_faces}"
    source = object_.source
    links = [] if source is None else list(source.links or [source.body_name])
    if stated.links is not None and sorted(stated.links) != sorted(links):
        yield f"links are {list(stated.links)}, the model's are {links}"
    if not _close(stated.mass, object_.mass):
        masses = ("null" if mass is None else mass for mass in (stated.mass, object_.mass))
        yield "mass is {}, the model's is {}".format(*masses)
    if not _close(stated.rho, object_.rho):
        yield f"rho is {stated.rho}, the model's is {object_.rho}"
    if not (np.abs(stated.p_BBcm - object_.p_BBcm) <= ROUNDING * object_.rho).all():
        yield f"p_BBcm is {stated.p_BBcm.tolist()}, the model's is {object_.p_BBcm.tolist()}"


def _close(stated: float | None, true: float | None) -> bool:
    if stated is None or true is None:
        return stated is true
    return abs(stated - true) <= ROUNDING * abs(true)


def _check_surface(
    stated: StatedGrasp, object_: GraspObject, avoided: Exclusion
) -> tuple[CheckResult, float | None]:
    """Checks SURFACE; returns also the least distance of a contact to an edge of its face [m]."""
    grasp, polyhedron = stated.grasp, object_.polyhedron
    touched = locate_contacts(polyhedron, grasp.p_BC, grasp.nhat_TB_B)
    violations = chain(
        surface_violations(stated, polyhedron, touched, avoided),
        region_surface_violations(stated, polyhedron, touched),
    )
    line = _line(Status.RECOMPUTED, violations)
    if line.status is Status.FAILED:
        return line, None
    return line, float(edge_distance(polyhedron, grasp.p_BC, touched.face).min())


def _with_numbers(
    grasps: list[GraspVerification], clearances: list[float | None], file: GraspFile
) -> list[GraspVerification]:
    """Recomputes the numbers of the certificates of grasps that are proved."""
    left_out = "placement_tolerance is not held against the faces' edges"
    rows = [i for i, checks in enumerate(grasps) if checks.forces.status is not Status.FAILED]
    stated = [file.grasps[i] for i in rows]
    found = number_violations(stated, file.object_, [clearances[i] for i in rows])
    lines = {
        i: _line(Status.RECOMPUTED, each, left_out if clearances[i] is None else "")
        for i, each in zip(rows, found, strict=True)
    }
    return [
        replace(checks, numbers=lines.get(i, checks.numbers)) for i, checks in enumerate(grasps)
    ]


def _with_regions(grasps: list[GraspVerification], file: GraspFile) -> list[GraspVerification]:
    """Recomputes the bounds under errors too, but only of regions that may be the surface's."""
    checks = [{g.forces.status, g.surface.status, g.numbers.status} for g in grasps]
    rows = [i for i, statuses in enumerate(checks) if Status.FAILED not in statuses]
    found = region_number_violations([file.grasps[i] for i in rows], file.object_)
    lines = {i: _line(Status.RECOMPUTED, each) for i, each in zip(rows, found, strict=True) if each}
    return [replace(g, numbers=lines.get(i, g.numbers)) for i, g in enumerate(grasps)]
