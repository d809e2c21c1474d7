"""The region of a grasp is borne out exactly, by the file's numbers and by the model's surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from drake_polygrasp import load_object, plan_grasps, save_grasps
from drake_polygrasp.region_bounds.region_epsilon import RegionEpsilon, region_epsilon
from drake_polygrasp.region_bounds.region_task import QUICK_GAP, RegionTask, task_of
from drake_polygrasp.verification.report import GraspVerification, Status
from drake_polygrasp.verification.verify import verify_file
from tests.support.grasp_files import Document, edit, write_box
from tests.support.grasp_regions import GREATEST, box_region, in_pieces
from tests.support.plant_scenes import model


def verified(folder: Path, region: Document) -> GraspVerification:
    file = edit(write_box(folder), lambda d: d["grasps"][0].update(region=region))
    return verify_file(file).grasps[0]


@pytest.mark.parametrize("in_other_form", [lambda region: region, in_pieces])
def test_a_region_holds_up_to_what_it_bears_by_hand(
    in_other_form: Callable[[Document], Document], tmp_path: Path
) -> None:
    # A spread of 1e-6 costs 1e-6 of friction.
    holds = verified(tmp_path, in_other_form(box_region(GREATEST * (1 - 1e-4))))
    assert holds.forces.status is Status.PROVED, holds.forces.reason
    assert holds.surface.status is Status.RECOMPUTED, holds.surface.reason
    fails = verified(tmp_path, in_other_form(box_region(GREATEST * (1 + 1e-9))))
    assert fails.forces.status is Status.FAILED
    assert "the region is not proved: the force at contact" in fails.forces.reason


def _smaller(region: Document) -> None:
    del region["p_BV"][0][0]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda r: r.update(placement_error=[0.002, 0.0021, 0.002]), "contact 2 does not hold"),
        (_smaller, "contact 1 does not hold its disc"),
        (lambda r: r.update(tilt_error=0.3), "not proved"),
        (lambda r: r.update(friction_error=0.9), "not proved"),
        (lambda r: r.update(internal_force=[2.5, 2.5, 0.0]), "not proved"),
    ],
)
def test_a_region_that_its_numbers_do_not_bear_out_is_refused(
    change: Callable[[Document], Any], reason: str, tmp_path: Path
) -> None:
    region = box_region()
    change(region)
    line = verified(tmp_path, region).forces
    assert line.status is Status.FAILED
    assert reason in line.reason


def test_pieces_that_leave_out_a_part_of_the_surface_are_refused(tmp_path: Path) -> None:
    region = in_pieces(box_region(0.002, radius=0.0021))
    # So that no polygon is held against its disc, and only the model can tell what is missing.
    for pieces in region["pieces"]:
        pieces[0]["tan_spread"] = 1e-6
    report = verified(tmp_path, region)
    assert report.forces.status is Status.PROVED, report.forces.reason
    assert report.surface.status is Status.FAILED
    assert report.surface.reason == (
        "the region of contact 1 lacks a part of the surface that it may touch"
    )


@pytest.mark.parametrize("share", [0.0, 1e-9, 1e-6])
@pytest.mark.parametrize("name", ["octahedron", "wedge"])
def test_files_of_plans_with_hardly_any_placement_error_verify(
    name: str, share: float, tmp_path: Path
) -> None:
    """Polygons on slanted faces are then as small as the rounding of their corners, or smaller."""
    object_ = model(name)
    plan = plan_grasps(
        object_,
        top=5,
        effort="quick",
        placement_error=share * object_.polyhedron.diameter,
        tilt_error=0.05,
    )
    assert plan.grasps and all(grasp.region is not None for grasp in plan.grasps)
    path = tmp_path / "tiny.grasp.yaml"
    save_grasps(path, object_, plan.grasps, plan.settings)
    report = verify_file(path)
    assert report.holds, [(grasp.forces.reason, grasp.surface.reason) for grasp in report.grasps]


def test_files_of_parts_that_cross_at_tiny_angles_verify(tmp_path: Path) -> None:
    # Where two faces cross at 1e-5 rad, rounding moves the line in which they do 1e5 times as far.
    shape = "<geometry><box><size>0.1 0.05 0.05</size></box></geometry>"
    friction = "<surface><friction><ode><mu>0.4</mu><mu2>0.4</mu2></ode></friction></surface>"
    poses = ["0 0 0 0 0 0", "1e-6 0 0 0 0 0", "0 0 0 0 0 1e-5"]
    parts = "".join(
        f'<collision name="c{k}"><pose>{pose}</pose>{shape}{friction}</collision>'
        for k, pose in enumerate(poses)
    )
    file = tmp_path / "boxes.sdf"
    file.write_text(
        f'<sdf version="1.9"><model name="m"><link name="b">{parts}</link></model></sdf>'
    )
    boxes = load_object(file)
    plan = plan_grasps(boxes)
    assert sum(len(pieces) > 1 for g in plan.grasps if g.region for pieces in g.region.pieces) > 2
    save_grasps(tmp_path / "boxes.grasp.yaml", boxes, plan.grasps, plan.settings)
    assert verify_file(tmp_path / "boxes.grasp.yaml").holds


def test_a_region_beyond_its_face_is_refused(tmp_path: Path) -> None:
    """Near an edge of the box a fingertip that misses by so much touches nothing."""

    def move(document: Document) -> None:
        region, grasp = box_region(), document["grasps"][0]
        for corners, contact in zip(region["p_BV"], grasp["contacts"], strict=True):
            contact["p_BC"][2] = 0.099
            for corner in corners:
                corner[2] += 0.099
        grasp["grasp_plane"]["p_BP"] = [0.0, 0.0, 0.099]
        grasp["region"] = region

    report = verify_file(edit(write_box(tmp_path), move)).grasps[0]
    assert report.forces.status is Status.PROVED, report.forces.reason
    assert report.surface.status is Status.FAILED
    reason = report.surface.reason
    assert reason == "contact 1 may not miss by 0.001998 m: the fingertip may miss the body"


def test_closer_bounds_than_a_plan_looks_for_hold_and_those_beyond_the_truth_do_not(
    tmp_path: Path,
) -> None:
    """A file of a version that finds closer bounds is as true as one of this version."""
    object_ = model("l_bracket")
    plan = plan_grasps(object_, top=1)
    (certified,) = plan.grasps
    region = certified.region
    assert region is not None and region.epsilon_lower and region.squeeze_force
    task = task_of(region, certified.grasp, object_.p_BBcm, object_.rho, object_.mass)
    close = region_epsilon(replace(task, relative_gap=0.004, squeeze_gap=0.004))
    assert close.squeeze_force is not None
    assert close.epsilon_lower > 1.005 * region.epsilon_lower
    assert close.squeeze_force < 0.97 * region.squeeze_force

    def numbers(epsilon_lower: float, squeeze_force: float) -> Status:
        stated = replace(region, epsilon_lower=epsilon_lower, squeeze_force=squeeze_force)
        file = tmp_path / "l_bracket.grasp.yaml"
        save_grasps(file, object_, [replace(certified, region=stated)], plan.settings)
        return verify_file(file).grasps[0].numbers.status

    assert numbers(close.epsilon_lower, close.squeeze_force) is Status.RECOMPUTED
    # Some placement withstands no more than the upper bound, nor more weight for so little squeeze.
    assert numbers(1.001 * close.epsilon_upper, close.squeeze_force) is Status.FAILED
    assert numbers(close.epsilon_lower, 0.8 * close.squeeze_force) is Status.FAILED


@pytest.mark.parametrize(("stated", "holds"), [(1.8, True), (2.5, True), (3.0, False)])
def test_an_upper_bound_holds_that_any_of_the_searches_finds(
    stated: float, holds: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """How bad a placement a search finds is luck: a search for closer bounds may find a better."""
    object_ = model("cube")
    plan = plan_grasps(object_, top=1, effort="quick")
    (certified,) = plan.grasps
    assert certified.region is not None and certified.region.epsilon_lower
    least = certified.region.epsilon_lower

    def searched(tasks: Sequence[RegionTask]) -> list[RegionEpsilon]:
        uppers = [2.4 if task.relative_gap == QUICK_GAP else 2.0 for task in tasks]
        return [
            replace(
                region_epsilon(task),
                epsilon_lower=least,
                epsilon_upper=upper * least,
                squeeze_force=None,
            )
            for task, upper in zip(tasks, uppers, strict=True)
        ]

    monkeypatch.setattr("drake_polygrasp.verification.region.region_epsilons", searched)
    region = replace(certified.region, epsilon_upper=stated * least, squeeze_force=None)
    file = tmp_path / "cube.grasp.yaml"
    save_grasps(file, object_, [replace(certified, region=region)], plan.settings)
    numbers = verify_file(file).grasps[0].numbers
    assert (numbers.status is Status.RECOMPUTED) == holds, numbers.reason
    assert holds or numbers.reason.endswith(f"more than the {2.4 * least:.6g} found")
