"""What a grasp file states, as values: an object, grasps and claims; nothing of it is proved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.exclusion import Exclusion, exclusion
from drake_polygrasp.grasp import Grasp, ModelSource, PlantRecord


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

    def source_at(self, model_file: Path) -> ModelSource:
        """Returns the stated source of the object, for loading it again.

        Args:
            model_file: path of the model file, resolved.

        Returns:
            The source with the digest, names and options that the file states.
        """
        return ModelSource(
            model_file=model_file,
            sha256=self.sha256,
            model_name=self.model_name,
            body_name=self.body_name,
            patch_angle=self.patch_angle,
            patch_depth=self.patch_depth,
            links=self.links or (),
            joints_free=self.joints_free,
            scale=self.scale,
        )


@dataclass(frozen=True, eq=False)
class StatedPlan:
    """What a file states of the plan: keys of any planner, and typed those that others go by.

    Attributes:
        stated: the plan block as it stands in the file; empty where there is none.
    """

    stated: Mapping[str, Any] = field(default_factory=dict)

    @property
    def mu(self) -> float | None:
        """Friction asked for in place of the model's; None where it is the model's."""
        return self.stated.get("mu")

    @property
    def tip_radius(self) -> float | None:
        """Radius of the plan's fingertips [m]; None where the file states none."""
        return self.stated.get("tip_radius")

    @property
    def obstacles(self) -> tuple[str, ...] | None:
        """Names of the bodies around; None where the plan knew of none."""
        names = self.stated.get("obstacles")
        return None if names is None else tuple(names)

    @property
    def exclusion(self) -> Exclusion:
        """Where the plan allows no contact."""
        return exclusion(
            self.stated.get("avoid_directions", ()),
            self.stated.get("exclude_faces", ()),
            self.stated.get("avoid_angle"),
        )


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
        plan: what repeats the plan.
        generator: the versions that wrote the file.
    """

    path: Path
    object_: StatedObject
    grasps: tuple[StatedGrasp, ...]
    plan: StatedPlan = field(default_factory=StatedPlan)
    generator: Mapping[str, Any] = field(default_factory=dict)
