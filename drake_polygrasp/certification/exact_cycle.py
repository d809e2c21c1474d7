"""Checks in exact arithmetic what contacts withstand for every placement in regions.

A proof names generators: forces that are in the friction cone of a contact about every normal that
it may have, and push with 1 at most. Six of them make a simplex of wrenches, and each simplex s has
a twist w_s. Where contact points and normals are anywhere in their regions, each simplex keeps to
its half-space, g.w_s >= bound N(w_s), since that holds at all corners. The simplices are a closed
surface (every five generators are in an even number of them), and a ray from the origin meets it an
odd number of times: it winds around the origin. While the contacts move, the surface is moved
without ever meeting the loads of less than the bound, and so winds around all of these: they are in
the convex hull of the wrenches. docs/certificate.md has the proof at length.

This file needs the standard library only and may be run alone: `python exact_cycle.py PROOF.json`.
"""

from __future__ import annotations

import itertools
import json
import math
import random
import sys
from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

Vector = Sequence[int]

UNIT_TOLERANCE = Fraction(1, 10**9)
"""Our choice: how far n . n may be from 1."""
_MARGIN = 1 + Fraction(1, 1 << 40)
"""Times this, a tangent in floating point is not less than the true one."""
_GRAVITY = Fraction(981, 100)
_DOUBLES = 1 - Fraction(1, 1 << 40)
"""More than m g / e is off, relative, in floating point."""
_BITS = 128
"""Binary places of square roots, rounded to the side on which less is claimed."""
_RAYS, _RAY_RANGE = 8, 10**6
"""Our choice: rays that are tried until one passes clear of all rims, and how long they are."""
_HYPERPLANES = 300
"""Our choice: hyperplanes beside a ray, which spare most simplices the solution of equations."""


class RefusedError(Exception):
    """A proof does not prove what it claims; says why."""


def check_region_proof(proof: dict[str, Any]) -> None:
    """Checks all bounds that a proof claims.

    Args:
        proof: as `region_proof.stated_proof` states it, and JSON returns it.

    Raises:
        RefusedError: a claim is not proved, or something is missing or not as it should be.
    """
    try:
        _check(proof)
    except (
        *(AttributeError, KeyError, IndexError, TypeError, ValueError),
        *(OverflowError, RecursionError, ZeroDivisionError),
    ) as error:
        raise RefusedError(f"the proof is not complete: {error!r}") from error


def _check(proof: dict[str, Any]) -> None:
    rho, com_error = _number(proof["rho"]), _number(proof["com_error"])
    p_BBcm = _vector(proof["p_BBcm"], 3)
    if rho <= 0 or com_error < 0:
        raise RefusedError("rho is not positive, or an error is negative")
    regions = proof["regions"]
    if len(regions) != 3 or len(proof["mu"]) != 3 or not all(regions):
        raise RefusedError("there are not three contacts with regions and friction")
    generators = proof["generators"]
    for k, generator in enumerate(generators):
        i = generator["contact"]
        if i not in (0, 1, 2) or len(generator["force"]) != len(regions[i]):
            raise RefusedError(f"generator {k} has no force for each piece of a contact's region")
        for force, piece in zip(generator["force"], regions[i], strict=True):
            if not _serves(_vector(force, 3), piece, proof["mu"][i], proof):
                raise RefusedError(f"a force of generator {k} is outside what its contact serves")
    corners = [
        [
            [[a - b for a, b in zip(_vector(p, 3), p_BBcm, strict=True)] for p in piece["p_BV"]]
            for piece in region
        ]
        for region in regions
    ]
    lengths, scale = _integers([*itertools.chain(*itertools.chain(*corners)), [rho]])
    places, rest = [], iter(lengths)
    for region in corners:
        places.append([[next(rest) for _ in piece] for piece in region])
    forces, force_scale = _integers([_vector(f, 3) for g in generators for f in g["force"]])
    rest = iter(forces)
    numbers = [(g["contact"], [next(rest) for _ in g["force"]]) for g in generators]
    claims = [(name, proof[name]) for name in ("epsilon", "weight") if proof.get(name) is not None]
    if not claims:
        raise RefusedError("the proof claims nothing")
    for name, claim in claims:
        simplices = [tuple(s) for s in claim["simplices"]]
        if any(
            len(s) != 6 or list(s) != sorted(set(s)) or s[0] < 0 or s[5] >= len(numbers)
            for s in simplices
        ):
            raise RefusedError(f"{name}: a simplex is not six different generators in order")
        _check_closed(name, simplices)
        _check_heights(name, claim, numbers, places, (rho, scale, force_scale, com_error))
        wrenches = [_wrench(fs[0], places[i][0], lengths[-1][0]) for i, fs in numbers]
        _check_around(name, simplices, wrenches)
    _check_stated(proof)


def _check_stated(proof: dict[str, Any]) -> None:
    """What a grasp file states follows from the bounds."""
    states = proof.get("states", {})
    if not isinstance(states, dict):
        raise TypeError(f"{states!r} states nothing")
    if "epsilon_lower" in states:
        claim = proof.get("epsilon")
        if claim is None or _number(claim["bound"]) < _number(states["epsilon_lower"]):
            raise RefusedError("epsilon_lower is more than is proved")
    if "squeeze_force" in states:
        weight, claim = _number(states["mass"]) * _GRAVITY, proof.get("weight")
        squeeze = _number(states["squeeze_force"])
        if claim is None or squeeze * _number(claim["bound"]) < weight * _DOUBLES:
            raise RefusedError("squeeze_force is less than is proved to hold the weight")


def _serves(
    force: list[Fraction], piece: dict[str, Any], mu: float, errors: dict[str, Any]
) -> bool:
    """Whether a force is in all cones of a piece and its normal part is at most 1 in each."""
    n, spread = _vector(piece["nhat_TB_B"], 3), _number(piece["tan_spread"])
    tilt, loss = _number(errors["tilt_error"]), _number(errors["friction_error"])
    if not (0 <= tilt < Fraction(3, 2) and 0 <= loss < 1 and spread >= 0):
        return False
    tangent = Fraction(math.tan(tilt)) * _MARGIN
    m = (1 - loss) * _number(mu)
    for t in (tangent, spread):
        if m <= t:
            return False
        m = (m - t) / (1 + m * t)
    n_n, n_f, f_f = _dot(n, n), _dot(n, force), _dot(force, force)
    if abs(n_n - 1) > UNIT_TOLERANCE or n_f <= 0 or n_f**2 * (1 + m**2) < f_f * n_n:
        return False
    if tangent * spread >= 1:
        return bool(f_f <= 1)
    # The greatest normal part: |f|, or that of the normal turned towards f as far as may be.
    t = (tangent + spread) / (1 - tangent * spread)
    push, slip = n_f / _root(n_n, up=False), _root(f_f - n_f**2 / n_n, up=True)
    longest = _root(1 + t**2, up=False)
    return bool(f_f <= 1 or (slip >= t * push and push + t * slip <= longest))


def _check_closed(name: str, simplices: list[tuple[int, ...]]) -> None:
    counts = Counter(ridge for s in simplices for ridge in itertools.combinations(s, 5))
    if not simplices or any(count % 2 for count in counts.values()):
        raise RefusedError(f"{name}: the surface is not closed")


def _check_heights(
    name: str,
    claim: dict[str, Any],
    generators: list[tuple[int, list[list[int]]]],
    places: list[list[list[list[int]]]],
    scales: tuple[Fraction, int, int, Fraction],
) -> None:
    """Each generator's wrenches are beyond bound N(w) along the twist of each of its simplices."""
    rho, length_scale, force_scale, com_error = scales
    bound = _number(claim["bound"])
    if bound <= 0 or len(claim["twists"]) != len(claim["simplices"]):
        raise RefusedError(f"{name}: the bound is not positive, or twists are missing")
    length = int(rho * length_scale)
    unit = bound * length * force_scale
    for s, twist in zip(claim["simplices"], claim["twists"], strict=True):
        w = _vector(twist, 6)
        (v, omega), _ = _integers([w[:3], w[3:]])
        least = math.ceil(unit * _reach(v, omega, com_error / rho, forces_only=name == "weight"))
        linear = [length * x for x in v]
        moved = {
            i: [
                [[a + b for a, b in zip(linear, _cross(omega, p), strict=True)] for p in piece]
                for piece in places[i]
            ]
            for i in {generators[k][0] for k in s}
        }
        for k in s:
            i, forces = generators[k]
            for f, velocities in zip(forces, moved[i], strict=True):
                if min(_dot(f, u) for u in velocities) < max(least, 1):
                    raise RefusedError(f"{name}: a generator is not beyond the bound")


def _reach(v: list[int], omega: list[int], s: Fraction, *, forces_only: bool) -> Fraction:
    """An upper bound of N(w): the longest (v + omega x d, omega), |d| <= s, or v + omega x d."""
    turn = _cross(omega, v)
    spin = _dot(omega, omega)
    square = _dot(v, v) + s * (2 * _root(Fraction(_dot(turn, turn)), up=True) + s * spin)
    return _root(square if forces_only else square + spin, up=True)


def _wrench(f: list[int], corners: list[list[int]], rho: int) -> list[int]:
    """A positive multiple of the wrench of a force at the mean of a piece's corners."""
    r = [sum(column) for column in zip(*corners, strict=True)]
    return [len(corners) * rho * x for x in f] + _cross(r, f)


def _check_around(name: str, simplices: list[tuple[int, ...]], wrenches: list[list[int]]) -> None:
    draw = random.Random(0)
    for _ in range(_RAYS):
        ray = _drawn(draw)
        beside = _hyperplanes_beside(ray, wrenches, draw)
        met = [
            # Where all six points are beyond one hyperplane, the ray is not.
            not beside[a] & beside[b] & beside[c] & beside[d] & beside[e] & beside[f]
            and _meets(ray, [wrenches[k] for k in (a, b, c, d, e, f)])
            for a, b, c, d, e, f in simplices
        ]
        if None not in met:
            if sum(map(bool, met)) % 2:
                return
            raise RefusedError(f"{name}: the surface is not around the origin")
    raise RefusedError(f"{name}: every ray meets a rim of the surface")


def _drawn(draw: random.Random) -> list[int]:
    return [draw.randint(-_RAY_RANGE, _RAY_RANGE) for _ in range(6)]


def _hyperplanes_beside(
    ray: list[int], wrenches: list[list[int]], draw: random.Random
) -> list[int]:
    """For each wrench, as bits, of which hyperplanes beside a ray it is not on the ray's side."""
    beside = [0] * len(wrenches)
    square = sum(x * x for x in ray)
    for bit in range(_HYPERPLANES):
        # The normal z has z.ray = -ray.ray: the hyperplane through the origin nearly holds the ray.
        any_ = _drawn(draw)
        along = sum(a * b for a, b in zip(any_, ray, strict=True))
        z = [square * a - (along + 1) * b for a, b in zip(any_, ray, strict=True)]
        for k, wrench in enumerate(wrenches):
            if sum(a * b for a, b in zip(z, wrench, strict=True)) >= 0:
                beside[k] |= 1 << bit
    return beside


def _meets(ray: list[int], points: list[list[int]]) -> bool | None:
    """Whether a ray meets a simplex inside; None where it meets a rim, or a flat one's plane."""
    # Fraction-free elimination (Bareiss, 1968) of sum of share_k point_k = ray.
    rows = [[point[j] for point in points] + [ray[j]] for j in range(6)]
    last = 1
    for k in range(6):
        pivot = next((j for j in range(k, 6) if rows[j][k]), None)
        if pivot is None:
            return _meets_flat(points, ray)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        head = rows[k][k]
        for j in range(6):
            if j != k:
                lead = rows[j][k]
                rows[j] = [
                    (head * a - lead * b) // last for a, b in zip(rows[j], rows[k], strict=True)
                ]
        last = head
    shares = [rows[j][6] * (1 if rows[j][j] > 0 else -1) for j in range(6)]
    if min(shares) < 0:
        return False
    return True if min(shares) > 0 else None


def _meets_flat(points: list[list[int]], ray: list[int]) -> bool | None:
    """No where a ray is outside the span of points, which is no whole space; else None."""
    return False if _rank([*points, ray]) > _rank(points) else None


def _rank(vectors: list[list[int]]) -> int:
    rows, rank = [[Fraction(x) for x in v] for v in vectors], 0
    for k in range(6):
        pivot = next((j for j in range(rank, len(rows)) if rows[j][k]), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        for j in range(rank + 1, len(rows)):
            factor = rows[j][k] / rows[rank][k]
            rows[j] = [a - factor * b for a, b in zip(rows[j], rows[rank], strict=True)]
        rank += 1
    return rank


def _number(value: Any) -> Fraction:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return Fraction(value)


def _vector(values: Any, length: int) -> list[Fraction]:
    if len(values) != length:
        raise ValueError(f"{values!r} has not {length} numbers")
    return [_number(value) for value in values]


def _integers(vectors: list[list[Fraction]]) -> tuple[list[list[int]], int]:
    """Vectors times one scale that makes all their numbers integers, and the scale."""
    scale = math.lcm(*(x.denominator for v in vectors for x in v))
    return [[int(x * scale) for x in v] for v in vectors], scale


def _root(square: Fraction, *, up: bool) -> Fraction:
    """A bound of a square root, from above or below."""
    floor = math.isqrt(max(square.numerator << 2 * _BITS, 0) // square.denominator)
    return Fraction(floor + up, 1 << _BITS)


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def main(arguments: Sequence[str]) -> int:
    """Judges every proof of a file.

    Args:
        arguments: the file's name.

    Returns:
        0 when there are proofs and all hold, 1 when not, 2 when the file has none to read.
    """
    try:
        (name,) = arguments
        proofs = json.loads(Path(name).read_text(encoding="utf-8"))["region_proofs"]
        enumerated = list(enumerate(proofs, start=1))
    except (OSError, ValueError, RecursionError, KeyError, TypeError) as error:
        print(f"usage: exact_cycle.py PROOF.json; no proofs of regions in it: {error!r}")
        return 2
    code = 0 if enumerated else 1
    for number, proof in enumerated:
        try:
            check_region_proof(proof)
        except RefusedError as refused:
            print(f"{_name(proof, number)}: does not hold: {refused}")
            code = 1
            continue
        claims = [f"{k} {proof[k]['bound']:.6g}" for k in ("epsilon", "weight") if proof.get(k)]
        print(f"{_name(proof, number)}: holds: {', '.join(claims)}")
    return code


def _name(proof: Any, number: int) -> str:
    """Which grasp a proof is of: its rank and faces, or else the proof's number."""
    try:
        faces = ", ".join(str(int(face)) for face in proof["states"]["faces"])
        return f"grasp {int(proof['states']['rank'])} on faces {faces}"
    except (KeyError, TypeError, ValueError, OverflowError):
        return f"grasp {number}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
