"""Defines the colours that 3-D scenes and figures share, those of Okabe and Ito (2008).

Colour-blind readers can tell them apart, and in grey print the three contacts differ in lightness.
"""

from __future__ import annotations

CONTACTS = ("#0072B2", "#E69F00", "#009E73")
"""Colours of contacts 1, 2 and 3 and of their faces: blue, orange, green."""
HATCHES = ("////", "\\\\\\\\", "....")
"""Hatching of faces 1, 2 and 3, for print in grey."""
PLANE = "#CC79A7"
"""Colour of the grasp plane Pi_p and of the contact triangle: reddish purple."""
OBJECT = "#9AA5B1"
COVER = "#D9D2C5"
"""Colour of links on the object's joints."""
INK = "#222222"
"""Colour of edges, face numbers and the centre of mass."""


def rgb(colour: str) -> tuple[float, float, float]:
    """Returns the red, green and blue of a colour, each from 0 to 1.

    Args:
        colour: the colour as "#RRGGBB".
    """
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
