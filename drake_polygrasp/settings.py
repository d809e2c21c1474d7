"""The options of a plan as they are asked for, and the settings that result, as files state them.

A new option is a field of `PlanOptions` and one of `PlanSettings`, an argument of `plan_grasps` and
an option of the command of the same name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from operator import index
from typing import Any, Literal, TypeAlias, cast, get_args

import numpy.typing as npt

from drake_polygrasp.arguments import (
    check_choice,
    check_count,
    check_instance,
    check_items,
    check_length,
    check_number,
    refuse,
)
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.exclusion import (
    AVOID_ANGLE,
    Exclusion,
    exclusion,
    unit_direction,
)
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.geometry.regions import (
    CLEARANCE_OF_INRADIUS,
    DEFAULT_CLEARANCE,
    ERROR_OF_INRADIUS,
    PLACEMENT_ERROR,
)

Method = Literal["enriched", "paper"]
"""The paper as it is read here, or the paper and the search beyond it."""
Rank = Literal["epsilon", "margin", "Q"]
EffortName = Literal["full", "quick", "complete"]
_HALVINGS = 5
"""Our choice: how often default errors are halved before they are left out."""
Directions: TypeAlias = tuple[tuple[float, float, float], ...]
MAX_TILT_ERROR = 1.5
"""Our choice [rad]: the greatest tilt that may be asked for; no usual friction is left of it."""
ERROR_NAMES = ("placement_error", "tilt_error", "friction_error", "com_error")
NO_ERRORS: dict[str, Any] = dict.fromkeys(ERROR_NAMES, 0.0)
"""Arguments of `plan_grasps` for exact hands and models: grasps of the greatest epsilon."""
TILT_ERROR = math.radians(5.0)
"""Our choice [rad]: by how much normals of fingertips and of models typically differ."""
FRICTION_ERROR = 0.2
"""Our choice: share by which friction coefficients may typically be less."""
COM_ERROR = 0.02
"""Our choice: over the object's diameter L, how far the centre of mass is typically off."""
LEAST_FRICTION_LEFT = 1 / 3
"""Our choice: share of the friction coefficient that default errors leave to plan with."""
TIP_RADIUS = 0.02
"""Our choice: the default fingertip radius over the object's diameter L."""


@dataclass(frozen=True)
class Steps:
    """The steps beyond the paper that `method="enriched"` takes.

    Attributes:
        spread: wider triangles on parallel sets and pairs of faces.
        search: triples of sample points on any faces.
        improve: moving contacts while epsilon rises.
    """

    spread: bool = True
    search: bool = True
    improve: bool = True


@dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """What is asked of a plan: the arguments of `plan_grasps`, valid for some object.

    Equal options are equal values with equal hashes, whatever types they were given as.

    Attributes:
        method: "paper" or "enriched".
        top: how many grasps are wanted at most.
        rank: what orders grasps; None for the method's own order.
        edge_clearance: least distance of contacts from the edges of their face [m]; None for one
            by the object's size.
        tip_radius: radius of the fingertips that need room [m]; None for one by the object's size.
        avoid_directions: no contact where the outward normal points nearly along one of these;
            kept as unit vectors in B, a tuple of three floats each.
        exclude_faces: indices of faces that have no contact; kept ascending, each once.
        obstacles: what fingertips must not penetrate beside the object.
        steps: the steps of "enriched"; None for all.
        effort: how long to search.
        placement_error: by how much a contact may miss its place along its face, in any direction
            [m].
        tilt_error: by how much the true normal at a contact may tilt [rad], 0 to 1.5.
        friction_error: share by which friction coefficients may be less, 0 to below 1.
        com_error: by how much the centre of mass may be off, in any direction [m]. Each error is
            None for a default by the object: `PlanOptions.resolve` says which.

    Raises:
        UsageError: when an option is not what it may be for any object.
    """

    method: Method = "enriched"
    top: int = 10
    rank: Rank | None = None
    edge_clearance: float | None = None
    tip_radius: float | None = None
    avoid_directions: Iterable[npt.ArrayLike] = ()
    exclude_faces: Iterable[int] = ()
    obstacles: Obstacles | None = None
    steps: Steps | None = None
    effort: EffortName = "full"
    placement_error: float | None = None
    tilt_error: float | None = None
    friction_error: float | None = None
    com_error: float | None = None

    def __post_init__(self) -> None:
        check_choice("method", self.method, get_args(Method))
        self._keep("top", check_count("top", self.top))
        if self.rank is not None:
            check_choice("rank", self.rank, get_args(Rank))
        check_choice("effort", self.effort, get_args(EffortName))
        for name in ("edge_clearance", "tip_radius"):
            if (length := getattr(self, name)) is not None:
                self._keep(name, check_length(name, length))
        asked = {name: getattr(self, name) for name in ERROR_NAMES}
        given = {name: error for name, error in asked.items() if error is not None}
        checked = check_errors(**NO_ERRORS | given)
        for name in given:
            self._keep(name, checked[name])
        directions = check_items("avoid_directions", self.avoid_directions)
        self._keep("avoid_directions", tuple(unit_direction(d) for d in directions))
        indices = enumerate(check_items("exclude_faces", self.exclude_faces))
        self._keep("exclude_faces", tuple(sorted({_face_index(*item) for item in indices})))
        if self.obstacles is not None:
            source = "as obstacles_from_plant returns them"
            check_instance("obstacles", self.obstacles, Obstacles, source)
        if self.steps is not None:
            check_instance("steps", self.steps, Steps)
        if self.effort == "quick" and (self.method, self.resolved_rank, self.steps) != (
            *("enriched", "epsilon", None),
        ):
            raise UsageError(
                "effort 'quick' is for all steps of 'enriched', ranked by epsilon; leave out "
                "method, rank and steps, or effort"
            )

    def _keep(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    @property
    def default_errors(self) -> tuple[str, ...]:
        """Names of the errors that have their default above 0; the method "paper" has none."""
        if self.method == "paper":
            return ()
        return tuple(name for name in ERROR_NAMES if getattr(self, name) is None)

    @property
    def without_default_errors(self) -> PlanOptions:
        """The same options, with errors only where they are given."""
        none: dict[str, Any] = dict.fromkeys(self.default_errors, 0.0)
        return replace(self, **none)

    def resolve(self, L: float, mu: float) -> PlanSettings:
        """Chooses what is not asked for by the size of an object and its friction.

        Errors of the method "paper" are 0 unless they are given. Else those of placement and of the
        centre of mass are 0.02 L, tilt is 5 degrees and the error of friction 0.2, these two halved
        together until a third of the friction is left to plan with.

        Args:
            L: the diameter of the object's surface [m].
            mu: the greatest friction coefficient of its faces.

        Returns:
            The settings of a plan on that object.
        """
        errors: dict[str, Any] = {name: getattr(self, name) or 0.0 for name in ERROR_NAMES}
        defaults = self.default_errors
        if defaults:
            typical = PLACEMENT_ERROR * L, TILT_ERROR, FRICTION_ERROR, COM_ERROR * L
            errors |= {n: e for n, e in zip(ERROR_NAMES, typical, strict=True) if n in defaults}
            errors |= _with_friction_left(errors, mu, defaults)
        own_share = "placement_error" in defaults
        clearance = self.edge_clearance
        if clearance is not None and not own_share:
            clearance = max(clearance, errors["placement_error"])
        # What __post_init__ made of all that it takes.
        directions = cast(Directions, self.avoid_directions)
        return PlanSettings(
            method=self.method,
            edge_clearance=DEFAULT_CLEARANCE * L if clearance is None else clearance,
            tip_radius=TIP_RADIUS * L if self.tip_radius is None else self.tip_radius,
            edge_clearance_share_of_inradius=CLEARANCE_OF_INRADIUS if clearance is None else None,
            **errors,
            placement_error_share_of_inradius=ERROR_OF_INRADIUS if own_share else None,
            avoid_directions=directions,
            avoid_angle=AVOID_ANGLE if directions else None,
            exclude_faces=tuple(self.exclude_faces),
            obstacles=None if self.obstacles is None else self.obstacles.names,
            rank=self.resolved_rank,
            top=self.top,
            effort=self.effort,
        )

    @property
    def resolved_rank(self) -> Rank:
        """What orders grasps: "epsilon" unless asked otherwise, "Q" for the paper."""
        return self.rank or ("Q" if self.method == "paper" else "epsilon")


@dataclass(frozen=True, kw_only=True)
class PlanSettings:
    """What repeats a plan: all that was asked for or, where it was not, chosen.

    The `plan` block of a grasp file states each field, in this order, that is not its default.

    Attributes:
        method: "paper" or "enriched".
        edge_clearance: least distance of contacts from the edges of their face [m].
        tip_radius: radius of the fingertips that have room [m].
        edge_clearance_share_of_inradius: the clearance of a face is this times its inradius where
            that is less than `edge_clearance`; None where it is `edge_clearance` on all faces. A
            contact keeps its placement error from edges too.
        placement_error: by how much contacts may miss along their faces [m].
        placement_error_share_of_inradius: on narrow faces, which are used where others have too few
            grasps, contacts may miss by this times the inradius; None where it is `placement_error`
            on all faces.
        tilt_error: by how much normals may tilt [rad].
        friction_error: share by which friction coefficients may be less.
        com_error: by how much the centre of mass may be off [m].
        avoid_directions: unit vectors in B; no contact where the outward normal is near one.
        avoid_angle: how near [rad]; None without `avoid_directions`.
        exclude_faces: indices of faces without contacts, ascending.
        obstacles: names of the bodies around that fingertips do not penetrate; None where no
            obstacles were given.
        rank: what orders grasps.
        top: how many grasps were wanted at most.
        effort: how long to search.
        top_in_plant: how many grasps had to hold in a plant; None where none was asked.
        mu: friction that replaces the model's; None where it does not.
    """

    method: Method
    edge_clearance: float
    tip_radius: float
    edge_clearance_share_of_inradius: float | None = None
    placement_error: float = 0.0
    placement_error_share_of_inradius: float | None = None
    tilt_error: float = 0.0
    friction_error: float = 0.0
    com_error: float = 0.0
    avoid_directions: Directions = ()
    avoid_angle: float | None = None
    exclude_faces: tuple[int, ...] = ()
    obstacles: tuple[str, ...] | None = None
    rank: Rank
    top: int
    effort: EffortName
    top_in_plant: int | None = None
    mu: float | None = None

    @property
    def stated(self) -> dict[str, Any]:
        """The plan block of a grasp file: values by their keys, in the order of the file."""
        values = ((field, getattr(self, field.name)) for field in fields(self))
        return {field.name: value for field, value in values if value != field.default}

    @property
    def has_errors(self) -> bool:
        """Whether grasps are to bear any errors."""
        return any(getattr(self, name) > 0 for name in ERROR_NAMES)

    @property
    def fixed_clearance(self) -> float | None:
        """The clearance of all faces [m]; None where it depends on the inradius of each."""
        return self.edge_clearance if self.edge_clearance_share_of_inradius is None else None

    @property
    def exclusion(self) -> Exclusion:
        """Where no contact may be."""
        return exclusion(self.avoid_directions, self.exclude_faces, self.avoid_angle)


def _with_friction_left(
    errors: dict[str, float], mu: float, defaults: tuple[str, ...]
) -> dict[str, float]:
    """Returns default tilt and friction errors that leave `LEAST_FRICTION_LEFT` of the friction.

    Where errors that are given leave less, the defaults become 0.
    """
    narrowed = {"tilt_error", "friction_error"} & {*defaults}
    for halvings in range(_HALVINGS):
        share: dict[str, float] = {name: errors[name] / 2**halvings for name in narrowed}
        both = errors | share
        angle = math.atan((1 - both["friction_error"]) * mu) - both["tilt_error"]
        if math.tan(angle) >= LEAST_FRICTION_LEFT * mu:
            return share
    return dict.fromkeys(narrowed, 0.0)


def check_errors(
    *, placement_error: object, tilt_error: object, friction_error: object, com_error: object
) -> dict[str, float]:
    """Checks the errors that a grasp is to bear.

    Args:
        placement_error: argument that must be a length [m].
        tilt_error: argument that must be an angle [rad], from 0 to `MAX_TILT_ERROR`.
        friction_error: argument that must be a share, from 0 to below 1.
        com_error: argument that must be a length [m].

    Returns:
        The four errors as floats, by their names.

    Raises:
        UsageError: when one is not what it must be.
    """
    angle = f"an angle in radians, from 0 to {MAX_TILT_ERROR}"
    share = "a share of the friction coefficient, from 0 to below 1"
    friction = check_number("friction_error", friction_error, share, least=0.0)
    if friction >= 1:
        raise refuse("friction_error", friction_error, share)
    return {
        "placement_error": check_length("placement_error", placement_error),
        "tilt_error": check_number("tilt_error", tilt_error, angle, least=0.0, most=MAX_TILT_ERROR),
        "friction_error": friction,
        "com_error": check_length("com_error", com_error),
    }


def _face_index(position: int, face: int) -> int:
    try:
        return index(face)
    except TypeError:
        raise refuse(f"exclude_faces[{position}]", face, "the index of a face") from None
