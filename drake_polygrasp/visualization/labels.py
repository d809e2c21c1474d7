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
_FACES_EYE = 0.05
"""Our choice: least cosine between a face's outward normal and the way to the eye that sees it."""


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


def label_F(
    face: Face, number: int, largest: float, keep_clear_B: Array, eye_B: Array
) -> shapely.MultiPolygon:
    """Places the number of a face on it, upright as seen from outside.

    On faces that the eye sees, upright is up in its picture; on others it is towards Bz, or away
    from the eye on faces nearly orthogonal to Bz. The number stands at the face's centroid if there
    is room, else at the centre of its largest disc.

    Args:
        face: the face.
        number: its number.
        largest: greatest height of the digits [m]; they are smaller if the face has less room.
        keep_clear_B: points in B that the number does not hide from the eye, if digits of full
            height fit elsewhere [m], shape (K, 3).
        eye_B: unit vector in B to the eye, whose picture has Bz up, shape (3,); not along Bz.

    Returns:
        The shape, in the coordinates along Fx and Fy [m].
    """
    shape = number_shape(number)
    reach = np.linalg.norm(shapely.get_coordinates(shape), axis=1).max() / 0.8
    seen_F = (keep_clear_B - face.p_BF) @ face.R_BF
    eye_F = face.R_BF.T @ eye_B
    # Points are shifted along the line of sight to where the eye sees them on the face.
    sight = eye_F[:2] / eye_F[2] if eye_F[2] > _FACES_EYE else np.zeros(2)
    xy = seen_F[:, :2] - seen_F[:, 2:] * sight
    clear = face.polygon_F - shapely.buffer(shapely.MultiPoint(xy), largest)
    center, radius = _room(clear)
    if radius < largest * reach:
        center, radius = _room(face.polygon_F)
    size = min(largest, radius / reach)
    up = _up_F(face, eye_B)
    right = np.array([up[1], -up[0]])
    return shapely.transform(shape, lambda v: center + size * v @ np.array([right, up]))


def _up_F(face: Face, eye_B: Array) -> Array:
    """Returns where up is for a number on the face, as a unit vector along Fx and Fy, (2,)."""
    nhat_B = face.R_BF[:, 2]
    if nhat_B @ eye_B > _FACES_EYE:
        right_B = np.cross([0.0, 0.0, 1.0], eye_B)
        up_B = np.cross(nhat_B, right_B)  # orthogonal to right: straight up in the picture
    elif abs(nhat_B[2]) > 0.9:
        up_B = -eye_B
    else:
        up_B = np.array([0.0, 0.0, 1.0])
    up: Array = face.R_BF[:, :2].T @ up_B
    return up / np.linalg.norm(up)


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
