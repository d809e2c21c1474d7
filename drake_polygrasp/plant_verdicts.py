"""What a MultibodyPlant says of a grasp, as values: made by `certify_in_plant`, kept by files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import Verdict


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
