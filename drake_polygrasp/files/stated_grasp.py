"""Values for what a grasp file states: object, plan, grasps, certificates; none is checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.exclusion import Exclusion, exclusion
from drake_polygrasp.grasp import Grasp, ModelSource, PlantRecord, RegionCertificate
from drake_polygrasp.hand_grasp import HandPlacement, HandSource


@dataclass(frozen=True, eq=False)
class StatedObject:
    """The object as a grasp file states it.

    Attributes:
        model_file: path relative to the grasp file's folder, or a package:// URI.
        sha256: hex digest of the model's files.
        model_name: model instance, as Drake names it.
        body_name: link whose frame is B, as the model names it.
        mass: mass [kg]; None where the model states none.
        p_BBcm: centre of mass, measured from Bo and expressed in B [m], shape (3,).
        rho: greatest distance of the surface from the centre of mass [m].
        num_faces: number of the object's faces, before erosion.
        patch_angle: greatest angle between a patch's normal and its facets' [rad]; None for the
            default.
        patch_depth: greatest distance of facets from the plane of their patch [m]; None for the
            default.
        links: links of the rigid body; None where the file names none, as for a single link.
        joints_free: whether links on joints are ignored.
        scale: factor for the lengths of an OBJ model; None for 1.
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
        """Returns the source from which the object can be loaded again.

        Args:
            model_file: path of the model file on this machine.
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
    """The plan block of a grasp file, with the values that a verification uses as properties.

    Attributes:
        stated: the plan block as it stands in the file; empty where there is none.
    """

    stated: Mapping[str, Any] = field(default_factory=dict)

    @property
    def mu(self) -> float | None:
        """Friction coefficient given in place of the model's; None where it is the model's."""
        return self.stated.get("mu")

    @property
    def tip_radius(self) -> float | None:
        """Radius of the plan's fingertips [m]; None where the file states none."""
        return self.stated.get("tip_radius")

    @property
    def obstacles(self) -> tuple[str, ...] | None:
        """Names of the obstacles; None where the plan had none."""
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
    """The certificate of a grasp as a file states it; a value is None where the file has none.

    Attributes:
        internal_force: x_12, x_13, x_23 of the proof of force closure [1/m], shape (3,).
        margin: how far inside the friction cones its forces are; 1 is the greatest value.
        mu_min: least friction at which the contacts are proved force closure.
        mu_min_internal_force: x_12, x_13, x_23 of that proof [1/m], shape (3,).
        epsilon_lower: lower bound of epsilon, for unit total normal force [N].
        epsilon_upper: upper bound of epsilon [N].
        placement_tolerance: distance by which all contacts may miss at once along their faces [m].
        squeeze_force: total normal force that holds the weight in every orientation [N].
        tilt_tolerance: angle by which all normals may be tilted at once [rad].
        friction_tolerance: amount by which all coefficients may be less at once.
    """

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
    """A grasp and its certificate as a file states them, unchecked.

    Attributes:
        grasp: the three contacts.
        f_Bc_B: internal force on B at each contact, expressed in B, scaled so that normal forces
            add up to 1, shape (3, 3).
        certificate: the stated certificate.
        tip_radius: radius of the plan's fingertips [m]; None where the file states none.
        plant: stated verdicts of checks in a plant; None where the file states none.
        region: stated errors that the grasp bears, with their proof; None where the file states
            none.
        hand: how a hand holds the grasp; None where the file states none.
    """

    grasp: Grasp
    f_Bc_B: Array
    certificate: StatedCertificate
    tip_radius: float | None = None
    plant: PlantRecord | None = None
    region: RegionCertificate | None = None
    hand: HandPlacement | None = None


@dataclass(frozen=True, eq=False)
class GraspFile:
    """The content of a grasp file, unchecked but for its format.

    Attributes:
        path: the grasp file.
        object_: the object that is grasped.
        grasps: its grasps, best first.
        plan: the settings of the plan.
        generator: names and versions of the programs that wrote the file.
        hand: the hand that the grasps are for; None where the file names none.
    """

    path: Path
    object_: StatedObject
    grasps: tuple[StatedGrasp, ...]
    plan: StatedPlan = field(default_factory=StatedPlan)
    generator: Mapping[str, Any] = field(default_factory=dict)
    hand: HandSource | None = None
