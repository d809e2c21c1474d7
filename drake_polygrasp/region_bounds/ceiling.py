"""Upper bounds of what facets may prove: what forces that serve all tilts withstand at most."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

from drake_polygrasp.arrays import Array
from drake_polygrasp.region_bounds.best_forces import BestForces
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.side_by_side import Search, result_of
from drake_polygrasp.region_bounds.swept_generators import SweptGenerators
from drake_polygrasp.region_bounds.worst_placement import Placeable, WorstPlacement

Compare: TypeAlias = Callable[[float, float], None]
"""Compares a lower bound, and what it may be at most, with those of other searches."""


class Ceiling:
    """What facets may prove at most, by the twists that were tried.

    Attributes:
        bound: the upper bound; infinite before the first twists.
    """

    def __init__(
        self,
        generators: SweptGenerators,
        served: Placeable,
        norm: LoadNorm,
        compare: Compare | None,
    ) -> None:
        """Knows no twists yet.

        Args:
            generators: of which the facets are.
            served: where contacts may be, with the friction of forces that serve all tilts.
            norm: what twists are measured in.
            compare: told what is proved and the bound whenever they may have changed.
        """
        self._generators, self._norm, self._compare = generators, norm, compare
        self._worst, self.bound = WorstPlacement(served, 0.0, norm), math.inf

    @property
    def w(self) -> Array:
        """The twist along which facets prove least, shape (6,)."""
        return self._worst.w

    def lowered(self, w: Array, least: float) -> Search[float]:
        """Finds the least bound with more twists.

        Args:
            w: twists, shape (K, 6); there may be none.
            least: what the facets prove from which they are.

        Returns:
            The bound.
        """
        before = self._worst.bound
        if not len(w):
            return self.bound
        if (yield from self._worst.lowered(w)) < before:
            _, _, most = yield from result_of(BestForces(self._generators, self.w[None]))
            self.bound = min(self.bound, float(most[0] / self._norm.of(self.w[None])[0]))
        if self._compare is not None:
            self._compare(least if self._generators.ranges_fully else 0.0, self.bound)
        return self.bound
