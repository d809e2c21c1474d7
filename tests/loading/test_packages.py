"""Packages of a model's URIs: ROS packages, Gazebo model folders, folders that the user names."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from drake_polygrasp.cli.main import make_parser
from drake_polygrasp.errors import ModelError, UsageError
from drake_polygrasp.loading.model_source import model_digest
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.loading.packages import find_packages, missing_package, resolve
from drake_polygrasp.loading.parsed_model import choose_body, parse_files
from drake_polygrasp.plant.certify_in_plant import certify_in_plant
from tests.support.fuzz import CUBE_OBJ, run
from tests.support.object_files import write_all
from tests.support.planned import exact_plan


def model(collision: str, visual: str = "") -> str:
    shown = f'<visual name="v"><geometry><mesh><uri>{visual}</uri></mesh></geometry></visual>'
    return (
        '<sdf version="1.7"><model name="part"><link name="part"><inertial><mass>0.3</mass>'
        f'</inertial><collision name="c"><geometry><mesh><uri>{collision}</uri></mesh></geometry>'
        "<surface><friction><ode><mu>1</mu><mu2>1</mu2></ode></friction></surface></collision>"
        f"{shown if visual else ''}</link></model></sdf>"
    )


CONFIG = "<?xml version='1.0'?><model><name>Another name</name>"
CONFIG += "<sdf version='1.5'>old.sdf</sdf><sdf version='1.10'>model.sdf</sdf>"
CONFIG += "<sdf version='1.9'>other.sdf</sdf></model>"
PACKAGE = "<package><name>{}</name></package>"
VISUAL = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
INCLUDE = '<sdf version="1.7"><model name="all"><include><uri>{}</uri></include></model></sdf>'
MASS = 0.3


def test_a_gazebo_folder_is_a_package_of_its_own_name_and_so_are_its_siblings(
    tmp_path: Path,
) -> None:
    write_all(
        tmp_path,
        {
            "box/model.config": CONFIG,
            "box/model.sdf": model("model://box/cube.obj", "model://box/seen.obj"),
            "box/cube.obj": CUBE_OBJ,
            "box/seen.obj": VISUAL,
            "copy/model.config": CONFIG,
            "copy/model.sdf": model("package://box/cube.obj", "model://box/seen.obj"),
            "copy/deep/model.sdf": model("model://box/cube.obj"),
            "copy/whole.sdf": INCLUDE.format("model://box/"),
            "stray.sdf": model("model://box/cube.obj"),
        },
    )
    for name in ("box/model.sdf", "copy/model.sdf", "copy/deep/model.sdf", "copy/whole.sdf"):
        assert load_object(tmp_path / name).mass == MASS
    with pytest.raises(ModelError, match="package 'box' is unknown; name its folder"):
        load_object(tmp_path / "stray.sdf")
    for known in ({"package_paths": [tmp_path]}, {"packages": {"box": tmp_path / "box"}}):
        assert load_object(tmp_path / "stray.sdf", **known).mass == MASS  # type: ignore[arg-type]
    write_all(tmp_path, {"wrong.sdf": model("model://Another name/cube.obj")})
    with pytest.raises(ModelError, match="package 'Another name' is unknown"):
        load_object(tmp_path / "wrong.sdf", package_paths=[tmp_path])


def test_a_named_folder_comes_before_all_that_are_found(tmp_path: Path) -> None:
    write_all(
        tmp_path,
        {
            "package.xml": "<package><name>",
            "found/package.xml": PACKAGE.format("thing"),
            "found/model.sdf": model("package://thing/cube.obj"),
            "found/cube.obj": CUBE_OBJ,
            "named/cube.obj": "\n".join(
                line.replace("1", "2") if line.startswith("v") else line
                for line in CUBE_OBJ.splitlines()
            ),
        },
    )
    file = tmp_path / "found/model.sdf"
    diameters = [
        load_object(file, packages=packages).polyhedron.diameter
        for packages in (None, {"thing": tmp_path / "named"})
    ]
    assert diameters[1] == pytest.approx(2 * diameters[0])
    assert model_digest(file) != model_digest(file, packages={"thing": tmp_path / "named"})


def test_a_malformed_folder_or_dict_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "model.sdf"
    write_all(tmp_path, {"model.sdf": model("package://a/cube.obj"), "bad/package.xml": "<p>"})
    with pytest.raises(ModelError, match=r"gone: no such folder of package 'a'"):
        load_object(file, packages={"a": tmp_path / "gone"})
    with pytest.raises(ModelError, match="a package below it cannot be read"):
        load_object(file, package_paths=[tmp_path / "bad"])
    for packages in ({"a": 5}, {5: tmp_path}, ["a"], {"": tmp_path}):
        with pytest.raises(UsageError, match="packages"):
            load_object(file, packages=packages)  # type: ignore[arg-type]


NETWORK = "meshcat:package_map"
REMOTE = r"package 'drake_models' is one that Drake downloads, and nothing is downloaded here"


@pytest.fixture
def offline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A machine on which Drake has never downloaded a package, and a folder for models."""
    for variable in ("HOME", "TEST_TMPDIR", "XDG_CACHE_HOME"):
        monkeypatch.setenv(variable, str(tmp_path / "home"))
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("DRAKE_ALLOW_NETWORK", NETWORK)
    return tmp_path


def test_a_package_that_drake_would_download_is_refused(
    offline: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    dish = "package://drake_models/dishes/plate.obj"
    write_all(
        offline,
        {
            "part.sdf": model(dish),
            "seen.sdf": model("cube.obj", dish),
            "cube.obj": CUBE_OBJ,
            "copy/package.xml": PACKAGE.format("drake_models"),
            "copy/dishes/plate.obj": CUBE_OBJ,
        },
    )
    for name in ("part.sdf", "seen.sdf"):
        with pytest.raises(ModelError, match=f"{REMOTE}; name a copy") as error:
            load_object(offline / name)
        assert "\n" not in str(error.value)
        for known in (
            {"packages": {"drake_models": offline / "copy"}},
            {"package_paths": [offline]},
        ):
            assert load_object(offline / name, **known).mass == MASS  # type: ignore[arg-type]
    assert "Downloading" not in "".join(capfd.readouterr())
    assert os.environ["DRAKE_ALLOW_NETWORK"] == NETWORK
    # Whoever keeps the copy where the model is names nothing.
    write_all(offline, {"copy/part.sdf": model(dish)})
    assert load_object(offline / "copy/part.sdf").mass == MASS


def test_every_command_takes_the_folder_of_a_package(offline: Path) -> None:
    write_all(offline, {"part.sdf": model("model://a/cube.obj"), "b/cube.obj": CUBE_OBJ})
    ending = run("plan part.sdf", offline, 60)
    assert (ending.code, ending.fault) == (2, "")
    assert "--package a=DIR" in ending.said
    assert run("plan part.sdf --top 1 --effort quick --package a=b", offline, 60).code == 0
    unchecked = run("verify part.grasp.yaml --require-model", offline, 60)
    assert (unchecked.code, "--package a=DIR" in unchecked.said) == (1, True)
    for command in (
        "verify part.grasp.yaml --require-model",
        "explain part.sdf --set 0,1",
        "show part.grasp.yaml --html page.html",
    ):
        ending = run(f"{command} --package a=b", offline, 60)
        assert ending.code == 0, ending.said
    for wrong in ("a", "=b", "a="):
        with pytest.raises(SystemExit):
            make_parser().parse_args(["plan", "part.sdf", "--package", wrong])


def test_a_remote_package_is_one_line_of_the_command(offline: Path) -> None:
    write_all(offline, {"part.sdf": model("package://drake_models/dishes/plate.obj")})
    ending = run("plan part.sdf", offline, 60)
    assert (ending.code, ending.fault, ending.said.count("\n")) == (2, "", 1)
    assert "--package drake_models=DIR" in ending.said


def test_a_plant_reads_the_model_with_the_same_packages(tmp_path: Path) -> None:

    write_all(tmp_path, {"part.sdf": model("model://a/cube.obj"), "b/cube.obj": CUBE_OBJ})
    packages = {"a": tmp_path / "b"}
    thing = load_object(tmp_path / "part.sdf", packages=packages)
    (grasp,) = exact_plan(thing, top=1, effort="quick").grasps
    with pytest.raises(ModelError, match="package 'a' is unknown"):
        certify_in_plant(thing, grasp)
    report = certify_in_plant(thing, grasp, packages=packages)
    assert {verdict.name: verdict.verdict for verdict in report.verdicts}["geometry"] == "holds"


def test_a_uri_means_what_it_means_to_drake(tmp_path: Path) -> None:
    package_map = find_packages(tmp_path / "x.sdf", packages={"a": tmp_path})
    assert resolve(" model://a//b/c.obj ", Path("d"), package_map) == tmp_path / "b/c.obj"
    assert resolve("file:///b/c.obj", Path("d"), package_map) == Path("/b/c.obj")
    assert resolve("b/c.obj", Path("d"), package_map) == Path("d/b/c.obj")
    with pytest.raises(ModelError, match="needs a slash after the package's name; write model://a"):
        resolve("model://a", Path("d"), package_map)
    assert missing_package("something else") is None


SUB_MESH = model("cube.obj").replace('"part"', '"sub"')


def opened_by_drake(model_file: Path) -> list[Path]:
    parsed = choose_body(parse_files(model_file))
    inspector = parsed.scene_graph.model_inspector()
    colliders = parsed.group.colliders(parsed.plant, inspector)
    return [Path(inspector.GetShape(c.geometry).source().path()) for c in colliders]


def test_the_meshes_of_an_included_sdf_are_those_that_drake_opens(tmp_path: Path) -> None:
    """Drake takes their paths as relative to the SDF that it began with."""
    write_all(
        tmp_path,
        {
            "outer.sdf": INCLUDE.format((tmp_path / "sub/sub.sdf").as_uri()),
            "cube.obj": CUBE_OBJ,
            "sub/sub.sdf": SUB_MESH,
            "sub/cube.obj": CUBE_OBJ + "# another",
        },
    )
    assert opened_by_drake(tmp_path / "outer.sdf") == [tmp_path / "cube.obj"]
    before = model_digest(tmp_path / "outer.sdf")
    write_all(tmp_path, {"sub/cube.obj": CUBE_OBJ + "# changed"})
    assert model_digest(tmp_path / "outer.sdf") == before
    write_all(tmp_path, {"cube.obj": CUBE_OBJ + "# changed"})
    assert model_digest(tmp_path / "outer.sdf") != before


def test_a_relative_include_is_refused_unless_drake_finds_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drake looks for it in the current folder; the digest must be of what Drake reads."""
    write_all(
        tmp_path,
        {
            "a/outer.sdf": INCLUDE.format("part.sdf"),
            "a/part.sdf": SUB_MESH,
            "a/cube.obj": CUBE_OBJ,
            "b/part.sdf": SUB_MESH,
        },
    )
    for folder in ("b", "."):
        monkeypatch.chdir(tmp_path / folder)
        with pytest.raises(ModelError, match="Drake looks for in the current folder"):
            load_object(tmp_path / "a/outer.sdf")
    monkeypatch.chdir(tmp_path / "a")
    assert load_object("outer.sdf").mass == MASS
