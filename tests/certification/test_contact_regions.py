"""The best internal force for regions of contacts, and what its certificate promises."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.certification.contact_regions import (
    CertifiedRegions,
    DiscPolygon,
    certify_regions,
    largest_certified_radius,
)
from drake_polygrasp.certification.exact import check_region, contains_disc
from drake_polygrasp.certification.region_search import RegionClaim, find_common_forces
from drake_polygrasp.wrenches.contacts import force_closure
from tests.support.common import box_grasp, prism_grasp, random_contacts, random_rotations


def is_proved(certificate: CertifiedRegions, mu, wider: float = 1.0) -> bool:
    regions = [
        [
            (
                (piece.p_BV.mean(axis=0) + wider * (piece.p_BV - piece.p_BV.mean(axis=0))).tolist(),
                piece.nhat_TB_B.tolist(),
                piece.tan_spread,
            )
            for piece in region
        ]
        for region in certificate.regions
    ]
    errors = certificate.tilt_error, certificate.friction_error
    return check_region(regions, mu.tolist(), certificate.internal_force.tolist(), *errors).ok


def grasps_that_hold():
    p, n, mu = random_contacts(60, seed=11, mu=(0.4, 1.0))
    holds = force_closure(p, n, mu)
    return [(p[k], n[k], mu[k]) for k in np.flatnonzero(holds)]


def test_the_discs_of_three_contacts_on_a_prism_are_those_of_the_closed_form():
    # By symmetry x is (1, 1, 1): f_1 = c_2 + c_3 - 2 c_1, so that discs of radius r, seen from
    # above, lead to a slope of at most mu, with contact 1 at one end and the others at theirs.
    grasp = prism_grasp(mu=0.5, radius=1.0)
    found = largest_certified_radius(
        grasp.p_BC, grasp.nhat_TB_B, grasp.mu, np.full(3, 1.0), size=2.0
    )
    assert found is not None
    n, angle = grasp.nhat_TB_B, np.linspace(0, 2 * np.pi, 2001)
    across = np.stack([np.cross([0, 0, 1.0], n[0]), np.array([0, 0, 1.0])])
    u = 0.5 * n[0] + np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    sideways = [np.linalg.norm(u - (u @ n_k)[:, None] * n_k, axis=1) for n_k in n]
    best = (0.5 * 3.0 / (2 * sideways[0] + sideways[1] + sideways[2])).min()
    # The polygon's corners are 0.9 percent beyond the disc.
    assert 0.985 * best < found.placement_error.min() <= best
    share = found.internal_force / found.internal_force.mean()
    assert np.abs(share - 1).max() < 0.02


def test_every_certificate_is_exact_contains_its_discs_and_is_near_the_largest():
    found = [
        (grasp, largest_certified_radius(*grasp, np.full(3, 1.0), size=2.0))
        for grasp in grasps_that_hold()
    ]
    assert sum(certificate is not None for _, certificate in found) >= 0.9 * len(found) >= 5
    for (p, n, mu), certificate in found:
        if certificate is None:
            continue
        assert is_proved(certificate, mu)
        assert not is_proved(certificate, mu, wider=1.1)
        for i, (piece,) in enumerate(certificate.regions):
            radius = certificate.placement_error[i]
            disc = piece.p_BV.tolist(), p[i].tolist(), n[i].tolist()
            assert contains_disc(*disc, radius).ok
            assert not contains_disc(*disc, 1.1 * radius).ok


def test_no_other_internal_force_bears_discs_that_are_much_larger():
    rng = np.random.default_rng(3)
    for p, n, mu in grasps_that_hold():
        found = largest_certified_radius(p, n, mu, np.full(3, 1.0), size=2.0)
        if found is None:
            continue
        x = found.internal_force
        for width in (0.003, 0.03, 0.3):
            for _ in range(30):
                other = x + width * np.abs(x).max() * rng.normal(size=3)
                rival = CertifiedRegions(other, found.regions, x, 0.0, 0.0)
                assert not is_proved(rival, mu, wider=1.01)


@pytest.mark.parametrize(("tilt", "loss"), [(0.0, 0.0), (0.05, 0.1)])
def test_placements_tilts_and_friction_within_a_certificate_never_fail(tilt, loss):
    rng = np.random.default_rng(4)
    for p, n, mu in grasps_that_hold():
        found = largest_certified_radius(
            p, n, mu, np.array([1.0, 0.7, 0.5]), size=2.0, tilt_error=tilt, friction_error=loss
        )
        if found is None:
            continue
        count = 400
        corners = [region[0].p_BV for region in found.regions]
        share = rng.dirichlet(np.full(24, 0.1), (count, 3))
        share[: count // 2] = np.eye(24)[rng.integers(0, 24, (count // 2, 3))]
        places = np.stack([share[:, i] @ corners[i] for i in range(3)], axis=1)
        across = np.cross(rng.normal(size=(count, 3, 3)), n)
        across /= np.linalg.norm(across, axis=-1, keepdims=True)
        normals = n * np.cos(tilt) + across * np.sin(tilt)
        assert force_closure(places, normals, np.tile((1 - loss) * mu, (count, 1))).all()


def test_the_frame_and_the_order_do_not_matter():
    p, n, mu = grasps_that_hold()[0]
    first = largest_certified_radius(p, n, mu, np.full(3, 1.0), size=2.0)
    assert first is not None
    for R in random_rotations(5, np.random.default_rng(2)):
        order = [2, 0, 1]
        turned = largest_certified_radius(
            (p @ R.T)[order], (n @ R.T)[order], mu[order], np.full(3, 1.0), size=2.0
        )
        assert turned is not None
        assert turned.placement_error == pytest.approx(first.placement_error, rel=3e-3)


def test_radii_no_larger_than_asked_for_are_certified_as_they_are():
    grasp = box_grasp()
    found = largest_certified_radius(
        grasp.p_BC, grasp.nhat_TB_B, grasp.mu, np.array([1e-3, 2e-3, 1e-3]), size=0.25
    )
    assert found is not None
    assert found.placement_error == pytest.approx([1e-3, 2e-3, 1e-3], rel=1e-3)


def pieces_about(p, n, radius: float, num: int, lean: float, spread: float):
    """Squares about a contact, with normals that lean in turn to all sides."""
    first = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    first /= np.linalg.norm(first)
    second = np.cross(n, first)
    square = p + radius * np.array([first, second, -first, -second])
    turned = [
        n + lean * (np.cos(a) * first + np.sin(a) * second)
        for a in 2 * np.pi * np.arange(num) / num
    ]
    return [DiscPolygon(square, t / np.linalg.norm(t), spread) for t in turned]


@pytest.mark.parametrize(("lean", "spread", "holds"), [(0.1, 0.05, True), (0.1, 0.5, False)])
def test_regions_of_many_pieces_and_curved_ones_are_proved_with_one_force(lean, spread, holds):
    grasp = prism_grasp(mu=0.5, radius=1.0)
    contacts = grasp.p_BC, grasp.nhat_TB_B, grasp.mu
    regions = [
        pieces_about(p, n, 0.05, 8, lean, spread) for p, n in zip(*contacts[:2], strict=True)
    ]
    (found,) = certify_regions([RegionClaim(*contacts, regions, np.full(3, 0.03), 0.05, 0.1)])
    assert (found is not None) is holds
    assert found is None or is_proved(found, grasp.mu)


@pytest.mark.parametrize("as_scale", [False, True])
def test_grasps_searched_together_get_what_each_gets_alone(as_scale):
    rng = np.random.default_rng(3)
    claims = []
    for p, n, mu in zip(*random_contacts(60, seed=5, mu=(0.5, 1.0)), strict=True):
        sizes = rng.choice([1, 1, 1, 2, 9], 3)
        regions = [
            pieces_about(p_i, n_i, 0.03, size, 0.02, 0.01)
            for p_i, n_i, size in zip(p, n, sizes, strict=True)
        ]
        errors = rng.choice([0.0, 0.05, 2.0], p=[0.4, 0.5, 0.1]), rng.choice([0.0, 0.2])
        claims.append(RegionClaim(p, n, mu, regions, np.full(3, 0.02), *errors))
    alone = [find_common_forces([claim], as_scale=as_scale)[0] for claim in claims]
    assert 5 < sum(found is not None for found in alone) < 40
    for found, expected in zip(find_common_forces(claims, as_scale=as_scale), alone, strict=True):
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert found[0].tolist() == expected[0].tolist()
            assert found[1] == expected[1]
    assert find_common_forces([], as_scale=as_scale) == []


def test_errors_that_leave_no_friction_have_no_certificate():
    grasp = box_grasp()
    for tilt, loss in ((0.3, 0.0), (0.0, 1.0), (2.0, 0.0), (-0.1, 0.0), (np.nan, 0.0)):
        assert (
            largest_certified_radius(
                grasp.p_BC,
                grasp.nhat_TB_B,
                grasp.mu,
                np.full(3, 1e-3),
                size=0.25,
                tilt_error=tilt,
                friction_error=loss,
            )
            is None
        )
