"""Proofs of bounds over regions, checked in exact arithmetic, and refused once they are changed."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp.certification import exact_cycle
from drake_polygrasp.certification.exact_cycle import RefusedError, check_region_proof
from drake_polygrasp.region_bounds.region_epsilon import region_epsilon
from drake_polygrasp.region_bounds.region_proof import stated_proof
from drake_polygrasp.region_bounds.region_task import RegionTask
from tests.region_bounds.test_region_epsilon import grasps_that_hold, leaning_pieces, polygons

ERRORS = {"tilt_error": 0.05, "friction_error": 0.1, "com_error": 0.02}


def proof_of(regions, mu, errors, mass=None):
    p_BBcm = np.array([0.01, -0.02, 0.03])
    task = RegionTask(regions, mu, p_BBcm, 1.1, mass=mass, **errors)
    found = region_epsilon(task)
    assert found.epsilon_lower > 0
    stated = stated_proof(found.proof, task)
    return json.loads(json.dumps(stated))


@pytest.fixture(scope="module")
def proof():
    p, n, mu = grasps_that_hold()[0]
    return proof_of(polygons(p, n, 0.02), mu, ERRORS, mass=1.0)


def test_every_bound_has_a_proof_that_holds(proof):
    check_region_proof(proof)
    assert proof["epsilon"]["bound"] < proof["weight"]["bound"]
    for p, n, mu in grasps_that_hold()[1:3]:
        for errors in ({}, ERRORS):
            check_region_proof(proof_of(polygons(p, n, 0.03), mu, errors))
    p, n, mu = grasps_that_hold()[0]
    check_region_proof(proof_of(leaning_pieces(p, n, 0.02, 0.03, 0.02), mu, ERRORS))


def missing_simplex(claim, _):
    del claim["simplices"][3], claim["twists"][3]


def raised_bound(claim, _):
    claim["bound"] *= 1.1


def no_simplices(claim, _):
    claim["simplices"], claim["twists"] = [], []


def twice_the_surface(claim, _):
    claim["simplices"] += claim["simplices"]
    claim["twists"] += claim["twists"]


def reversed_twist(claim, _):
    claim["twists"][0] = [-x for x in claim["twists"][0]]


def zero_twist(claim, _):
    claim["twists"][0] = [0.0] * 6


def repeated_generator(claim, _):
    claim["simplices"][0][1] = claim["simplices"][0][0]


def unknown_generator(claim, _):
    claim["simplices"][0][5] = 10**6


def force_outside_its_cone(_, proof):
    force, nhat = proof["generators"][0]["force"][0], proof["regions"][0][0]["nhat_TB_B"]
    across = np.array(force) - np.dot(force, nhat) * np.array(nhat)
    proof["generators"][0]["force"][0] = (np.array(force) + 0.01 * across).tolist()


def force_that_is_too_long(_, proof):
    proof["generators"][0]["force"][0] = [1.01 * x for x in proof["generators"][0]["force"][0]]


def wider_region(_, proof):
    piece = proof["regions"][1][0]
    middle = np.mean(piece["p_BV"], axis=0)
    piece["p_BV"] = (middle + 1.5 * (np.array(piece["p_BV"]) - middle)).tolist()


def greater_tilt(_, proof):
    proof["tilt_error"] *= 1.1


def less_friction(_, proof):
    proof["friction_error"] *= 1.1


def worse_centre_of_mass(_, proof):
    proof["com_error"] *= 3.0


def curved_surface(_, proof):
    proof["regions"][2][0]["tan_spread"] = 0.01


def another_contact(_, proof):
    proof["generators"][0]["contact"] = 1


def not_a_number(_, proof):
    proof["rho"] = float("nan")


def nothing_claimed(_, proof):
    proof["epsilon"] = proof["weight"] = None


def missing_key(_, proof):
    del proof["mu"]


CHANGES = [
    *(missing_simplex, raised_bound, no_simplices, twice_the_surface, reversed_twist, zero_twist),
    *(repeated_generator, unknown_generator, force_outside_its_cone, force_that_is_too_long),
    *(wider_region, greater_tilt, less_friction, worse_centre_of_mass, curved_surface),
    *(another_contact, not_a_number, nothing_claimed, missing_key),
]


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
@pytest.mark.parametrize("name", ["epsilon", "weight"])
def test_a_changed_proof_is_refused(proof, change, name):
    changed = copy.deepcopy(proof)
    # The other claim alone would be refused too.
    changed["weight" if name == "epsilon" else "epsilon"] = None
    check_region_proof(changed)
    change(changed[name], changed)
    with pytest.raises(RefusedError):
        check_region_proof(changed)


def octahedral_proof(bound: float):
    """A made-up surface that is closed but not around the origin: both sides of one simplex."""
    p, n, mu = grasps_that_hold()[0]
    proof = proof_of(polygons(p, n, 0.0), mu, {})
    claim = proof["epsilon"]
    claim["simplices"] = [claim["simplices"][0]] * 2
    claim["twists"] = [claim["twists"][0]] * 2
    claim["bound"] = bound
    return proof


def test_a_surface_that_is_met_an_even_number_of_times_is_refused():
    with pytest.raises(RefusedError, match="around"):
        check_region_proof(octahedral_proof(1e-6))


def test_it_runs_alone(proof, tmp_path):
    lone = tmp_path / "exact_cycle.py"
    lone.write_text(Path(exact_cycle.__file__).read_text())
    changed = copy.deepcopy(proof)
    raised_bound(changed["epsilon"], changed)
    expected = {"holds": ([proof], 0), "does not hold": ([proof, changed], 1)}
    for words, (proofs, code) in expected.items():
        file = tmp_path / "proof.json"
        file.write_text(json.dumps({"region_proofs": proofs}))
        result = subprocess.run(
            [sys.executable, "-I", str(lone), str(file)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert result.returncode == code and words in result.stdout.splitlines()[-1]
    for text in ("", "[]", "{}"):
        file.write_text(text)
        assert exact_cycle.main([str(file)]) == 2
    assert exact_cycle.main([]) == 2
