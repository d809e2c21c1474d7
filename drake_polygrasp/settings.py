"""The options of a plan as they are asked for, and the settings that result, as files state them.

A new option is a field of `PlanOptions` and one of `PlanSettings`, an argument of `plan_grasps` and
an option of the command of the same name.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
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
from drake_polygrasp.geometry.regions import CLEARANCE_OF_INRADIUS, DEFAULT_CLEARANCE

Method = Literal["enriched", "paper"]
"""The paper as it is read here, or the paper and the search beyond it."""
Rank = Literal["epsilon", "margin", "Q"]
EffortName = Literal["full", "quick", "complete"]
Directions: TypeAlias = tuple[tuple[float, float, float], ...]
MAX_TILT_ERROR = 1.5
"""Our choice [rad]: the greatest tilt that may be asked for; no usual friction is left of it."""
ERROR_NAMES = ("placement_error", "tilt_error", "friction_error", "com_error")
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
        friction_error: share by which friction coefficients may be too high, 0 to below 1.
        com_error: by how much the centre of mass may be off, in any direction [m].

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
    placement_error: float = 0.0
    tilt_error: float = 0.0
    friction_error: float = 0.0
    com_error: float = 0.0

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
        for name, error in check_errors(**asked).items():
            self._keep(name, error)
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

    def resolve(self, L: float) -> PlanSettings:
        """Chooses what is not asked for by the size of an object.

        Args:
            L: the diameter of the object's surface [m].

        Returns:
            The settings of a plan on that object.
        """
        clearance = self.edge_clearance
        if clearance is not None:
            clearance = max(clearance, self.placement_error)
        # What __post_init__ made of all that it takes.
        directions = cast(Directions, self.avoid_directions)
        return PlanSettings(
            method=self.method,
            edge_clearance=DEFAULT_CLEARANCE * L if clearance is None else clearance,
            tip_radius=TIP_RADIUS * L if self.tip_radius is None else self.tip_radius,
            edge_clearance_share_of_inradius=CLEARANCE_OF_INRADIUS if clearance is None else None,
            placement_error=self.placement_error,
            tilt_error=self.tilt_error,
            friction_error=self.friction_error,
            com_error=self.com_error,
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
            that is less than `edge_clearance`, but at least `placement_error`; None where it is
            `edge_clearance` on all faces.
        placement_error: by how much contacts may miss along their faces [m].
        tilt_error: by how much normals may tilt [rad].
        friction_error: share by which friction coefficients may be too high.
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
