"""Bounds over whole sets of faces are bounds, and order the sets as comparing all of them does."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.peers import random_triples, surface_of
from drake_polygrasp.arrays import Ints
from drake_polygrasp.certification.robustness import epsilon_interval
from drake_polygrasp.geometry.face_sets import all_sets
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.orientation import friction_angle, opposes, pair_opposes, sets_oppose
from drake_polygrasp.search.set_bounds import promising_sets, region_support
from drake_polygrasp.search.triples import NO_TRIPLES, Triples
from drake_polygrasp.wrenches.contacts import force_closure
from tests.support.convex_polyhedra import ellipsoid_hull, holed_prism
from tests.support.solids import cube, solid


@pytest.mark.parametrize("mu", [0.2, 0.6])
def test_no_contacts_on_a_set_of_faces_beat_its_bound(mu: float) -> None:
    object_ = solid(ellipsoid_hull(12, 3), mu=mu)
    regions, scale = erode(object_.polyhedron), (object_.p_BBcm, object_.rho)
    drawn = random_triples(surface_of(regions), 20_000, np.random.default_rng(1))
    drawn = drawn.take(np.flatnonzero(force_closure(*drawn.contacts))[:40])
    assert len(drawn.mu) == 40
    H = region_support(regions, Triples(drawn.region, drawn.p_BC), *scale)
    bound = H[drawn.region].max(axis=1).min(axis=1)
    for k in range(40):
        p_BC, nhat_TB_B, mu_k = (values[k] for values in drawn.contacts)
        epsilon = epsilon_interval(p_BC, nhat_TB_B, mu_k, *scale)
        assert epsilon.lower <= bound[k] * (1 + 1e-5)  # single precision


def opposing_sets(object_: GraspObject) -> Ints:
    regions = erode(object_.polyhedron)
    nhat, mu = regions.nhat_TB_B, regions.mu
    sets = all_sets(len(regions.face))
    threes, twos = sets[sets[:, 2] >= 0], sets[sets[:, 2] < 0][:, :2]
    holds = np.append(
        opposes(nhat[threes], friction_angle(mu[threes])),
        pair_opposes(nhat[twos], friction_angle(mu[twos])),
    )
    return sets[holds]


@pytest.mark.parametrize("object_", [solid(holed_prism(7, 1, 2)), solid(ellipsoid_hull(14, 1))])
def test_promising_sets_are_those_of_greatest_bound_greatest_first(object_: GraspObject) -> None:
    regions, scale = erode(object_.polyhedron), (object_.p_BBcm, object_.rho)
    H = region_support(regions, NO_TRIPLES, *scale)

    def bound(sets: Ints) -> list[float]:
        return [float(H[[r for r in s if r >= 0]].max(axis=0).min()) for s in sets.tolist()]

    sets = opposing_sets(object_)
    found = promising_sets(
        regions, NO_TRIPLES, *scale, above=-1.0, most=len(sets) + 1000, opposing=sets_oppose
    )
    assert sorted(found.tolist()) == sorted(sets.tolist())
    assert bound(found) == pytest.approx(sorted(bound(sets), reverse=True), abs=2e-5)
    middle = float(np.median(bound(sets)))
    above = promising_sets(
        regions, NO_TRIPLES, *scale, above=middle, most=10_000, opposing=sets_oppose
    )
    assert above.tolist() == found[: len(above)].tolist()
    assert min(bound(above)) > middle - 2e-5
    assert max(bound(found[len(above) :])) < middle + 2e-5
    few = promising_sets(regions, NO_TRIPLES, *scale, above=-1.0, most=40, opposing=sets_oppose)
    assert few.tolist() == found[:40].tolist()


def test_on_a_cube_only_sets_with_two_opposite_faces_can_hold() -> None:
    box = cube()
    regions = erode(box.polyhedron)
    found = promising_sets(
        regions, NO_TRIPLES, box.p_BBcm, box.rho, above=0.0, most=100, opposing=sets_oppose
    )
    assert len(found) == 12 + 3
    for faces in found.tolist():
        nhat = regions.nhat_TB_B[[r for r in faces if r >= 0]]
        assert (nhat @ nhat.T).min() == pytest.approx(-1.0)
