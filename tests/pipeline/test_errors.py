"""Plans for errors: friction that is left, clearance of contacts that miss, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp import UsageError, explain_sets, plan_grasps
from drake_polygrasp.certification import exact
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.geometry.surface_contact import edge_distance
from drake_polygrasp.pipeline.friction_left import NO_FRICTION, friction_left, friction_that_leaves
from drake_polygrasp.settings import MAX_TILT_ERROR, NO_ERRORS, PlanOptions
from tests.support.convex_polyhedra import prism
from tests.support.miss_judge import is_force_closure
from tests.support.plant_scenes import model
from tests.support.solids import regular_polygon, solid

TILT, SHARE = 0.1, 0.2
MU, LEFT = 0.3, 0.1363812
"""By hand: m = 0.8 * 0.3 = 0.24, T = tan(0.1) = 0.1003347, (m - T) / (1 + m T)."""


def test_the_friction_that_is_left_is_the_closed_form() -> None:
    left = friction_left(np.array([MU, 0.05, MU]), TILT, SHARE)
    assert left == pytest.approx([LEFT, NO_FRICTION, LEFT], abs=1e-7)
    assert friction_left(np.array([MU]), 0.0, SHARE) == pytest.approx([0.24])
    assert friction_left(np.array([MU]), TILT, 0.0) == pytest.approx([np.tan(np.arctan(MU) - TILT)])
    assert friction_that_leaves(LEFT, TILT, SHARE) == pytest.approx(MU, abs=1e-6)
    # arctan(5) + 0.5 is beyond a right angle.
    assert friction_that_leaves(5.0, 0.5, 0.0) is None
    assert friction_that_leaves(MU, 0.0, 0.0) == MU


def test_a_tilt_that_leaves_no_friction_is_refused_with_the_greatest_that_does() -> None:
    with pytest.raises(UsageError) as caught:
        friction_left(np.array([0.15, 0.1]), 0.17, 0.0)
    assert str(caught.value) == (
        "tilt_error 0.17 rad leaves no friction at mu 0.15; the tilt must be at most 0.1488"
    )
    assert friction_left(np.array([0.15]), 0.1488, 0.0)[0] > NO_FRICTION
    with pytest.raises(UsageError, match=r"0.3 rad and friction_error 0.2 leave no friction"):
        plan_grasps(model("cube"), tilt_error=0.3, friction_error=SHARE)
    assert MAX_TILT_ERROR == exact.MAX_TILT


@pytest.mark.parametrize("name", ["cube", "l_bracket", "two_materials"])
@pytest.mark.parametrize("effort", ["full", "quick"])
def test_grasps_planned_with_errors_hold_at_both_frictions(name: str, effort: str) -> None:
    object_, r = model(name), 0.003
    errors = {"placement_error": r, "tilt_error": TILT, "friction_error": SHARE}
    plan = plan_grasps(object_, effort=effort, top=5, **errors)  # type: ignore[arg-type]
    assert plan.grasps
    of_faces = object_.polyhedron.mu
    for certified in plan.grasps:
        grasp = certified.grasp
        assert grasp.mu.tolist() == of_faces[list(grasp.faces)].tolist()
        left = np.tan(np.arctan((1 - SHARE) * grasp.mu) - TILT)
        for mu in (grasp.mu, left):
            assert is_force_closure(grasp.p_BC[None], grasp.nhat_TB_B[None], mu[None])[0]
        room = edge_distance(object_.polyhedron, grasp.p_BC, np.array(grasp.faces))
        assert room.min() >= r * (1 - 1e-6)  # contacts have twelve digits


def test_what_holds_at_the_models_friction_only_is_not_planned() -> None:
    """Two sides of a triangular prism converge at 60 degrees: they need tan(30 deg) = 0.577."""
    wedge = solid(prism(regular_polygon(3), 0.01), mu=0.6)
    faces = wedge.polyhedron.faces
    ends = [k for k, face in enumerate(faces) if abs(face.R_BF[2, 2]) > 0.5]
    others = [*ends, next(k for k in range(len(faces)) if k not in ends)]
    for tilt, holds in ((0.0, True), (0.01, True), (0.05, False)):  # 0.584 and 0.534 are left
        asked = NO_ERRORS | {"exclude_faces": others, "tip_radius": 0.0, "tilt_error": tilt}
        plan = plan_grasps(wedge, **asked)
        assert bool(plan.grasps) == holds
        assert holds or plan.outcome == "no_certified_grasp"
        assert ("certified" in explain_sets(wedge, **asked).counts) == holds


def test_the_friction_needed_is_that_for_all_errors() -> None:
    tetrahedron = model("tetrahedron")
    alone = np.arcsin(1 / 3)
    for tilt, share in ((0.0, 0.0), (TILT, 0.0), (TILT, SHARE)):
        plan = plan_grasps(tetrahedron, tilt_error=tilt, friction_error=share)
        assert not plan.grasps
        assert plan.mu_needed == pytest.approx(np.tan(alone + tilt) / (1 - share), rel=1e-6)


def test_explanations_and_plans_with_errors_agree() -> None:
    bracket = model("l_bracket")
    errors = NO_ERRORS | {"placement_error": 0.004, "tilt_error": TILT, "friction_error": SHARE}
    explanation = explain_sets(bracket, **errors)
    reasons = {
        frozenset(faces) - {-1}: reason
        for faces, reason in zip(explanation.faces.tolist(), explanation.reasons, strict=True)
    }
    plan = plan_grasps(bracket, top=100, **errors)
    assert plan.grasps
    assert {reasons[frozenset(found.grasp.faces)] for found in plan.grasps} == {"certified"}


def test_contacts_keep_the_greater_of_clearance_and_miss() -> None:
    """A plate of 60 x 60 x 8 mm: by default 0.86 mm on its faces, 0.8 mm on its rim."""
    plate = solid(prism(regular_polygon(4, 0.03 * np.sqrt(2)), 0.008)).polyhedron
    L = plate.diameter
    area = {
        name: np.sort(regions.area)
        for name, regions in (
            ("given", erode(plate, 0.002, least_clearance=0.001)),
            ("missing", erode(plate, 0.001, least_clearance=0.002)),
            ("default", erode(plate, least_clearance=0.00083)),
            ("each", erode(plate, least_clearance=np.linspace(0.001, 0.002, 6))),
        )
    }
    assert area["given"] == pytest.approx([0.056 * 0.004] * 4 + [0.056**2] * 2)
    assert area["missing"] == pytest.approx(area["given"])
    rim, top = 0.00083, 0.01 * L
    expected = [(0.06 - 2 * rim) * (0.008 - 2 * rim)] * 4 + [(0.06 - 2 * top) ** 2] * 2
    assert area["default"] == pytest.approx(expected)
    assert len(set(area["each"].round(9))) == 6
    assert (
        PlanOptions(edge_clearance=1e-3, placement_error=2e-3).resolve(L, 0.3).edge_clearance
        == 2e-3
    )


def test_errors_are_stated_only_where_there_are_any() -> None:
    asked = NO_ERRORS | {"placement_error": 1e-3, "com_error": 2e-3}
    stated = PlanOptions(**asked).resolve(1.0, 0.3).stated
    assert (stated["placement_error"], stated["com_error"]) == (1e-3, 2e-3)
    assert not {"tilt_error", "friction_error"} & set(stated)
