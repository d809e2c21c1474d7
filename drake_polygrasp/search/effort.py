"""Beyond the paper: how long grasps are sought before the best are proved."""

from __future__ import annotations

from dataclasses import dataclass

MORE_SETS = 32_000
"""Ours: where fewer grasps are found than wanted, the paper's stages see so many sets at most,
which takes about a second."""
ANY_SETS = 300_000
"""Ours: and where none is found, so many: some seconds; about 120 regions have as many."""
CHUNKS = (4_000, 32_000, 128_000)
"""Ours: so many sets are seen first, those of greatest bound, then so many, then so many. To order
still more of them takes as long as the paper's stages do."""


@dataclass(frozen=True)
class Effort:
    """Sizes of search and improvement, ours.

    Attributes:
        points: sample points on objects of few regions.
        most_points: on objects of many; of more regions the largest have one.
        strides: each pass searches every so many of the points: those before the last cost little,
            and tell it the directions that their winners resist least.
        sources: grasps whose weakest directions are taken in each pass.
        kept: triples kept in each pass at least; of many points, as many.
        rounds: of improvement: how many grasps, the best so far, move in each.
    """

    points: int
    most_points: int
    strides: tuple[int, ...]
    sources: int
    kept: int
    rounds: tuple[int, ...]

    @property
    def starts(self) -> int:
        """Triples that are improved."""
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
"""Where `FULL` finds fewer grasps than wanted."""
QUICK = Effort(
    points=70,
    most_points=120,
    strides=(1,),
    sources=12,
    kept=70,
    rounds=(4, 3, 2),
)
