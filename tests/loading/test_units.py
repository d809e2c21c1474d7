"""Lengths that look like no metres are said, and an OBJ model can be scaled to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.geometry import Mesh
from pydrake.multibody.tree import CalcSpatialInertia

from drake_polygrasp.cli.main import main
from drake_polygrasp.errors import GraspFileError, UsageError
from drake_polygrasp.files.grasp_file import load_grasps, save_grasps
from drake_polygrasp.loading.object_model import load_object, load_solid
from drake_polygrasp.plant.certify_in_plant import certify_in_plant
from drake_polygrasp.verification.report import Status
from drake_polygrasp.verification.verify import verify_file
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.planned import exact_plan
from tests.support.solids import regular_polygon


def hexagon(folder: Path, scale: float = 1.0, name: str = "hexagon.obj") -> Path:
    """A prism of 40 mm radius and 60 mm height, times a scale."""
    write_obj(folder / name, scale * prism(regular_polygon(6), 0.06))
    return folder / name


@pytest.mark.parametrize(("scale", "said"), [(1000, "100 m"), (1.0, ""), (1e-3, "0.0001 m")])
def test_a_body_of_unlikely_size_gets_one_line_about_units(
    scale: float, said: str, tmp_path: Path
) -> None:
    warnings = load_object(hexagon(tmp_path, scale)).warnings
    doubts = [warning for warning in warnings if "across" in warning]
    assert len(doubts) == bool(said)
    assert all(f"is {said} across" in w and "--scale" in w for w in doubts)
    assert all(("millimetres" in w) == (scale > 1) for w in doubts)


def test_millimetres_scaled_are_metres(tmp_path: Path) -> None:
    metres = load_object(hexagon(tmp_path))
    scaled = load_object(hexagon(tmp_path, 1000.0, "mm.obj"), scale=0.001)
    assert scaled.polyhedron.diameter == pytest.approx(0.1)
    np.testing.assert_allclose(scaled.p_BBcm, metres.p_BBcm, atol=1e-12)
    assert not [warning for warning in scaled.warnings if "across" in warning]
    assert scaled.source is not None
    M_BBo_B = load_solid(scaled.source).M_BBo_B
    there = CalcSpatialInertia(Mesh(str(tmp_path / "mm.obj"), 0.001), 1000.0)
    np.testing.assert_array_equal(M_BBo_B.CopyToFullMatrix6(), there.CopyToFullMatrix6())


def test_the_scale_is_in_the_file_and_repeated_by_whoever_reads_it(tmp_path: Path) -> None:
    object_ = load_object(hexagon(tmp_path, 1000.0), scale=0.001)
    plan = exact_plan(object_, top=1)
    file = tmp_path / "hexagon.grasp.yaml"
    save_grasps(file, object_, plan.grasps, plan.settings)
    assert load_grasps(file).object_.scale == 0.001
    report = verify_file(file)
    assert [line.status for line in report.grasps[0].lines.values()] == [
        Status.PROVED,
        Status.RECOMPUTED,
        Status.RECOMPUTED,
    ]
    assert main(["show", str(file), "--html", str(tmp_path / "page.html")]) == 0
    verdicts = certify_in_plant(object_, plan.grasps[0].grasp, tip_radius=0.002).verdicts
    assert {v.verdict for v in verdicts if v.name == "geometry"} == {"holds"}
    document = yaml.safe_load(file.read_text())
    del document["object"]["scale"]
    file.write_text(yaml.safe_dump(document))
    assert verify_file(file).grasps[0].surface.status is Status.FAILED
    document["object"] |= {"scale": 0.001, "model_file": "hexagon.sdf"}
    file.write_text(yaml.safe_dump(document))
    with pytest.raises(GraspFileError, match=r"scale.* only \.obj models have one"):
        load_grasps(file)


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("x.sdf", "the <scale> of its <mesh>"),
        ("x.urdf", "the scale attribute of its <mesh>"),
        ("x.xml", "in its <asset>"),
        ("x.dmd.yaml", "the models that it adds"),
    ],
)
def test_other_models_state_their_own_scale(name: str, remedy: str) -> None:
    with pytest.raises(UsageError, match=f"scale is for .obj models; {name} states .*{remedy}"):
        load_object(name, scale=2.0)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.inf, np.nan, 1e9, "2", True])
def test_a_scale_is_a_factor(scale: object, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"scale is .*; it must be a factor from 1e-06 to 1e"):
        load_object(hexagon(tmp_path), scale=scale)  # type: ignore[arg-type]


def test_the_command_line_scales_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    hexagon(tmp_path, 1000.0)
    assert main(["plan", "hexagon.obj", "--scale", "0.001", "--top", "1"]) == 0
    assert yaml.safe_load(Path("hexagon.grasp.yaml").read_text())["object"]["scale"] == 0.001
    assert main(["verify", "hexagon.grasp.yaml", "--require-model"]) == 0
    assert main(["show", "hexagon.grasp.yaml", "--scale", "2"]) == 2
    assert "leave them out" in capsys.readouterr().err
