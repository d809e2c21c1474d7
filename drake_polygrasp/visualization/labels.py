"""Makes face numbers as flat shapes, because Meshcat draws no text.

Digits are thickened polylines on a grid of 4 x 6.
"""

from __future__ import annotations

import numpy as np
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Face

_STROKES: dict[str, list[tuple[float, float]]] = {
    "0": [(1, 0), (3, 0), (4, 1), (4, 5), (3, 6), (1, 6), (0, 5), (0, 1), (1, 0)],
    "1": [(1, 5), (2, 6), (2, 0)],
    "2": [(0, 5), (1, 6), (3, 6), (4, 5), (4, 4), (0, 0), (4, 0)],
    "3": [(0, 6), (4, 6), (2, 3.5), (3, 3.5), (4, 2.5), (4, 1), (3, 0), (1, 0), (0, 1)],
    "4": [(3, 0), (3, 6), (0, 2), (4, 2)],
    "5": [(4, 6), (0, 6), (0, 3.5), (3, 3.5), (4, 2.5), (4, 1), (3, 0), (0, 0)],
    "6": [(3, 6), (1, 6), (0, 5), (0, 1), (1, 0), (3, 0), (4, 1), (4, 2.5), (3, 3.5), (0, 3.5)],
    "7": [(0, 6), (4, 6), (1.5, 0)],
    "8": [(0, 5), (1, 6), (3, 6), (4, 5), (0, 2), (0, 1), (1, 0), (3, 0), (4, 1), (4, 2), (0, 5)],
    "9": [(1, 0), (3, 0), (4, 1), (4, 5), (3, 6), (1, 6), (0, 5), (0, 3.5), (1, 2.5), (4, 2.5)],
}
_PITCH = 5.8
_THICKNESS = 0.9


def number_shape(number: int) -> shapely.MultiPolygon:
    """Returns a number as a shape, upright about the origin, with digits of height 1.

    A number that reads as another upside down, like 6, is underlined as on dice.

    Args:
        number: whole number, 0 or more.
    """
    text = str(number)
    strokes = [np.add(_STROKES[c], (_PITCH * i, 0)) for i, c in enumerate(text)]
    width = _PITCH * len(text) - 1.8
    if set(text) <= set("0689") and set(text) & set("69"):
        strokes.append(np.array([(0, -1.8), (width, -1.8)]))
    lines = shapely.MultiLineString([stroke - (width / 2, 3) for stroke in strokes])
    shape = shapely.buffer(lines, _THICKNESS / 2, quad_segs=3)
    return shapely.transform(shape, lambda xy: xy / 6)


def label_F(face: Face, number: int, largest: float, keep_clear_B: Array) -> shapely.MultiPolygon:
    """Places the number of a face on it, upright as seen from outside.

    Upright is towards Bz, or towards By on faces nearly orthogonal to Bz. The number stands at the
    face's centroid if there is room, else at the centre of its largest disc.

    Args:
        face: the face.
        number: its number.
        largest: greatest height of the digits [m]; they are smaller if the face has less room.
        keep_clear_B: points in B that the number avoids if digits of full height fit elsewhere [m],
            shape (K, 3).

    Returns:
        The shape, in the coordinates along Fx and Fy [m].
    """
    shape = number_shape(number)
    reach = np.linalg.norm(shapely.get_coordinates(shape), axis=1).max() / 0.8
    xy = ((keep_clear_B - face.p_BF) @ face.R_BF)[:, :2]
    clear = face.polygon_F - shapely.buffer(shapely.MultiPoint(xy), largest)
    center, radius = _room(clear)
    if radius < largest * reach:
        center, radius = _room(face.polygon_F)
    size = min(largest, radius / reach)
    upward = np.eye(3)[1 if abs(face.R_BF[2, 2]) > 0.9 else 2]
    up = face.R_BF[:, :2].T @ upward
    up /= np.linalg.norm(up)
    right = np.array([up[1], -up[0]])
    return shapely.transform(shape, lambda v: center + size * v @ np.array([right, up]))


def _room(shape: shapely.Geometry) -> tuple[Array, float]:
    """Finds the centre of a disc within a shape, and its radius [m]."""
    if shapely.is_empty(shape):
        return np.zeros(2), 0.0
    circle = shapely.maximum_inscribed_circle(shape)  # a segment, from centre to border
    radius = shapely.length(circle)
    at_centroid = shapely.distance(shape.centroid, shape.boundary)
    if shape.contains(shape.centroid) and at_centroid > 0.7 * radius:
        return shapely.get_coordinates(shape.centroid)[0], at_centroid
    return shapely.get_coordinates(circle)[0], radius
