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

UNIT_TOLERANCE = Fraction(1, 10**9)
"""Ours: how far n . n may be from 1."""
MIN_AREA_RATIO = Fraction(1, 10**3)
"""Ours: twice the triangle's area over the square of its longest side, at least. Collinear points,
once turned in floating point, have a tiny area and not none."""
INTERIOR = 1 + Fraction(1, 10**9)
"""Ours: the part by which (n . f)^2 must exceed its value on the cone."""


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


def _rows(values: Any, name: str) -> list[list[float]]:
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise _RefusedError(f"{name} is not three vectors")
    return [_numbers(row, name) for row in values]


def _numbers(values: Any, name: str) -> list[float]:
    """Three finite doubles, the nearest to the numbers given."""
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise _RefusedError(f"{name} is not made of three numbers each")
    if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        raise _RefusedError(f"{name} holds something that is no number")
    try:
        doubles = [float(v) for v in values]
    except OverflowError:
        doubles = [math.inf]
    if not all(math.isfinite(v) for v in doubles):
        raise _RefusedError(f"{name} holds a number that is not finite")
    return doubles


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


def main() -> int:
    """Judge every grasp of a plan in JSON on standard input.

    Returns:
        0 when there are grasps and all hold, 1 when not, 2 when the input is no plan.
    """
    try:
        grasps = [
            (
                [contact["p_BC"] for contact in grasp["contacts"]],
                [contact["nhat_TB_B"] for contact in grasp["contacts"]],
                [contact["mu"] for contact in grasp["contacts"]],
                grasp["certificate"]["internal_force"],
            )
            for grasp in json.load(sys.stdin)["grasps"]
        ]
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError) as error:
        print(f"no plan in JSON on standard input: {error!r}", file=sys.stderr)
        return 2
    proofs = [check_and_margin(*grasp) for grasp in grasps]
    for rank, (check, margin) in enumerate(proofs, start=1):
        holds = f"holds, margin {margin:.6g}"
        print(f"grasp {rank}: {holds if check.ok else f'does not hold: {check.reason}'}")
    return 0 if proofs and all(check.ok for check, _ in proofs) else 1


if __name__ == "__main__":
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:
        # Who closes the pipe has read enough; Python would flush once more, and complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    sys.exit(code)
