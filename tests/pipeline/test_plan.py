"""What planning beyond the paper returns: proved, in its place, different, and accounted for."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import comb
from typing import Any

import numpy as np
import pytest
import shapely

from benchmarks import measure
from benchmarks.peers import random_triples
from drake_polygrasp import UsageError
from drake_polygrasp.certification import exact
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.geometry.surface_contact import edge_distance, fingertip_fits
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.reasons import unplanned
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.pipeline import judging, proposals, request
from drake_polygrasp.pipeline.candidates import project_candidates
from drake_polygrasp.pipeline.explain import explain_sets
from drake_polygrasp.pipeline.plan import GraspPlan
from drake_polygrasp.search.triples import Triples
from drake_polygrasp.settings import NO_ERRORS, TIP_RADIUS, PlanOptions, Steps
from drake_polygrasp.wrenches.epsilon_bound import FEW_ANGLES, epsilon_upper_bound
from tests.support.convex_polyhedra import holed_prism, prism, tangent_polyhedron
from tests.support.lp_judge import is_force_closure
from tests.support.planned import exact_plan
from tests.support.solids import cube, regular_prism, solid

CHANNEL = shapely.box(0, 0, 0.1, 0.08) - shapely.box(0.03, 0.03, 0.07, 0.09)
OBJECTS = {
    "cube": cube(),
    "octagonal prism": regular_prism(8, mu=0.5),
    "channel": solid(prism(CHANNEL, 0.04)),
    "holed prism": solid(holed_prism(6, 1, 1)),
    "many faces": solid(tangent_polyhedron(45, 1)),
}
every_object = pytest.mark.parametrize("name", OBJECTS)
every_effort = pytest.mark.parametrize("effort", ["all", "quick"])
STEPS = {
    "none": Steps(spread=False, search=False, improve=False),
    "spread": Steps(search=False, improve=False),
    "search": Steps(improve=False),
    "improve": Steps(search=False),
    "all": Steps(),
}


@cache
def plan(name: str, how: str = "all") -> GraspPlan:
    if how == "quick":
        return exact_plan(OBJECTS[name], effort="quick")
    return exact_plan(OBJECTS[name], steps=STEPS[how])


def request_of(object_: GraspObject) -> request.PlanRequest:
    return request.make_request(object_, PlanOptions(**NO_ERRORS))


def best(plan_: GraspPlan) -> float:
    return max(certified.certificate.epsilon_lower for certified in plan_.grasps)


@every_object
@every_effort
def test_every_grasp_is_proved_and_the_judge_agrees(name: str, effort: str) -> None:
    assert plan(name, effort).grasps
    for certified in plan(name, effort).grasps:
        grasp, x = certified.grasp, certified.certificate.internal_force
        contacts = grasp.p_BC.tolist(), grasp.nhat_TB_B.tolist(), grasp.mu.tolist()
        assert exact.check_force_closure(*contacts, x.tolist()).ok
        assert is_force_closure(grasp.p_BC, grasp.nhat_TB_B, grasp.mu, around=False, sides=64)


@every_object
@every_effort
def test_contacts_keep_their_distance_from_edges_and_tips_fit(name: str, effort: str) -> None:
    object_ = OBJECTS[name]
    regions, L = erode(object_.polyhedron), object_.polyhedron.diameter
    for certified in plan(name, effort).grasps:
        grasp = certified.grasp
        faces = np.array(grasp.faces)
        for p_BC, face in zip(grasp.p_BC, faces, strict=True):
            gaps = []
            for k in np.flatnonzero(regions.face == face):
                p_FC = (p_BC - regions.p_BF[k]) @ regions.R_BF[k]
                assert abs(p_FC[2]) < 3e-5 * L
                gaps.append(shapely.distance(regions.polygon_F[k], shapely.Point(p_FC[:2])))
            assert min(gaps) < 1e-8 * L
        assert (edge_distance(object_.polyhedron, grasp.p_BC, faces) > 0).all()
        radius = TIP_RADIUS * L
        assert fingertip_fits(object_.polyhedron, grasp.p_BC, grasp.nhat_TB_B, radius).all()


@every_object
@every_effort
def test_grasps_are_on_different_sets_best_first_and_in_their_planes(
    name: str, effort: str
) -> None:
    grasps = plan(name, effort).grasps
    assert len({frozenset(certified.grasp.faces) for certified in grasps}) == len(grasps)
    lower = [certified.certificate.epsilon_lower for certified in grasps]
    assert (np.diff(lower) <= 1e-9).all()
    for certified in grasps:
        grasp, plane = certified.grasp, certified.grasp.grasp_plane
        assert np.linalg.norm(plane.nhat_B) == pytest.approx(1)
        height = (grasp.p_BC - plane.p_BP) @ plane.nhat_B
        assert np.abs(height).max() < 1e-6 * OBJECTS[name].rho


@every_object
def test_every_step_is_worth_its_time_or_at_least_no_loss(name: str) -> None:
    least = 0.98  # bounds rank and epsilon decides; grasps beyond the tenth are not measured
    assert best(plan(name, "spread")) >= least * best(plan(name, "none"))
    assert best(plan(name, "improve")) >= least * best(plan(name, "spread"))
    assert best(plan(name)) >= least * best(plan(name, "search"))
    assert best(plan(name)) > 1.005 * best(plan(name, "none"))


def test_a_cube_is_held_from_corner_to_corner() -> None:
    # Two fingers at the ends of a face's diagonal, one opposite: half again the paper's epsilon.
    top = plan("cube").grasps[0].grasp
    apart = max(np.linalg.norm(p - q) for p in top.p_BC for q in top.p_BC)
    assert top.kind == "two_faces"
    assert apart > 0.06 * 1.25
    assert best(plan("cube")) > 1.3 * best(plan("cube", "spread"))


@every_object
def test_reasons_account_for_all_sets(name: str) -> None:
    n = len(erode(OBJECTS[name].polyhedron).face)
    for how in (*STEPS, "quick"):
        found = plan(name, how)
        assert found.num_sets == comb(n, 3) + comb(n, 2)
        assert sum(found.reasons.values()) == found.num_sets
        assert found.num_certified >= len(found.grasps)


@pytest.mark.parametrize("name", ["octagonal prism", "many faces"])
def test_what_is_planned_explain_certifies(name: str) -> None:
    explanation = explain_sets(OBJECTS[name], **NO_ERRORS)
    assert "not_evaluated" not in explanation.reasons
    certified = {
        frozenset(faces) - {-1}
        for faces, reason in zip(explanation.faces.tolist(), explanation.reasons, strict=True)
        if reason == "certified"
    }
    assert {frozenset(c.grasp.faces) for c in plan(name).grasps} <= certified


def test_quality_is_that_of_the_set_or_unknown() -> None:
    object_ = OBJECTS["octagonal prism"]
    regions, L = erode(object_.polyhedron), object_.polyhedron.diameter
    rows = plan_sets(regions, object_.p_BBcm, L, object_.rho, "enriched").candidates
    known = {
        frozenset(regions.face[region].tolist()): Q
        for region, Q in zip(rows.region, rows.Q, strict=True)
    }
    for certified in plan("octagonal prism").grasps:
        quality, faces = certified.grasp.quality, frozenset(certified.grasp.faces)
        assert (quality is None) == (faces not in known)
        if quality is not None:
            assert quality.Q == pytest.approx(known[faces])


def test_with_many_regions_only_the_chosen_sets_are_evaluated_and_nothing_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    few = plan("many faces")
    assert few.reasons["not_evaluated"] > 0.9 * few.num_sets
    monkeypatch.setattr(proposals, "MANY_REGIONS", 1000)
    assert best(few) > 0.9 * best(exact_plan(OBJECTS["many faces"]))


@pytest.mark.parametrize("rank", ["margin", "Q"])
def test_other_ranks_are_of_the_papers_constructions(rank: judging.Rank) -> None:
    object_ = OBJECTS["channel"]
    grasps = exact_plan(object_, rank=rank).grasps
    scores = [
        c.certificate.margin if rank == "margin" else c.grasp.quality.Q
        for c in grasps
        if c.grasp.quality is not None
    ]
    assert len(scores) == len(grasps)
    assert (np.diff(scores) <= 1e-9).all()


def test_a_plan_repeats() -> None:
    again = exact_plan(OBJECTS["holed prism"])
    for one, other in zip(plan("holed prism").grasps, again.grasps, strict=True):
        np.testing.assert_array_equal(one.grasp.p_BC, other.grasp.p_BC)


@every_object
def test_quick_grasps_are_better_than_random_ones_and_little_worse_than_the_best(name: str) -> None:
    quick = best(plan(name, "quick"))
    assert quick >= measure.search(OBJECTS[name], random_triples)["epsilon"]
    assert quick >= 0.8 * best(plan(name))


def test_a_quick_grasp_keeps_out_of_corners_that_improvement_leads_into(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Improved contacts in the corner of a floor and a wall: the tips of none of them fit.
    corner = shapely.box(0, 0, 0.1, 0.02).union(shapely.box(0, 0, 0.02, 0.1))
    object_ = solid(prism(corner, 0.05))
    deep = object_.polyhedron.diameter / 100

    def into_the_corner(_: Regions, starts: Triples, *__: object) -> Triples:
        p_BC, moved = starts.p_BC.copy(), np.zeros(len(starts.region), dtype=bool)
        for axis, other in ((0, 1), (1, 0)):
            on_wall = np.isclose(p_BC[..., axis], 0.02) & (p_BC[..., other] > 0.02)
            p_BC[on_wall, other] = 0.02 + deep
            moved |= on_wall.any(axis=1)
        assert moved.any()
        return Triples(starts.region[moved], p_BC[moved])

    monkeypatch.setattr(proposals, "improved_triples", into_the_corner)
    monkeypatch.setattr(judging, "enriched", None)  # quick's own, not those that would follow
    found = exact_plan(object_, effort="quick", tip_radius=3 * deep)
    assert found.grasps
    for certified in found.grasps:
        grasp = certified.grasp
        assert fingertip_fits(object_.polyhedron, grasp.p_BC, grasp.nhat_TB_B, 3 * deep).all()


def test_where_a_quick_search_finds_none_the_full_one_follows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    unseen = unplanned(np.array([[0, 1, 2]]))
    nothing = project_candidates(request_of(cube()), unseen, proposals.NO_TRIPLES)
    monkeypatch.setattr(judging, "quick", lambda *_: (nothing, np.empty(0)))
    found, full = exact_plan(cube(), effort="quick"), plan("cube")
    assert found.reasons == full.reasons
    assert found.grasps[0].grasp.p_BC.tolist() == full.grasps[0].grasp.p_BC.tolist()
    assert found.settings == replace(full.settings, effort="quick")


def test_quick_bounds_are_those_of_the_contacts_that_are_judged() -> None:
    """On flat faces, where the planes of faces are the true surface."""
    object_ = cube()
    work, bound = proposals.quick(request_of(object_), 3)
    anew = epsilon_upper_bound(*work.contacts, object_.p_BBcm, object_.rho, FEW_ANGLES)
    assert len(bound) == len(anew) > 3
    assert bound == pytest.approx(anew, rel=1e-4)


@pytest.mark.parametrize(
    "options", [{"exclude_faces": range(6)}, {"exclude_faces": range(4)}, {"edge_clearance": 1.0}]
)
def test_quick_says_what_full_says_where_nothing_holds(options: dict[str, Any]) -> None:
    quick, full = (exact_plan(cube(), effort=effort, **options) for effort in ("quick", "full"))
    assert not quick.grasps
    assert (quick.reasons, quick.mu_needed) == (full.reasons, full.mu_needed)


@pytest.mark.parametrize(
    "options", [{"rank": "Q"}, {"rank": "margin"}, {"method": "paper"}, {"steps": Steps()}]
)
def test_quick_is_of_one_method_and_rank(options: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match="'quick' is for all steps of 'enriched'"):
        exact_plan(cube(), effort="quick", **options)


def test_an_object_that_cannot_be_held_has_reasons() -> None:
    corners = 0.04 * np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1.0]])
    tetrahedron = solid(corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]], mu=0.3)
    found = exact_plan(tetrahedron)
    assert exact_plan(tetrahedron, effort="quick").reasons == found.reasons
    assert not found.grasps
    assert found.reasons == {"orientation": 10}
    assert found.mu_needed == pytest.approx(np.tan(np.arcsin(1 / 3)))


def test_more_sets_than_can_be_followed_are_a_clear_mistake(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(request, "MOST_SETS", 34)
    assert exact_plan(cube(), exclude_faces=(0,), rank="Q").grasps
    for ask in (explain_sets, lambda it: exact_plan(it, method="paper")):
        with pytest.raises(UsageError, match=r"35 sets of faces are too many .* up to 34"):
            ask(cube())
