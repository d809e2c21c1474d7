"""Where few grasps are found planning goes on, says how far it went, and explain agrees with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import shapely

from drake_polygrasp.cli.plan_table import no_grasp_message
from drake_polygrasp.geometry.face_sets import sets_of
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.orientation import sets_oppose
from drake_polygrasp.pipeline import judging, longer_search
from drake_polygrasp.pipeline.explain import Explanation, explain_sets
from drake_polygrasp.pipeline.plan import GraspPlan
from drake_polygrasp.search.every_set import triples_on_each_set
from drake_polygrasp.search.face_support import contacts_on, points_on
from drake_polygrasp.search.sample_points import sample_points
from drake_polygrasp.settings import NO_ERRORS
from drake_polygrasp.wrenches.contacts import force_closure
from tests.pipeline.test_hard_solids import gear, spiked_cube, star
from tests.support.convex_polyhedra import boxes, ellipsoid_hull, holed_prism, prism
from tests.support.planned import exact_plan
from tests.support.solids import cube, regular_prism, solid


def tetrahedron(mu: float) -> GraspObject:
    corners = 0.03 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]
    return solid(corners[faces], mu=mu)


def bracket() -> GraspObject:
    profile = shapely.box(0, 0, 0.1, 0.02) | shapely.box(0, 0, 0.02, 0.06)
    return solid(prism(profile, 0.05))


OBJECTS: dict[str, Callable[[], GraspObject]] = {
    "cube": cube,
    "bracket": bracket,
    "hexagonal prism": lambda: regular_prism(6, mu=0.5),
    "holed prism": lambda: solid(holed_prism(8, 2, 1)),
    "boxes": lambda: solid(boxes(3, 2)),
    "ellipsoid": lambda: solid(ellipsoid_hull(12, 1), mu=0.2),
    "spiked cube": lambda: solid(spiked_cube(1.5), mu=0.1),
    "star": lambda: solid(star(7, 0.5, 0.02), mu=0.2),
}


def certified_sets(found: GraspPlan | Explanation) -> Counter[frozenset[int]]:
    """The faces of each certified set, as often as it is one."""
    if isinstance(found, GraspPlan):
        return Counter(frozenset(each.grasp.faces) for each in found.grasps)
    rows = zip(found.faces.tolist(), found.reasons, strict=True)
    return Counter(frozenset(faces) - {-1} for faces, reason in rows if reason == "certified")


@pytest.mark.parametrize("make", OBJECTS.values(), ids=OBJECTS.keys())
def test_no_set_that_any_plan_certifies_is_called_rejected(
    make: Callable[[], GraspObject],
) -> None:
    object_ = make()
    explained = certified_sets(explain_sets(object_, **NO_ERRORS))
    for top in (1, 10, 100, 1000):
        for effort in ("full", "quick"):
            planned = certified_sets(exact_plan(object_, top=top, effort=effort))
            assert planned <= explained, (top, effort)


@pytest.mark.parametrize("name", ["bracket", "star"])
def test_a_complete_plan_counts_as_explain_does_however_many_grasps_it_returns(name: str) -> None:
    object_ = OBJECTS[name]()
    counts = explain_sets(object_, **NO_ERRORS).counts
    for top in (1, 30):
        plan = exact_plan(object_, top=top, effort="complete")
        assert plan.reasons == counts
        assert plan.num_not_evaluated == 0
        assert plan.num_certified == counts["certified"] >= len(plan.grasps) == top


def test_of_a_bracket_with_enough_asked_for_all_sets_are_evaluated() -> None:
    plan = exact_plan(bracket(), top=1000)
    assert plan.num_not_evaluated == 0
    assert (
        len(plan.grasps)
        == plan.num_certified
        == explain_sets(bracket(), **NO_ERRORS).counts["certified"]
    )


def test_a_tetrahedron_of_little_friction_has_no_grasp_and_every_set_was_evaluated() -> None:
    """Its faces oppose each other only above mu = 1 / sqrt(8)."""
    plan = exact_plan(tetrahedron(0.35))
    assert (plan.outcome, plan.reasons) == ("no_certified_grasp", {"orientation": 10})
    assert exact_plan(tetrahedron(0.36)).outcome == "grasps"


def test_where_not_all_sets_were_evaluated_no_grasp_is_only_not_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A gear without friction to speak of holds nowhere, but planning ends before it is sure."""
    object_ = solid(gear(10), mu=1e-6)
    plan = exact_plan(object_, tip_radius=1.0)  # no such finger fits between its teeth
    assert plan.outcome == "no_certified_grasp"
    assert plan.num_not_evaluated == 0
    monkeypatch.setattr(longer_search, "CHUNKS", ())
    monkeypatch.setattr(longer_search, "ANY_SETS", 500)
    monkeypatch.setattr(judging, "ANY_SETS", 500)
    plan = exact_plan(object_, tip_radius=1.0)
    assert plan.outcome == "none_found"
    assert plan.num_not_evaluated > 0
    assert sum(plan.reasons.values()) == plan.num_sets
    message = no_grasp_message("gear.obj", object_, plan, tmp_path / "gear.grasp.yaml")
    left_out = f"{plan.num_not_evaluated} of {plan.num_sets} sets of faces were not evaluated"
    assert f"gear.obj: no grasp found; {left_out}" in message
    assert "--effort complete" in message
    assert "no certified grasp" not in message
    assert exact_plan(object_, tip_radius=1.0, effort="complete").outcome == "no_certified_grasp"


def test_fewer_grasps_than_asked_for_are_sought_longer() -> None:
    object_ = solid(gear(10), mu=0.1)
    found = [len(exact_plan(object_, top=top).grasps) for top in (10, 300)]
    assert found == [10, 300]


def test_every_triple_of_points_is_looked_at() -> None:
    object_ = solid(holed_prism(6, 0, 2), mu=0.4)
    regions = erode(object_.polyhedron)
    points = sample_points(regions, 30)
    rows = np.array(list(combinations(range(len(points[0])), 3)))
    region = points[0][rows]
    p_BC = points_on(regions, *points)[rows]
    holds = force_closure(*contacts_on(regions, region, p_BC))
    expected = {tuple(s) for s in sets_of(region[holds]).tolist()}
    found = triples_on_each_set(regions, points, object_.p_BBcm, object_.rho, 2, sets_oppose)
    counts = Counter(tuple(s) for s in sets_of(found.region).tolist())
    assert set(counts) == expected
    assert max(counts.values()) == 2
    assert force_closure(*contacts_on(regions, found.region, found.p_BC)).all()
