"""What a verification finds, as values: a line for each claim, grasp by grasp."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from drake_polygrasp.grasp import PlantRecord, Verdict

if TYPE_CHECKING:
    from drake_polygrasp.plant.certify_in_plant import PlantReport


class Status(StrEnum):
    """What was done about one line of a grasp."""

    PROVED = "proved"
    RECOMPUTED = "recomputed"
    NOT_CHECKED = "not checked"
    FAILED = "FAILED"


@dataclass(frozen=True)
class CheckResult:
    """A status and, where there is something to say, a sentence."""

    status: Status
    reason: str = ""


@dataclass(frozen=True)
class GraspReport:
    """The three lines of one grasp, and what a plant says of it.

    Attributes:
        forces: verdict of the exact certificate.
        surface: verdict on whether contacts are on the exposed surface.
        numbers: verdict on the stated numbers.
        plant: none where it was not asked for, or the lines leave nothing to ask.
        stated_plant: what the file states of a plant: not proved again unless it was asked for.
    """

    forces: CheckResult
    surface: CheckResult
    numbers: CheckResult
    plant: PlantReport | None = None
    stated_plant: PlantRecord | None = None

    @property
    def lines(self) -> dict[str, CheckResult]:
        """By name, as they are printed."""
        return {"FORCES": self.forces, "SURFACE": self.surface, "NUMBERS": self.numbers}


@dataclass(frozen=True)
class VerificationReport:
    """What verification found, grasps in the file's order.

    Attributes:
        path: the grasp file.
        grasps: one report each, in the order of the file.
        model_checked: whether the model was there to check SURFACE against.
        warnings: what loading the model says, and what the file does not state.
    """

    path: Path
    grasps: tuple[GraspReport, ...]
    model_checked: bool
    warnings: tuple[str, ...] = ()

    @property
    def holds(self) -> bool | None:
        """True if there are grasps and everything about them was checked and holds.

        False if there are none or something does not hold. None if nothing fails, but the model was
        not there to check SURFACE against, or a plant leaves a grasp undecided.
        """
        lines = [line for grasp in self.grasps for line in grasp.lines.values()]
        plants = {grasp.plant.verdict for grasp in self.grasps if grasp.plant is not None}
        failed = any(line.status is Status.FAILED for line in lines)
        if not lines or failed or Verdict.FAILS in plants:
            return False
        return True if self.model_checked and Verdict.UNDECIDED not in plants else None

    @property
    def plant_checked(self) -> bool:
        """Whether a plant was asked about every grasp."""
        return all(grasp.plant is not None for grasp in self.grasps)

    @property
    def plant_decided(self) -> bool:
        """Whether a plant that was asked about a grasp says that it holds or that it fails."""
        asked = [grasp.plant for grasp in self.grasps if grasp.plant is not None]
        return all(plant.verdict is not Verdict.UNDECIDED for plant in asked)
