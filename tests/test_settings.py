"""What is asked of a plan and what files state of it: equal values, checked once, nothing lost."""

from __future__ import annotations

import inspect
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import explain_sets, load_grasps, plan_grasps, save_grasps
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.settings import NO_ERRORS, TIP_RADIUS, PlanOptions, PlanSettings, Steps
from tests.support.grasp_files import write_box
from tests.support.plant_scenes import model

L, MU = 0.06 * np.sqrt(3), 0.3


def test_options_that_ask_the_same_are_equal_and_hash_equal() -> None:
    one = PlanOptions(
        top=np.int64(5),  # type: ignore[arg-type]
        tip_radius=np.float64(0.01),
        avoid_directions=[np.array([0, 0, -2])],
        exclude_faces=range(3),
    )
    other = PlanOptions(
        top=5, tip_radius=0.01, avoid_directions=((0.0, 0.0, -1.0),), exclude_faces=[2, 1, 0, 1]
    )
    assert one == other
    assert hash(one) == hash(other)
    assert {one: "plan"}[other] == "plan"
    assert one != replace(other, steps=Steps(spread=False))


def test_options_are_the_arguments_of_planning_with_the_same_defaults() -> None:
    asked = {field.name: field.default for field in fields(PlanOptions)}
    for function in (plan_grasps, explain_sets):
        _, *parameters = inspect.signature(function).parameters.values()
        defaults = {parameter.name: parameter.default for parameter in parameters}
        defaults.pop("progress", None)  # of explain_sets
        assert defaults.items() <= asked.items()
        assert function is explain_sets or defaults == asked


def test_what_is_not_asked_for_follows_from_the_size() -> None:
    default, given = PlanOptions(), PlanOptions(edge_clearance=0.002, tip_radius=0.0)
    assert default.resolve(L, MU).edge_clearance == pytest.approx(0.01 * L)
    assert default.resolve(L, MU).edge_clearance_share_of_inradius == 0.2
    assert default.resolve(L, MU).fixed_clearance is None
    assert default.resolve(L, MU).tip_radius == TIP_RADIUS * L
    assert given.resolve(L, MU).fixed_clearance == 0.002
    assert given.resolve(L, MU).tip_radius == 0.0
    assert default.resolve(L, MU).rank == "epsilon"
    assert PlanOptions(method="paper").resolve(L, MU).rank == "Q"


def test_settings_are_stated_in_one_order_and_only_where_they_say_something() -> None:
    assert list(PlanOptions(tip_radius=0.0).resolve(L, MU).stated) == [
        *("method", "edge_clearance", "tip_radius", "edge_clearance_share_of_inradius"),
        *("placement_error", "placement_error_share_of_inradius", "tilt_error"),
        *("friction_error", "com_error", "rank", "top", "effort"),
    ]
    assert list(PlanOptions(tip_radius=0.0, **NO_ERRORS).resolve(L, MU).stated) == [
        *("method", "edge_clearance", "tip_radius", "edge_clearance_share_of_inradius"),
        *("rank", "top", "effort"),
    ]
    everything = PlanSettings(
        method="enriched",
        edge_clearance=0.001,
        tip_radius=0.002,
        avoid_directions=((0.0, 0.0, -1.0),),
        avoid_angle=0.7,
        exclude_faces=(0,),
        obstacles=(),  # there were some, and none near the object
        rank="margin",
        top=3,
        effort="complete",
        top_in_plant=2,
        mu=0.4,
    )
    assert list(everything.stated) == [
        *("method", "edge_clearance", "tip_radius", "avoid_directions", "avoid_angle"),
        *("exclude_faces", "obstacles", "rank", "top", "effort", "top_in_plant", "mu"),
    ]


def test_a_plan_that_is_read_says_what_was_written(tmp_path: Path) -> None:
    box = load_grasps(write_box(tmp_path))
    settings = PlanOptions(avoid_directions=[(1, 1, 0)], exclude_faces=[0]).resolve(L, MU)
    written = replace(settings, mu=0.25, obstacles=("table",))
    object_ = model("cube")
    save_grasps(tmp_path / "cube.yaml", object_, box.grasps, written)
    read = load_grasps(tmp_path / "cube.yaml").plan
    assert read.mu == 0.25
    assert read.tip_radius == settings.tip_radius
    assert read.obstacles == ("table",)
    assert read.exclusion.directions_B.tolist() == settings.exclusion.directions_B.tolist()
    assert (read.exclusion.faces, read.exclusion.angle) == ((0,), settings.avoid_angle)
    assert list(read.stated) == list(written.stated)


def test_what_another_planner_states_of_its_plan_is_kept(tmp_path: Path) -> None:
    box = load_grasps(write_box(tmp_path))
    stated = {"planner": "another", "method": ["mine", 2], "tip_radius": 0, "seed": {"a": 1}}
    save_grasps(tmp_path / "one.yaml", model("cube"), box.grasps, StatedPlan(stated))
    one = load_grasps(tmp_path / "one.yaml")
    assert one.plan.stated == stated
    save_grasps(tmp_path / "two.yaml", model("cube"), one.grasps, one.plan)
    assert (tmp_path / "two.yaml").read_bytes() == (tmp_path / "one.yaml").read_bytes()
