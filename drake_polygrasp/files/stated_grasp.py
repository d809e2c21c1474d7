"""What a grasp file states, as values: an object, grasps and claims; nothing of it is proved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import Grasp, PlantRecord


@dataclass(frozen=True, eq=False)
class StatedObject:
    """The object as the file states it; see `GraspObject` for units and frames.

    Attributes:
        model_file: relative to the grasp file's folder, or a package:// URI.
        sha256: digest of the model's files.
        model_name: model instance, as Drake names it.
        body_name: body, as the model names it.
        mass: mass [kg]; None where the model states none.
        p_BBcm: centre of mass measured from Bo, in B [m], shape (3,).
        rho: greatest distance of the surface from the centre of mass [m].
        num_faces: how many faces the object had.
        patch_angle: what the model is loaded with, None for the default; see `load_object`.
        patch_depth: greatest depth of a patch of a curved surface [m].
        links: those of a rigid body of several, None where the file names none.
        joints_free: whether links on joints were ignored.
        scale: of an OBJ model, None for 1.
    """

    model_file: str
    sha256: str
    model_name: str
    body_name: str
    mass: float | None
    p_BBcm: Array
    rho: float
    num_faces: int
    patch_angle: float | None = None
    patch_depth: float | None = None
    links: tuple[str, ...] | None = None
    joints_free: bool = False
    scale: float | None = None


@dataclass(frozen=True, eq=False)
class StatedCertificate:
    """What the file claims of a grasp, None where it is silent; see `Certificate`."""

    internal_force: Array
    margin: float | None = None
    mu_min: float | None = None
    mu_min_internal_force: Array | None = None
    epsilon_lower: float | None = None
    epsilon_upper: float | None = None
    placement_tolerance: float | None = None
    squeeze_force: float | None = None
    tilt_tolerance: float | None = None
    friction_tolerance: float | None = None


@dataclass(frozen=True, eq=False)
class StatedGrasp:
    """A grasp and what the file claims of it: nothing here is proved by being read.

    Attributes:
        grasp: the three contacts.
        f_Bc_B: the internal force on B at each contact, shape (3, 3); normal forces add up to 1.
        certificate: what the file states of them.
        tip_radius: radius of the plan's fingertips [m]; None where the file states none.
        plant: what a plant said of the grasp; None where the file states nothing.
    """

    grasp: Grasp
    f_Bc_B: Array
    certificate: StatedCertificate
    tip_radius: float | None = None
    plant: PlantRecord | None = None


@dataclass(frozen=True, eq=False)
class GraspFile:
    """A grasp file's content, grasps best first.

    Attributes:
        path: the grasp file.
        object_: what is grasped.
        grasps: best first.
        plan: what it takes to repeat the plan.
        generator: the versions that wrote the file.
    """

    path: Path
    object_: StatedObject
    grasps: tuple[StatedGrasp, ...]
    plan: Mapping[str, Any] = field(default_factory=dict)
    generator: Mapping[str, Any] = field(default_factory=dict)
