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
    """Where an object came from."""

    model_file: Path | str
    """The file given to Drake's Parser: an absolute path, or a package:// URI as it was given."""
    sha256: str
    """Hex digest over the digests of the model file, its included files and collision meshes."""
    model_name: str
    body_name: str
    patch_angle: float | None = None
    """What patches of its surface were asked for, as of `load_object`; None for the default."""
    patch_depth: float | None = None
    links: tuple[str, ...] = ()
    """The links that the model fixes to one another, when more than one; B is of `body_name`."""
    joints_free: bool = False
    """Whether links on its joints were ignored, as of `load_object`."""
    scale: float | None = None
    """Of an OBJ model, as of `load_object`; None for 1."""


@dataclass(frozen=True, eq=False)
class GraspObject:
    """A rigid body as the planner and the certificate see it, in its body frame B."""

    polyhedron: Polyhedron
    """Its exposed surface; friction belongs to the faces."""
    mass: float | None
    """[kg]; None when the model states none."""
    p_BBcm: Array
    """Centre of mass [m], shape (3,); the volume's centroid when the model states none."""
    rho: float
    """Greatest distance from the centre of mass to the surface [m]."""
    source: ModelSource | None = None
    warnings: tuple[str, ...] = ()
    """What was assumed or changed on loading, one sentence each."""
    body: BodyIdentity | None = None
    """What tells it from other bodies, for obstacles; None where that is not known."""


@dataclass(frozen=True, eq=False)
class GraspPlane:
    """The paper's plane Pi_p, which holds the three contacts."""

    nhat_B: Array
    """Unit normal, shape (3,)."""
    p_BP: Array
    """A point of the plane [m], shape (3,)."""


@dataclass(frozen=True)
class Quality:
    """The paper's quality of a set of faces (eq. 5-10)."""

    scale: Literal["paper", "object"]
    """What distances and areas are divided by: maxima over all valid sets, or rho."""
    Q: float
    q: tuple[float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Grasp:
    """Three frictional point contacts; how they were found is not part of it."""

    p_BC: Array
    """Contact points on the exposed surface [m], shape (3, 3), one row a contact."""
    nhat_TB_B: Array
    """Inward unit normals, shape (3, 3)."""
    mu: Array
    """Friction coefficient of each contact's pair, shape (3,)."""
    kind: Kind
    faces: tuple[int, int, int]
    """Index of each contact's face in the polyhedron."""
    grasp_plane: GraspPlane
    quality: Quality | None = None


@dataclass(frozen=True, eq=False)
class Certificate:
    """What is proved of a grasp; every number can be recomputed from the grasp file alone."""

    internal_force: Array
    """x_12, x_13, x_23 [1/m], shape (3,): the proof of force closure."""
    margin: float
    """In (0, 1]: attained by `internal_force`."""
    mu_min: float
    """The grasp still holds when friction drops, by one factor, until the greatest is this."""
    mu_min_internal_force: Array
    """What proves it then [1/m], shape (3,)."""
    epsilon_lower: float
    """Bounds of the largest wrench withstood in every direction by unit total normal force."""
    epsilon_upper: float
    placement_tolerance: float
    """All three contacts may move at once by less than this along their faces [m]."""
    tilt_tolerance: float
    """All three normals may tilt at once by less than this [rad]."""
    friction_tolerance: float
    """All three friction coefficients may drop at once by less than this."""
    squeeze_force: float | None = field(default=None)
    """[N] of total normal force that holds the weight in every orientation."""


@dataclass(frozen=True)
class PlantVerdict:
    """One answer to the question whether a grasp holds."""

    name: str
    """exact, convex, geometry, statics or simulation."""
    verdict: Verdict
    """Undecided where the check could not be run."""
    margin: float | None
    """What is left until it would not hold; None where the check was not run."""
    unit: str
    reason: str = ""


@dataclass(frozen=True, eq=False)
class HeldWeight:
    """How contacts in a plant hold the object's weight along one axis of B."""

    weight_B: Array
    """[N], shape (3,)."""
    residual: float
    """What the planned forces leave unbalanced, torques over rho, in units of the weight."""
    p_BC: Array
    """Where Drake's contact wrenches act [m], shape (3, 3); none, shape (0, 3), if it failed."""
    f_Bc_B: Array
    """The forces of Drake's contact wrenches on B [N], likewise."""


@dataclass(frozen=True, eq=False)
class PlantRecord:
    """The verdicts of a plant on a grasp, as a grasp file states them."""

    verdicts: tuple[PlantVerdict, ...]
    settings: Mapping[str, Any]
    """What the plant was asked."""
    equilibria: tuple[HeldWeight, ...] = ()
    """Of the weight along +x, +y, +z, -x, -y, -z of B."""

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
    """A grasp that holds, and its proof."""

    grasp: Grasp
    certificate: Certificate
    tip_radius: float | None = None
    """Radius of the fingertips that have room at the contacts [m]; None where no plan says so."""
    plant: PlantRecord | None = None
    """What a plant says of the grasp; None where it was not asked."""


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
