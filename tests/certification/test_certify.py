"""Verdicts and certificates: what holds is proved, what does not is explained."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from drake_polygrasp.certification.certify import (
    Proof,
    ProvedGrasp,
    certify_proved,
    prove,
    prove_any,
    prove_many,
)
from drake_polygrasp.certification.convex import friction_at
from drake_polygrasp.certification.exact import attained_margin, check_force_closure
from drake_polygrasp.grasp import CertifiedGrasp, Grasp, Verdict
from drake_polygrasp.wrenches.contacts import force_closure
from tests.support.common import (
    RHO_BOX,
    box_grasp,
    certified_grasp,
    collinear_contacts,
    grasp,
    lattice_contacts,
    prism_grasp,
    random_contacts,
    wedge_grasp,
)
from tests.support.lp_judge import is_force_closure


def certify_box(box: Grasp, mass: float | None = 1.0) -> CertifiedGrasp:
    return certified_grasp(box, mass, RHO_BOX, np.zeros(3), edge_distance=0.03)


def test_the_example_is_certified_with_its_figures():
    certified = certify_box(box_grasp())
    assert isinstance(certified, CertifiedGrasp)
    certificate = certified.certificate
    np.testing.assert_allclose(certificate.internal_force, [2.5, 2.5, -1.25], rtol=1e-12)
    np.testing.assert_allclose(certificate.mu_min_internal_force, [2.5, 2.5, -1.25], rtol=1e-6)
    assert certificate.margin == pytest.approx(0.75, abs=1e-12)
    assert certificate.mu_min == 0.0
    assert certificate.epsilon_lower == pytest.approx(0.02440, abs=5e-6)
    assert certificate.epsilon_upper == pytest.approx(0.02484, abs=5e-6)
    assert certificate.placement_tolerance == pytest.approx(0.00286, abs=5e-6)
    assert 34.1 < certificate.squeeze_force <= 34.7


def test_a_certificate_is_of_plain_numbers_and_read_only_arrays():
    certificate = certify_box(box_grasp()).certificate
    for field in dataclasses.fields(certificate):
        value = getattr(certificate, field.name)
        if isinstance(value, np.ndarray):
            assert not value.flags.writeable
        else:
            assert type(value) is float, field.name


def test_without_a_mass_there_is_no_squeeze_force():
    assert certify_box(box_grasp(), mass=None).certificate.squeeze_force is None


def test_a_certificate_repeats_to_the_last_bit():
    first, second = (certify_box(wedge_grasp(0.2, 0.3)).certificate for _ in range(2))
    for field in dataclasses.fields(first):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))


def test_a_grasp_that_fails_is_never_certified():
    for bad in (wedge_grasp(0.5, 0.3), grasp(np.zeros((3, 3)), box_grasp().nhat_TB_B, 0.3)):
        proof = prove(bad)
        assert isinstance(proof, Proof)
        assert proof.verdict is Verdict.FAILS
        assert proof.reason
        assert proof.internal_force is None
        with pytest.raises(AssertionError):
            certify_proved([ProvedGrasp(bad, proof)], mass=1.0, p_BBcm=np.zeros(3), rho=RHO_BOX)


@pytest.mark.parametrize("prove_all", [prove_many, prove_any])
def test_proofs_agree_with_the_closed_form_and_each_with_its_evidence(prove_all):
    contacts = random_contacts(1500, seed=1)
    closed = force_closure(*contacts)
    for k, proof in enumerate(prove_all(*contacts)):
        numbers = tuple(values[k].tolist() for values in contacts)
        assert (proof.verdict is Verdict.HOLDS) == closed[k]
        if closed[k]:
            assert check_force_closure(*numbers, proof.internal_force.tolist()).ok
            margin = attained_margin(*numbers, proof.internal_force.tolist())
            assert margin - 1e-11 < proof.margin <= margin
            assert 0 < proof.margin <= 1
        else:
            assert proof.verdict is Verdict.FAILS
            assert proof.escape is not None or "collinear" in proof.reason


def test_lattice_contacts_are_proved_or_refuted_unless_they_lie_on_the_boundary():
    contacts = lattice_contacts(1500, seed=1)
    for k, proof in enumerate(prove_many(*contacts)):
        p, n, mu = (values[k] for values in contacts)
        if proof.verdict is Verdict.HOLDS:
            assert is_force_closure(p, n, mu, around=True)
            assert force_closure(p[None], n[None], mu[None])[0]
        if proof.verdict is Verdict.UNDECIDED:
            # A little more friction decides it, a little less too.
            more, less = (
                prove_many(p[None], n[None], factor * mu[None])[0].verdict
                for factor in (1.001, 0.999)
            )
            assert less is Verdict.FAILS
            assert more is not Verdict.UNDECIDED


def test_any_proof_gives_the_verdict_of_the_best():
    contacts = lattice_contacts(1500, seed=1)
    verdicts = [[proof.verdict for proof in each(*contacts)] for each in (prove_any, prove_many)]
    assert verdicts[0] == verdicts[1]


def test_few_lattice_contacts_are_undecided():
    verdicts = [proof.verdict for proof in prove_many(*lattice_contacts(1500, seed=1))]
    assert verdicts.count(Verdict.UNDECIDED) < 0.01 * len(verdicts)
    assert verdicts.count(Verdict.HOLDS) > 0.01 * len(verdicts)


def test_collinear_contacts_turned_in_floating_point_do_not_hold():
    for proof in prove_many(*collinear_contacts(200)):
        assert proof.verdict is Verdict.FAILS
        assert "collinear" in proof.reason


def test_friction_on_the_boundary_never_holds():
    for phi in (0.1, 0.2, 0.5):
        assert prove(wedge_grasp(phi, np.tan(phi))).verdict is not Verdict.HOLDS
        assert prove(wedge_grasp(phi, np.tan(phi) * (1 - 1e-6))).verdict is Verdict.FAILS
        assert prove(wedge_grasp(phi, np.tan(phi) * (1 + 1e-6))).verdict is Verdict.HOLDS


@pytest.mark.parametrize("prove_all", [prove_many, prove_any])
@pytest.mark.parametrize("value", [np.nan, np.inf, -0.3, 0.0])
def test_numbers_that_are_none_do_not_hold_and_do_not_spoil_their_neighbours(value, prove_all):
    p, n, mu = (np.array([values] * 3) for values in arrays_of(box_grasp()))
    mu[1, 2] = value
    verdicts = [proof.verdict for proof in prove_all(p, n, mu)]
    assert verdicts == [Verdict.HOLDS, Verdict.FAILS, Verdict.HOLDS]


def arrays_of(grasp_: Grasp) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return grasp_.p_BC, grasp_.nhat_TB_B, grasp_.mu


@pytest.mark.parametrize("scale", [1e-3, 1.0, 100.0])
def test_size_does_not_matter(scale):
    for small in (box_grasp(), prism_grasp(), wedge_grasp(0.2, 0.3)):
        proof = prove(dataclasses.replace(small, p_BC=scale * small.p_BC))
        assert proof.verdict is Verdict.HOLDS
        assert proof.margin == pytest.approx(prove(small).margin, rel=1e-6)


def test_a_contact_moved_or_a_normal_tilted_too_far_is_refused():
    x = prove(box_grasp()).internal_force.tolist()
    p, n, mu = (values.tolist() for values in arrays_of(box_grasp(0.01)))
    assert check_force_closure(p, n, mu, x).ok
    p[1][1] += 0.01
    assert not check_force_closure(p, n, mu, x).ok
    p[1][1] -= 0.01
    n[0] = [-np.cos(0.011), np.sin(0.011), 0.0]
    assert not check_force_closure(p, n, mu, x).ok


def test_the_least_friction_of_a_certificate_has_its_witness():
    wedge = wedge_grasp(0.2, 0.3)
    certificate = certify_box(wedge).certificate
    lowered = friction_at(wedge.mu, certificate.mu_min).tolist()
    witness = certificate.mu_min_internal_force.tolist()
    assert check_force_closure(wedge.p_BC.tolist(), wedge.nhat_TB_B.tolist(), lowered, witness).ok


def test_the_exact_check_is_imported_without_drake_or_numpy():
    code = (
        "import sys; import drake_polygrasp.certification.exact; "
        "assert not {'pydrake', 'numpy'} & set(sys.modules), sorted(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
