"""Checks proofs of force closure in exact arithmetic.

A frictional grasp is force closure iff its grasp map has full rank and some internal force lies
strictly inside every friction cone (Murray, Li & Sastry, 1994, ch. 5). With three contacts that
are not collinear, every internal force pushes along the sides of the contact triangle,

    f_1 = x_12 (p_2 - p_1) + x_13 (p_3 - p_1)
    f_2 = x_12 (p_1 - p_2) + x_23 (p_3 - p_2)
    f_3 = x_13 (p_1 - p_3) + x_23 (p_2 - p_3)

and balances for every x. So x is the proof, and checking it means finding the signs of polynomials
in the given doubles. Each polynomial is homogeneous in p, in n and in x, so all numbers are scaled
to integers and no step rounds. The file uses no solver and only the standard library: it can be
read in full, or run alone as `polygrasp plan MODEL --json | python exact.py`.

One x can also prove all placements of three contacts in three regions, with normals and friction
known within bounds: see `check_region`.
"""

from __future__ import annotations

import functools
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
"""A part of the surface: corners of a convex polygon or polytope that contains it [m], an inward
unit normal, and the tangent of the greatest angle between that normal and the surface's in it."""

UNIT_TOLERANCE = Fraction(1, 10**9)
"""Our choice: greatest difference of n . n from 1."""
MIN_AREA_RATIO = Fraction(1, 10**3)
"""Our choice: least ratio of twice the triangle's area to the square of its longest side. After a
rotation in floating point, the area of collinear points is tiny but not zero."""
INTERIOR = 1 + Fraction(1, 10**9)
"""Our choice: factor by which (n . f)^2 must exceed its value on the cone."""
FLATNESS = Fraction(1, 10**6)
"""Our choice: greatest distance of rounded corners from a disc's plane, over its radius."""
OFF_PLANE = Fraction(1, 10**8)
"""Our choice: the same, over the size of the grasp, for discs hardly larger than roundings."""
MAX_TILT = 1.5
"""Our choice: greatest tilt error [rad]; a fingertip tilted more than this does not touch."""
_FRICTION_BITS = 64
_LENGTH_BITS = 192
"""Binary places of rounded friction and lengths; rounding always weakens the claim."""
_ARCS = 1 << 12
"""Our choice: most arcs in a quadrant of the cone, which is then exact to 1 in 10^7."""


@dataclass(frozen=True)
class Check:
    """The result of a check.

    Attributes:
        ok: whether the proof holds.
        reason: why it does not; empty if it does.
    """

    ok: bool
    reason: str = ""


class _RefusedError(Exception):
    """The input cannot be the basis of a proof; the message says why."""


@dataclass(frozen=True)
class _Contacts:
    """Three contacts in integers: the given numbers times p_scale, n_scale and mu_scale."""

    p: list[list[int]]
    p_scale: int
    n: list[list[int]]
    n_scale: int
    mu: list[int]
    mu_scale: int


def check_contacts(p: Vectors, n: Vectors, mu: Sequence[float]) -> Check:
    """Checks the assumptions of the proof: finite numbers, unit normals, contacts not collinear.

    Args:
        p: contact points [m], three lists of three numbers, in any frame.
        n: unit normals into the object, in the same form and frame.
        mu: three friction coefficients.

    Returns:
        Not ok if a number is missing or not finite, a coefficient is not positive, a normal is not
        of unit length, or the contacts are collinear or nearly so. Never raises.
    """
    try:
        _triangle(p, n, mu)
    except _RefusedError as refused:
        return Check(False, str(refused))
    return Check(True)


def check_force_closure(p: Vectors, n: Vectors, mu: Sequence[float], x: Sequence[float]) -> Check:
    """Checks that an internal force proves three contacts force closure.

    Args:
        p: contact points [m], three lists of three numbers, in any frame.
        n: unit normals into the object, in the same form and frame.
        mu: three friction coefficients.
        x: the internal force x_12, x_13, x_23 [1/m].

    Returns:
        Ok only if `check_contacts` is and each f_i lies strictly inside its friction cone. If it is
        not ok, x is no proof, but another x may be. Never raises.
    """
    try:
        contacts = _triangle(p, n, mu)
        return _check_forces(contacts, _edge_forces(contacts, x))
    except _RefusedError as refused:
        return Check(False, str(refused))


def attained_margin(p: Vectors, n: Vectors, mu: Sequence[float], x: Sequence[float]) -> float:
    """Computes how far inside the friction cones an internal force is.

    Args:
        p: contact points [m], three lists of three numbers, in any frame.
        n: unit normals into the object, in the same form and frame.
        mu: three friction coefficients.
        x: the internal force x_12, x_13, x_23 [1/m].

    Returns:
        The least over contacts of 3 (n.f - |f - (n.f) n| / mu) / (sum of all n.f), exact up to the
        last square root: 1 for three equal normal forces, 0 if a force is on its cone, -inf if
        `check_contacts` fails or the forces pull.
    """
    try:
        contacts = _triangle(p, n, mu)
        return _margin(contacts, _edge_forces(contacts, x))
    except _RefusedError:
        return -math.inf


def check_and_margin(
    p: Vectors, n: Vectors, mu: Sequence[float], x: Sequence[float]
) -> tuple[Check, float]:
    """Returns `check_force_closure` and `attained_margin`, in little more than the time of one.

    Args:
        p: contact points [m], three lists of three numbers, in any frame.
        n: unit normals into the object, in the same form and frame.
        mu: three friction coefficients.
        x: the internal force x_12, x_13, x_23 [1/m].

    Returns:
        The check and the margin. Never raises.
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
    """Checks that along a twist no contact force does negative work, so the grasp cannot hold.

    Args:
        p: contact points [m], three lists of three numbers, measured from the origin Bo.
        n: unit normals into the object, in the same form and frame.
        mu: three friction coefficients.
        v: velocity of Bo [m/s].
        omega: angular velocity [rad/s], in the same frame.

    Returns:
        Ok only if the twist is not zero and each velocity u_i = v + omega x p_i is zero or at an
        angle of at most pi/2 - arctan(mu_i) from n_i. Never raises.
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
    """Checks that no contact force resists rotation about the line through two contacts.

    An object escapes this way if two contacts can squeeze it and the third adds nothing. The two
    contacts on the axis must have velocity zero, which a twist in doubles cannot give exactly.

    Args:
        p: contact points [m], three lists of three numbers, in any frame.
        n: unit normals into the object, in the same form and frame.
        mu: three friction coefficients.
        hinge: two different indices, 0 to 2; the angular velocity points from the first contact to
            the second.

    Returns:
        Ok only if the velocities are as `check_escaping_twist` demands. Never raises.
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
    """Checks that an internal force proves all placements of three contacts in three regions.

    f_i is affine in the contact points, a friction cone is convex, and x balances for all points.
    So if f_i is strictly inside the cone of a piece with contact i at each of its corners and the
    other contacts at each corner of their regions, it is inside for all placements between them. On
    an edge between pieces a fingertip's normal is a combination of theirs, and the normals within a
    given angle of f_i form a convex cone too. No placement is collinear: of three collinear points
    one is between the other two, but a slab separates each region from the other two.

    Args:
        regions: three lists of pieces; a contact is in the convex hull of the corners of one.
        mu: three friction coefficients.
        x: the internal force x_12, x_13, x_23 [1/m].
        tilt_error: greatest angle between each normal and the surface's, 0 to `MAX_TILT` [rad].
        friction_error: greatest relative loss of each coefficient, at least 0 and below 1.

    Returns:
        Ok only if all placements, normals and coefficients within these bounds pass
        `check_force_closure` with x. If it is not ok, x is no proof, but another x may be. Never
        raises.
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
    corners: Vectors,
    centre: Sequence[float],
    normal: Sequence[float],
    radius: float,
    size: float = 0.0,
) -> Check:
    """Checks that a polygon contains a disc about a contact in its face.

    Each edge, seen along the normal, must have the centre on the same side at a distance of
    `radius` or more. Then the polygon winds about every point of the disc, and its hull contains
    the disc.

    Args:
        corners: corners of the polygon, in order, either way around [m], lists of three numbers.
        centre: contact point [m], in the same frame.
        normal: unit normal of the face.
        radius: radius of the disc [m]; 0 if the centre may also be a corner.
        size: greatest difference of a coordinate between the grasp's contacts [m].

    Returns:
        Ok only if that holds and each corner is on the plane of the disc within `FLATNESS` times
        its radius or `OFF_PLANE` times the size, for the rounding of coordinates. Never raises.
    """
    try:
        points, scale = _integers([_numbers(centre, "centre"), *_rows(corners, "corners", None)])
        (n,), _ = _integers([_numbers(normal, "normal")])
        length = Fraction(_number(radius, "radius")) * scale
        flat = max(FLATNESS * length, OFF_PLANE * Fraction(_number(size, "size")) * scale)
    except _RefusedError as refused:
        return Check(False, str(refused))
    from_centre = [_minus(p, points[0]) for p in points[1:]]
    n_n, r_r = _dot(n, n), length**2
    if length < 0 or n_n == 0:
        return Check(False, "the radius is negative or the normal zero")
    if length == 0 and [0, 0, 0] in from_centre:
        return Check(True)
    if any(_sign(_dot(n, a) ** 2, flat**2, n_n) > 0 for a in from_centre):
        return Check(False, "a corner is not on the plane of the disc")
    winding = 0
    for a, b in zip(from_centre, from_centre[1:] + from_centre[:1], strict=True):
        if a == b:
            continue
        # Twice the area of the triangle of edge and centre, and the edge, as seen along n.
        area, edge = _dot(n, _cross(a, b)), _cross(n, _minus(b, a))
        winding = winding or area
        if area * winding <= 0 or _sign(area**2, r_r, _dot(edge, edge)) < 0:
            return Check(False, "the polygon does not contain the disc")
    return Check(winding != 0, "" if winding else "the polygon does not contain the disc")


def narrowed_friction(
    mu: float, tilt_error: float, friction_error: float, tan_spread: float = 0.0
) -> Fraction:
    """Bounds from below the friction that errors leave about a stated normal.

    A force within arctan m' of the normal, m' = (m - T) / (1 + m T), is within arctan m of every
    normal that differs by an angle of tangent T, because arctan m' = arctan m - arctan T. This
    narrows m = (1 - friction_error) mu for the tilt and then for the spread.

    Args:
        mu: friction coefficient.
        tilt_error: greatest angle between a normal and the surface's, 0 to `MAX_TILT` [rad].
        friction_error: greatest relative loss of the coefficient, at least 0 and below 1.
        tan_spread: tangent of the greatest angle between the surface's normal and the stated one.

    Returns:
        The friction coefficient; zero or negative if no friction is left.
    """
    left = (1 - Fraction(friction_error)) * Fraction(mu)
    return _narrowed(_narrowed(left, _tangent_bound(Fraction(tilt_error))), Fraction(tan_spread))


def _narrowed(mu: Fraction, tangent: Fraction) -> Fraction:
    return (mu - tangent) / (1 + mu * tangent) if mu > 0 else mu


@functools.lru_cache(maxsize=256)  # a plan asks again and again for the same few
def _tangent_bound(angle: Fraction) -> Fraction:
    """Bounds the tangent of an angle from 0 to `MAX_TILT` from above, to 1 in 10^12.

    The series of the sine that ends with an added term is an upper bound, that of the cosine that
    ends with a subtracted term a lower bound.
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
            # Python rounds the quotient of two integers once, however long they are.
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
    """A piece in integers: points on one scale for all pieces, the normal on a scale of its own."""

    p: list[list[int]]
    n: list[int]
    mu: int
    """Friction that the errors leave, in units of 2**-_FRICTION_BITS."""


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
        for piece in region:
            if not isinstance(piece, list | tuple) or len(piece) != 3:
                raise _RefusedError("a piece is not corners, a normal and a spread")
            start = len(rows)
            rows += _rows(piece[0], "corners", None)
            normal = _unit_normal(piece[1], i)
            spread = _number(piece[2], "tan_spread")
            if spread < 0:
                raise _RefusedError("tan_spread is negative")
            inside = _friction_inside(friction[i], tilt, loss, spread)
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


@functools.lru_cache(maxsize=256)  # like `_tangent_bound`
def _friction_inside(mu: float, tilt: float, loss: float, spread: float) -> int:
    """Returns friction m with (1 + m^2) INTERIOR <= 1 + left^2, in units of 2**-_FRICTION_BITS.

    What the errors leave of mu is `left`; m is 0 or negative if that is.
    """
    left = narrowed_friction(mu, tilt, loss, spread)
    if left <= 0:
        return 0
    return math.floor((left - (INTERIOR - 1) * (1 + left * left) / left) * (1 << _FRICTION_BITS))


def _refuse_near_line(corners: list[list[list[int]]]) -> None:
    """Refuses regions unless a slab separates each from the other two.

    The height of a contact triangle over its longest side is at least the thickness of the slab of
    the opposite contact, so 2 area / side^2 is at least thickness / side.
    """
    # The mean corner of each region, times one number for all.
    count = math.prod(len(region) for region in corners)
    means = [
        [sum(c) * (count // len(region)) for c in zip(*region, strict=True)] for region in corners
    ]
    # A ball about the middle of these holds all corners: no side is longer than its diameter.
    middle = [sum(c) for c in zip(*means, strict=True)]
    offs = [_minus([3 * count * c for c in p], middle) for region in corners for p in region]
    longest = 4 * max(_dot(off, off) for off in offs)
    area = _cross(_minus(means[1], means[0]), _minus(means[2], means[0]))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        across = _cross(area, _minus(means[k], means[j]))
        near = min(_dot(across, p) for p in corners[i])
        far = max(_dot(across, p) for p in corners[j] + corners[k])
        thickness, unit = near - far, _dot(across, across) * longest
        if thickness <= 0 or _sign((3 * count * thickness) ** 2, MIN_AREA_RATIO**2, unit) < 0:
            raise _RefusedError("contacts in the regions may be collinear, or nearly so")


def _is_inside(piece: _Piece, factors: list[int], places: list[list[list[int]]]) -> bool:
    """Tells whether all sums over k of factor_k times a corner of places_k are in a piece's cone.

    f is inside if mu n . f + t . f > 0 for each tangent t as long as n. An arc of the circle of t,
    from angle 2 arctan(a) to 2 arctan(b), lies in the triangle of its ends and the point where the
    circle's tangents at them meet. A linear function that is positive at all such points is
    positive on the circle. An arc whose point fails is halved, unless the function is not positive
    at its middle.
    """
    n = piece.n
    axis = [0, 0, 0]
    axis[min(range(3), key=lambda k: abs(n[k]))] = 1
    e_1 = _cross(n, axis)
    frame = [[c * (piece.mu << (_LENGTH_BITS - _FRICTION_BITS)) for c in n]]
    for tangent in (e_1, _cross(n, e_1)):
        # The tangent times stretch / 2**_LENGTH_BITS is a hair longer than n.
        stretch = math.isqrt((_dot(n, n) << (2 * _LENGTH_BITS)) // _dot(tangent, tangent)) + 1
        frame.append([c * stretch for c in tangent])

    def is_positive(a: int, b: int, turn: int) -> bool:
        along = _ARCS**2 + a * b
        c, s = _ARCS**2 - a * b, _ARCS * (a + b)
        for _ in range(turn):
            c, s = -s, c
        x, y, z = (along * w + c * t_1 + s * t_2 for w, t_1, t_2 in zip(*frame, strict=True))
        least = 0
        for factor, points in zip(factors, places, strict=True):
            values = [x * p_x + y * p_y + z * p_z for p_x, p_y, p_z in points]
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
    """Returns f_1, f_2, f_3 times p_scale and the common denominator of x."""
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
    """Reads `count` vectors, or at least one if that is None."""
    if not isinstance(values, list | tuple) or not values or len(values) != (count or len(values)):
        raise _RefusedError(f"{name} is not {'three' if count else 'a list of'} vectors")
    return [_numbers(row, name) for row in values]


def _numbers(values: Any, name: str) -> list[float]:
    """Reads three finite doubles, the nearest to the given numbers."""
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
    """Returns the rows times the least power of two that makes them integers, and that power."""
    ratios = [[v.as_integer_ratio() for v in row] for row in rows]
    scale = max(denominator for row in ratios for _, denominator in row)
    return [[a * (scale // b) for a, b in row] for row in ratios], scale


def _sign(a: int, ratio: Fraction, b: int) -> int:
    """Returns a number of the sign of a - ratio b, without the common divisors of fractions."""
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
    """Checks the region of a grasp, as grasp files state it."""
    region, contacts = grasp["region"], grasp["contacts"]
    normals = [contact["nhat_TB_B"] for contact in contacts]
    if "pieces" in region:
        pieces = [
            [(piece["p_BV"], piece["nhat_TB_B"], piece.get("tan_spread", 0.0)) for piece in pieces]
            for pieces in region["pieces"]
        ]
    else:
        pieces = [[(p_BV, n, 0.0)] for p_BV, n in zip(region["p_BV"], normals, strict=True)]
    axes = zip(*(contact["p_BC"] for contact in contacts), strict=True)
    size = max(max(axis) - min(axis) for axis in axes)
    places = zip(pieces, contacts, region["placement_error"], strict=True)
    for i, (own, contact, radius) in enumerate(places, start=1):
        if len(own) == 1 and not own[0][2]:
            disc = contains_disc(own[0][0], contact["p_BC"], own[0][1], radius, size)
            if not disc.ok:
                return Check(False, f"{disc.reason} about contact {i}")
    mu, x = [contact["mu"] for contact in contacts], region["internal_force"]
    return check_region(pieces, mu, x, region["tilt_error"], region["friction_error"])


def main() -> int:
    """Checks every grasp of a plan in JSON on standard input, and its region if it has one.

    Returns:
        The exit code: 0 if there are grasps and all hold, 1 if not, 2 if the input is no plan.
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
        regions = [_check_stated_region(g) if "region" in g else None for g in grasps]
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
        # The reader has closed the pipe; Python would flush once more at exit, and complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    sys.exit(code)
