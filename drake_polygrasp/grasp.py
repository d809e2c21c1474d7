"""The values that all rooms share: an object, a grasp of it, and what is proved of that grasp.

All are immutable. Everything geometric is expressed in the body frame B, in SI units. Names follow
Drake's monogram notation: `p_BC` is the position of contact C measured from B's origin, `nhat_TB_B`
the unit normal that points from the fingertip T into the body B (the paper's inward n_i), `f_Bc_B`
the force on body B at contact c.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from drake_polygrasp.arguments import check_number
from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.body_identity import BodyIdentity
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface_pieces import SurfacePiece

Kind = Literal["three_faces", "three_parallel_faces", "two_faces"]
"""How many faces a grasp touches; parallel are three that parallel forces hold, one against two."""


class Verdict(StrEnum):
    """The answer of a check: HOLDS, FAILS ("does not hold") or UNDECIDED.

    UNDECIDED means that the check could not be run or found no proof either way; it never counts
    as HOLDS.
    """

    HOLDS = "holds"
    FAILS = "does not hold"
    UNDECIDED = "undecided"


@dataclass(frozen=True)
class ModelSource:
    """The model file of an object and the options with which it was loaded.

    Attributes:
        model_file: the file given to Drake's Parser: an absolute path, or a package:// URI as it
            was given.
        sha256: hex digest over the digests of the model file, its included files and collision
            meshes.
        model_name: name of the model instance in Drake.
        body_name: name of the link whose frame is B.
        patch_angle: greatest angle between a patch's normal and those of its facets [rad], if it
            was given to `load_object`; None for the default.
        patch_depth: greatest distance of facets from the plane of their patch [m], if it was given
            to `load_object`; None for the default.
        links: names of all links that the model fixes to one another, if there are several;
            together they are the rigid body.
        joints_free: whether links on the body's joints were ignored; otherwise they cover faces.
        scale: factor on the lengths of an OBJ model; None for 1.
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


_FRICTION = "a friction coefficient, above 0 and at most 100"


@dataclass(frozen=True, eq=False)
class GraspObject:
    """A rigid body to grasp: its exposed surface, mass and centre of mass, in body frame B.

    `load_object` reads one from a model file, `object_from_plant` from a `MultibodyPlant`.

        box = load_object("models/brick/brick.urdf")
        print(len(box.polyhedron.faces), box.polyhedron.faces[0].mu, box.mass, box.warnings)

    Attributes:
        polyhedron: the exposed surface, as planar faces that are numbered from 0; each face has its
            friction coefficient `mu`.
        mass: mass of the body [kg]; None if the model states none.
        p_BBcm: centre of mass [m], shape (3,); the volume's centroid if the model states none.
        rho: greatest distance from the centre of mass to the surface [m]; torques are divided by
            it.
        source: the model file; None for a body of a plant without one.
        warnings: what was assumed or changed on loading, one sentence each.
        body: identifies the body among those of its plant, for obstacles; None if it is unknown.
        mu: friction coefficient that replaces the model's, which files state; None where none does.
    """

    polyhedron: Polyhedron
    mass: float | None
    p_BBcm: Array
    rho: float
    source: ModelSource | None = None
    warnings: tuple[str, ...] = ()
    body: BodyIdentity | None = None
    mu: float | None = None

    def with_friction(self, mu: float) -> GraspObject:
        """Returns the object with another friction coefficient on all faces, without loading it.

        It is what loading the model with this `mu` gives, but faces that only their friction
        divides stay divided.

            slippery = box.with_friction(0.2)

        Args:
            mu: friction coefficient, above 0 and at most 100.

        Raises:
            UsageError: when it is no such number.
        """
        mu = check_number("mu", mu, _FRICTION, above=0.0, most=100.0)
        faces = tuple(replace(face, mu=mu) for face in self.polyhedron.faces)
        return replace(self, polyhedron=replace(self.polyhedron, faces=faces), mu=mu)

    def with_mass(self, mass: float | None) -> GraspObject:
        """Returns the object with another mass at the same centre, without loading it.

        Args:
            mass: mass [kg], above 0; None where it is unknown.

        Raises:
            UsageError: when it is no such number.
        """
        if mass is not None:
            mass = check_number("mass", mass, "a mass in kg, above 0", above=0.0)
        return replace(self, mass=mass)


@dataclass(frozen=True, eq=False)
class GraspPlane:
    """The plane through the three contacts, the paper's Pi_p.

    Attributes:
        nhat_B: unit normal, shape (3,).
        p_BP: a point of the plane [m], shape (3,).
    """

    nhat_B: Array
    p_BP: Array


@dataclass(frozen=True)
class Quality:
    """The paper's quality of a set of faces (equations 5 to 10).

    Attributes:
        scale: what distances and areas are divided by: "paper", their maxima over all valid sets
            of the object; "object", rho and its square.
        Q: product of the five factors, from 0 to 1.
        q: the factors q_1 to q_5, each from 0 to 1.
    """

    scale: Literal["paper", "object"]
    Q: float
    q: tuple[float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class Grasp:
    """Three frictional point contacts on the exposed surface of an object, in body frame B.

    Attributes:
        p_BC: contact points [m], shape (3, 3), one row a contact.
        nhat_TB_B: unit normals from the fingertips into the body, shape (3, 3).
        mu: friction coefficient at each contact, shape (3,), above 0.
        kind: "three_faces", "three_parallel_faces" (held by parallel forces, one against two) or
            "two_faces".
        faces: index of each contact's face in `polyhedron.faces` of the object.
        grasp_plane: the plane through the contacts.
        quality: the paper's quality; None for contacts that its stages did not construct.
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
    """The proof of force closure of a grasp, and bounds of the loads and errors that it withstands.

    Every number can be recomputed from the grasp and the object's mass, centre of mass and rho.
    epsilon is the size of the largest wrench (force, torque about the centre of mass / rho) that
    the contacts withstand in every direction with normal forces of total 1 (Ferrari and Canny). The
    tolerances allow one kind of error at a time, at all three contacts at once.

    Attributes:
        internal_force: x_12, x_13, x_23 [1/m], shape (3,), the proof: the forces
            f_1 = x_12 (p_2 - p_1) + x_13 (p_3 - p_1), and likewise at the other contacts, balance
            each other strictly inside the friction cones. Their normal parts have total 1.
        margin: how far inside the cones those forces are, in (0, 1]: the least over contacts of
            3 (n.f - |tangential f| / mu), 1 for three equal normal forces.
        mu_min: friction that is proved to be enough: all coefficients may be scaled down by one
            factor until the greatest is this; 0 if hardly any friction is needed.
        mu_min_internal_force: the proof at friction `mu_min` [1/m], shape (3,).
        epsilon_lower: lower bound of epsilon.
        epsilon_upper: upper bound of epsilon.
        placement_tolerance: contacts may move along their faces by anything less than this [m].
        tilt_tolerance: normals may tilt by anything less than this [rad].
        friction_tolerance: friction coefficients may drop by anything less than this.
        squeeze_force: total normal force that holds the weight in every orientation [N]; None if
            the mass is unknown.
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


@dataclass(frozen=True, eq=False)
class RegionCertificate:
    """Proof that a grasp stays force closure under bounded errors, all of them at once.

    Wherever each contact is on its pieces of the surface, by whatever angle its normal differs and
    however much less its friction is, within these bounds, `internal_force` is strictly inside
    every friction cone.

    Attributes:
        placement_error: how far each contact may be off in its tangent plane [m], shape (3,).
        tilt_error: angle by which each normal may differ from the surface's [rad].
        friction_error: share by which each friction coefficient may be less.
        com_error: how far the centre of mass may be off [m]; counts for the bounds below.
        internal_force: x_12, x_13, x_23 [1/m], shape (3,).
        pieces: for each contact, convex pieces that cover the surface that it may touch.
        epsilon_lower: lower bound of the least epsilon under these errors; None where none is
            known.
        epsilon_upper: upper bound of it, likewise.
        squeeze_force: total normal force that holds the weight in every orientation under these
            errors [N]; None where the mass or a bound is not known.
    """

    placement_error: Array
    tilt_error: float
    friction_error: float
    com_error: float
    internal_force: Array
    pieces: tuple[tuple[SurfacePiece, ...], ...]
    epsilon_lower: float | None = None
    epsilon_upper: float | None = None
    squeeze_force: float | None = None

    @property
    def least_placement_error(self) -> float:
        """How far all contacts may be off at once [m]."""
        return float(self.placement_error.min())


@dataclass(frozen=True)
class PlantVerdict:
    """The result of one check of a grasp in a plant.

    Attributes:
        name: "exact", the internal force of the certificate in exact arithmetic; "convex", the
            best internal force that a solver finds; "geometry", contacts and fingertips by
            SceneGraph's signed distance; "statics", the weight along each axis of B; "simulation",
            the same and disturbances through time; "misses", simulations with errors that are drawn
            within those of the region certificate; or "hand", a lift with the whole hand.
        verdict: UNDECIDED if the check could not be run.
        margin: distance from failing, negative if the check fails; None if it was not run.
        unit: unit of the margin: "1", "m" or "N".
        reason: why the check fails or was not run, or what it was run on; may be empty.
    """

    name: str
    verdict: Verdict
    margin: float | None
    unit: str
    reason: str = ""


@dataclass(frozen=True, eq=False)
class HeldWeight:
    """The contact forces that hold the object's weight along one axis of B in a plant.

    Attributes:
        weight_B: weight [N], shape (3,).
        residual: norm of the wrench that the planned forces leave unbalanced, torques divided by
            rho, over the weight.
        p_BC: points at which Drake's contact wrenches act [m], shape (3, 3); shape (0, 3) if its
            `StaticEquilibriumProblem` failed.
        f_Bc_B: forces of those contact wrenches on B [N], same shape.
    """

    weight_B: Array
    residual: float
    p_BC: Array
    f_Bc_B: Array


@dataclass(frozen=True, eq=False)
class PlantRecord:
    """The verdicts on a grasp in a plant, as a grasp file states them.

    Attributes:
        verdicts: one for each check, in the order exact, convex, geometry, statics, simulation,
            misses, hand; misses only if they were asked for and the grasp has a region certificate,
            hand only if the file says how a hand holds it.
        settings: parameters of the checks by name, in SI units.
        equilibria: how the weight along +x, +y, +z, -x, -y, -z of B is held; empty if it was not
            computed.
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
        """FAILS if any verdict is, HOLDS if there are verdicts and all are, else UNDECIDED."""
        found = {verdict.verdict for verdict in self.verdicts}
        if Verdict.FAILS in found:
            return Verdict.FAILS
        return Verdict.HOLDS if found == {Verdict.HOLDS} else Verdict.UNDECIDED


@dataclass(frozen=True, eq=False)
class CertifiedGrasp:
    """A force-closure grasp with its proof.

        best = plan_grasps(box).grasps[0]
        print(best.grasp.p_BC, best.certificate.epsilon_lower, best.certificate.squeeze_force)

    Attributes:
        grasp: the three contacts.
        certificate: the proof, and bounds of what the grasp withstands.
        tip_radius: radius of spherical fingertips that fit at the contacts [m], 0 for points; None
            if that was not checked.
        plant: verdicts of `rank_in_plant`; None if the grasp was not checked in a plant.
        region: the errors that the grasp bears, with their proof; None if none is proved.
    """

    grasp: Grasp
    certificate: Certificate
    tip_radius: float | None = None
    plant: PlantRecord | None = None
    region: RegionCertificate | None = None


class CarriesProof(Protocol):
    """A proof of force closure: a `Certificate`, or what a grasp file states."""

    @property
    def internal_force(self) -> Array:
        """The internal force x_12, x_13, x_23 [1/m], shape (3,)."""


class CarriesGrasp(Protocol):
    """A grasp with its certificate: a `CertifiedGrasp`, or a grasp of a file."""

    @property
    def grasp(self) -> Grasp:
        """The three contacts."""

    @property
    def certificate(self) -> CarriesProof:
        """The proof of its force closure."""

    @property
    def tip_radius(self) -> float | None:
        """Radius of the fingertips for which it was planned [m]; None if it is unknown."""

    @property
    def region(self) -> RegionCertificate | None:
        """The errors that it is certified to bear; None if there are none."""


AnyGrasp = Grasp | CarriesGrasp
"""A grasp, alone or with its certificate."""
_BEYOND_MEASURE = 1e9
"""Our choice: greatest coordinate of a grasp [m]; larger ones overflow in the proof."""
_UNIT = 1e-6
"""Our choice: error allowed in the length of a unit vector; the proof allows less."""


def grasp_of(grasp: AnyGrasp) -> Grasp:
    """Returns the three contacts of a grasp, checked.

    Args:
        grasp: a `Grasp`, or a grasp with its certificate.

    Raises:
        UsageError: when it is no grasp, an array has the wrong shape, a number is not finite or
            a normal is no unit vector.
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
