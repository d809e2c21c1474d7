"""What `plan_grasps` and `explain_sets` return for our models holds by judges of their own."""

from __future__ import annotations

from functools import cache
from math import comb
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.paper.reasons import REASONS
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.pipeline.explain import Explanation, explain_sets
from drake_polygrasp.pipeline.plan import GraspPlan
from drake_polygrasp.settings import NO_ERRORS, Method
from tests.support.lp_judge import is_force_closure
from tests.support.planned import exact_plan
from tests.support.surface_judge import on_surface

MODELS = {
    path.stem: path
    for path in sorted((Path(__file__).parents[2] / "models").glob("*/*.*"))
    if path.suffix in (".sdf", ".urdf")
}
METHODS = get_args(Method)
MU = 0.3


@cache
def load(name: str) -> GraspObject:
    return load_object(MODELS[name], mu=MU)


@cache
def plan(name: str, method: Method) -> GraspPlan:
    return exact_plan(load(name), method=method)


@cache
def explain(name: str, method: Method) -> Explanation:
    return explain_sets(load(name), method=method, **NO_ERRORS)


graspable = pytest.mark.parametrize("name", sorted(set(MODELS) - {"tetrahedron"}))
both_methods = pytest.mark.parametrize("method", METHODS)


@graspable
@both_methods
def test_every_grasp_is_force_closure_by_a_linear_program(name: str, method: Method) -> None:
    grasps = plan(name, method).grasps
    assert grasps
    for certified in grasps:
        grasp = certified.grasp
        assert is_force_closure(grasp.p_BC, grasp.nhat_TB_B, grasp.mu, around=False, sides=64)


@graspable
@both_methods
def test_every_contact_is_on_a_triangle_of_the_model_with_its_normal(
    name: str, method: Method
) -> None:
    polyhedron = load(name).polyhedron
    parts = [polyhedron.triangles_B]
    for certified in plan(name, method).grasps:
        grasp = certified.grasp
        for p_BC, nhat_TB_B in zip(grasp.p_BC, grasp.nhat_TB_B, strict=True):
            assert on_surface(p_BC, nhat_TB_B, parts, polyhedron.diameter)


@graspable
@both_methods
def test_every_certified_number_is_in_its_range(name: str, method: Method) -> None:
    for certified in plan(name, method).grasps:
        numbers = certified.certificate
        assert 0 < numbers.margin <= 1
        assert 0 <= numbers.mu_min < MU
        assert 0 < numbers.epsilon_lower <= numbers.epsilon_upper
        assert numbers.epsilon_upper <= 1.02 * numbers.epsilon_lower / 0.98
        assert numbers.placement_tolerance > 0
        assert numbers.squeeze_force is not None
        # Normal forces that add up to the weight, all straight up, could just hold it.
        assert numbers.squeeze_force > 0.9 * (load(name).mass or 0) * 9.81


@pytest.mark.parametrize("name", sorted(MODELS))
@both_methods
def test_every_set_of_faces_has_one_reason(name: str, method: Method) -> None:
    num_regions = len(erode(load(name).polyhedron).face)
    num_sets = comb(num_regions, 3) + comb(num_regions, 2)
    for found in (plan(name, method), explain(name, method)):
        counts = found.reasons if isinstance(found, GraspPlan) else found.counts
        assert sum(counts.values()) == num_sets
        assert set(counts) <= set(REASONS)
    explanation = explain(name, method)
    assert "not_evaluated" not in explanation.counts
    assert len(explanation.faces) == len(explanation.reasons) == num_sets
    assert len({tuple(row) for row in explanation.faces.tolist()}) == num_sets


@graspable
def test_what_a_plan_certifies_explain_certifies_too(name: str) -> None:
    explanation = explain(name, "paper")
    certified = {
        tuple(sorted(set(row) - {-1}))
        for row, reason in zip(explanation.faces.tolist(), explanation.reasons, strict=True)
        if reason == "certified"
    }
    for grasp in plan(name, "paper").grasps:
        assert tuple(sorted(set(grasp.grasp.faces))) in certified


@both_methods
def test_the_tetrahedron_has_no_grasp_and_needs_tan_asin_a_third(method: Method) -> None:
    found = plan("tetrahedron", method)
    assert not found.grasps
    assert found.reasons == {"orientation": 10}
    assert found.mu_needed == pytest.approx(np.tan(np.arcsin(1 / 3)), rel=1e-6)
    needed = np.tan(np.arcsin(1 / 3))
    for mu, holds in ((0.999 * needed, False), (1.01 * needed, True)):
        grasps = exact_plan(load_object(MODELS["tetrahedron"], mu=mu), method=method).grasps
        assert bool(grasps) == holds


def test_where_the_set_of_best_quality_is_rejected_the_next_is_returned() -> None:
    object_ = load("boxes")
    polyhedron = object_.polyhedron
    sets = plan_sets(erode(polyhedron), object_.p_BBcm, polyhedron.diameter, object_.rho, "paper")
    best = int(np.argmax(sets.candidates.Q))
    faces = sets.sets[sets.candidates.set_index[best]].tolist()
    explanation = explain("boxes", "paper")
    row = explanation.faces.tolist().index(faces)
    assert explanation.reasons[row] == "tip_blocked"

    top = plan("boxes", "paper").grasps[0].grasp
    assert top.quality is not None
    assert top.quality.Q < sets.candidates.Q[best] - 1e-4
    assert sorted(set(top.faces)) != faces[:2]


@both_methods
def test_the_same_object_has_the_same_grasps(method: Method) -> None:
    again = exact_plan(load("l_bracket"), method=method)
    for one, other in zip(plan("l_bracket", method).grasps, again.grasps, strict=True):
        np.testing.assert_array_equal(one.grasp.p_BC, other.grasp.p_BC)
        np.testing.assert_array_equal(
            one.certificate.internal_force, other.certificate.internal_force
        )


@graspable
def test_the_paper_s_grasps_come_best_quality_first(name: str) -> None:
    Q = [grasp.grasp.quality.Q for grasp in plan(name, "paper").grasps if grasp.grasp.quality]
    assert np.all(np.diff(Q) < 1e-9)


@graspable
def test_enriched_grasps_come_best_epsilon_first_and_beat_the_paper_s(name: str) -> None:
    epsilon = [grasp.certificate.epsilon_lower for grasp in plan(name, "enriched").grasps]
    assert np.all(np.diff(epsilon) < 1e-8)
    literal = max(grasp.certificate.epsilon_lower for grasp in plan(name, "paper").grasps)
    assert epsilon[0] > 0.98 * literal


def test_more_clearance_keeps_contacts_from_edges() -> None:
    corners = load("brick").polyhedron.triangles_B.reshape(-1, 3)
    centre, half = (corners.max(axis=0) + corners.min(axis=0)) / 2, np.ptp(corners, axis=0) / 2
    for certified in exact_plan(load("brick"), edge_clearance=0.008).grasps:
        inset = np.sort(half - np.abs(certified.grasp.p_BC - centre), axis=1)
        assert (inset[:, 0] < 1e-9).all()
        assert (inset[:, 1] > 0.008 - 1e-9).all()
