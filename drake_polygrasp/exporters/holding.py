"""How a hand holds the grasps of a file, for formats that are about hands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.stated_grasp import GraspFile, StatedGrasp
from drake_polygrasp.hand_grasp import HandPlacement


@dataclass(frozen=True, eq=False)
class GraspInHand:
    """A grasp with the hand that holds it.

    Attributes:
        name: "grasp_R" with the grasp's rank R in the file, from 1.
        stated: the grasp.
        hand: where the hand is, with its joints and torques.
    """

    name: str
    stated: StatedGrasp
    hand: HandPlacement

    @property
    def quality(self) -> float:
        """The margin of the proof of force closure, from 0 to 1."""
        margin = self.stated.certificate.margin
        return 0.0 if margin is None else min(margin, 1.0)


def held_grasps(file: GraspFile) -> list[GraspInHand]:
    """Returns the grasps of a file that a hand holds, best first.

    Args:
        file: the grasp file.

    Returns:
        At least one; grasps of contacts alone are left out.

    Raises:
        GraspFileError: when the file states no hand.
    """
    held = [
        GraspInHand(f"grasp_{rank}", stated, stated.hand)
        for rank, stated in enumerate(file.grasps, start=1)
        if stated.hand is not None
    ]
    if not held:
        raise GraspFileError(
            f"{file.path}: states no posture of a hand, which this format is about; plan with "
            "--hand, or export contacts or frames"
        )
    return held


def independent(hand: HandPlacement, q: Mapping[str, float]) -> dict[str, float]:
    """Returns positions of the joints that are not coupled to others, as torques are stated of.

    Args:
        hand: how the hand holds the object.
        q: positions of its joints by name [rad or m].
    """
    return {name: float(q[name]) for name in hand.torque.torque if name in q}
