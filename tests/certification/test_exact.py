"""The three-number certificate: what it proves, and that nothing spoilt passes it."""

from __future__ import annotations

import ast
import json
import math
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_polygrasp.certification import exact
from drake_polygrasp.certification.exact import (
    Check,
    attained_margin,
    check_and_margin,
    check_contacts,
    check_escaping_hinge,
    check_escaping_twist,
    check_force_closure,
)
from drake_polygrasp.grasp import Grasp
from tests.support.common import box_grasp, collinear_contacts, prism_grasp, random_contacts

BOX_X = [2.5, 2.5, -1.25]


def numbers(grasp: Grasp) -> tuple[list, list, list]:
    return grasp.p_BC.tolist(), grasp.nhat_TB_B.tolist(), grasp.mu.tolist()


def slanted(height: float) -> tuple[list, list]:
    """Contacts 2 and 3 whose forces for x = (1, 1, 0) make slopes of height / 2."""
    return [[1, 0, 0], [-1, height, 0], [-1, -height, 0]], [[-1, 0, 0], [1, 0, 0], [1, 0, 0]]


def test_the_example_box_holds_with_margin_three_quarters():
    assert check_force_closure(*numbers(box_grasp()), BOX_X).ok
    assert attained_margin(*numbers(box_grasp()), BOX_X) == pytest.approx(0.75, abs=1e-14)


def test_three_equal_normal_forces_have_margin_one():
    prism = numbers(prism_grasp())
    assert check_force_closure(*prism, [1.0, 1.0, 1.0]).ok
    assert attained_margin(*prism, [1.0, 1.0, 1.0]) == pytest.approx(1.0, abs=1e-12)


def test_the_margin_is_that_of_its_definition():
    p, n, mu = random_contacts(200, seed=1)
    for k, x in enumerate(np.random.default_rng(1).normal(size=(200, 3))):
        f = np.zeros((3, 3))
        for x_ij, (i, j) in zip(x, ((0, 1), (0, 2), (1, 2)), strict=True):
            f[i] += x_ij * (p[k, j] - p[k, i])
            f[j] -= x_ij * (p[k, j] - p[k, i])
        push = (n[k] * f).sum(axis=1)
        slip = np.linalg.norm(f - push[:, None] * n[k], axis=1)
        expected = (3 * (push - slip / mu[k]) / push.sum()).min() if push.sum() > 0 else -math.inf
        stated = attained_margin(p[k].tolist(), n[k].tolist(), mu[k].tolist(), x.tolist())
        assert stated == pytest.approx(expected, rel=1e-9)


def test_the_margin_is_positive_wherever_the_check_holds():
    p, n, mu = random_contacts(500, seed=2)
    for k, x in enumerate(np.random.default_rng(2).uniform(-0.2, 1, size=(500, 3))):
        contacts = p[k].tolist(), n[k].tolist(), mu[k].tolist(), x.tolist()
        if check_force_closure(*contacts).ok:
            assert attained_margin(*contacts) > 0


def test_a_proof_is_the_check_and_the_margin_at_once():
    p, n, mu = random_contacts(200, seed=3)
    grasps = [(*numbers(prism_grasp()), [1.0, 1.0, 1.0])]
    for k, x in enumerate(np.random.default_rng(3).uniform(-0.2, 1, size=(200, 3))):
        grasps.append((p[k].tolist(), n[k].tolist(), mu[k].tolist(), x.tolist()))
    for grasp in grasps:
        assert check_and_margin(*grasp) == (check_force_closure(*grasp), attained_margin(*grasp))
    refused = check_and_margin([[0.0] * 3] * 3, [[0.0, 0.0, 1.0]] * 3, [0.3] * 3, BOX_X)
    assert refused == (Check(False, "the contacts are collinear, or nearly so"), -math.inf)


def test_a_force_on_its_cone_is_refused_and_a_hair_inside_is_not():
    p, n = slanted(1.5)
    for hair, holds in ((0.0, False), (1e-9, False), (2e-9, True), (-1e-9, False)):
        mu = [0.3, 0.75 * (1 + hair), 1.0]
        assert check_force_closure(p, n, mu, [1.0, 1.0, 0.0]).ok is holds, hair


def test_a_normal_a_hair_too_long_is_refused():
    for length, holds in ((1 + 4e-10, True), (1 - 4e-10, True), (1 + 6e-10, False), (5.0, False)):
        p, n, mu = numbers(box_grasp())
        n[0] = [-length, 0.0, 0.0]
        assert check_force_closure(p, n, mu, BOX_X).ok is holds, length


def test_contacts_a_hair_from_collinear_are_refused():
    for height, holds in ((0.00201, True), (0.00199, False), (0.0, False)):
        p = [[0.0, height, 0.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
        check = check_contacts(p, numbers(box_grasp())[1], [1.0, 1.0, 1.0])
        assert check.ok is holds, height
        assert holds or "collinear" in check.reason


def test_collinear_contacts_turned_in_floating_point_never_pass():
    p, n, mu = collinear_contacts(300)
    for k in range(len(p)):
        assert not check_contacts(p[k].tolist(), n[k].tolist(), mu[k].tolist()).ok


@pytest.mark.parametrize("scale", [1e-300, 1e-9, 1e-2, 50.0, 1e9, 1e300])
def test_the_unit_of_length_does_not_matter(scale):
    p, n, mu = numbers(box_grasp())
    p = [[scale * c for c in row] for row in p]
    assert check_force_closure(p, n, mu, BOX_X).ok
    assert attained_margin(p, n, mu, BOX_X) == pytest.approx(0.75, abs=1e-12)
    assert not check_force_closure(p, n, mu, [-x for x in BOX_X]).ok


SPOILT = {
    "internal force negated": (3, [-2.5, -2.5, 1.25]),
    "internal force zero": (3, [0.0, 0.0, 0.0]),
    "x nan": (3, [2.5, math.nan, -1.25]),
    "x of two": (3, [2.5, 2.5]),
    "x of text": (3, ["2.5", "2.5", "-1.25"]),
    "mu negative": (2, [0.3, -0.3, 0.3]),
    "mu zero": (2, [0.0, 0.3, 0.3]),
    "mu nan": (2, [math.nan, 0.3, 0.3]),
    "mu infinite": (2, [math.inf, 0.3, 0.3]),
    "mu true": (2, [True, 0.3, 0.3]),
    "mu a number": (2, 0.3),
    "mu too large for a double": (2, [10**400, 0.3, 0.3]),
    "two points": (0, [[0.05, 0, 0], [-0.05, 0.02, 0]]),
    "a point in a plane": (0, [[0.05, 0], [-0.05, 0.02], [-0.05, -0.02]]),
    "points in one": (0, [[0.0, 0.0, 0.0]] * 3),
    "points in a dictionary": (0, {0: [0.05, 0, 0], 1: [-0.05, 0.02, 0], 2: [-0.05, -0.02, 0]}),
    "no points": (0, None),
    "normals outward": (1, [[1, 0, 0], [-1, 0, 0], [-1, 0, 0]]),
    "normals zero": (1, [[0, 0, 0]] * 3),
    "normals tiny": (1, [[-5e-324, 0, 0], [5e-324, 0, 0], [5e-324, 0, 0]]),
}


@pytest.mark.parametrize("name", SPOILT)
def test_what_is_spoilt_is_refused_with_a_reason(name):
    index, value = SPOILT[name]
    arguments = [*numbers(box_grasp()), BOX_X]
    arguments[index] = value
    check = check_force_closure(*arguments)
    assert not check.ok
    assert check.reason
    assert not attained_margin(*arguments) > 0


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=2), inner),
    max_leaves=12,
)
rows = st.lists(st.floats() | st.integers(), min_size=3, max_size=3)


@given(st.integers(0, 3), json_values)
def test_any_json_in_place_of_an_argument_is_answered_without_raising(index, value):
    arguments = [*numbers(box_grasp()), BOX_X]
    arguments[index] = value
    check = check_force_closure(*arguments)
    margin = attained_margin(*arguments)
    assert check.ok <= (margin > 0)
    assert check_escaping_twist(*arguments[:3], [0, 0, 0], [0, 0, 0]).ok is False
    assert check_escaping_hinge(*arguments[:3], value).ok is False or index < 3


@given(st.lists(rows, min_size=3, max_size=3), rows, rows)
def test_whatever_holds_balances_and_lies_in_the_cones(p, mu, x):
    n = numbers(box_grasp())[1]
    if not check_force_closure(p, n, mu, x).ok:
        return
    p_, x_ = [[Fraction(float(c)) for c in row] for row in p], [Fraction(float(c)) for c in x]
    force = dict(zip(((0, 1), (0, 2), (1, 2)), x_, strict=True))
    for i in range(3):
        f_i = [
            sum(force[min(i, j), max(i, j)] * (p_[j][c] - p_[i][c]) for j in range(3) if j != i)
            for c in range(3)
        ]
        push = sum(a * int(b) for a, b in zip(f_i, n[i], strict=True))
        assert push > 0
        assert sum(c * c for c in f_i) - push**2 < (Fraction(float(mu[i])) * push) ** 2


twists = st.lists(st.floats(-1, 1), min_size=6, max_size=6)


@given(twists)
def test_no_twist_escapes_a_grasp_that_holds(twist):
    for grasp in (box_grasp(), prism_grasp()):
        assert not check_escaping_twist(*numbers(grasp), twist[:3], twist[3:]).ok


def test_no_hinge_escapes_a_grasp_that_holds():
    for i in range(3):
        for j in range(3):
            assert not check_escaping_hinge(*numbers(box_grasp()), (i, j)).ok


def test_contacts_on_one_face_let_the_object_go_along_their_normal():
    p, _, mu = numbers(box_grasp())
    n = [[1.0, 0.0, 0.0]] * 3
    assert check_escaping_twist(p, n, mu, [1e-300, 0.0, 0.0], [0.0, 0.0, 0.0]).ok
    assert not check_escaping_twist(p, n, mu, [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]).ok
    assert not check_escaping_twist(p, n, mu, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]).ok


def test_an_object_between_two_contacts_turns_about_their_line():
    # The third contact pushes along the contact plane's normal: it can only turn the object.
    p = [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0], [0.0, 0.3, 0.0]]
    n = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    mu = [0.3] * 3
    assert check_escaping_hinge(p, n, mu, (1, 0)).ok
    assert not check_escaping_hinge(p, n, mu, (0, 1)).ok
    assert check_escaping_twist(p, n, mu, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]).ok


def plan(*internal_forces: list) -> str:
    p, n, mu = numbers(box_grasp())
    contacts = [
        {"p_BC": p_i, "nhat_TB_B": n_i, "mu": mu_i} for p_i, n_i, mu_i in zip(p, n, mu, strict=True)
    ]
    grasps = [{"contacts": contacts, "certificate": {"internal_force": x}} for x in internal_forces]
    return json.dumps({"model": "box.sdf", "grasps": grasps})


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        (plan(BOX_X), 0, "grasp 1: holds, margin 0.75"),
        (plan(BOX_X, [-1.0, -1.0, 1.0]), 1, "grasp 2: does not hold: the force at contact 1"),
        (plan(), 1, ""),
        ("{", 2, ""),
        ("[]", 2, ""),
        ('{"grasps": [{"contacts": 3}]}', 2, ""),
        ("[" * 100000, 2, ""),
    ],
)
def test_it_runs_alone_on_a_plan(text, code, says):
    # -I -S: neither this package nor site-packages can be imported.
    command = [sys.executable, "-I", "-S", exact.__file__]
    result = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert result.returncode == code, result.stderr
    assert says in result.stdout
    assert "Traceback" not in result.stderr


def test_a_reader_that_leaves_early_sees_no_traceback():
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-I", "-S", exact.__file__]
    run = {"input": plan(BOX_X), "stdout": writer, "stderr": subprocess.PIPE, "text": True}
    result = subprocess.run(command, check=False, **run)
    os.close(writer)
    assert (result.returncode, result.stderr) == (1, "")


def test_it_imports_the_standard_library_alone():
    tree = ast.parse(Path(exact.__file__).read_text())
    modules = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [
        a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names
    ]
    assert all(module.split(".")[0] in sys.stdlib_module_names for module in modules)
