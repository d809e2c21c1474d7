"""Colours that 3-D scenes and figures share: those of Okabe and Ito (2008).

Colour-blind readers tell them apart, and in grey print the three contacts differ in lightness.
"""

from __future__ import annotations

CONTACTS = ("#0072B2", "#E69F00", "#009E73")
"""Contacts, and the faces they are on, in the grasp's order: blue, orange, green."""
HATCHES = ("////", "\\\\\\\\", "....")
"""Of faces 1, 2 and 3, for print in grey."""
PLANE = "#CC79A7"
"""The grasp plane Pi_p and the triangle in it: reddish purple."""
OBJECT = "#9AA5B1"
COVER = "#D9D2C5"
"""Links on the object's joints."""
INK = "#222222"
"""Edges, face numbers and the centre of mass."""


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue of "#RRGGBB", each in [0, 1]."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
