"""Grasps that bear errors: what is certified holds wherever contacts land, and ranks first."""

from __future__ import annotations

import inspect
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import (
    NO_ERRORS,
    certify_region,
    load_object,
    plan_grasps,
    save_grasps,
    verify_file,
)
from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.exact import narrowed_friction
from drake_polygrasp.certification.robustness import epsilon_interval
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.placement_regions import regions_of_grasps
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.grasp import Grasp, GraspObject, GraspPlane
from drake_polygrasp.pipeline import region_certificates
from drake_polygrasp.pipeline.region_certificates import Errors, prove_errors
from drake_polygrasp.wrenches.contacts import force_closure
from tests.support.common import round_body
from tests.support.grasp_files import BOX_SDF
from tests.support.grasp_regions import FRICTION, GREATEST, TILT
from tests.support.solids import solid

MODELS = Path(__file__).parents[2] / "models"
ERRORS = {
    "placement_error": 0.002,
    "tilt_error": 0.05,
    "friction_error": 0.2,
    "com_error": 0.002,
}


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> GraspObject:
    file = tmp_path_factory.mktemp("box") / "box.sdf"
    file.write_text(BOX_SDF)
    return load_object(file)


def across(y: float = 0.02, z: float = 0.0) -> Grasp:
    """The grasp of the box whose errors are computed by hand in `grasp_regions`."""
    return Grasp(
        p_BC=frozen([[0.05, 0.0, z], [-0.05, y, z], [-0.05, -y, z]]),
        nhat_TB_B=frozen([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        mu=frozen([0.3, 0.3, 0.3]),
        kind="two_faces",
        faces=(5, 0, 0),
        grasp_plane=GraspPlane(frozen([0.0, 0.0, 1.0]), frozen([0.0, 0.0, z])),
    )


def test_the_best_internal_force_bears_more_than_the_one_by_hand(box: GraspObject) -> None:
    asked = {"tilt_error": TILT, "friction_error": FRICTION}
    # Squares of half a side s hold what discs of that radius may reach.
    region = certify_region(box, across(), placement_error=GREATEST, **asked)
    assert region is not None
    assert region.placement_error.tolist() == pytest.approx([GREATEST] * 3, rel=1e-5)
    # Contact 1 off by r along y and the others by -r: from there, forces within their cones pass
    # contact 1 on one side, all in the plane z = 0, once 2 r is above 0.02 and 0.1 mu' together.
    mu_left = float(narrowed_friction(0.3, TILT, FRICTION))
    never = (0.02 + 0.1 * mu_left) / 2 * 1.001
    assert certify_region(box, across(), placement_error=never, **asked) is None


def drawn(region_of: Grasp, r: float, count: int, seed: int) -> tuple[Array, Array, Array]:
    """Contacts, normals and friction within errors, a third of the places on rims."""
    random = np.random.default_rng(seed)
    radius = r * np.where(
        random.random((count, 3)) < 1 / 3, 1.0, np.sqrt(random.random((count, 3)))
    )
    angle = 2 * np.pi * random.random((count, 3))
    n = np.broadcast_to(region_of.nhat_TB_B, (count, 3, 3))
    helper = np.eye(3)[np.abs(region_of.nhat_TB_B).argmin(axis=1)]
    t_1 = np.cross(region_of.nhat_TB_B, helper)
    t_1 /= np.linalg.norm(t_1, axis=1)[:, None]
    t_2 = np.cross(region_of.nhat_TB_B, t_1)

    def tangent(angles: Array) -> Array:
        return np.cos(angles)[..., None] * t_1 + np.sin(angles)[..., None] * t_2

    p_BC = region_of.p_BC + radius[..., None] * tangent(angle)
    tilt = ERRORS["tilt_error"] * random.choice([0.5, 1.0], (count, 3, 1))
    tilted = np.cos(tilt) * n + np.sin(tilt) * tangent(2 * np.pi * random.random((count, 3)))
    mu = region_of.mu * (1 - ERRORS["friction_error"] * random.choice([0.0, 1.0], (count, 3)))
    return p_BC, tilted, mu


@pytest.mark.parametrize(
    "name", ["brick/brick.urdf", "wedge/wedge.urdf", "l_bracket/l_bracket.sdf"]
)
def test_whatever_happens_within_the_errors_is_force_closure(name: str) -> None:
    object_ = load_object(MODELS / name)
    best = plan_grasps(object_, top=1, **ERRORS).grasps[0]
    assert best.region is not None
    contacts = drawn(best.grasp, ERRORS["placement_error"], 3000, seed=1)
    assert force_closure(*contacts).all()
    # Epsilon of the worst of some, centres of mass off in any direction.
    random = np.random.default_rng(2)
    least = np.inf
    for p_BC, nhat_TB_B, mu in zip(*(values[:60] for values in contacts), strict=True):
        off = random.normal(size=3)
        off *= ERRORS["com_error"] / np.linalg.norm(off)
        scale = object_.p_BBcm + off, object_.rho
        least = min(least, epsilon_interval(p_BC, nhat_TB_B, mu, *scale).upper)
    assert best.region.epsilon_lower is not None
    assert least >= best.region.epsilon_lower > 0


def test_grasps_that_bear_the_errors_come_first_and_best_first() -> None:
    plan = plan_grasps(load_object(MODELS / "l_bracket" / "l_bracket.sdf"), top=20, **ERRORS)
    lower = [g.region.epsilon_lower if g.region else None for g in plan.grasps]
    bearing = [epsilon for epsilon in lower if epsilon is not None]
    assert len(bearing) >= 10
    assert lower[: len(bearing)] == sorted(bearing, reverse=True)
    for grasp in plan.grasps[: len(bearing)]:
        assert grasp.region is not None
        assert grasp.region.placement_error.tolist() == [ERRORS["placement_error"]] * 3
        stated = grasp.region.tilt_error, grasp.region.friction_error, grasp.region.com_error
        assert stated == (0.05, 0.2, 0.002)


@pytest.mark.parametrize("error", ERRORS)
def test_each_error_alone_is_stated_and_borne_out(error: str, tmp_path: Path) -> None:
    brick = load_object(MODELS / "brick" / "brick.urdf", package_paths=[MODELS])
    plan = plan_grasps(brick, top=2, **{error: ERRORS[error]})
    assert all(grasp.region is not None for grasp in plan.grasps)
    file = tmp_path / "brick.grasp.yaml"
    save_grasps(file, brick, plan.grasps, plan.settings)
    report = verify_file(file, package_paths=[MODELS])
    assert report.holds, [line for grasp in report.grasps for line in grasp.lines.values()]


def test_without_errors_nothing_is_certified_of_them(box: GraspObject) -> None:
    assert all(grasp.region is None for grasp in plan_grasps(box, top=3, **NO_ERRORS).grasps)


def test_a_miss_beyond_the_face_is_not_certified(box: GraspObject) -> None:
    assert certify_region(box, across(z=0.099), placement_error=0.0009) is not None
    assert certify_region(box, across(z=0.099), placement_error=0.0011) is None


def test_a_grasp_of_another_object_is_refused(box: GraspObject) -> None:
    elsewhere = replace(across(), faces=(6, 0, 0))
    with pytest.raises(UsageError, match="on face 6, and the object has 6 faces from 0"):
        certify_region(box, elsewhere)


def test_the_example_in_help_certifies_a_grasp(capsys: pytest.CaptureFixture[str]) -> None:
    text = str(inspect.getdoc(certify_region)).partition("Args:")[0].splitlines()
    shown = "\n".join(line for line in text if line.startswith("    "))
    brick = load_object(MODELS / "brick" / "brick.urdf")
    exec(
        textwrap.dedent(shown),
        {"box": brick, "plan_grasps": plan_grasps, "certify_region": certify_region},
    )
    assert float(capsys.readouterr().out) > 0


def test_grasps_lost_at_points_where_fingertips_land_are_lost_in_their_regions(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    object_ = solid(round_body(4000, (0.03, 0.04, 0.05), noise=2e-4, seed=5), mu=0.5)
    grasps = [found.grasp for found in plan_grasps(object_, **NO_ERRORS, top=12).grasps]
    none = np.zeros(len(object_.polyhedron.faces))
    asked = [
        (each, Errors(none + placement, 0.05, 0.1, 0.002))
        for placement in (0.001, 0.002, 0.004)
        for each in grasps
    ]
    quick = [each is not None for each in prove_errors(object_, asked)]
    searched = []

    def counted(polyhedron: Polyhedron, p_BC: Array, *contacts: Array) -> list:
        searched.append(len(p_BC))
        return regions_of_grasps(polyhedron, p_BC, *contacts)

    def only_contacts(_: Polyhedron, p_BC: Array, nhat: Array, *__: Array) -> tuple[Array, Array]:
        return p_BC[:, None], nhat[:, None]

    monkeypatch.setattr(region_certificates, "regions_of_grasps", counted)
    assert [each is not None for each in prove_errors(object_, asked)] == quick
    monkeypatch.setattr(region_certificates, "landing_points", only_contacts)
    assert [each is not None for each in prove_errors(object_, asked)] == quick
    # Of those that fail, most are not searched for regions.
    few, all_ = searched
    assert few - sum(quick) < (all_ - sum(quick)) / 2
