"""The errors that the box of `grasp_files` bears, by hand.

With x = (2.5, 2.5, -1.25) the force at contact 2 is 0.25 along its normal, and where contacts are
off by s along both edges of their faces, in the worst directions, it is off by 5 sqrt(2) s: it is
2.5 p_1 - 1.25 p_2 - 1.25 p_3. And f_1 = 2.5 p_2 + 2.5 p_3 - 5 p_1, 0.5 along its normal, is off
by twice that. With a friction of 0.3, 20 percent less and tilted by 0.0873 rad, 0.149 are left, so
that s may be 0.25 * 0.149 / (5 sqrt(2)) = 0.00527 m.
"""

from __future__ import annotations

from drake_polygrasp.certification.exact import narrowed_friction
from tests.support.grasp_files import Document

TILT, FRICTION = 0.0873, 0.2
GREATEST = 0.25 * float(narrowed_friction(0.3, TILT, FRICTION)) / (5 * 2**0.5)
"""s [m]."""


def box_region(s: float = 0.002, radius: float | None = None) -> Document:
    """The region of squares of half a side s [m], as a file states it.

    Discs are a thousandth smaller than the squares, for the rounding of corners.
    """
    contacts = [(0.05, 0.0), (-0.05, 0.02), (-0.05, -0.02)]
    return {
        "placement_error": [0.999 * s if radius is None else radius] * 3,
        "tilt_error": TILT,
        "friction_error": FRICTION,
        "com_error": 0.0,
        "internal_force": [2.5, 2.5, -1.25],
        "p_BV": [
            [[x, y + s, s], [x, y - s, s], [x, y - s, -s], [x, y + s, -s]] for x, y in contacts
        ],
    }


def in_pieces(region: Document) -> Document:
    """The same region with a normal for each polygon."""
    normals = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    pieces = [
        [{"p_BV": corners, "nhat_TB_B": n}]
        for corners, n in zip(region["p_BV"], normals, strict=True)
    ]
    # A spread needs the pieces; without one, and with the contacts' normals, they are polygons.
    pieces[0][0]["tan_spread"] = 1e-6
    return {key: value for key, value in region.items() if key != "p_BV"} | {"pieces": pieces}
