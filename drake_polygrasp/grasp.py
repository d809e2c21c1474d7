"""The central nouns: an object to grasp, a grasp of it, and what is proved of that grasp.

All are immutable values. Everything geometric is expressed in the body frame B, in SI units.
Frames and names follow Drake's monogram notation: `p_BC` is the position of contact C measured
from B's origin, `nhat_TB_B` the unit normal that points from the fingertip T into the body B (the
paper's inward n_i), `f_Bc_B` the force on body B at contact c.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.body_identity import BodyIdentity
from drake_polygrasp.geometry.polyhedron import Polyhedron

Kind = Literal["three_faces", "three_parallel_faces", "two_faces"]


class Verdict(StrEnum):
    """The answer to whether a grasp holds; undecided is never "holds"."""

    HOLDS = "holds"
    FAILS = "does not hold"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class ModelSource:
    """Where an object came from.

    Attributes:
        model_file: the file given to Drake's Parser: an absolute path, or a package:// URI as it
            was given.
        sha256: hex digest over the digests of the model file, its included files and collision
            meshes.
        model_name: model instance, as Drake names it.
        body_name: body, as the model names it.
        patch_angle: what patches of its surface were asked for, as of `load_object`; None for the
            default.
        patch_depth: greatest depth of a patch of a curved surface [m].
        links: the links that the model fixes to one another, when more than one; B is of
            `body_name`.
        joints_free: whether links on its joints were ignored, as of `load_object`.
        scale: of an OBJ model, as of `load_object`; None for 1.
    """

    model_file: Path | str
    sha256: str
    model_name: str
    body_name: str
    patch_angle: float | None = None
    patch_depth: float | None = None
    links: tuple[str, ...] = ()
    joints_free: bool = False
    scale: float | None = None


@dataclass(frozen=True, eq=False)
class GraspObject:
    """A rigid body as the planner and the certificate see it, in its body frame B.

    Attributes:
        polyhedron: its exposed surface; friction belongs to the faces.
        mass: [kg]; None when the model states none.
        p_BBcm: centre of mass [m], shape (3,); the volume's centroid when the model states none.
        rho: greatest distance from the centre of mass to the surface [m].
        source: where the object came from; None for a body of a plant.
        warnings: what was assumed or changed on loading, one sentence each.
        body: what tells it from other bodies, for obstacles; None where that is not known.
    """

    polyhedron: Polyhedron
    mass: float | None
    p_BBcm: Array
    rho: float
    source: ModelSource | None = None
    warnings: tuple[str, ...] = ()
    body: BodyIdentity | None = None


@dataclass(frozen=True, eq=False)
class GraspPlane:
    """The paper's plane Pi_p, which holds the three contacts.

    Attributes:
        nhat_B: unit normal, shape (3,).
        p_BP: a point of the plane [m], shape (3,).
    """

    nhat_B: Array
    p_BP: Array


@dataclass(frozen=True)
class Quality:
    """The paper's quality of a set of faces (eq. 5-10).

    Attributes:
        scale: what distances and areas are divided by: maxima over all valid sets, or rho.
        Q: the product of the five.
        q: the five factors of equations 5 to 10.
    """

    scale: Literal["paper", "object"]
    Q: float
    q: tuple[float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Grasp:
    """Three frictional point contacts; how they were found is not part of it.

    Attributes:
        p_BC: contact points on the exposed surface [m], shape (3, 3), one row a contact.
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficient of each contact's pair, shape (3,).
        kind: how many faces, and whether they are parallel.
        faces: index of each contact's face in the polyhedron.
        grasp_plane: the plane Pi_p.
        quality: the paper's quality; None where its stages give none.
    """

    p_BC: Array
    nhat_TB_B: Array
    mu: Array
    kind: Kind
    faces: tuple[int, int, int]
    grasp_plane: GraspPlane
    quality: Quality | None = None


@dataclass(frozen=True, eq=False)
class Certificate:
    """What is proved of a grasp; every number can be recomputed from the grasp file alone.

    Attributes:
        internal_force: x_12, x_13, x_23 [1/m], shape (3,): the proof of force closure.
        margin: in (0, 1]: attained by `internal_force`.
        mu_min: the grasp still holds when friction drops, by one factor, until the greatest is
            this.
        mu_min_internal_force: what proves it then [1/m], shape (3,).
        epsilon_lower: bounds of the largest wrench withstood in every direction by unit total
            normal force.
        epsilon_upper: upper bound of epsilon.
        placement_tolerance: all three contacts may move at once by less than this along their faces
            [m].
        tilt_tolerance: all three normals may tilt at once by less than this [rad].
        friction_tolerance: all three friction coefficients may drop at once by less than this.
        squeeze_force: [N] of total normal force that holds the weight in every orientation.
    """

    internal_force: Array
    margin: float
    mu_min: float
    mu_min_internal_force: Array
    epsilon_lower: float
    epsilon_upper: float
    placement_tolerance: float
    tilt_tolerance: float
    friction_tolerance: float
    squeeze_force: float | None = field(default=None)


@dataclass(frozen=True)
class PlantVerdict:
    """One answer to the question whether a grasp holds.

    Attributes:
        name: exact, convex, geometry, statics or simulation.
        verdict: undecided where the check could not be run.
        margin: what is left until it would not hold; None where the check was not run.
        unit: unit of the margin.
        reason: why the check has no answer; empty where it has one.
    """

    name: str
    verdict: Verdict
    margin: float | None
    unit: str
    reason: str = ""


@dataclass(frozen=True, eq=False)
class HeldWeight:
    """How contacts in a plant hold the object's weight along one axis of B.

    Attributes:
        weight_B: [N], shape (3,).
        residual: what the planned forces leave unbalanced, torques over rho, in units of the
            weight.
        p_BC: where Drake's contact wrenches act [m], shape (3, 3); none, shape (0, 3), if it
            failed.
        f_Bc_B: the forces of Drake's contact wrenches on B [N], likewise.
    """

    weight_B: Array
    residual: float
    p_BC: Array
    f_Bc_B: Array


@dataclass(frozen=True, eq=False)
class PlantRecord:
    """The verdicts of a plant on a grasp, as a grasp file states them.

    Attributes:
        verdicts: one of each check, by its name.
        settings: what the plant was asked.
        equilibria: of the weight along +x, +y, +z, -x, -y, -z of B.
    """

    verdicts: tuple[PlantVerdict, ...]
    settings: Mapping[str, Any]
    equilibria: tuple[HeldWeight, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether there are verdicts and all of them are "holds"."""
        return self.verdict is Verdict.HOLDS

    @property
    def verdict(self) -> Verdict:
        """The worst of all verdicts; undecided where there is none."""
        found = {verdict.verdict for verdict in self.verdicts}
        if Verdict.FAILS in found:
            return Verdict.FAILS
        return Verdict.HOLDS if found == {Verdict.HOLDS} else Verdict.UNDECIDED


@dataclass(frozen=True, eq=False)
class CertifiedGrasp:
    """A grasp that holds, and its proof.

    Attributes:
        grasp: the three contacts.
        certificate: what is proved of them.
        tip_radius: radius of the fingertips that have room at the contacts [m]; None where no plan
            says so.
        plant: what a plant says of the grasp; None where it was not asked.
    """

    grasp: Grasp
    certificate: Certificate
    tip_radius: float | None = None
    plant: PlantRecord | None = None


class CarriesProof(Protocol):
    """A certificate, as it is proved or stated."""

    @property
    def internal_force(self) -> Array:
        """x_12, x_13, x_23 [1/m], shape (3,)."""


class CarriesGrasp(Protocol):
    """A grasp with what is known of it: `CertifiedGrasp`, or a file's `StatedGrasp`."""

    @property
    def grasp(self) -> Grasp:
        """The three contacts."""

    @property
    def certificate(self) -> CarriesProof:
        """The proof of force closure."""

    @property
    def tip_radius(self) -> float | None:
        """Radius of the fingertips that it was planned for [m]."""


AnyGrasp = Grasp | CarriesGrasp
_BEYOND_MEASURE = 1e9
"""[m], ours: coordinates of no grasp."""
_UNIT = 1e-6
"""Ours: of a unit vector's length; the proof asks for more."""


def grasp_of(grasp: AnyGrasp) -> Grasp:
    """Returns the three contacts of a grasp, or of one that carries its certificate.

    Raises UsageError when it is no grasp, or its arrays have other shapes or numbers than stated.
    """
    contacts = grasp if isinstance(grasp, Grasp) else getattr(grasp, "grasp", None)
    if not isinstance(contacts, Grasp):
        raise UsageError(
            f"the grasp is a {type(grasp).__name__}; it must be a Grasp, or a CertifiedGrasp of a "
            "plan, or a grasp of a file that was loaded"
        )
    for name, shape in (("p_BC", (3, 3)), ("nhat_TB_B", (3, 3)), ("mu", (3,))):
        values = getattr(contacts, name)
        numbers = isinstance(values, np.ndarray) and values.dtype.kind == "f"
        if not numbers or values.shape != shape or not (np.abs(values) <= _BEYOND_MEASURE).all():
            raise UsageError(
                f"the grasp's {name} must be floats of at most {_BEYOND_MEASURE:g}, an array of "
                f"shape {shape}"
            )
    if not (contacts.mu > 0).all():
        raise UsageError(f"the grasp's mu is {contacts.mu.tolist()}; each must be above 0")
    length = np.linalg.norm(contacts.nhat_TB_B, axis=1)
    if not (np.abs(length - 1) <= _UNIT).all():
        raise UsageError(
            f"the grasp's nhat_TB_B are {length.tolist()} long; they must be unit vectors"
        )
    return contacts
