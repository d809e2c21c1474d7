"""From model files to objects: shapes, poses, bodies, friction, mass, and clear errors."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from drake_polygrasp.errors import ModelError, UsageError
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.model_source import model_digest
from drake_polygrasp.loading.object_model import load_object
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.grasp_files import TETRAHEDRON_VTK

SDF = '<?xml version="1.0"?><sdf version="1.9" xmlns:drake="drake.mit.edu">{}</sdf>'
INERTIAL = "<inertial><mass>2</mass></inertial>"
MU = (
    "<drake:proximity_properties><drake:mu_static>{0}</drake:mu_static>"
    "<drake:mu_dynamic>{1}</drake:mu_dynamic></drake:proximity_properties>"
)
L_PROFILE = shapely.Polygon([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.2), (0, 0.2)])
L_AREA = 2 * L_PROFILE.area + 0.1 * L_PROFILE.length

Write = Callable[[str, str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a file into a folder that holds l.obj, an L bracket, as well."""
    write_obj(tmp_path / "l.obj", prism(L_PROFILE, 0.1))

    def write(name: str, content: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
        return path

    return write


def box(size: str = "0.1 0.2 0.4", extra: str = MU.format(0.5, 0.5), name: str = "c") -> str:
    shape = f"<geometry><box><size>{size}</size></box></geometry>"
    return f'<collision name="{name}">{shape}{extra}</collision>'


def mesh(inner: str = "<uri>l.obj</uri>", extra: str = MU.format(0.5, 0.5)) -> str:
    return f'<collision name="m"><geometry><mesh>{inner}</mesh></geometry>{extra}</collision>'


def link(*collisions: str, inertial: str = INERTIAL, name: str = "thing") -> str:
    return f'<link name="{name}">{inertial}{"".join(collisions)}</link>'


def sdf(*links: str) -> str:
    return SDF.format(f'<model name="model">{"".join(links)}</model>')


def urdf_link(collision: str, inertial: str = '<mass value="2"/>') -> str:
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    inertial = f"<inertial>{inertial}{inertia}</inertial>" if inertial else ""
    return (
        '<robot name="model" xmlns:drake="drake.mit.edu"><link name="thing">'
        f"{inertial}<collision>{collision}</collision></link></robot>"
    )


def area(thing: GraspObject) -> float:
    return sum(face.polygon_F.area for face in thing.polyhedron.faces)


def test_a_box_from_sdf(write: Write) -> None:
    path = write("model.sdf", sdf(link(box())))
    thing = load_object(path)
    assert len(thing.polyhedron.faces) == 6
    assert area(thing) == pytest.approx(0.28)
    assert thing.mass == 2
    assert thing.p_BBcm.tolist() == [0, 0, 0]
    assert thing.rho == pytest.approx(sqrt(0.05**2 + 0.1**2 + 0.2**2))
    assert thing.warnings == ()
    assert thing.source is not None
    assert (thing.source.model_file, thing.source.model_name) == (path, "model")
    assert thing.source.body_name == "thing"


def test_a_box_from_urdf_and_from_mjcf(write: Write) -> None:
    friction = (
        '<drake:proximity_properties><drake:mu_static value="0.4"/></drake:proximity_properties>'
    )
    urdf = write(
        "model.urdf", urdf_link(f'<geometry><box size="0.1 0.2 0.4"/></geometry>{friction}')
    )
    body = '<body name="thing"><freejoint/><geom type="box" size=".05 .1 .2" friction=".4"/></body>'
    mjcf = write("model.xml", f'<mujoco model="m"><worldbody>{body}</worldbody></mujoco>')
    for thing in (load_object(urdf), load_object(mjcf)):
        assert area(thing) == pytest.approx(0.28)
        assert {face.mu for face in thing.polyhedron.faces} == {0.4}
    assert load_object(mjcf).mass == pytest.approx(1000 * 0.1 * 0.2 * 0.4)


def test_a_mesh_is_its_true_surface_and_not_its_hull(write: Write) -> None:
    thing = load_object(write("model.sdf", sdf(link(mesh()))))
    assert len(thing.polyhedron.faces) == 8
    assert area(thing) == pytest.approx(L_AREA)


def test_a_convex_mesh_is_its_hull(write: Write) -> None:
    convex = mesh("<uri>l.obj</uri><drake:declare_convex/>")
    thing = load_object(write("model.sdf", sdf(link(convex))))
    hull = L_PROFILE.convex_hull
    assert area(thing) == pytest.approx(2 * hull.area + 0.1 * hull.length)
    assert len(thing.polyhedron.faces) == 7


@pytest.mark.parametrize("scale", [(2.0, 2.0, 2.0), (-1.0, 1.0, 1.0), (1.0, -2.0, 0.5)])
def test_a_mesh_may_be_scaled_and_mirrored(scale: tuple[float, float, float], write: Write) -> None:
    text = " ".join(map(str, scale))
    inner = f"<uri>l.obj</uri><scale>{text}</scale>"
    thing = load_object(write("model.sdf", sdf(link(mesh(inner), inertial=""))))
    x, y, z = np.abs(scale)
    profile = shapely.affinity.scale(L_PROFILE, x, y)
    assert area(thing) == pytest.approx(2 * profile.area + 0.1 * z * profile.length)
    centroid = [*np.ravel(L_PROFILE.centroid.coords), 0.05] * np.array(scale)
    np.testing.assert_allclose(thing.p_BBcm, centroid, atol=1e-9)


def test_a_posed_part_is_where_its_pose_puts_it(write: Write) -> None:
    pose = "<pose>0.3 -0.1 0.2 0.4 0.5 0.6</pose>"
    thing = load_object(write("model.sdf", sdf(link(mesh(extra=pose), inertial=""))))
    R = Rotation.from_euler("xyz", [0.4, 0.5, 0.6]).as_matrix()
    centroid = R @ [*np.ravel(L_PROFILE.centroid.coords), 0.05] + [0.3, -0.1, 0.2]
    np.testing.assert_allclose(thing.p_BBcm, centroid, atol=1e-9)
    normals = {tuple(np.round(R.T @ f.nhat_TB_B, 6) + 0.0) for f in thing.polyhedron.faces}
    assert normals == {tuple(s * e) for e in np.eye(3) for s in (1.0, -1.0)}


def test_a_vtk_mesh_is_the_surface_of_its_tetrahedra(write: Write) -> None:
    write("t.vtk", TETRAHEDRON_VTK)
    thing = load_object(write("model.sdf", sdf(link(mesh("<uri>t.vtk</uri>")))))
    assert area(thing) == pytest.approx(1.5 + sqrt(3) / 2)


def test_an_obj_alone_is_an_object_that_states_nothing(tmp_path: Path) -> None:
    write_obj(tmp_path / "l.obj", prism(L_PROFILE, 0.1))
    thing = load_object(tmp_path / "l.obj")
    assert area(thing) == pytest.approx(L_AREA)
    assert thing.mass is None
    assert [w.partition("states ")[2][:11] for w in thing.warnings] == [
        "no friction",
        "no mass; it",
    ]


def test_parts_are_merged_and_keep_their_friction(write: Write) -> None:
    other = box(extra=MU.format(0.6, 0.6) + "<pose>0 0 0.4 0 0 0</pose>", name="d")
    thing = load_object(write("model.sdf", sdf(link(box(), other))))
    assert sorted(face.mu for face in thing.polyhedron.faces) == [0.5] * 5 + [0.6] * 5
    assert area(thing) == pytest.approx(2 * 0.28 - 2 * 0.02)


FRICTION = {
    "sdf, drake": (box(), 0.5, []),
    "sdf, ode": (
        box(extra="<surface><friction><ode><mu>.7</mu><mu2>.7</mu2></ode></friction></surface>"),
        0.7,
        [],
    ),
    "an explicit 1": (box(extra=MU.format(1, 1)), 1.0, []),
    "dynamic below static": (box(extra=MU.format(0.5, 0.3)), 0.3, ["0.5 static, 0.3 dynamic"]),
    "none": (box(extra=""), 0.3, ["states no friction; 0.3 is assumed"]),
    "an empty surface": (box(extra="<surface/>"), 0.3, ["states no friction"]),
}


@pytest.mark.parametrize("name", FRICTION)
def test_friction_is_the_lesser_that_the_file_states(name: str, write: Write) -> None:
    collision, mu, warnings = FRICTION[name]
    path = write("model.sdf", sdf(link(collision)))
    thing = load_object(path)
    assert {face.mu for face in thing.polyhedron.faces} == {mu}
    assert len(thing.warnings) == len(warnings)
    assert all(part in found for part, found in zip(warnings, thing.warnings, strict=True))
    assert {face.mu for face in load_object(path, mu=0.45).polyhedron.faces} == {0.45}
    assert load_object(path, mu=0.45).warnings == ()


def test_only_the_part_that_states_no_friction_is_given_some(write: Write) -> None:
    apart = "<pose>1 0 0 0 0 0</pose>"
    bare, stated = box(extra=apart, name="bare"), box(extra=MU.format(1, 1), name="stated")
    thing = load_object(write("model.sdf", sdf(link(bare, stated))))
    assert sorted(face.mu for face in thing.polyhedron.faces) == [0.3] * 6 + [1.0] * 6


def test_friction_in_an_urdf_that_drake_does_not_read_is_none(write: Write) -> None:
    text = urdf_link('<geometry><box size="1 1 1"/></geometry>')
    text = text.replace(
        "<collision>", '<contact><lateral_friction value="0.9"/></contact><collision>'
    )
    thing = load_object(write("model.urdf", text))
    assert {face.mu for face in thing.polyhedron.faces} == {0.3}


def test_a_model_without_mass_has_its_centre_in_the_volume(write: Write) -> None:
    moved = box(extra=MU.format(0.5, 0.5) + "<pose>1 2 3 0 0 0</pose>")
    thing = load_object(write("model.sdf", sdf(link(moved, inertial=""))))
    assert thing.mass is None
    np.testing.assert_allclose(thing.p_BBcm, [1, 2, 3], atol=1e-9)
    assert "states no mass" in thing.warnings[0]


def test_a_body_is_chosen_by_name_among_several(write: Write) -> None:
    small, large = link(box("1 1 1"), name="small"), link(box("2 2 2"), name="large")
    path = write("model.sdf", sdf(small, large, link(name="frame")))
    assert area(load_object(path, body_name="large")) == pytest.approx(24)
    assert area(load_object(path, body_name="model::small")) == pytest.approx(6)
    with pytest.raises(ModelError, match=r"several bodies to grasp: 'small', 'large'; name one"):
        load_object(path)
    with pytest.raises(ModelError, match=r"no body 'lid' in .*; it has 'small', 'large', 'frame'"):
        load_object(path, body_name="lid")
    with pytest.raises(ModelError, match="no collision geometry on 'frame'"):
        load_object(path, body_name="frame")


def test_bodies_of_one_name_are_told_apart_by_their_models(write: Write) -> None:
    write("one.sdf", sdf(link(box("1 1 1"))))
    write("two.sdf", sdf(link(box("2 2 2"))))
    folder = write("one.sdf", sdf(link(box("1 1 1")))).parent.as_uri()
    adding = "".join(
        f"- add_model: {{name: {n}, file: {folder}/{n}.sdf}}\n" for n in ("one", "two")
    )
    path = write("both.dmd.yaml", f"directives:\n{adding}")
    assert area(load_object(path, body_name="two::thing")) == pytest.approx(24)
    with pytest.raises(ModelError, match="'one::thing', 'two::thing'"):
        load_object(path, body_name="thing")


REFUSED = {
    "malformed": ("<sdf><model>", "cannot be read as XML"),
    "no collision geometry": (sdf(link()), "no collision geometry on 'thing'"),
    "no body at all": (
        SDF.format('<model name="m" static="1"><frame name="f"/></model>'),
        "Drake|any",
    ),
    "a half-space": (
        sdf(link('<collision name="h"><geometry><plane/></geometry></collision>')),
        "is a HalfSpace",
    ),
    "a box of no size": (sdf(link(box("0 1 1"))), "size of a collision box is .*; write three"),
    "a negative box": (sdf(link(box("-1 1 1"))), "size of a collision box is .*; write three"),
    "a box without size": (
        sdf(link(box().replace("<size>0.1 0.2 0.4</size>", ""))),
        "size of a collision box is .*; write three",
    ),
    "no mass": (
        sdf(link(box(), inertial=INERTIAL.replace("2", "0"))),
        "a mass that is not above 0",
    ),
    "less mass": (
        sdf(link(box(), inertial=INERTIAL.replace("2", "-1"))),
        "a mass that is not above",
    ),
    "a missing mesh": (
        sdf(link(mesh("<uri>gone.obj</uri>"))),
        r"model\.sdf: .*gone\.obj: there is no such mesh",
    ),
    "an STL": (sdf(link(mesh("<uri>l.stl</uri>"))), r"model\.sdf: .*l\.stl: .* convert it"),
    "an unknown package": (
        sdf(link(mesh("<uri>package://p/l.obj</uri>"))),
        "package 'p' is unknown",
    ),
    "no friction": (
        sdf(link(box(extra=MU.format(0, 0)))),
        "friction of 'model::c' is .*; it must be above 0",
    ),
    "negative friction": (sdf(link(box(extra=MU.format(-1, -1)))), "Drake cannot load it"),
    "more dynamic friction": (sdf(link(box(extra=MU.format(0.3, 0.5)))), "Drake cannot load it"),
    "a missing include": (
        SDF.format("<include><uri>x.sdf</uri></include>"),
        r"x\.sdf: there is no",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_grasped_is_refused_in_one_sentence(name: str, write: Write) -> None:
    content, fault = REFUSED[name]
    with pytest.raises(ModelError, match=fault) as error:
        load_object(write("model.sdf", content))
    assert str(error.value).count("\n") <= 1


def test_a_failed_assertion_of_drake_is_an_error_of_the_model(write: Write) -> None:
    body = '<body name="thing"><geom type="box" size="0 1 1"/></body>'
    path = write("m.xml", f'<mujoco model="m"><worldbody>{body}</worldbody></mujoco>')
    with pytest.raises(ModelError, match=r"m\.xml: Drake cannot load it: .*width"):
        load_object(path)


def test_a_bad_mesh_never_reaches_drake(write: Write) -> None:
    write("bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + "f 1 2 999999999\n" * 4)
    path = write("model.sdf", sdf(link(mesh("<uri>bad.obj</uri>"))))
    with pytest.raises(ModelError, match=r"bad\.obj: a face refers to vertex 999999999,"):
        load_object(path)


def test_missing_and_foreign_files_are_named(tmp_path: Path, write: Write) -> None:
    with pytest.raises(ModelError, match=r"gone\.sdf: there is no such model file"):
        load_object(tmp_path / "gone.sdf")
    with pytest.raises(ModelError, match=r"Drake reads \.sdf, \.urdf"):
        load_object(write("thing.step", ""))
    with pytest.raises(ModelError, match="no such folder"):
        load_object(tmp_path / "l.obj", package_paths=[tmp_path / "gone"])


@pytest.mark.parametrize("name", ["gone", "gone.txt", "0.5", "gone.yaml", "gone.urdf"])
def test_a_missing_file_is_said_to_be_missing_whatever_its_name(tmp_path: Path, name: str) -> None:
    with pytest.raises(ModelError, match="there is no such model file"):
        load_object(tmp_path / name)


@pytest.mark.parametrize("mu", [0.0, -1.0, float("nan"), float("inf")])
def test_friction_given_by_hand_must_be_above_0(mu: float, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="must be above 0"):
        load_object(tmp_path / "l.obj", mu=mu)


def test_what_drake_warns_of_is_told_and_not_printed(
    write: Write, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    cone = '<collision name="e"><geometry><cone><radius>1</radius></cone></geometry></collision>'
    with caplog.at_level(logging.WARNING):
        thing = load_object(write("model.sdf", sdf(link(box(), cone))))
    assert any("cone" in warning for warning in thing.warnings)
    assert not caplog.records
    assert capfd.readouterr() == ("", "")


def test_an_open_mesh_is_loaded_with_a_warning(write: Write, tmp_path: Path) -> None:
    write_obj(tmp_path / "open.obj", prism(L_PROFILE, 0.1)[1:])
    thing = load_object(write("model.sdf", sdf(link(mesh("<uri>open.obj</uri>")))))
    assert any("not closed" in warning for warning in thing.warnings)


def digest(*paths: Path) -> str:
    parts = [hashlib.sha256(path.read_bytes()).digest() for path in paths]
    return hashlib.sha256(b"".join(parts)).hexdigest()


def test_the_digest_covers_model_includes_and_collision_meshes_once(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # Drake looks for relative includes there.
    obj = tmp_path / "l.obj"
    inner = write("inner.sdf", sdf(link(mesh("<uri>l.obj</uri>"), mesh(), name="inner")))
    second = write("sub/t.vtk", TETRAHEDRON_VTK)
    include = "<include><uri>inner.sdf</uri></include>"
    outer = write("outer.sdf", sdf(link(mesh("<uri>sub/t.vtk</uri>")), include))
    assert model_digest(inner) == digest(inner, obj)
    assert model_digest(outer) == digest(outer, inner, second, obj)
    assert model_digest(obj) == digest(obj)
    before = model_digest(outer)
    second.write_text(TETRAHEDRON_VTK + " ")
    assert model_digest(outer) != before


def test_packages_are_found_above_the_model_and_below_given_folders(
    write: Write, tmp_path: Path
) -> None:
    write("pkg/package.xml", "<package><name>pkg</name></package>")
    write_obj(tmp_path / "pkg/l.obj", prism(L_PROFILE, 0.1))
    uri = "<uri>package://pkg/l.obj</uri>"
    inside = write("pkg/deep/model.sdf", sdf(link(mesh(uri))))
    outside = write("elsewhere/model.sdf", sdf(link(mesh(uri))))
    assert area(load_object(inside)) == pytest.approx(L_AREA)
    assert area(load_object(outside, package_paths=[tmp_path])) == pytest.approx(L_AREA)
    named = load_object("package://pkg/deep/model.sdf", package_paths=[tmp_path])
    assert named.source is not None
    assert named.source.model_file == "package://pkg/deep/model.sdf"
    assert named.source.sha256 == model_digest(inside)
    with pytest.raises(ModelError, match="package 'pkg' is unknown; name its folder"):
        load_object(outside)
