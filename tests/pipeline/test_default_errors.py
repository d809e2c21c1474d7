"""Default errors: what they are, that they cost no grasp, and what each grasp says it bears."""

from __future__ import annotations

from functools import cache
from math import atan, radians, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely import Polygon

from drake_polygrasp import GraspPlan, certify_region, explain_sets, plan_grasps, save_grasps
from drake_polygrasp.geometry.regions import erode, regions_at
from drake_polygrasp.paper.reasons import REASONS
from drake_polygrasp.pipeline.fallback import make_requests, sets_and_codes
from drake_polygrasp.pipeline.judging import judge_all
from drake_polygrasp.settings import ERROR_NAMES, NO_ERRORS, PlanOptions
from tests.support.convex_polyhedra import boxes, prism
from tests.support.planned import exact_plan
from tests.support.plant_scenes import model
from tests.support.solids import regular_polygon, solid

FEW_SETS = ("wedge", "triangular_prism", "tetrahedron")
"""Models with fewer than ten sets of faces that hold."""


@cache
def default_plan(name: str) -> GraspPlan:
    return plan_grasps(model(name))


def faces_of(plan: GraspPlan) -> list[frozenset[int]]:
    return [frozenset(certified.grasp.faces) for certified in plan.grasps]


def share(plan: GraspPlan, rank: int) -> float:
    """Returns the share of the plan's errors that a grasp bears, 0 for none."""
    region = plan.grasps[rank].region
    return 0.0 if region is None else region.com_error / plan.settings.com_error


def test_errors_are_by_size_and_friction_unless_given() -> None:
    default = PlanOptions().resolve(0.1, 0.3)
    assert default.placement_error == pytest.approx(0.002)
    assert default.placement_error_share_of_inradius == 0.5
    assert default.tilt_error == pytest.approx(radians(5))
    assert (default.friction_error, default.com_error) == (0.2, pytest.approx(0.002))
    given = PlanOptions(placement_error=0.004, tilt_error=0.0, com_error=0.0).resolve(0.1, 0.3)
    assert (given.placement_error, given.placement_error_share_of_inradius) == (0.004, None)
    assert (given.tilt_error, given.friction_error, given.com_error) == (0.0, 0.2, 0.0)
    assert not PlanOptions(method="paper").resolve(0.1, 0.3).has_errors
    assert PlanOptions(method="paper", tilt_error=0.1).resolve(0.1, 0.3).tilt_error == 0.1


@pytest.mark.parametrize("mu", [1.0, 0.3, 0.2, 0.15, 0.1, 0.02])
def test_default_tilt_and_friction_errors_leave_a_third_of_the_friction(mu: float) -> None:
    def left(tilt: float, friction: float) -> float:
        return tan(atan((1 - friction) * mu) - tilt) / mu

    settings = PlanOptions().resolve(0.1, mu)
    tilt, friction = settings.tilt_error, settings.friction_error
    assert left(tilt, friction) >= 1 / 3
    assert tilt / radians(5) == pytest.approx(friction / 0.2)
    if tilt < radians(5):
        assert left(2 * tilt, 2 * friction) < 1 / 3
    if mu == 0.15:  # 0.12 and 5 degrees leave 0.0322; 0.135 and 2.5 degrees 0.0908
        assert (tilt, friction) == (pytest.approx(radians(2.5)), 0.1)
    alone = PlanOptions(friction_error=0.2).resolve(0.1, mu)
    assert alone.friction_error == 0.2
    assert left(alone.tilt_error, 0.2) >= 1 / 3


def test_contacts_keep_the_placement_error_of_their_face_from_edges() -> None:
    """A bar of 10 x 10 mm and a rod of 2 x 2 mm, both 100 mm long: 2 percent of L is about 2 mm."""
    bar = solid(prism(regular_polygon(4, 0.005 * np.sqrt(2)), 0.1))
    miss = 0.02 * np.sqrt(0.1**2 + 2 * 0.01**2)
    ends, sides = (0.01 - 2 * miss) ** 2, (0.01 - 2 * miss) * (0.1 - 2 * miss)
    for request in make_requests(bar, PlanOptions())[:2]:
        assert np.sort(request.regions.area) == pytest.approx([ends] * 2 + [sides] * 4)
    rod = solid(prism(regular_polygon(4, 0.001 * np.sqrt(2)), 0.1))
    first, narrow, last = make_requests(rod, PlanOptions())
    assert len(first.regions.area) == 0
    half = [0.001**2] * 2 + [0.001 * 0.099] * 4
    assert np.sort(narrow.regions.area) == pytest.approx(half)
    assert last.errors is None
    assert (last.regions.area > narrow.regions.area).all()


@pytest.mark.parametrize("name", FEW_SETS)
def test_default_errors_cost_no_grasp(name: str) -> None:
    exact = exact_plan(model(name))
    assert set(faces_of(exact)) <= set(faces_of(default_plan(name)))
    assert sum(default_plan(name).reasons.values()) == default_plan(name).num_sets
    assert default_plan(name).num_certified == len(default_plan(name).grasps)
    assert default_plan(name).mu_needed == exact.mu_needed


def test_default_errors_cost_no_grasp_where_friction_is_just_enough() -> None:
    """Sides of a triangular prism converge at 60 degrees: they need 0.577, and 0.6 is there."""
    wedge = solid(prism(regular_polygon(3), 0.01), mu=0.6)
    faces = wedge.polyhedron.faces
    ends = [k for k, face in enumerate(faces) if abs(face.R_BF[2, 2]) > 0.5]
    others = [*ends, next(k for k in range(len(faces)) if k not in ends)]
    asked: dict[str, Any] = {"exclude_faces": others, "tip_radius": 0.0}
    (grasp,) = plan_grasps(wedge, **asked).grasps
    # Half of 5 degrees leaves tan(31.0 - 2.5 degrees) = 0.54 at most.
    assert grasp.region is None or grasp.region.tilt_error < radians(2)
    assert explain_sets(wedge, **asked).counts["certified"] == 1
    given = plan_grasps(wedge, **asked | {"tilt_error": 0.05})
    assert not given.grasps
    assert given.mu_needed == pytest.approx(tan(radians(30) + 0.05))


@pytest.mark.parametrize("name", ["wedge", "concave_mesh", "skewed_block"])
def test_grasps_that_bear_more_come_first(name: str) -> None:
    plan = default_plan(name)
    shares = [share(plan, rank) for rank in range(len(plan.grasps))]
    assert shares == sorted(shares, reverse=True)
    assert {round(s, 9) for s in shares} <= {1.0, 0.5, 0.25, 0.0}
    for s in set(shares):
        least = [
            c.region.epsilon_lower or 0.0
            for rank, c in enumerate(plan.grasps)
            if c.region and shares[rank] == s
        ]
        assert least == sorted(least, reverse=True)


@pytest.mark.parametrize("name", ["brick", "concave_mesh"])
def test_default_errors_are_lessened_until_they_leave_a_tenth_of_epsilon(name: str) -> None:
    object_, plan = model(name), default_plan(name)
    asked = plan.settings
    shares = []
    for certified in plan.grasps:
        region = certified.region
        assert region is not None
        own = region.com_error / asked.com_error
        exact = certified.certificate.epsilon_lower
        for k in (1.0, 0.5, 0.25):
            # No face is narrow here, so all contacts may miss by as much.
            bears = certify_region(
                object_,
                certified,
                placement_error=k * asked.placement_error * (1 - 1e-9),
                tilt_error=k * asked.tilt_error,
                friction_error=k * asked.friction_error,
                com_error=k * asked.com_error,
            )
            least = 0.0 if bears is None else bears.epsilon_lower or 0.0
            if k > own + 1e-9:
                assert least < 0.11 * exact
            elif k == pytest.approx(own):
                assert least >= 0.099 * exact
        shares.append(round(own, 3))
    assert {1.0, 0.5} <= {*shares}


def test_quick_bounds_are_bounds_and_less_close() -> None:
    object_ = model("two_materials")
    (quick,) = plan_grasps(object_, effort="quick", top=1).grasps
    region = quick.region
    assert region is not None
    close = certify_region(
        object_,
        quick,
        placement_error=region.placement_error.max(),
        tilt_error=region.tilt_error,
        friction_error=region.friction_error,
        com_error=region.com_error,
    )
    assert close is not None
    least, most = close.epsilon_lower or 0.0, close.epsilon_upper or 0.0
    assert region.epsilon_lower is not None and region.epsilon_upper is not None
    assert region.epsilon_lower <= most and least <= region.epsilon_upper
    # 2 and 5 percent are of what forces that serve all tilts may prove; the upper bound is of all.
    assert region.epsilon_lower >= 0.9 * region.epsilon_upper
    assert region.epsilon_upper - region.epsilon_lower > most - least


def test_given_errors_are_not_lessened() -> None:
    plan = plan_grasps(model("concave_mesh"), placement_error=0.003)
    regions = [certified.region for certified in plan.grasps if certified.region]
    assert {region.tilt_error for region in regions} > {plan.settings.tilt_error}
    for region in regions:
        assert region.placement_error.tolist() == [0.003] * 3


def test_explain_certifies_what_default_plans_do() -> None:
    for name in FEW_SETS:
        explanation = explain_sets(model(name))
        certified = {
            frozenset(faces) - {-1}
            for faces, reason in zip(explanation.faces.tolist(), explanation.reasons, strict=True)
            if reason == "certified"
        }
        assert set(faces_of(default_plan(name))) <= certified
        assert sum(explanation.counts.values()) == len(explanation.reasons)


def test_explain_says_what_judging_every_candidate_of_every_request_does() -> None:
    """Blocks of little friction hold on some sets only at points of a request with more errors."""
    object_ = solid(boxes(3, 2), mu=0.2)
    requests = make_requests(object_, PlanOptions())
    judges = [judge_all(request) for request in requests]
    sets, codes = sets_and_codes(requests, judges)
    explanation = explain_sets(object_)
    expected = np.append(requests[-1].every_face, -1)[sets]
    np.testing.assert_array_equal(explanation.faces, expected)
    assert explanation.reasons == [REASONS[code] for code in codes]
    assert explanation.counts["certified"] > len(judges[-1].held_sets)


def test_all_sets_are_evaluated_with_and_without_default_errors() -> None:
    object_ = model("triangular_prism")
    plan = plan_grasps(object_, effort="complete")
    assert plan.reasons == explain_sets(object_).counts
    assert plan.num_not_evaluated == 0


def test_the_paper_is_planned_for_exact_contacts(tmp_path: Path) -> None:
    object_ = model("cube")
    for name, errors in (("default", {}), ("none", NO_ERRORS)):
        plan = plan_grasps(object_, method="paper", **errors)
        save_grasps(tmp_path / name, object_, plan.grasps, plan.settings)
    assert (tmp_path / "default").read_bytes() == (tmp_path / "none").read_bytes()
    assert not {*ERROR_NAMES} & {*plan.settings.stated}


def test_points_are_on_the_nearest_region_of_their_face() -> None:
    """A dumb-bell whose waist is cut by the clearance has two regions on top and bottom each."""
    outline = [(0, 0), (3, 0), (3, 1), (5, 1), (5, 0), (8, 0), (8, 3), (5, 3)]
    outline += [(5, 1.4), (3, 1.4), (3, 3), (0, 3)]
    bell = solid(prism(Polygon(0.01 * np.array(outline, float)), 0.02))
    regions = erode(bell.polyhedron, 0.003)
    faces, counts = np.unique(regions.face, return_counts=True)
    cut = faces[counts == 2]
    assert len(cut) == 2
    for face in cut:
        rows = np.flatnonzero(regions.face == face)
        centre = np.array([regions.p_BV[regions.ring_offsets[r] :][:4].mean(axis=0) for r in rows])
        found = regions_at(regions, np.repeat(face, 4), np.vstack([centre, centre[::-1]]))
        assert found.tolist() == [*rows, *rows[::-1]]
