"""Patches that were asked for: a grasp file says of what, and `verify` makes the same ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from drake_polygrasp.cli.main import make_parser
from drake_polygrasp.cli.shown_scene import load_file_scene
from drake_polygrasp.errors import GraspFileError, UsageError
from drake_polygrasp.files.grasp_file import load_grasps, save_grasps
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.verification.verify import verify_file
from tests.support.common import round_body
from tests.support.planned import exact_plan

ANGLE, DEPTH = 0.3, 2e-3


def write_egg(path: Path) -> Path:
    corners = round_body(1200, (0.03, 0.04, 0.05)).reshape(-1, 3).tolist()
    lines = [f"v {x} {y} {z}\n" for x, y, z in corners]
    lines += [f"f {k} {k + 1} {k + 2}\n" for k in range(1, len(corners), 3)]
    path.write_text("".join(lines))
    return path


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A grasp file of an egg with patches as asked for, beside its model."""
    folder = tmp_path_factory.mktemp("egg")
    egg = load_object(write_egg(folder / "egg.obj"), patch_angle=ANGLE, patch_depth=DEPTH)
    plan = exact_plan(egg, top=2)
    save_grasps(folder / "egg.grasp.yaml", egg, plan.grasps, plan.settings)
    return folder / "egg.grasp.yaml"


def changed(path: Path, change: Callable[[dict[str, float]], object]) -> Path:
    """A copy beside it whose object block is changed."""
    document = yaml.safe_load(path.read_text())
    change(document["object"])
    copy = path.with_name("changed.grasp.yaml")
    copy.write_text(yaml.safe_dump(document, sort_keys=False))
    return copy


def test_the_file_states_what_patches_were_asked_for_and_verify_makes_them(planned: Path) -> None:
    stated = load_grasps(planned).object_
    assert (stated.patch_angle, stated.patch_depth) == (ANGLE, DEPTH)
    report = verify_file(planned)
    assert report.model_checked
    assert report.holds
    assert len(load_file_scene(planned).object_.polyhedron.faces) == stated.num_faces


def test_with_other_patches_the_faces_are_not_those_of_the_file(planned: Path) -> None:
    by_default = len(load_object(planned.with_name("egg.obj")).polyhedron.faces)
    assert by_default != load_grasps(planned).object_.num_faces
    for key, value in (("patch_angle", ANGLE / 2), ("patch_depth", DEPTH / 4)):
        other = changed(planned, lambda block, key=key, value=value: block.update({key: value}))
        assert "num_faces" in verify_file(other).grasps[0].surface.reason
    silent = changed(planned, lambda block: (block.pop("patch_angle"), block.pop("patch_depth")))
    assert f"the model has {by_default}" in verify_file(silent).grasps[0].surface.reason


def test_what_was_not_asked_for_is_not_stated(planned: Path) -> None:
    egg = load_object(planned.with_name("egg.obj"))
    silent = planned.with_name("silent.grasp.yaml")
    save_grasps(silent, egg, [], StatedPlan())
    assert not {"patch_angle", "patch_depth"} & set(yaml.safe_load(silent.read_text())["object"])


@pytest.mark.parametrize("key", ["patch_angle", "patch_depth"])
@pytest.mark.parametrize("value", [0.0, -0.1, np.nan, np.inf, "0.1", None])
def test_tolerances_that_no_patch_has_are_refused(
    planned: Path, key: str, value: float | str | None
) -> None:
    with pytest.raises(GraspFileError, match=key):
        load_grasps(changed(planned, lambda block: block.update({key: value})))
    if isinstance(value, float):
        with pytest.raises(UsageError, match=f"{key} is {value}"):
            load_object(planned.with_name("egg.obj"), **{key: value})


def test_normals_within_a_patch_lean_by_less_than_a_right_angle(planned: Path) -> None:
    with pytest.raises(GraspFileError, match="patch_angle"):
        load_grasps(changed(planned, lambda block: block.update(patch_angle=1.58)))
    with pytest.raises(UsageError, match="it must be radians"):
        load_object(planned.with_name("egg.obj"), patch_angle=1.58)


@pytest.mark.parametrize(
    ("option", "value"),
    [("--patch-angle", v) for v in ("0", "-1", "1.58", "nan", "wide")]
    + [("--patch-depth", v) for v in ("0", "-1", "inf", "deep")],
)
def test_the_command_line_refuses_them_too(
    option: str, value: str, capsys: pytest.CaptureFixture[str]
) -> None:
    accepted = make_parser().parse_args(["plan", "egg.obj", option, "0.2"])
    assert 0.2 in (accepted.patch_angle, accepted.patch_depth)
    with pytest.raises(SystemExit, match="2"):
        make_parser().parse_args(["plan", "egg.obj", option, value])
    assert option in capsys.readouterr().err
