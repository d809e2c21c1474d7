"""What Drake refuses is measured in another way or left undecided; it is never an error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
import shapely
from pydrake.geometry import Mesh
from pydrake.math import RigidTransform

from drake_polygrasp import certify_in_plant, load_object
from drake_polygrasp.arrays import Array
from drake_polygrasp.cli.main import main
from drake_polygrasp.geometry.triangles import nearest_on_triangles, point_triangle_distance
from drake_polygrasp.grasp import Verdict
from drake_polygrasp.plant import certify_in_plant as in_plant
from drake_polygrasp.plant import loads
from drake_polygrasp.plant.contact_geometry import check_geometry
from drake_polygrasp.plant.scratch_plant import make_scene
from drake_polygrasp.plant.surface_distance import SurfaceDistance
from tests.geometry.test_surface_contact import L_PROFILE
from tests.support.common import grasp
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.planned import exact_plan
from tests.support.plant_scenes import cube_grasp, model
from tests.support.surface_judge import nearest_point

X, Y, Z = np.eye(3)


def wedge(half_thickness: float) -> Array:
    """A blade of 0.1 x 0.1 m along x that narrows to an edge at x = 0.1."""
    ends = (-0.05, 0.05)
    a, b = ([np.array([0, y, z]) for y in ends] for z in (-half_thickness, half_thickness))
    c = [np.array([0.1, y, 0]) for y in ends]
    quads = [(b[0], b[1], a[1], a[0]), (a[0], a[1], c[1], c[0]), (c[0], c[1], b[1], b[0])]
    split = [t for p, q, r, s in quads for t in ((p, q, r), (p, r, s))]
    return np.array([*split, (a[0], c[0], b[0]), (b[1], c[1], a[1])])


def block() -> Array:
    """A box of 6 x 8 x 10 cm about the origin."""
    return prism(shapely.box(-0.03, -0.04, 0.03, 0.04), 0.1) - 0.05 * Z


def with_burr(solid: Array) -> Array:
    """A fin without thickness on the top of a block: a triangle and the same turned over."""
    fin = np.array([[-0.01, 0, 0.05], [0.01, 0, 0.05], [0, 0, 0.06]])
    return np.concatenate([solid, [fin, fin[[0, 2, 1]]]])


def with_needle(solid: Array) -> Array:
    """A spike of 1 cm on the top, a micrometre thick."""
    base = np.array([[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0]]) + 0.0499 * Z
    tip = 0.06 * Z
    sides = [np.array([base[k], base[(k + 1) % 3], tip]) for k in range(3)]
    return np.concatenate([solid, [base[[0, 2, 1]], *sides]])


def with_blade(solid: Array) -> Array:
    """A blade along the top, 4 micrometres thick at its root."""
    return np.concatenate([solid, wedge(1e-6)[..., [1, 2, 0]] * [1, 1, 0.2] + 0.0499 * Z])


SHARP = {"burr": with_burr, "needle": with_needle, "blade": with_blade}


def distance_to(file: Path, triangles: Array) -> SurfaceDistance:
    write_obj(file, triangles)
    return SurfaceDistance([(Mesh(str(file)), RigidTransform())])


@pytest.mark.parametrize("half_thickness", [1e-2, 1e-5])
def test_distances_to_a_wedge_are_known_by_hand(tmp_path: Path, half_thickness: float) -> None:
    surface = distance_to(tmp_path / "wedge.obj", wedge(half_thickness))
    beyond, within = surface.nearest(0.2 * X), surface.nearest(0.05 * X)
    slope = np.arctan(half_thickness / 0.1)
    assert bool(surface.refusal) == (half_thickness == 1e-5)  # Drake's edge of about 1e-3 rad.
    np.testing.assert_allclose(beyond.p_BN, 0.1 * X, atol=1e-12)
    assert beyond.distance == pytest.approx(0.1, rel=1e-9)
    assert within.distance == pytest.approx(-0.05 * np.sin(slope), rel=1e-6)
    above = 0.05 * (np.cos(slope) - np.sin(slope))
    assert surface.nearest(0.05 * (X + Z)).distance == pytest.approx(above, rel=1e-9)


def test_on_triangles_the_distances_are_those_of_drake(tmp_path: Path) -> None:
    surface = distance_to(tmp_path / "bracket.obj", prism(L_PROFILE, 0.1))
    (part,) = surface._parts
    points = np.random.default_rng(0).uniform(-0.1, 0.4, (200, 3))
    for p in points:
        drake, own = surface.nearest(p), part._nearest_triangle(p)
        assert own.distance == pytest.approx(drake.distance, abs=1e-12)
        assert np.linalg.norm(own.p_BN - p) == pytest.approx(abs(drake.distance), abs=1e-12)
    assert surface.refusal == ""
    assert {np.sign(surface.nearest(p).distance) for p in points} == {-1, 1}


def test_the_nearest_point_of_a_triangle_is_the_judges() -> None:
    rng = np.random.default_rng(0)
    triangles = rng.normal(size=(300, 3, 3))
    for p in rng.normal(size=(5, 3)):
        found = nearest_on_triangles(p, triangles)
        judged = [nearest_point(p, triangle) for triangle in triangles]
        np.testing.assert_allclose(found, judged, atol=1e-9)
        gap = np.linalg.norm(found - p, axis=1)
        np.testing.assert_allclose(gap, point_triangle_distance(p, triangles), atol=1e-12)


def test_a_triangle_without_area_is_a_segment() -> None:
    flat = np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]])
    np.testing.assert_allclose(nearest_on_triangles(np.array([1.5, 1, 0]), flat), [[1.5, 0, 0]])


@pytest.mark.parametrize("name", SHARP)
def test_a_block_with_something_sharp_on_it_is_measured(tmp_path: Path, name: str) -> None:
    write_obj(tmp_path / "part.obj", SHARP[name](block()))
    object_ = load_object(tmp_path / "part.obj", mu=0.3)
    plan = exact_plan(object_, top=3)
    for found in plan.grasps:
        report = certify_in_plant(object_, found.grasp, tip_radius=plan.settings.tip_radius)
        geometry = next(v for v in report.verdicts if v.name == "geometry")
        assert geometry.verdict is Verdict.HOLDS, geometry
        assert "measured on triangles" in geometry.reason
        assert ("needle" if name == "needle" else "sharp edge") in geometry.reason


def sides(level: float, height: float = 0.0) -> Array:
    """Contacts on the block's sides across x, one against two."""
    return np.array([[0.03 + height, 0, level], [-0.03, 0.01, level], [-0.03, -0.01, level]])


@pytest.mark.parametrize(
    ("p_BC", "fault"),
    [
        (sides(0.0), ""),
        (sides(0.0, height=1e-5), "fingertip 1 does not touch the object by 1e-05 m"),
        (sides(0.0, height=-1e-5), "fingertip 1 penetrates the object by 1e-05 m"),
    ],
)
def test_beside_a_burr_each_fault_is_seen(tmp_path: Path, p_BC: Array, fault: str) -> None:
    write_obj(tmp_path / "burr.obj", with_burr(block()))
    object_ = load_object(tmp_path / "burr.obj", mu=0.3)
    found = check_geometry(make_scene(object_, grasp(p_BC, [-X, X, X], 0.3), 0.002))
    assert found.refusal
    assert fault in found.faults if fault else not found.faults


def test_a_fingertip_that_a_burr_is_in_the_way_of_penetrates_it(tmp_path: Path) -> None:
    write_obj(tmp_path / "burr.obj", with_burr(block()))
    object_ = load_object(tmp_path / "burr.obj", mu=0.3)
    on_top = grasp([[0, 0.003, 0.05], [0.01, 0, -0.05], [-0.01, 0, -0.05]], [-Z, Z, Z], 0.3)
    (fault,) = check_geometry(make_scene(object_, on_top, tip_radius=0.005)).faults
    # Its centre is 3 mm beside a sheet of which the edge is higher than that.
    assert fault == "fingertip 1 penetrates the object by 0.002 m"


def refuse(*_: object) -> NoReturn:
    raise RuntimeError("Drake says\nno")


def fail_an_assertion(*_: object) -> NoReturn:
    raise SystemExit("condition 'x > 0' failed")


@pytest.mark.parametrize("error", [refuse, fail_an_assertion])
@pytest.mark.parametrize(
    ("module", "function", "undecided"),
    [
        (in_plant, "check_geometry", ["geometry", "statics", "simulation"]),
        (in_plant.statics, "find_equilibria", ["statics"]),
        (in_plant.simulation, "simulate", ["simulation"]),
        (loads, "hold", ["statics", "simulation"]),
    ],
)
def test_what_drake_refuses_is_undecided(
    monkeypatch: pytest.MonkeyPatch,
    error: object,
    module: object,
    function: str,
    undecided: Sequence[str],
) -> None:
    monkeypatch.setattr(module, function, error)
    report = certify_in_plant(model("cube"), cube_grasp(), tip_radius=0.002)
    said = {v.name: v for v in report.verdicts}
    assert [name for name, v in said.items() if v.verdict is not Verdict.HOLDS] == undecided
    assert all(said[name].verdict is Verdict.UNDECIDED for name in undecided)
    assert any(word in said[undecided[0]].reason for word in ("Drake says no", "condition 'x > 0'"))
    assert not report.holds


def test_the_command_says_what_was_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_obj(tmp_path / "burr.obj", with_burr(block()))
    assert main(["plan", "burr.obj", "--mu", "0.3", "--top", "1"]) == 0
    assert main(["verify", "burr.grasp.yaml", "--plant"]) == 1  # It states no mass to hold.
    printed = capsys.readouterr()
    assert "measured on triangles" in printed.out
    assert "internal error" not in printed.err
