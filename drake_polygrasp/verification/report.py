"""The results of a verification as values: three checks for each grasp, four with a hand."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from drake_polygrasp.grasp import PlantRecord, Verdict

if TYPE_CHECKING:
    from drake_polygrasp.plant.certify_in_plant import PlantReport


class Status(StrEnum):
    """The outcome of one check of a grasp.

    PROVED: in exact arithmetic. RECOMPUTED: compared with values computed here. NOT_CHECKED: the
    model was not there, or an earlier check failed. FAILED: a claim is violated.
    """

    PROVED = "proved"
    RECOMPUTED = "recomputed"
    NOT_CHECKED = "not checked"
    FAILED = "FAILED"


@dataclass(frozen=True)
class CheckResult:
    """The result of one check of a grasp.

    Attributes:
        status: the outcome.
        reason: why it failed or was not checked, or what was left out; may be empty.
    """

    status: Status
    reason: str = ""


@dataclass(frozen=True)
class GraspVerification:
    """The checks of one grasp, and its verdicts in a plant.

    Attributes:
        forces: whether the internal force proves force closure.
        surface: whether contacts, normals and friction are those of the model's exposed surface.
        numbers: whether the certificate's numbers are at most as favourable as recomputed ones.
        plant: verdicts of a plant; None if it was not asked for or a check failed.
        stated_plant: verdicts of a plant that the file states, which are not checked.
        hand: whether a hand holds the grasp as stated; None if the file states no hand for it.
        bears: misses of all contacts along their faces that the grasp is stated to bear, together
            with the other errors of its `region` [m]; None if it states none. The checks say
            whether that holds.
    """

    forces: CheckResult
    surface: CheckResult
    numbers: CheckResult
    plant: PlantReport | None = None
    stated_plant: PlantRecord | None = None
    hand: CheckResult | None = None
    bears: float | None = None

    @property
    def lines(self) -> dict[str, CheckResult]:
        """The checks by their printed names: FORCES, SURFACE, NUMBERS, and HAND if there is one."""
        lines = {"FORCES": self.forces, "SURFACE": self.surface, "NUMBERS": self.numbers}
        return lines if self.hand is None else lines | {"HAND": self.hand}


@dataclass(frozen=True)
class VerificationReport:
    """The results of verifying a grasp file.

        report = verify_file("box.grasp.yaml")
        print(report.holds, [grasp.lines for grasp in report.grasps])

    Attributes:
        path: the grasp file.
        grasps: one report for each grasp, in the file's order.
        model_checked: whether the model was found, so that surfaces could be checked.
        warnings: warnings of loading the model, and what was not checked, one sentence each.
    """

    path: Path
    grasps: tuple[GraspVerification, ...]
    model_checked: bool
    warnings: tuple[str, ...] = ()

    @property
    def holds(self) -> bool | None:
        """True if there are grasps and all checks of all of them hold.

        False if there are no grasps or a check fails. None if no check fails, but the model of the
        object or of the hand was not found, or a plant leaves a grasp undecided.
        """
        lines = [line for grasp in self.grasps for line in grasp.lines.values()]
        plants = {grasp.plant.verdict for grasp in self.grasps if grasp.plant is not None}
        failed = any(line.status is Status.FAILED for line in lines)
        if not lines or failed or Verdict.FAILS in plants:
            return False
        if not self.hand_checked or Verdict.UNDECIDED in plants:
            return None
        return True if self.model_checked else None

    @property
    def hand_checked(self) -> bool:
        """Whether the model of the hand was found, if the file states one."""
        hands = [grasp.hand for grasp in self.grasps if grasp.hand is not None]
        return all(line.status is not Status.NOT_CHECKED for line in hands)

    @property
    def plant_checked(self) -> bool:
        """Whether every grasp was checked in a plant."""
        return all(grasp.plant is not None for grasp in self.grasps)

    @property
    def plant_decided(self) -> bool:
        """Whether each grasp that was checked in a plant holds or fails there."""
        asked = [grasp.plant for grasp in self.grasps if grasp.plant is not None]
        return all(plant.verdict is not Verdict.UNDECIDED for plant in asked)
