"""Force closure proved by three numbers, checked in exact arithmetic.

A frictional grasp is force closure iff its grasp map has full rank and some internal force lies
strictly inside every friction cone (Murray, Li & Sastry, 1994, ch. 5). With three contacts that
are not collinear every internal force pushes along the sides of the contact triangle,

    f_1 = x_12 (p_2 - p_1) + x_13 (p_3 - p_1)
    f_2 = x_12 (p_1 - p_2) + x_23 (p_3 - p_2)
    f_3 = x_13 (p_1 - p_3) + x_23 (p_2 - p_3)

and balances whatever x is. So x is the proof, and what is left to check are signs of polynomials
in the doubles given. Each is homogeneous in p, in n and in x: all are scaled to integers, and no
step rounds. There is no solver here and nothing but the standard library, so that one may read
this file instead of trusting it, or run it alone: `polygrasp plan MODEL --json | python exact.py`.

One x can also prove every placement of three contacts that are known only to lie in three regions,
with normals and friction known only within bounds: `check_region` says how.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

Vectors = Sequence[Sequence[float]]
Piece = tuple[Vectors, Sequence[float], float]
"""Corners of a convex polygon or polytope [m], the inward unit normal of the surface in it, and the
tangent of the greatest angle between that normal and the true one anywhere in it."""

UNIT_TOLERANCE = Fraction(1, 10**9)
"""Our choice: how far n . n may be from 1."""
MIN_AREA_RATIO = Fraction(1, 10**3)
"""Our choice: twice the area over the square of the longest side, at least. Collinear points,
once turned in floating point, have a tiny area and not none."""
INTERIOR = 1 + Fraction(1, 10**9)
"""Our choice: the part by which (n . f)^2 must exceed its value on the cone."""
FLATNESS = Fraction(1, 10**6)
"""Our choice: over a disc's radius, how far rounded corners may be from its plane."""
MAX_TILT = 1.5
"""[rad], our choice: a finger that slants more touches nothing with its tip."""
_FRICTION_BITS = 64
_LENGTH_BITS = 192
"""Binary places of what is rounded, always to the side on which less is claimed."""
_ARCS = 1 << 12
"""Our choice: parts of a quadrant at most; the cone is then exact to 1 in 10^7."""


@dataclass(frozen=True)
class Check:
    """An answer and, where it is no, the reason."""

    ok: bool
    reason: str = ""


class _RefusedError(Exception):
    """The input is nothing to build a proof on; says why."""


@dataclass(frozen=True)
class _Contacts:
    """All as integers: the numbers given times p_scale, n_scale and mu_scale."""

    p: list[list[int]]
    p_scale: int
    n: list[list[int]]
    n_scale: int
    mu: list[int]
    mu_scale: int


def check_contacts(p: Vectors, n: Vectors, mu: Sequence[float]) -> Check:
    """Check what the mathematics presumes of three contacts.

    Args:
        p: contact points [m], three lists of three numbers, in any one frame.
        n: unit normals into the object, likewise.
        mu: three friction coefficients.

    Returns:
        Not ok where a number is missing or not finite, a coefficient is not positive, a normal is
        not of unit length, or the contacts are collinear or nearly so. Never raises.
    """
    try:
        _triangle(p, n, mu)
    except _RefusedError as refused:
        return Check(False, str(refused))
    return Check(True)


def check_force_closure(p: Vectors, n: Vectors, mu: Sequence[float], x: Sequence[float]) -> Check:
    """Check that x proves three contacts force closure.

    Args:
        p: contact points [m], three lists of three numbers, in any one frame.
        n: unit normals into the object, likewise.
        mu: three friction coefficients.
        x: the internal force x_12, x_13, x_23 [1/m].

    Returns:
        ok only where `check_contacts` is and each edge force lies strictly inside its friction
        cone. Not ok says that x is no proof, not that there is none. Never raises.
    """
    try:
        contacts = _triangle(p, n, mu)
        return _check_forces(contacts, _edge_forces(contacts, x))
    except _RefusedError as refused:
        return Check(False, str(refused))


def attained_margin(p: Vectors, n: Vectors, mu: Sequence[float], x: Sequence[float]) -> float:
    """How far inside the friction cones x keeps all forces.

    The least over contacts of 3 (n.f - |f - (n.f) n| / mu) / (sum of all n.f): 1 for three equal
    normal forces, 0 where a force is on its cone; -inf where the input is refused or the forces
    pull. Exact up to the last square root. Arguments as in `check_force_closure`.
    """
    try:
        contacts = _triangle(p, n, mu)
        return _margin(contacts, _edge_forces(contacts, x))
    except _RefusedError:
        return -math.inf


def check_and_margin(
    p: Vectors, n: Vectors, mu: Sequence[float], x: Sequence[float]
) -> tuple[Check, float]:
    """What `check_force_closure` and `attained_margin` say, in little more than the time of one.

    Arguments as in `check_force_closure`. Never raises.
    """
    try:
        contacts = _triangle(p, n, mu)
        forces = _edge_forces(contacts, x)
    except _RefusedError as refused:
        return Check(False, str(refused)), -math.inf
    return _check_forces(contacts, forces), _margin(contacts, forces)


def check_escaping_twist(
    p: Vectors, n: Vectors, mu: Sequence[float], v: Sequence[float], omega: Sequence[float]
) -> Check:
    """Check that along a twist no contact force does negative work, so the grasp cannot hold.

    Args:
        p: contact points [m], three lists of three numbers, measured from the origin Bo.
        n: unit normals into the object, likewise.
        mu: three friction coefficients.
        v: velocity of Bo [m/s].
        omega: angular velocity [rad/s], in the same frame.

    Returns:
        ok only where the twist is not zero and u_i = v + omega x p_i, for each i, makes at most
        the angle pi/2 - arctan(mu_i) with n_i, or is zero. Never raises.
    """
    try:
        contacts = _contacts(p, n, mu)
        (linear, angular), _ = _integers([_numbers(v, "v"), _numbers(omega, "omega")])
    except _RefusedError as refused:
        return Check(False, str(refused))
    if not any(linear + angular):
        return Check(False, "the twist is zero")
    velocities = [
        [contacts.p_scale * a + b for a, b in zip(linear, _cross(angular, p_i), strict=True)]
        for p_i in contacts.p
    ]
    return _check_escape(contacts, velocities)


def check_escaping_hinge(
    p: Vectors, n: Vectors, mu: Sequence[float], hinge: tuple[int, int]
) -> Check:
    """Check that no contact force resists turning about the line through two contacts.

    So an object escapes that two contacts can squeeze while the third adds nothing. The two must
    then stay where they are, which no twist of doubles grants them exactly.

    Args:
        p: contact points [m], three lists of three numbers, in any one frame.
        n: unit normals into the object, likewise.
        mu: three friction coefficients.
        hinge: two different indices, 0 to 2; the angular velocity points from the first to the
            second contact.

    Returns:
        ok only where the velocities are as `check_escaping_twist` demands. Never raises.
    """
    try:
        contacts = _contacts(p, n, mu)
    except _RefusedError as refused:
        return Check(False, str(refused))
    pairs = list(itertools.permutations(range(3), 2))
    if not isinstance(hinge, list | tuple) or tuple(hinge) not in pairs:
        return Check(False, "the hinge is not two different contacts")
    start, end = (contacts.p[int(i)] for i in hinge)
    omega = _minus(end, start)
    if not any(omega):
        return Check(False, "the twist is zero")
    return _check_escape(contacts, [_cross(omega, _minus(p_i, start)) for p_i in contacts.p])


def check_region(
    regions: Sequence[Sequence[Piece]],
    mu: Sequence[float],
    x: Sequence[float],
    tilt_error: float,
    friction_error: float,
) -> Check:
    """Check that x proves force closure for every placement of three contacts in three regions.

    f_i is affine in the contact points, a friction cone is convex, and x balances whatever the
    points are. So where f_i is strictly inside the cone of a piece for contact i at each of its
    corners and the other contacts at each corner of their regions, it is inside for every placement
    between. On an edge between pieces a fingertip's normal is a combination of theirs, and the
    normals within a given angle of f_i form a convex cone too. No placement is collinear: of three
    collinear points one is between the other two, but a slab separates each region from the other
    two.

    Args:
        regions: three lists of pieces; a contact is in the convex hull of the corners of one.
        mu: three friction coefficients.
        x: the internal force x_12, x_13, x_23 [1/m].
        tilt_error: angle by which each normal may differ from the surface's [rad].
        friction_error: share by which each coefficient may be less, below 1.

    Returns:
        ok only where all placements, normals and coefficients within these bounds pass
        `check_force_closure` with x. Not ok says that x is no proof, not that there is none.
        Never raises.
    """
    try:
        pieces = _pieces(regions, mu, tilt_error, friction_error)
        ((x_12, x_13, x_23),), _ = _integers([_numbers(x, "x")])
        corners = [_distinct([p for piece in region for p in piece.p]) for region in pieces]
        _refuse_near_line(corners)
    except _RefusedError as refused:
        return Check(False, str(refused))
    # f_i is the sum of these factors times the contact points.
    factors = [
        [-x_12 - x_13, x_12, x_13],
        [x_12, -x_12 - x_23, x_23],
        [x_13, x_23, -x_13 - x_23],
    ]
    for i, region in enumerate(pieces):
        for s, piece in enumerate(region):
            places = [piece.p if k == i else corners[k] for k in range(3)]
            if not _is_inside(piece, factors[i], places):
                where = f" on its piece {s + 1}" if len(region) > 1 else ""
                return Check(False, f"the force at contact {i + 1} may leave its cone{where}")
    return Check(True)


def contains_disc(
    corners: Vectors, centre: Sequence[float], normal: Sequence[float], radius: float
) -> Check:
    """Check that a polygon contains a disc about a contact along its face.

    Every edge, seen along the normal, passes the centre on its left at a distance of `radius` or
    more, so the polygon winds about every point of the disc, which its hull then contains.

    Args:
        corners: of the polygon, counter-clockwise about the normal [m].
        centre: the contact point [m].
        normal: unit normal of the face.
        radius: of the disc [m]; at 0 a centre that is a corner is enough.

    Returns:
        ok only where that holds and each corner is on the plane of the disc, to `FLATNESS` of its
        radius for the rounding of coordinates. Never raises.
    """
    try:
        points, scale = _integers([_numbers(centre, "centre"), *_rows(corners, "corners", None)])
        (n,), _ = _integers([_numbers(normal, "normal")])
        length = Fraction(_number(radius, "radius")) * scale
    except _RefusedError as refused:
        return Check(False, str(refused))
    from_centre = [_minus(p, points[0]) for p in points[1:]]
    n_n, r_r = _dot(n, n), length**2
    if length < 0 or n_n == 0:
        return Check(False, "the radius is negative or the normal zero")
    if length == 0 and [0, 0, 0] in from_centre:
        return Check(True)
    if any(_sign(_dot(n, a) ** 2, FLATNESS**2 * r_r, n_n) > 0 for a in from_centre):
        return Check(False, "a corner is not on the plane of the disc")
    for a, b in zip(from_centre, from_centre[1:] + from_centre[:1], strict=True):
        if a == b:
            continue
        # Twice the area of the triangle of edge and centre, and the edge, as seen along n.
        area, edge = _dot(n, _cross(a, b)), _cross(n, _minus(b, a))
        if area <= 0 or _sign(area**2, r_r, _dot(edge, edge)) < 0:
            return Check(False, "the polygon does not contain the disc")
    if all(a == from_centre[0] for a in from_centre):
        return Check(False, "the polygon does not contain the disc")
    return Check(True)


def narrowed_friction(
    mu: float, tilt_error: float, friction_error: float, tan_spread: float = 0.0
) -> Fraction:
    """Friction that is left about a stated normal when all errors are at their worst.

    A force within arctan m' of the normal, m' = (m - T) / (1 + m T), is within arctan m of every
    normal that differs by an angle of tangent T, because arctan m' = arctan m - arctan T. So T is
    taken from m = (1 - friction_error) mu for the tilt, then for the spread.

    Args:
        mu: friction coefficient.
        tilt_error: angle between a normal and the surface's, at most [rad], 0 to `MAX_TILT`.
        friction_error: share by which the coefficient may be less.
        tan_spread: tangent of the angle between the surface's normal and the stated one, at most.

    Returns:
        A lower bound; not positive where nothing is left.
    """
    left = (1 - Fraction(friction_error)) * Fraction(mu)
    return _narrowed(_narrowed(left, _tangent_bound(Fraction(tilt_error))), Fraction(tan_spread))


def _narrowed(mu: Fraction, tangent: Fraction) -> Fraction:
    return (mu - tangent) / (1 + mu * tangent) if mu > 0 else mu


def _tangent_bound(angle: Fraction) -> Fraction:
    """An upper bound of the tangent of an angle from 0 to `MAX_TILT`.

    The series of the sine up to a term that is added is not less than it, that of the cosine up to
    a term that is subtracted not more; the bound is exact to 1 in 10^12.
    """
    terms = [Fraction(1)]
    for k in range(1, 22):
        terms.append(terms[-1] * angle / k)
    sine, cosine = terms[1] - terms[3], terms[0] - terms[2]
    for k in range(4, 20, 4):
        sine += terms[k + 1] - terms[k + 3]
        cosine += terms[k] - terms[k + 2]
    sine += terms[21]
    return Fraction(math.ceil(sine / cosine * (1 << _FRICTION_BITS)), 1 << _FRICTION_BITS)


def _check_forces(contacts: _Contacts, forces: list[list[int]]) -> Check:
    one = contacts.mu_scale**2
    for i, (n_i, f_i, mu_i) in enumerate(zip(contacts.n, forces, contacts.mu, strict=True)):
        push = _dot(n_i, f_i)
        if push <= 0:
            return Check(False, f"the force at contact {i + 1} does not push into the object")
        if _sign(push**2 * (one + mu_i**2), INTERIOR, one * _dot(f_i, f_i) * _dot(n_i, n_i)) < 0:
            return Check(False, f"the force at contact {i + 1} is not inside its friction cone")
    return Check(True)


def _margin(contacts: _Contacts, forces: list[list[int]]) -> float:
    push = [_dot(n_i, f_i) for n_i, f_i in zip(contacts.n, forces, strict=True)]
    total = sum(push)
    if total <= 0:
        return -math.inf
    unit = (contacts.n_scale * contacts.mu_scale) ** 2
    margins = []
    try:
        for n_i, f_i, mu_i, push_i in zip(contacts.n, forces, contacts.mu, push, strict=True):
            n_n = _dot(n_i, n_i)
            sideways = unit * (_dot(f_i, f_i) * n_n - push_i**2)
            # The quotient of two integers, however long they are, is rounded once.
            slip = math.sqrt(sideways / (n_n * (total * mu_i) ** 2))
            margins.append(3 * (push_i / total - slip))
    except OverflowError:
        return -math.inf
    return min(margins)


def _check_escape(contacts: _Contacts, velocities: list[list[int]]) -> Check:
    one = contacts.mu_scale**2
    for i, (n_i, mu_i, u_i) in enumerate(zip(contacts.n, contacts.mu, velocities, strict=True)):
        away = _dot(n_i, u_i)
        if away < 0 or (one + mu_i**2) * away**2 < mu_i**2 * _dot(u_i, u_i) * _dot(n_i, n_i):
            return Check(False, f"contact {i + 1} resists the twist")
    return Check(True)


def _contacts(p: Vectors, n: Vectors, mu: Sequence[float]) -> _Contacts:
    points, p_scale = _integers(_rows(p, "p"))
    normals, n_scale = _integers(_rows(n, "n"))
    (friction,), mu_scale = _integers([_numbers(mu, "mu")])
    one = n_scale**2
    for i, (n_i, mu_i) in enumerate(zip(normals, friction, strict=True)):
        if mu_i <= 0:
            raise _RefusedError(f"the friction coefficient of contact {i + 1} is not positive")
        if _sign(abs(_dot(n_i, n_i) - one), UNIT_TOLERANCE, one) > 0:
            raise _RefusedError(f"the normal of contact {i + 1} is not of unit length")
    return _Contacts(points, p_scale, normals, n_scale, friction, mu_scale)


def _triangle(p: Vectors, n: Vectors, mu: Sequence[float]) -> _Contacts:
    contacts = _contacts(p, n, mu)
    sides = [_minus(contacts.p[j], contacts.p[i]) for i, j in ((0, 1), (0, 2), (1, 2))]
    longest = max(_dot(side, side) for side in sides)
    area = _cross(sides[0], sides[1])
    if longest == 0 or _sign(_dot(area, area), MIN_AREA_RATIO**2, longest**2) < 0:
        raise _RefusedError("the contacts are collinear, or nearly so")
    return contacts


@dataclass(frozen=True)
class _Piece:
    """All as integers: points on one scale for all pieces, the normal on a scale of its own."""

    p: list[list[int]]
    n: list[int]
    mu: int
    """What is left of the friction, in units of 2**-_FRICTION_BITS."""


def _pieces(
    regions: Any, mu: Sequence[float], tilt_error: float, friction_error: float
) -> list[list[_Piece]]:
    friction = _numbers(mu, "mu")
    tilt, loss = _number(tilt_error, "tilt_error"), _number(friction_error, "friction_error")
    if not 0 <= tilt <= MAX_TILT:
        raise _RefusedError(f"tilt_error is not from 0 to {MAX_TILT} rad")
    if not 0 <= loss < 1:
        raise _RefusedError("friction_error is not from 0 to below 1")
    if not isinstance(regions, list | tuple) or len(regions) != 3:
        raise _RefusedError("regions is not three lists of pieces")
    rows: list[list[float]] = []
    faces: list[list[tuple[slice, list[int], int]]] = []
    for i, region in enumerate(regions):
        if not isinstance(region, list | tuple) or not region:
            raise _RefusedError("regions is not three lists of pieces")
        faces.append([])
        on_faces = narrowed_friction(friction[i], tilt, loss)
        for piece in region:
            if not isinstance(piece, list | tuple) or len(piece) != 3:
                raise _RefusedError("a piece is not corners, a normal and a spread")
            start = len(rows)
            rows += _rows(piece[0], "corners", None)
            normal = _unit_normal(piece[1], i)
            spread = _number(piece[2], "tan_spread")
            if spread < 0:
                raise _RefusedError("tan_spread is negative")
            left = _narrowed(on_faces, Fraction(spread))
            inside = _strictly_less(left) if left > 0 else 0
            if inside <= 0:
                raise _RefusedError(f"the errors leave no friction at contact {i + 1}")
            faces[i].append((slice(start, len(rows)), normal, inside))
    points, _ = _integers(rows)
    return [[_Piece(_distinct(points[rows]), n, m) for rows, n, m in face] for face in faces]


def _unit_normal(normal: Any, i: int) -> list[int]:
    (n,), scale = _integers([_numbers(normal, "normal")])
    if _sign(abs(_dot(n, n) - scale**2), UNIT_TOLERANCE, scale**2) > 0:
        raise _RefusedError(f"a normal of contact {i + 1} is not of unit length")
    return n


def _strictly_less(mu: Fraction) -> int:
    """Friction m such that (1 + m^2) INTERIOR <= 1 + mu^2, in units of 2**-_FRICTION_BITS."""
    return math.floor((mu - (INTERIOR - 1) * (1 + mu * mu) / mu) * (1 << _FRICTION_BITS))


def _refuse_near_line(corners: list[list[list[int]]]) -> None:
    """Refuse regions that are not each behind a slab from the other two.

    The height of a triangle over its longest side is at least the thickness of the slab of the
    contact that is opposite, so that 2 area / side^2 is at least thickness / side.
    """
    pairs = ((0, 1), (0, 2), (1, 2))
    sides = [_minus(b, a) for i, j in pairs for a in corners[i] for b in corners[j]]
    longest = max(_dot(side, side) for side in sides)
    # Of each region the mean of its corners, all times one number.
    count = math.prod(len(region) for region in corners)
    means = [
        [sum(c) * (count // len(region)) for c in zip(*region, strict=True)] for region in corners
    ]
    area = _cross(_minus(means[1], means[0]), _minus(means[2], means[0]))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        across = _cross(area, _minus(means[k], means[j]))
        near = min(_dot(across, p) for p in corners[i])
        far = max(_dot(across, p) for p in corners[j] + corners[k])
        thickness, unit = near - far, _dot(across, across) * longest
        if thickness <= 0 or _sign(thickness**2, MIN_AREA_RATIO**2, unit) < 0:
            raise _RefusedError("contacts in the regions may be collinear, or nearly so")


def _is_inside(piece: _Piece, factors: list[int], places: list[list[list[int]]]) -> bool:
    """Whether every sum over k of factor_k times a corner of places_k is inside piece's cone.

    f is inside where mu n . f + t . f > 0 for each tangent t as long as n. A quadrant's t from
    angle 2 arctan(a) to 2 arctan(b) are in a triangle with the meeting point of the circle's
    tangents there, and a linear function that is positive at such points all round is positive on
    the circle. Where one is not the arc is cut in two, unless the circle itself tells.
    """
    n = piece.n
    axis = [0, 0, 0]
    axis[min(range(3), key=lambda k: abs(n[k]))] = 1
    e_1 = _cross(n, axis)
    frame = [[c * (piece.mu << (_LENGTH_BITS - _FRICTION_BITS)) for c in n]]
    for tangent in (e_1, _cross(n, e_1)):
        # Times this over 2**_LENGTH_BITS it is a hair longer than n.
        stretch = math.isqrt((_dot(n, n) << (2 * _LENGTH_BITS)) // _dot(tangent, tangent)) + 1
        frame.append([c * stretch for c in tangent])
    seen = [[[_dot(axis, p) for axis in frame] for p in corners] for corners in places]

    def is_positive(a: int, b: int, turn: int) -> bool:
        along = _ARCS**2 + a * b
        c, s = _ARCS**2 - a * b, _ARCS * (a + b)
        for _ in range(turn):
            c, s = -s, c
        least = 0
        for factor, points in zip(factors, seen, strict=True):
            values = [along * w + c * y + s * z for w, y, z in points]
            least += factor * (min(values) if factor > 0 else max(values))
        return least > 0

    arcs = [(0, _ARCS, turn) for turn in range(4)]
    while arcs:
        a, b, turn = arcs.pop()
        if is_positive(a, b, turn):
            continue
        middle = (a + b) // 2
        if middle == a or not is_positive(middle, middle, turn):
            return False
        arcs += [(a, middle, turn), (middle, b, turn)]
    return True


def _distinct(points: list[list[int]]) -> list[list[int]]:
    return [list(p) for p in dict.fromkeys(map(tuple, points))]


def _edge_forces(contacts: _Contacts, x: Sequence[float]) -> list[list[int]]:
    """The three forces, times p_scale and the common denominator of x."""
    p = contacts.p
    ((x_12, x_13, x_23),), _ = _integers([_numbers(x, "x")])
    along_12 = [x_12 * d for d in _minus(p[1], p[0])]
    along_13 = [x_13 * d for d in _minus(p[2], p[0])]
    along_23 = [x_23 * d for d in _minus(p[2], p[1])]
    return [
        [a + b for a, b in zip(along_12, along_13, strict=True)],
        _minus(along_23, along_12),
        [-a - b for a, b in zip(along_13, along_23, strict=True)],
    ]


def _rows(values: Any, name: str, count: int | None = 3) -> list[list[float]]:
    """Vectors, `count` of them, or one at least where that is None."""
    if not isinstance(values, list | tuple) or not values or len(values) != (count or len(values)):
        raise _RefusedError(f"{name} is not {'three' if count else 'a list of'} vectors")
    return [_numbers(row, name) for row in values]


def _numbers(values: Any, name: str) -> list[float]:
    """Three finite doubles, the nearest to the numbers given."""
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise _RefusedError(f"{name} is not made of three numbers each")
    return [_number(value, name) for value in values]


def _number(value: Any, name: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise _RefusedError(f"{name} holds something that is no number")
    try:
        double = float(value)
    except OverflowError:
        double = math.inf
    if not math.isfinite(double):
        raise _RefusedError(f"{name} holds a number that is not finite")
    return double


def _integers(rows: list[list[float]]) -> tuple[list[list[int]], int]:
    """The rows times the least power of two that makes all their numbers integers, and that."""
    ratios = [[v.as_integer_ratio() for v in row] for row in rows]
    scale = max(denominator for row in ratios for _, denominator in row)
    return [[a * (scale // b) for a, b in row] for row in ratios], scale


def _sign(a: int, ratio: Fraction, b: int) -> int:
    """A number of the sign of a - ratio b; arithmetic of fractions would seek common divisors."""
    return a * ratio.denominator - ratio.numerator * b


def _minus(a: list[int], b: list[int]) -> list[int]:
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def _dot(a: list[int], b: list[int]) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: list[int], b: list[int]) -> list[int]:
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def _check_stated_region(grasp: dict[str, Any]) -> Check:
    """Check the region of a grasp as grasp files state it."""
    region, contacts = grasp["region"], grasp["contacts"]
    normals = [contact["nhat_TB_B"] for contact in contacts]
    if "pieces" in region:
        pieces = [
            [(piece["p_BV"], piece["nhat_TB_B"], piece.get("tan_spread", 0.0)) for piece in pieces]
            for pieces in region["pieces"]
        ]
    else:
        pieces = [[(p_BV, n, 0.0)] for p_BV, n in zip(region["p_BV"], normals, strict=True)]
        for i, radius in enumerate(region["placement_error"]):
            disc = contains_disc(region["p_BV"][i], contacts[i]["p_BC"], normals[i], radius)
            if not disc.ok:
                return Check(False, f"{disc.reason} about contact {i + 1}")
    mu, x = [contact["mu"] for contact in contacts], region["internal_force"]
    return check_region(pieces, mu, x, region["tilt_error"], region["friction_error"])


def main() -> int:
    """Judge every grasp of a plan in JSON on standard input, and its region where it has one.

    Returns:
        0 when there are grasps and all hold, 1 when not, 2 when the input is no plan.
    """
    try:
        grasps = json.load(sys.stdin)["grasps"]
        proofs = [
            check_and_margin(
                [contact["p_BC"] for contact in grasp["contacts"]],
                [contact["nhat_TB_B"] for contact in grasp["contacts"]],
                [contact["mu"] for contact in grasp["contacts"]],
                grasp["certificate"]["internal_force"],
            )
            for grasp in grasps
        ]
        regions = [_check_stated_region(g) if g.get("region") else None for g in grasps]
    except (ValueError, RecursionError, KeyError, IndexError, TypeError, AttributeError) as error:
        print(f"no plan in JSON on standard input: {error!r}", file=sys.stderr)
        return 2
    for rank, ((check, margin), region) in enumerate(zip(proofs, regions, strict=True), start=1):
        holds = f"holds, margin {margin:.6g}"
        line = f"grasp {rank}: {holds if check.ok else f'does not hold: {check.reason}'}"
        if region is not None:
            line += f"; region {'holds' if region.ok else f'does not hold: {region.reason}'}"
        print(line)
    all_hold = all(check.ok for check, _ in proofs) and all(r is None or r.ok for r in regions)
    return 0 if proofs and all_hold else 1


if __name__ == "__main__":
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:
        # Who closes the pipe has read enough; Python would flush once more, and complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    sys.exit(code)
