"""One internal force for three regions: what the exact check proves, and what it refuses."""

from __future__ import annotations

import itertools
import json
import math
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_polygrasp.certification import exact
from drake_polygrasp.certification.exact import (
    check_contacts,
    check_force_closure,
    check_region,
    contains_disc,
    narrowed_friction,
)
from tests.certification.test_exact import BOX_X, json_values, numbers
from tests.support.common import box_grasp, prism_grasp, random_contacts, random_rotations

DISC = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
"""A square about a disc of radius sqrt(1/2), counter-clockwise about x."""


def at_points(p, n, spread=0.0):
    return [[([p_i], n_i, spread)] for p_i, n_i in zip(p, n, strict=True)]


def slab_regions(half: float):
    """The contacts of a plate 4 thick; the first may be anywhere in a square of half the side."""
    square = [[2.0, y, z] for y in (-half, half) for z in (-half, half)]
    n = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    return [
        [(square, n[0], 0.0)],
        [([[-2.0, 1.0, 0.0]], n[1], 0.0)],
        [([[-2.0, -1.0, 0.0]], n[2], 0.0)],
    ]


def slab_friction(half: float) -> float:
    """What x = (1, 1, 0) needs there: f_2 = (4, y - 1, z) is steepest with a corner far away."""
    return math.hypot(half + 1, half) / 4


@pytest.mark.parametrize("half", [0.25, 0.5, 1.0])
def test_the_friction_that_a_square_needs_is_that_of_its_worst_corner(half):
    x, regions = [1.0, 1.0, 0.0], slab_regions(half)
    for hair, holds in ((1e-6, True), (-1e-6, False)):
        mu = [slab_friction(half) * (1 + hair)] * 3
        assert check_region(regions, mu, x, 0.0, 0.0).ok is holds


@pytest.mark.parametrize(("tilt", "loss", "spread"), [(0.1, 0.0, 0.0), (0, 0.2, 0), (0, 0, 0.05)])
def test_each_error_costs_the_friction_of_its_closed_form(tilt, loss, spread):
    regions = slab_regions(0.5)
    regions[1][0] = (*regions[1][0][:2], spread)
    regions[2][0] = (*regions[2][0][:2], spread)
    angle = math.atan(slab_friction(0.5)) + tilt + math.atan(spread)
    for hair, holds in ((1e-6, True), (-1e-6, False)):
        mu = [math.tan(angle) / (1 - loss) * (1 + hair)] * 3
        assert check_region(regions, mu, [1.0, 1.0, 0.0], tilt, loss).ok is holds


def test_errors_add_up_as_angles():
    for mu, tilt, loss, spread in itertools.product(
        (0.1, 0.5, 2.0), (0.0, 0.03, 0.5, 1.5), (0.0, 0.2, 0.9), (0.0, 0.01, 1.0)
    ):
        left = narrowed_friction(mu, tilt, loss, spread)
        angle = math.atan((1 - loss) * mu) - tilt - math.atan(spread)
        assert (left > 0) is (angle > 0)
        if angle > 0:
            assert float(left) == pytest.approx(math.tan(angle), rel=1e-11, abs=1e-13)


def test_the_tangent_is_bounded_from_above():
    for angle in (0.0, 5e-324, 1e-9, 0.0873, 0.7853981633974483, 1.2, 1.5):
        # By the tangent of half the angle: a bound of both obeys 2 t / (1 - t^2) to rounding.
        tangent, half = (exact._tangent_bound(Fraction(a)) for a in (angle, angle / 2))
        assert tangent >= Fraction(angle)
        assert abs(tangent - 2 * half / (1 - half**2)) <= Fraction(1, 10**12)
        exact_to_a_hair = math.tan(angle) * (1 + 1e-11) + 1e-19
        assert math.tan(angle) * (1 - 1e-15) <= float(tangent) <= exact_to_a_hair


def test_corners_that_hold_prove_nothing_of_a_middle_that_is_collinear():
    n = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    x, mu = [1.0, 1.0, 0.0], [0.5] * 3
    for y in (-0.3, 0.3):
        p = [[0.0, y, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
        assert check_force_closure(p, n, mu, x).ok
    first = ([[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]], n[0], 0.0)
    regions = [[first], *at_points([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], n[1:])]
    check = check_region(regions, mu, x, 0.0, 0.0)
    assert check == exact.Check(False, "contacts in the regions may be collinear, or nearly so")


def test_regions_of_points_are_contacts():
    p, n, mu = (values.tolist() for values in random_contacts(400, seed=4))
    for k, x in enumerate(np.random.default_rng(4).uniform(-0.2, 1, size=(400, 3)).tolist()):
        expected = check_force_closure(p[k], n[k], mu[k], x).ok
        assert check_region(at_points(p[k], n[k]), mu[k], x, 0.0, 0.0).ok is expected
    for height, holds in ((0.00201, True), (0.00199, False)):
        p_ = [[0.0, height, 0.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
        n_ = numbers(box_grasp())[1]
        check = check_region(at_points(p_, n_), [1e4] * 3, [1, 1, 1], 0.0, 0.0)
        assert check_contacts(p_, n_, [1.0] * 3).ok is holds
        assert ("collinear" in check.reason) is not holds


def test_corners_by_the_thousand_are_judged_as_their_hull():
    p, n, mu = numbers(box_grasp())
    for half, holds in ((0.004, True), (0.04, False)):
        square = half * np.array([[0.0, -1, -1], [0, -1, 1], [0, 1, 1], [0, 1, -1], [0, -1, -1]])
        at = np.linspace(0, 4, 4001)
        dense = np.stack([np.interp(at, range(5), axis) for axis in square.T], axis=1)
        for corners in (square, dense):
            regions = [
                [((p_i + corners).tolist(), n_i, 0.0)] for p_i, n_i in zip(p, n, strict=True)
            ]
            assert check_region(regions, mu, BOX_X, 0.05, 0.1).ok is holds


def random_regions(rng, radius: float, num_pieces: int = 1, num_corners: int = 4):
    """Polytopes about the contacts of a prism, with normals turned a little."""
    grasp = prism_grasp(radius=1.0)
    regions = []
    for p_i, n_i in zip(grasp.p_BC, grasp.nhat_TB_B, strict=True):
        region = []
        for _ in range(num_pieces):
            n = n_i + rng.normal(scale=0.05, size=3) * (num_pieces > 1)
            corners = p_i + radius * rng.uniform(-1, 1, (num_corners, 3))
            region.append((corners.tolist(), (n / np.linalg.norm(n)).tolist(), 0.0))
        regions.append(region)
    return regions


def worst_friction(regions, x) -> float:
    """The least friction with which every corner triple is inside, computed one by one."""
    needed = 0.0
    hulls = [[p for piece in region for p in piece[0]] for region in regions]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        x_ij, x_ik = (x[sum(sorted((i, other))) - 1] for other in (j, k))
        for corners, n, _ in regions[i]:
            for c_i, c_j, c_k in itertools.product(corners, hulls[j], hulls[k]):
                f = x_ij * np.subtract(c_j, c_i) + x_ik * np.subtract(c_k, c_i)
                push = float(np.dot(n, f))
                if push <= 0:
                    return math.inf
                needed = max(needed, float(np.linalg.norm(f - push * np.array(n))) / push)
    return needed


@pytest.mark.parametrize("num_pieces", [1, 3])
def test_the_cone_is_judged_as_by_all_corner_triples(num_pieces):
    rng = np.random.default_rng(5)
    for radius in (0.01, 0.03, 0.1, 0.2):
        for _ in range(10):
            regions = random_regions(rng, radius, num_pieces)
            x = rng.uniform(0.7, 1.3, 3).tolist()
            needed = worst_friction(regions, x)
            for hair, holds in ((2e-6, True), (-2e-6, False)):
                assert check_region(regions, [needed * (1 + hair)] * 3, x, 0, 0).ok is holds


def test_only_the_forces_and_places_matter_not_the_frame_the_unit_or_the_order():
    rng = np.random.default_rng(6)
    for R in random_rotations(10, rng):
        regions, x = random_regions(rng, 0.1, 2), rng.uniform(0.7, 1.3, 3).tolist()
        needed = worst_friction(regions, x)
        moved = [
            [((7 * p @ R.T + 3).tolist(), (R @ n).tolist(), s) for p, n, s in region]
            for region in [[(np.array(p), np.array(n), s) for p, n, s in r] for r in regions]
        ]
        doubled = [[(p[::-1] + p[:1], n, s) for p, n, s in region[::-1]] for region in regions]
        swapped = [regions[2], regions[0], regions[1]]
        for hair, holds in ((1e-5, True), (-1e-5, False)):
            mu = [needed * (1 + hair)] * 3
            assert check_region(regions, mu, x, 0.0, 0.0).ok is holds
            assert check_region(moved, mu, x, 0.0, 0.0).ok is holds
            assert check_region(doubled, mu, [1e6 * v for v in x], 0.0, 0.0).ok is holds
            assert check_region(swapped, mu, [x[1], x[2], x[0]], 0.0, 0.0).ok is holds


weights = st.lists(st.floats(0, 1), min_size=12, max_size=12)
tilts = st.lists(st.floats(-1, 1), min_size=9, max_size=9)


@given(weights, tilts, st.floats(0, 1))
def test_every_placement_tilt_and_friction_within_the_bounds_is_proved_by_the_same_x(w, d, loss):
    rng, tilt, x = np.random.default_rng(7), 0.1, [1.0, 1.1, 0.9]
    regions = random_regions(rng, 0.1)
    mu = 1.001 * math.tan(math.atan(worst_friction(regions, x)) + tilt) / 0.8
    assert check_region(regions, [mu] * 3, x, tilt, 0.2).ok
    p, n = [], []
    for i, ((corners, normal, _),) in enumerate(regions):
        share = np.array(w[4 * i : 4 * i + 4]) + 1e-9
        p.append((share / share.sum() @ np.array(corners)).tolist())
        across = np.array(d[3 * i : 3 * i + 3]) - np.dot(d[3 * i : 3 * i + 3], normal) * np.array(
            normal
        )
        turned = np.array(normal) + math.tan(tilt) * across / max(np.linalg.norm(across), 1e-3)
        n.append((turned / np.linalg.norm(turned)).tolist())
    assert check_force_closure(p, n, [mu * (1 - 0.2 * loss)] * 3, x).ok


def good_arguments():
    p, n, mu = numbers(box_grasp())
    return [at_points(p, n), mu, BOX_X, 0.05, 0.1]


def replaced_piece(**changes):
    arguments = good_arguments()
    p, n, spread = arguments[0][1][0]
    piece = {"p": p, "n": n, "spread": spread} | changes
    arguments[0][1][0] = tuple(piece.values())
    return arguments


SPOILT = {
    "internal force negated": (2, [-2.5, -2.5, 1.25], "may leave its cone"),
    "x nan": (2, [2.5, math.nan, -1.25], "not finite"),
    "friction too low": (1, [0.3, 0.05, 0.3], "leave no friction at contact 2"),
    "friction zero": (1, [0.3, 0.0, 0.3], "leave no friction at contact 2"),
    "friction negative": (1, [0.3, -9.0, 0.3], "leave no friction at contact 2"),
    "friction infinite": (1, [0.3, math.inf, 0.3], "not finite"),
    "tilt negative": (3, -1e-9, "tilt_error"),
    "tilt beyond a right angle": (3, 1.6, "tilt_error"),
    "tilt nan": (3, math.nan, "tilt_error"),
    "tilt true": (3, True, "tilt_error"),
    "all friction lost": (4, 1.0, "friction_error"),
    "friction gained": (4, -0.1, "friction_error"),
    "two regions": (0, good_arguments()[0][:2], "three lists"),
    "an empty region": (0, [[], *good_arguments()[0][1:]], "three lists"),
    "no regions": (0, None, "three lists"),
    "no corners": (0, replaced_piece(p=[])[0], "corners"),
    "a corner in a plane": (0, replaced_piece(p=[[0.0, 0.0]])[0], "corners"),
    "a corner at infinity": (0, replaced_piece(p=[[math.inf, 0.0, 0.0]])[0], "not finite"),
    "a normal of length 2": (0, replaced_piece(n=[2.0, 0.0, 0.0])[0], "unit length"),
    "a normal of length 0": (0, replaced_piece(n=[0.0, 0.0, 0.0])[0], "unit length"),
    "a normal outward": (0, replaced_piece(n=[-1.0, 0.0, 0.0])[0], "may leave its cone"),
    "spread negative": (0, replaced_piece(spread=-1e-300)[0], "tan_spread"),
    "spread of everything": (0, replaced_piece(spread=1e300)[0], "leave no friction"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_what_is_spoilt_is_refused_with_a_reason(name):
    assert check_region(*good_arguments()).ok
    index, value, reason = SPOILT[name]
    arguments = good_arguments()
    arguments[index] = value
    check = check_region(*arguments)
    assert not check.ok
    assert reason in check.reason


@given(st.integers(0, 4), json_values)
def test_any_json_in_place_of_an_argument_is_answered_without_raising(index, value):
    arguments = good_arguments()
    arguments[index] = value
    assert isinstance(check_region(*arguments).ok, bool)
    piece = list(good_arguments()[0][1][0])
    piece[index % 3] = value
    arguments = good_arguments()
    arguments[0][1] = [piece]
    assert isinstance(check_region(*arguments).ok, bool)
    disc = [DISC, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.5]
    disc[index % 4] = value
    assert isinstance(contains_disc(*disc).ok, bool)


@pytest.mark.parametrize("scale", [1e-300, 1e-9, 1.0, 1e9, 1e150])
def test_a_square_contains_its_inscribed_disc_and_no_more(scale):
    corners, centre = [[scale * c for c in p] for p in DISC], [0.0, 0.0, 0.0]
    inner, n = math.sqrt(0.5) * scale, [1.0, 0.0, 0.0]
    assert contains_disc(corners, centre, n, inner * (1 - 1e-15)).ok
    assert not contains_disc(corners, centre, n, inner * (1 + 1e-15)).ok
    assert contains_disc(corners[::-1], centre, n, inner * (1 - 1e-15)).ok
    # Nearer to an edge by 0.1 sqrt(1/2).
    for radius, holds in ((0.63, True), (0.64, False)):
        assert contains_disc(corners, [0.0, 0.1 * scale, 0.0], n, radius * scale).ok is holds


@pytest.mark.parametrize(
    "corners",
    [
        [DISC[0], DISC[2], DISC[1], DISC[3]],
        DISC[:2],
        DISC[:1] * 4,
        [[0.01, 1.0, 0.0], *DISC[1:]],
        [[c + (k == 1) for k, c in enumerate(p)] for p in DISC],
    ],
    ids=["crossed", "segment", "point", "bent", "elsewhere"],
)
def test_what_winds_about_no_disc_contains_none(corners):
    assert not contains_disc(corners, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.1).ok


@pytest.mark.parametrize("radius", [0.0, 1e-13, 1e-9])
def test_corners_of_a_tiny_disc_may_be_off_its_plane_by_the_rounding_of_the_grasp(radius):
    size, width = 0.1, 2 * radius + 4e-12
    n = [0.6, 0.8, 0.0]
    # In the plane, square about the origin; then off the plane at one corner.
    corners = [
        [-0.8 * width * y, 0.6 * width * y, width * z]
        for y, z in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    for off, holds in ((0.9e-9, True), (1.1e-9, False)):
        corners[0][:2] = -0.8 * width + 0.6 * off, 0.6 * width + 0.8 * off
        assert contains_disc(corners, [0.0, 0.0, 0.0], n, radius, size).ok is holds
        assert not contains_disc(corners, [0.0, 0.0, 0.0], n, radius).ok


def test_a_disc_of_no_radius_is_a_point():
    n = [1.0, 0.0, 0.0]
    assert contains_disc([[1.0, 2.0, 3.0]], [1.0, 2.0, 3.0], n, 0.0).ok
    assert contains_disc(DISC, [0.0, 0.1, 0.1], n, 0.0).ok
    assert not contains_disc([[1.0, 2.0, 3.0]], [1.0, 2.0, 3.1], n, 0.0).ok
    assert not contains_disc(DISC, [0.0, 0.6, 0.6], n, 0.0).ok
    assert not contains_disc(DISC, [0.0, 0.0, 0.0], n, -0.1).ok


def stated_plan(**changes):
    p, n, mu = numbers(box_grasp())
    contacts = [
        {"p_BC": p_i, "nhat_TB_B": n_i, "mu": mu_i} for p_i, n_i, mu_i in zip(p, n, mu, strict=True)
    ]
    # y of contact 1, to the sides of a square as it is seen along each normal.
    offsets = [[0.0, -s, -s], [0.0, -s, s], [0.0, s, s], [0.0, s, -s]] if (s := 0.002) else []
    squares = [np.add(p_i, offsets).tolist() for p_i in p]
    squares[1:] = [square[::-1] for square in squares[1:]]
    region = {
        "placement_error": [0.00199] * 3,
        "tilt_error": 0.05,
        "friction_error": 0.1,
        "internal_force": BOX_X,
        "p_BV": squares,
    } | changes
    grasp = {"contacts": contacts, "certificate": {"internal_force": BOX_X}, "region": region}
    return json.dumps({"grasps": [grasp]})


def stated_pieces(normal):
    p, n, _ = numbers(box_grasp())
    pieces = [
        [{"p_BV": [p_i], "nhat_TB_B": n_i, "tan_spread": 0.01}]
        for p_i, n_i in zip(p, n, strict=True)
    ]
    pieces[1].append({"p_BV": [p[1]], "nhat_TB_B": normal})
    return pieces


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        (stated_plan(), 0, "margin 0.75; region holds"),
        (stated_plan(tilt_error=0.25), 1, "region does not hold: the force at contact 1 may leave"),
        (
            stated_plan(placement_error=[0.001, 0.0021, 0.001]),
            1,
            "contain the disc about contact 2",
        ),
        (stated_plan(pieces=stated_pieces([1.0, 0.0, 0.0])), 0, "region holds"),
        (
            stated_plan(pieces=stated_pieces([0.0, 1.0, 0.0])),
            1,
            "may leave its cone on its piece 2",
        ),
        (
            stated_plan(pieces=[[piece[0] | {"tan_spread": 0.0}] for piece in stated_pieces(None)]),
            1,
            "contain the disc about contact 1",
        ),
        (stated_plan(placement_error=[0.00199] * 2), 2, ""),
        (json.dumps({"grasps": [json.loads(stated_plan())["grasps"][0] | {"region": {}}]}), 2, ""),
        (stated_plan(p_BV=None), 2, ""),
        (stated_plan(pieces=[[{}]]), 2, ""),
    ],
)
def test_a_region_is_judged_with_its_grasp_by_the_file_alone(text, code, says):
    command = [sys.executable, "-I", "-S", exact.__file__]
    result = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert result.returncode == code, result.stderr
    assert says in result.stdout
    assert "Traceback" not in result.stderr
