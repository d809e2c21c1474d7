"""Faces and directions to avoid: no contact is there, every set is counted, and files say so."""

from __future__ import annotations

import json
from functools import cache
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shapely
import yaml
from scipy.spatial.transform import Rotation

from drake_polygrasp import (
    GraspFileError,
    GraspObject,
    UsageError,
    explain_sets,
    load_grasps,
    load_object,
    plan_grasps,
    save_grasps,
    verify_file,
)
from drake_polygrasp.cli.main import main
from drake_polygrasp.geometry.exclusion import AVOID_ANGLE, Exclusion, exclusion, unit_direction
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.geometry.surface import build_polyhedron, curved_part
from drake_polygrasp.settings import Method
from drake_polygrasp.verification.report import Status
from tests.support.common import round_body
from tests.support.convex_polyhedra import holed_prism, tangent_polyhedron
from tests.support.planned import exact_plan
from tests.support.solids import cube, object_of, regular_prism, solid

MODELS = Path(__file__).parents[2] / "models"
CUBE = MODELS / "cube" / "cube.sdf"
DOWN = (0.0, 0.0, -1.0)
OBJECTS = {
    "cube": cube,
    "hexagonal prism": lambda: regular_prism(6),
    "holed prism": lambda: solid(holed_prism(4, 1, 0)),
    "ten faces": lambda: solid(tangent_polyhedron(10, 1)),
    "thirty faces": lambda: solid(tangent_polyhedron(30, 0)),
}


@cache
def sphere() -> GraspObject:
    radii = np.array([0.04, 0.04, 0.04])
    ball = Primitive("ellipsoid", np.eye(3), np.zeros(3), radii)
    return object_of(build_polyhedron([curved_part(ball, 0.5)]))


@cache
def scan() -> GraspObject:
    """An ellipsoid of so many facets that they make patches."""
    return solid(round_body(1200, (0.05, 0.04, 0.03)), mu=0.5)


@cache
def named(name: str) -> GraspObject:
    return {"sphere": sphere, "scan": scan, **OBJECTS}[name]()


def num_sets(n: int) -> int:
    """Of three and of two among n regions."""
    return comb(n, 3) + comb(n, 2)


def outward(object_: GraspObject, **avoided: Any) -> npt.NDArray[np.float64]:
    """Outward normals of all planned contacts, one row each."""
    grasps = exact_plan(object_, **avoided).grasps
    return np.concatenate([-certified.grasp.nhat_TB_B for certified in grasps])


@pytest.mark.parametrize("method", ["paper", "enriched"])
@pytest.mark.parametrize("name", OBJECTS)
def test_no_contact_is_on_an_excluded_face_and_every_set_is_counted(
    name: str, method: Method
) -> None:
    object_ = named(name)
    used = exact_plan(object_, method=method).grasps[0].grasp.faces[0]
    plan = exact_plan(object_, method=method, exclude_faces=[used])
    assert plan.grasps
    assert used not in {face for g in plan.grasps for face in g.grasp.faces}
    face = erode(object_.polyhedron).face
    n, m = len(face), int((face != used).sum())
    assert plan.num_sets == num_sets(n) == sum(plan.reasons.values())
    assert plan.reasons["excluded"] == num_sets(n) - num_sets(m)
    assert plan.excluded_faces == (used,)


@pytest.mark.parametrize("name", ["cube", "hexagonal prism", "holed prism", "ten faces"])
def test_excluding_a_face_changes_nothing_for_the_sets_without_it(name: str) -> None:
    before = explain_sets(named(name), method="paper")
    after = explain_sets(named(name), method="paper", exclude_faces=[1])
    assert after.faces.tolist() == before.faces.tolist()
    with_it = (before.faces == 1).any(axis=1)
    expected = np.where(with_it, "excluded", before.reasons)
    assert after.reasons == expected.tolist()
    assert after.counts["excluded"] == with_it.sum()
    assert sum(after.counts.values()) == len(after.reasons)


def test_a_direction_excludes_the_faces_within_45_degrees_of_it() -> None:
    angle = np.deg2rad([0, 30, 44.9, 45, 45.1, 90, 180])
    nhat = np.column_stack([np.sin(angle), np.zeros(7), -np.cos(angle)])
    avoided = exclusion([DOWN]).avoids(-nhat, np.arange(7))
    assert avoided.tolist() == [True, True, True, True, False, False, False]
    assert pytest.approx(np.pi / 4) == AVOID_ANGLE


def test_a_cubes_underside_is_the_face_of_its_normal() -> None:
    box = named("cube")
    down = [k for k, f in enumerate(box.polyhedron.faces) if np.allclose(f.R_BF[:, 2], DOWN)]
    by_index = exact_plan(box, exclude_faces=down)
    by_direction = exact_plan(box, avoid_directions=[DOWN])
    assert by_index.excluded_faces == by_direction.excluded_faces == tuple(down)
    assert by_index.reasons == by_direction.reasons
    for one, other in zip(by_index.grasps, by_direction.grasps, strict=True):
        assert np.array_equal(one.grasp.p_BC, other.grasp.p_BC)


def test_a_directions_length_means_nothing() -> None:
    for size in (1e-300, 1e-3, 7.0, 1e300):
        scaled = exclusion([unit_direction(size * np.array([1.0, 2.0, -2.0]))])
        assert scaled.directions_B == pytest.approx(np.array([[1.0, 2.0, -2.0]]) / 3)


@pytest.mark.parametrize("name", ["sphere", "scan"])
def test_on_curved_surfaces_the_true_normals_keep_off(name: str) -> None:
    side = [1.0, 1.0, 1.0] / np.sqrt(3)
    directions = [side, Rotation.from_euler("z", 180, degrees=True).apply(side)]
    limit = np.cos(np.pi / 4)
    cosines = outward(named(name), avoid_directions=directions) @ np.transpose(directions)
    assert cosines.size
    assert cosines.max() < limit
    free = outward(named(name)) @ np.transpose(directions)
    assert free.max() > limit


@pytest.mark.parametrize("name", ["cube", "sphere"])
def test_nothing_is_left_when_all_is_excluded(name: str) -> None:
    n = len(named(name).polyhedron.faces)
    for avoided in (
        {"exclude_faces": range(n)},
        {"avoid_directions": [v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)] - np.ones(3)},
    ):
        plan = exact_plan(named(name), **avoided)  # type: ignore[arg-type]
        assert not plan.grasps
        assert plan.mu_needed is None
        assert sum(plan.reasons.values()) == plan.num_sets
        if "exclude_faces" in avoided:
            assert plan.reasons == {"excluded": plan.num_sets}


@pytest.mark.parametrize(
    ("avoided", "complaint"),
    [
        ({"avoid_directions": [(0, 0, 0)]}, "not all 0"),
        ({"avoid_directions": [(0, 0, np.nan)]}, "three finite numbers"),
        ({"avoid_directions": [(0, np.inf, 1)]}, "three finite numbers"),
        ({"avoid_directions": [(0, 1)]}, "three finite numbers"),
        ({"avoid_directions": (0, 0, -1)}, "three finite numbers"),
        ({"avoid_directions": ["down"]}, "three finite numbers"),
        ({"exclude_faces": [6]}, "0 to 5"),
        ({"exclude_faces": [-1]}, "0 to 5"),
        ({"exclude_faces": [0.5]}, r"exclude_faces\[0\] is 0.5; it must be the index of a face"),
        ({"exclude_faces": "0"}, "must be a list"),
    ],
)
def test_what_cannot_be_avoided_is_refused(avoided: dict[str, Any], complaint: str) -> None:
    for function in (plan_grasps, explain_sets):
        with pytest.raises(UsageError, match=complaint):
            function(named("cube"), **avoided)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Of a cube whose underside and one side are excluded."""
    path = tmp_path / "cube.grasp.yaml"
    object_ = load_object(CUBE)
    plan = exact_plan(object_, avoid_directions=[DOWN], exclude_faces=[0], top=2)
    save_grasps(path, object_, plan.grasps, plan.settings)
    return path


def test_a_grasp_file_says_what_was_excluded(file: Path) -> None:
    plan = load_grasps(file).plan
    assert plan.exclusion.directions_B.tolist() == [list(DOWN)]
    assert plan.exclusion.angle == AVOID_ANGLE
    assert plan.exclusion.faces == (0,)
    assert verify_file(file).holds


def test_without_exclusion_a_grasp_file_says_nothing_of_it() -> None:
    assert not {"avoid_directions", "avoid_angle", "exclude_faces", "obstacles"} & set(
        exact_plan(named("cube"), top=1).settings.stated
    )


def test_a_file_whose_grasps_are_where_its_plan_avoids_does_not_verify(file: Path) -> None:
    document = yaml.safe_load(file.read_text())
    used = document["grasps"][0]["faces"][0]
    for settings in ({"exclude_faces": [used]}, {"avoid_angle": 3.0}):
        spoilt = document | {"plan": document["plan"] | settings}
        file.write_text(yaml.safe_dump(spoilt))
        surface = verify_file(file).grasps[0].surface
        assert surface.status is Status.FAILED
        assert "where the plan says that no finger may be" in surface.reason


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        ({"avoid_directions": [[0, 0]]}, r"plan.avoid_directions\[0\]"),
        ({"avoid_directions": [[0, 0, -1], [0, 0, -2]]}, "unit vectors"),
        ({"avoid_directions": -1}, "plan.avoid_directions"),
        ({"avoid_angle": 4}, "plan.avoid_angle"),
        ({"avoid_angle": "wide"}, "plan.avoid_angle"),
        ({"exclude_faces": [6]}, "plan.exclude_faces"),
        ({"exclude_faces": [True]}, "plan.exclude_faces"),
        ({"exclude_faces": 3}, "plan.exclude_faces"),
        ({"obstacles": [1]}, "plan.obstacles"),
    ],
)
def test_a_file_with_settings_that_cannot_be_is_refused(
    file: Path, settings: dict[str, Any], place: str
) -> None:
    document = yaml.safe_load(file.read_text())
    file.write_text(yaml.safe_dump(document | {"plan": document["plan"] | settings}))
    with pytest.raises(GraspFileError, match=place):
        load_grasps(file)


def test_the_commands_take_directions_and_faces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    down, up = ["--avoid-direction", "0", "0", "-1"], ["--avoid-direction", "0", "0", "1"]
    avoided = [*down, *up, "--exclude-faces", "0,5"]
    assert main(["explain", str(CUBE), *avoided, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["excluded_faces"] == [0, 2, 3, 5]
    assert document["reasons"]["excluded"] == num_sets(6) - 1
    assert main(["explain", str(CUBE), *avoided]) == 0
    assert "6 faces (excluded: 0 2 3 5), 35 sets" in capsys.readouterr().out
    assert main(["plan", str(CUBE), *avoided, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["excluded_faces"] == [0, 2, 3, 5]
    assert {face for grasp in document["grasps"] for face in grasp["faces"]} == {1, 4}


@pytest.mark.parametrize(
    ("avoided", "code", "complaint"),
    [
        ("--exclude-faces 0,1,2,3,4,5", 1, "no certified grasp; all 35 sets of faces"),
        ("--exclude-faces 0,6", 2, "face 6 cannot be excluded"),
        ("--avoid-direction 0 0 0", 2, "not all 0"),
    ],
)
def test_the_command_says_in_one_line_what_is_wrong(
    avoided: str,
    code: int,
    complaint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", str(CUBE), *avoided.split()]) == code
    error = capsys.readouterr().err
    assert complaint in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize("avoided", ["--avoid-direction 0 0 x", "--exclude-faces 1,,2"])
def test_what_is_no_number_is_a_usage_error(avoided: str) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["plan", str(CUBE), *avoided.split()])


def test_no_exclusion_avoids_nothing() -> None:
    nothing = Exclusion(np.empty((0, 3)), ())
    assert not nothing
    assert not nothing.avoids(np.eye(3), np.arange(3)).any()


@pytest.mark.parametrize("name", ["holed prism", "thirty faces"])
def test_some_regions_keep_their_rings(name: str) -> None:
    """Ragged boundaries, sliced anew: those of each polygon in its face's frame."""
    regions = erode(named(name).polyhedron)
    kept = np.random.default_rng(0).random(len(regions.face)) < 0.5
    some = regions.take(kept)
    assert some.face.tolist() == regions.face[kept].tolist()
    for r, polygon in enumerate(some.polygon_F):
        first, last = some.ring_offsets[some.region_offsets[r : r + 2]]
        p_BV = some.p_BF[r] + shapely.get_coordinates(polygon) @ some.R_BF[r][:, :2].T
        assert some.p_BV[first:last] == pytest.approx(p_BV, abs=1e-15)
    assert len(some.p_BV) == some.ring_offsets[-1]
    assert len(some.ring_offsets) == some.region_offsets[-1] + 1
    assert len(some.region_offsets) == kept.sum() + 1
