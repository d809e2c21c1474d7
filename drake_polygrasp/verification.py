"""Verifies a grasp file without the planner: what is in it is proved, recomputed or not checked.

FORCES needs the file's numbers alone: the internal force proves force closure in exact
arithmetic. SURFACE needs the model: it is the one that was planned on, and each contact lies on
its exposed surface, along its normal, with no more friction than it has. NUMBERS recomputes what
the file says of the grasp's quality; a number that flatters the grasp is refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from drake_polygrasp.claims import ROUNDING, force_faults, number_faults
from drake_polygrasp.errors import ModelError
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.grasp_file import GraspFile, StatedGrasp, StatedObject, load_grasps
from drake_polygrasp.model_source import find_packages, model_digest, resolve
from drake_polygrasp.object_model import load_object
from drake_polygrasp.seating import edge_distance, face_of


class Status(StrEnum):
    """What was done about one line of a grasp."""

    PROVED = "proved"
    RECOMPUTED = "recomputed"
    NOT_CHECKED = "not checked"
    FAILED = "FAILED"


@dataclass(frozen=True)
class Line:
    """A status and, where there is something to say, a sentence."""

    status: Status
    reason: str = ""


@dataclass(frozen=True)
class GraspReport:
    """The three lines of one grasp."""

    forces: Line
    surface: Line
    numbers: Line

    @property
    def lines(self) -> dict[str, Line]:
        """By name, as they are printed."""
        return {"FORCES": self.forces, "SURFACE": self.surface, "NUMBERS": self.numbers}


@dataclass(frozen=True)
class Report:
    """What verification found, grasps in the file's order."""

    path: Path
    grasps: tuple[GraspReport, ...]
    model_checked: bool
    """Whether the model was there to check SURFACE against."""
    warnings: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether there are grasps, each proved, and nothing that was checked failed."""
        lines = [line for grasp in self.grasps for line in grasp.lines.values()]
        return bool(lines) and all(line.status is not Status.FAILED for line in lines)


@dataclass(frozen=True)
class _Model:
    """The model a file names, or why SURFACE cannot be checked against it."""

    object_: GraspObject | None
    line: Line
    warnings: tuple[str, ...] = ()


def verify_file(path: Path | str, package_paths: Sequence[Path | str] = ()) -> Report:
    """Check everything a grasp file claims.

    Args:
        path: the grasp file, which is not changed.
        package_paths: folders searched for the packages of package:// URIs.

    Raises:
        GraspFileError: when the file cannot be read or breaks the format.
        ModelError: when one of `package_paths` is no folder.
    """
    file = load_grasps(path)
    model = _find_model(file, package_paths)
    # A file may state numbers of any size; every comparison below fails on what overflows.
    with np.errstate(all="ignore"):
        grasps = tuple(_verify_grasp(stated, file.object_, model) for stated in file.grasps)
    return Report(file.path, grasps, model.line.status is not Status.NOT_CHECKED, model.warnings)


def _verify_grasp(stated: StatedGrasp, object_: StatedObject, model: _Model) -> GraspReport:
    surface, clearance = model.line, None
    if model.object_ is not None:
        surface, clearance = _check_surface(stated, model.object_)
    forces = _line(Status.PROVED, force_faults(stated))
    if forces.status is Status.FAILED:
        return GraspReport(forces, surface, Line(Status.NOT_CHECKED, "the grasp is not proved"))
    return GraspReport(forces, surface, _check_numbers(stated, object_, clearance))


def _line(passed: Status, faults: Iterable[str]) -> Line:
    """FAILED with the first fault, if there is one."""
    fault = next(iter(faults), None)
    return Line(passed) if fault is None else Line(Status.FAILED, fault)


def _find_model(file: GraspFile, package_paths: Sequence[Path | str]) -> _Model:
    """The model a file names: missing, changed, not what the file says of it, or as it was."""
    stated, mu = file.object_, file.plan.get("mu")
    name = stated.model_file
    packages = find_packages(file.path, package_paths)
    try:
        model_file = resolve(name, file.path.parent, packages)
    except ModelError as error:
        return _missing(str(error))
    if not model_file.is_file():
        return _missing(f"{model_file}: there is no such model file")
    try:
        if model_digest(model_file, package_paths) != stated.sha256:
            return _Model(None, Line(Status.FAILED, f"{name} has changed since: sha256 differs"))
        object_ = load_object(
            model_file,
            body_name=f"{stated.model_name}::{stated.body_name}",
            mu=mu,
            package_paths=package_paths,
        )
    except ModelError as error:
        return _Model(None, Line(Status.FAILED, str(error)))
    line = _line(Status.RECOMPUTED, _object_faults(stated, object_))
    if line.status is Status.FAILED:
        return _Model(None, line)
    asked = (
        () if mu is None else (f"friction {mu} was asked for in the plan, not read from {name}",)
    )
    return _Model(object_, line, (*object_.warnings, *asked))


def _missing(reason: str) -> _Model:
    return _Model(None, Line(Status.NOT_CHECKED, reason), (f"SURFACE is not checked: {reason}",))


def _object_faults(stated: StatedObject, object_: GraspObject) -> Iterator[str]:
    """Where the file's object differs from the model's."""
    num_faces = len(object_.polyhedron.faces)
    if stated.num_faces != num_faces:
        yield f"num_faces is {stated.num_faces}, the model has {num_faces}"
    if not _close(stated.mass, object_.mass):
        yield f"mass is {stated.mass}, the model's is {object_.mass}"
    if not _close(stated.rho, object_.rho):
        yield f"rho is {stated.rho}, the model's is {object_.rho}"
    if not (np.abs(stated.p_BBcm - object_.p_BBcm) <= ROUNDING * object_.rho).all():
        yield f"p_BBcm is {stated.p_BBcm.tolist()}, the model's is {object_.p_BBcm.tolist()}"


def _close(stated: float | None, true: float | None) -> bool:
    if stated is None or true is None:
        return stated is true
    return abs(stated - true) <= ROUNDING * abs(true)


def _check_surface(stated: StatedGrasp, object_: GraspObject) -> tuple[Line, float | None]:
    """The line, and the least distance from a contact to an edge of its face [m]."""
    grasp, polyhedron = stated.grasp, object_.polyhedron
    face = face_of(polyhedron, grasp.p_BC, grasp.nhat_TB_B)
    for i, k in enumerate(face):
        if k < 0:
            off = f"contact {i + 1} is not on the exposed surface, or not along its normal"
            return Line(Status.FAILED, off), None
        mu = polyhedron.faces[k].mu
        if not grasp.mu[i] <= mu * (1 + ROUNDING):
            more = f"contact {i + 1} claims friction {grasp.mu[i]:.6g}, its face has {mu:.6g}"
            return Line(Status.FAILED, more), None
    return Line(Status.RECOMPUTED), float(edge_distance(polyhedron, grasp.p_BC, face).min())


def _check_numbers(stated: StatedGrasp, object_: StatedObject, clearance: float | None) -> Line:
    line = _line(Status.RECOMPUTED, number_faults(stated, object_, clearance))
    if line.status is Status.RECOMPUTED and clearance is None:
        return Line(line.status, "placement_tolerance is not held against the faces' edges")
    return line
