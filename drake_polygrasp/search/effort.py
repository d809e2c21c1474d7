"""Beyond the paper: how much is searched before the best candidates are proved."""

from __future__ import annotations

from dataclasses import dataclass

MORE_SETS = 32_000
"""Our choice: where fewer grasps are found than wanted, the paper's stages see at most so many
sets, which takes about a second."""
ANY_SETS = 300_000
"""Our choice: the same limit where no grasp is found; so many sets, those of about 120 regions,
take some seconds."""
CHUNKS = (4_000, 32_000, 128_000)
"""Our choice: numbers of sets seen in turn, those of greatest bound first. To order more sets takes
as long as the paper's stages do."""


@dataclass(frozen=True)
class Effort:
    """Sizes of search and improvement, our choices.

    Attributes:
        points: number of sample points on objects of few regions.
        most_points: greatest number on objects of many; of more regions the largest have one each.
        strides: each pass searches every so many of the points. Early passes cost little, and find
            the directions that their best triples resist least.
        sources: number of grasps whose weakest directions are taken in each pass.
        kept: least number of triples kept in each pass; as many as points where these are more.
        rounds: number of grasps, the best so far, that move in each round of improvement.
    """

    points: int
    most_points: int
    strides: tuple[int, ...]
    sources: int
    kept: int
    rounds: tuple[int, ...]

    @property
    def starts(self) -> int:
        """Number of triples that are improved."""
        return self.rounds[0]


FULL = Effort(
    points=100,
    most_points=1300,
    strides=(4, 2, 1),
    sources=24,
    kept=150,
    rounds=(60, 30, 20, 10, 10, 5, 5, 5),
)
DENSE = Effort(
    points=400,
    most_points=2600,
    strides=(4, 2, 1),
    sources=48,
    kept=600,
    rounds=FULL.rounds,
)
"""Used where `FULL` finds fewer grasps than wanted."""
QUICK = Effort(
    points=70,
    most_points=120,
    strides=(1,),
    sources=12,
    kept=70,
    rounds=(4, 3, 2),
)
