"""Beyond the paper: variants of its choices, tried for every set by `method="enriched"`."""

from __future__ import annotations

SPREADS = (0.5, 0.9)
"""Places of P_2 and P_3 on their halves of the segments, 1 at the far end.

The text's 0.5 defeats its own aim of a large triangle; on most objects 0.9 holds better.
"""
