"""What is said of models: once, with the file's name, and with what would mend it."""

from __future__ import annotations

from pathlib import Path

import pytest

from drake_polygrasp.cli.main import main
from drake_polygrasp.errors import MissingPackageError, ModelError
from drake_polygrasp.files.grasp_file import save_grasps
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.verification.report import Status
from drake_polygrasp.verification.verify import verify_file
from tests.support.fuzz import CUBE_OBJ
from tests.support.object_files import write_all
from tests.support.planned import exact_plan

GEOM = '<geom type="box" size=".05 .05 .05" pos="{} 0 0" mass="1" friction="1 .01 .01"/>'
MJCF = (
    '<mujoco model="m"><worldbody><body name="b"><freejoint/>\n'
    + "\n".join(GEOM.format(0.1 * k) for k in range(3))
    + "</body></worldbody></mujoco>"
)


def sdf(geometry: str, more: str = "") -> str:
    shape = f'<collision name="c"><geometry>{geometry}</geometry>{more}</collision>'
    return f'<sdf version="1.9"><model name="m"><link name="a">{shape}</link></model></sdf>'


def urdf(collision: str, links: int = 1) -> str:
    bodies = [
        f'<link name="l{k}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" '
        'ixz="0" iyz="0"/></inertial>'
        f"<collision><geometry>{collision}</geometry></collision></link>"
        for k in range(links)
    ]
    joints = [
        f'<joint name="j{k}" type="fixed"><parent link="l0"/><child link="l{k}"/>'
        f'<origin xyz="{0.1 * k} 0 0"/></joint>'
        for k in range(1, links)
    ]
    return f'<robot name="r">{"".join(bodies + joints)}</robot>'


BOX = '<box size="0.1 0.1 0.1"/>'
SDF_BOX = "<box><size>0.1 0.1 0.1</size></box>"
CONE = "<cone><radius>0.1</radius><length>0.1</length></cone>"
NORMALS_OBJ = CUBE_OBJ.replace("\nf 1 ", "\nf 1//9 ", 1)
NEGATIVE = "<surface><friction><ode><mu>-1</mu></ode></friction></surface>"


def test_one_warning_of_drake_on_many_lines_is_one_line_without_its_label(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_all(tmp_path, {"deep/m.xml": MJCF})
    (said,) = load_object(tmp_path / "deep/m.xml").warnings
    assert said.startswith(f"{tmp_path}/deep/m.xml:2 (and 2 more): The torsional and rolling")
    file = str(tmp_path / "m.grasp.yaml")
    assert main(["plan", str(tmp_path / "deep/m.xml"), "--top", "1", "-o", file]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: m.xml:2 (and 2 more): The torsional")


def test_links_that_state_no_friction_are_named_in_one_line(tmp_path: Path) -> None:
    write_all(tmp_path, {"r.urdf": urdf(BOX, 3), "one.urdf": urdf(BOX)})
    said = [w for w in load_object(tmp_path / "r.urdf").warnings if "friction" in w]
    where = f"{tmp_path}/r.urdf: body 'l0'"
    each = "each of the links 'l0', 'l1', 'l2' states no friction; 0.3 is assumed"
    assert said == [f"{where}: {each}"]
    (said,) = load_object(tmp_path / "one.urdf").warnings
    assert said.endswith("one.urdf: body 'l0' states no friction; 0.3 is assumed")


def test_shapes_that_state_no_friction_are_named_where_others_of_their_link_do(
    tmp_path: Path,
) -> None:
    geoms = "".join(GEOM.replace(' friction="1 .01 .01"', "").format(0.1 * k) for k in range(2))
    model = MJCF.replace("<freejoint/>", f"<freejoint/>{geoms}")
    write_all(tmp_path, {"m.xml": model})
    object_ = load_object(tmp_path / "m.xml")
    assert {face.mu for face in object_.polyhedron.faces} == {0.3, 1.0}
    (said,) = [w for w in object_.warnings if "states no friction" in w]
    who = "each of the collision geometries 'm::geom0', 'm::geom1'"
    assert said == f"{tmp_path}/m.xml: body 'b': {who} states no friction; 0.3 is assumed"


def test_one_line_says_which_of_two_coefficients_many_shapes_are_planned_with(
    tmp_path: Path,
) -> None:
    shapes = "".join(
        f'<collision name="c{k}"><pose>0 0 {0.1 * k} 0 0 0</pose><geometry>{SDF_BOX}</geometry>'
        f"<surface><friction><ode><mu>{mu}</mu><mu2>0.4</mu2></ode></friction></surface>"
        "</collision>"
        for k, mu in enumerate([0.5, 0.4, 0.5, 0.6])
    )
    model = f'<sdf version="1.9"><model name="m"><link name="a">{shapes}</link></model></sdf>'
    write_all(tmp_path, {"m.sdf": model})
    object_ = load_object(tmp_path / "m.sdf")
    said = [w.partition("friction of ")[2] for w in object_.warnings if "friction" in w]
    who = [w.partition(" static, 0.4 dynamic; 0.4 is used")[0] for w in said]
    assert who == ["'m::c0', 'm::c2' is 0.5", "'m::c3' is 0.6"]


def test_what_drake_says_of_a_mesh_is_said_once_and_not_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    files = {"m.sdf": sdf("<mesh><uri>cube.obj</uri></mesh>"), "cube.obj": NORMALS_OBJ}
    write_all(tmp_path, files)
    said = [w for w in load_object(tmp_path / "m.sdf").warnings if "normal indices" in w]
    assert len(said) == 1
    assert not caplog.records
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.urdf", "<sdf version='1.7'/>", "its first element is <sdf>, and Drake reads <robot>"),
        ("a.sdf", urdf(BOX), "its first element is <robot>, and Drake reads <sdf>"),
        ("a.xml", urdf(BOX), "its first element is <robot>, and Drake reads <mujoco>"),
        ("a.urdf", urdf(BOX).replace("robot", "u:robot"), "its first element is <u:robot>"),
        (
            "a.xml",
            MJCF.replace(' model="m"', ""),
            "Drake cannot load it: line 1: Your robot must have",
        ),
        ("a.sdf", sdf(SDF_BOX).replace(' version="1.9"', ""), "its <sdf> states no version; write"),
        ("a.sdf", sdf(CONE), "Drake says: line 1: Ignoring unsupported SDFormat element"),
        ("a.sdf", sdf(SDF_BOX, NEGATIVE), "(The value [-1] is less than the minimum allowed value"),
        ("a.obj", CUBE_OBJ.replace("f ", "f \\\n", 1), "export triangles, or join the lines"),
        ("a/b.txt", "", "is a folder without a model.config; name a model in it"),
        ("a.urdf", urdf('<mesh filename="package://p/b.obj"/>'), "package://p/b.obj: package 'p'"),
    ],
)
def test_what_cannot_be_read_is_named_and_so_is_the_reason(
    name: str, content: str, said: str, tmp_path: Path
) -> None:
    write_all(tmp_path, {name: content})
    path = tmp_path / Path(name).parts[0]
    with pytest.raises(ModelError) as raised:
        load_object(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert said in str(raised.value)
    assert str(raised.value).count(str(path)) == 1
    assert "; repair the mesh" not in str(raised.value)


def test_a_model_whose_package_is_unknown_is_not_checked_and_not_false(tmp_path: Path) -> None:
    write_all(
        tmp_path, {"a.urdf": urdf('<mesh filename="package://p/b.obj"/>'), "q/b.obj": CUBE_OBJ}
    )
    packages = {"p": tmp_path / "q"}
    object_ = load_object(tmp_path / "a.urdf", packages=packages)
    plan = exact_plan(object_, top=1, effort="quick")
    file = tmp_path / "a.grasp.yaml"
    save_grasps(file, object_, plan.grasps, plan.settings)
    assert verify_file(file, packages=packages).holds is True
    report = verify_file(file)
    assert report.holds is None
    assert report.grasps[0].lines["SURFACE"].status is Status.NOT_CHECKED
    assert [main(["verify", str(file), *more]) for more in ([], ["--require-model"])] == [0, 1]
    with pytest.raises(MissingPackageError, match="--package p=DIR"):
        load_object(tmp_path / "a.urdf")


@pytest.mark.parametrize("scale", ["0", "-1", "nan", "1e7", "x"])
def test_what_is_no_scale_is_told_the_whole_range(
    scale: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_all(tmp_path, {"a.obj": CUBE_OBJ})
    with pytest.raises(SystemExit) as ended:
        main(["plan", str(tmp_path / "a.obj"), "--scale", scale])
    assert ended.value.code == 2
    assert f"'{scale}' is not a number from 1e-06 to 1e+06" in capsys.readouterr().err


PREFIXLESS = '<proximity_properties><mu_dynamic value="0.5"/></proximity_properties>'


@pytest.mark.parametrize(
    ("name", "content", "place"),
    [
        ("a.sdf", sdf(SDF_BOX, "<surface><friction/></surface>"), ""),
        ("a.sdf", sdf(SDF_BOX, "<surface><friction> </friction></surface>"), ""),
        (
            "a.sdf",
            sdf(SDF_BOX, "<surface><friction>0.5</friction></surface>"),
            "<surface><friction>",
        ),
        (
            "a.urdf",
            urdf(BOX).replace("</geometry>", f"</geometry>{PREFIXLESS}"),
            "<proximity_properties><mu_dynamic>",
        ),
    ],
)
def test_a_place_of_friction_is_blamed_only_where_it_states_some(
    name: str, content: str, place: str, tmp_path: Path
) -> None:
    write_all(tmp_path, {name: content})
    (said,) = [w for w in load_object(tmp_path / name).warnings if "states no friction" in w]
    reason = f", because Drake reads no friction from {place}" if place else ""
    assert said.endswith(f"states no friction; 0.3 is assumed{reason}")
