"""What is drawn is where it should be, as large as it should be, and nowhere else."""

from __future__ import annotations

import itertools
import re
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Sphere
from pydrake.math import RigidTransform

from drake_polygrasp import UsageError, load_grasps, load_object, plan_grasps, save_grasps
from drake_polygrasp.arrays import Array
from drake_polygrasp.cli.main import main
from drake_polygrasp.cli.shown_scene import ShownScene
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.visualization import (
    draw_grasps,
    draw_object,
    look_at,
    save_html,
    show_plan,
    show_rank,
)
from drake_polygrasp.visualization.labels import label_F, number_shape
from drake_polygrasp.visualization.meshes import FEW
from drake_polygrasp.visualization.palette import CONTACTS, PLANE, rgb
from drake_polygrasp.visualization.precision import FINE, NORMALS_CHANGE, placement_words
from drake_polygrasp.visualization.shown_grasp import FORCE_SCALE
from drake_polygrasp.wrenches.contacts import edge_forces
from tests.support.planned import MODELS, exact_plan, model, planned

ROOT = Path(__file__).parents[2]
TIP = 0.004


class Recorder:
    """Stands in for a Meshcat and remembers what it was told, by path."""

    def __init__(self) -> None:
        self.shapes: dict[str, Any] = {}
        self.poses: dict[str, RigidTransform] = {}
        self.meshes: dict[str, Array] = {}
        self.visible: dict[str, bool] = {}
        self.paths: set[str] = set()

    def Delete(self, path: str) -> None:
        self.paths.add(path)

    def SetObject(self, path: str, shape: Any, *_: Any) -> None:
        self.paths.add(path)
        self.shapes[path] = shape

    def SetTransform(self, path: str, X: RigidTransform) -> None:
        self.paths.add(path)
        self.poses[path] = X

    def SetTriangleMesh(self, path: str, p: Array, index: Array, *_: Any, **__: Any) -> None:
        self.paths.add(path)
        self.meshes[path] = p.T[index.T]

    def SetCameraPose(self, eye: Array, target: Array) -> None:
        self.camera = eye, target

    def SetLineSegments(self, path: str, *_: Any) -> None:
        self.paths.add(path)

    def SetProperty(self, path: str, name: str, value: Any) -> None:
        self.paths.add(path)
        if name == "visible":
            self.visible[path] = value


@cache
def recorded(name: str) -> Recorder:
    recorder = Recorder()
    object_, grasps = planned(name)
    draw_grasps(recorder, object_, grasps, tip_radius=TIP, path="/mine")  # type: ignore[arg-type]
    return recorder


def contacts_of(name: str) -> Any:
    """Recorder, path of a contact, and its position, normal, friction, force and certificate."""
    for rank, certified in enumerate(planned(name)[1], start=1):
        grasp, certificate = certified.grasp, certified.certificate
        f_Bc_B = edge_forces(grasp.p_BC[None], certificate.internal_force[None])[0]
        for i in range(3):
            path = f"/mine/grasps/{rank}/contact_{i + 1}"
            row = grasp.p_BC[i], grasp.nhat_TB_B[i], grasp.mu[i], f_Bc_B[i]
            yield recorded(name), path, *row, certificate


def area_vectors(triangles: Array) -> Array:
    a, b, c = np.moveaxis(triangles, 1, 0)
    return np.cross(b - a, c - a) / 2


NAMES = ("l_bracket", "hexagonal_prism", "skewed_block", "two_materials")


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_the_faces_that_are_drawn_have_their_area_and_close_around_the_object(path: Path) -> None:
    object_ = load_object(path)
    recorder = Recorder()
    draw_object(recorder, object_)  # type: ignore[arg-type]
    area = area_vectors(recorder.meshes["polygrasp/object/faces"])
    faces = object_.polyhedron.faces
    total = sum(shapely.area(face.polygon_F) for face in faces)
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(total)
    assert np.abs(area.sum(axis=0)).max() < 1e-6 * total


VIEWS = [
    np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
    for a, e in ((-1.0, 0.4), (0.6, 0.8), (2.0, 0.4), (3.9, 0.8))
]


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_every_number_stands_upright_for_the_eye_within_its_face(path: Path) -> None:
    polyhedron = load_object(path).polyhedron
    for face, eye in itertools.product(polyhedron.faces, VIEWS):
        label = label_F(face, 71, 0.06 * polyhedron.diameter, face.p_BF[None], eye)
        assert shapely.contains(face.polygon_F, label)
        # Where the number's own right and up, of digits that are 1 high, are on the face.
        shape = shapely.get_coordinates(number_shape(71))
        flat = np.linalg.lstsq(np.c_[shape, np.ones(len(shape))], shapely.get_coordinates(label))[0]
        assert np.linalg.det(flat[:2]) > 0  # not mirrored, seen from outside
        right_B, up_B = flat[:2] @ face.R_BF[:, :2].T / np.sqrt(np.linalg.det(flat[:2]))
        outward = face.R_BF[:, 2]
        if outward @ eye > 0.05:  # straight up in the picture
            across = np.cross((0, 0, 1), eye)
            assert up_B @ across == pytest.approx(0, abs=1e-9)
            assert up_B @ np.cross(eye, across) > 0
        else:
            away_B = -eye if abs(outward[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
            assert right_B @ away_B == pytest.approx(0, abs=1e-9)
            assert up_B @ away_B > 0


def test_a_number_does_not_hide_a_contact_behind_its_face_from_the_eye() -> None:
    cube = load_object(model("cube")).polyhedron
    eye = np.array([0.6, 0.0, 0.8])
    top = next(face for face in cube.faces if face.R_BF[2, 2] > 0.9)
    behind = top.p_BF - 0.02 * eye  # seen at the middle of the face
    label = label_F(top, 8, 0.01, behind[None], eye)
    assert shapely.distance(label, shapely.Point(0, 0)) > 0.003


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
def test_all_that_is_drawn_of_all_grasps_fits_a_square_picture(path: Path) -> None:
    recorder = Recorder()
    object_, grasps = planned(path.stem)
    draw_grasps(recorder, object_, grasps, tip_radius=0.0)  # type: ignore[arg-type]
    best, others = (grasps[0], grasps[1:]) if grasps else (None, ())
    look_at(recorder, object_, best, others=others)  # type: ignore[arg-type]
    eye, target = recorder.camera
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    meshes = [mesh.reshape(-1, 3) for mesh in recorder.meshes.values()]
    seen = np.concatenate([*meshes, object_.p_BBcm[None]]) - eye
    across = np.abs(seen @ np.array([right, np.cross(right, forward)]).T).max(axis=1)
    share = (across / (seen @ forward)).max() / np.tan(np.radians(15))
    assert 0.85 < share < 1


def test_numbers_are_seen_from_outside_only() -> None:
    object_, _ = planned("l_bracket")
    for k, face in enumerate(object_.polyhedron.faces):
        area = area_vectors(recorded("l_bracket").meshes[f"/mine/object/numbers/{k}"])
        unit = area / np.linalg.norm(area, axis=1)[:, None]
        assert unit == pytest.approx(np.tile(face.R_BF[:, 2], (len(unit), 1)))


def test_patches_of_a_curved_surface_are_numbered_only_where_they_are_touched() -> None:
    object_, grasps = planned("l_bracket")
    patches = tuple(replace(face, reach=1e-3) for face in object_.polyhedron.faces)
    curved = replace(object_, polyhedron=replace(object_.polyhedron, faces=patches))
    recorder = Recorder()
    draw_grasps(recorder, curved, grasps[:1], path="/mine")  # type: ignore[arg-type]
    numbers = [path for path in recorder.meshes if "number" in path]
    assert len(numbers) == len(set(grasps[0].grasp.faces))
    assert len(recorder.meshes["/mine/object/faces"]) == len(curved.polyhedron.triangles_B)
    assert "/mine/object/edges" not in recorder.paths


@pytest.mark.parametrize("count", [FEW, FEW + 1])
def test_faces_are_numbered_where_they_are_few_or_touched(count: int) -> None:
    object_, grasps = planned("l_bracket")
    touched = len(set(grasps[0].grasp.faces))
    faces = (object_.polyhedron.faces * count)[:count]
    many = replace(object_, polyhedron=replace(object_.polyhedron, faces=faces))
    recorder = Recorder()
    draw_grasps(recorder, many, grasps[:1], path="/mine")  # type: ignore[arg-type]
    numbers = sum("number" in path for path in recorder.meshes)
    assert numbers == (count if count == FEW else touched)


def test_the_page_of_a_scan_is_small(tmp_path: Path) -> None:
    object_, grasps = planned("l_bracket")
    # In place of the bracket's triangles, 16,128 of a sphere.
    up, around = np.meshgrid(np.linspace(0, np.pi, 65), np.linspace(0, 2 * np.pi, 127))
    p = np.stack([np.sin(up) * np.cos(around), np.sin(up) * np.sin(around), np.cos(up)], axis=-1)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, :-1], p[1:, 1:]
    triangles = np.concatenate([np.stack([a, c, b], axis=2), np.stack([b, c, d], axis=2)])
    patches = tuple(replace(face, reach=1e-3) for face in object_.polyhedron.faces)
    polyhedron = replace(
        object_.polyhedron, faces=patches, triangles_B=0.1 * triangles.reshape(-1, 3, 3)
    )
    meshcat = Meshcat()
    draw_grasps(meshcat, replace(object_, polyhedron=polyhedron), grasps)
    save_html(tmp_path / "scan.html", meshcat, grasps)
    assert (tmp_path / "scan.html").stat().st_size < 4e6


def test_no_number_reads_as_another_even_upside_down() -> None:
    shapes = np.array([number_shape(n) for n in range(100)], dtype=object)
    turned = np.array([shapely.transform(s, np.negative) for s in shapes], dtype=object)
    i, j = np.triu_indices(100, 1)
    for others in (shapes, turned):
        unlike = shapely.area(shapely.symmetric_difference(shapes[i], others[j]))
        assert unlike.min() > 0.05


@pytest.mark.parametrize("name", NAMES)
def test_fingertips_touch_their_contacts_from_outside(name: str) -> None:
    for recorder, path, p_BC, nhat, *_ in contacts_of(name):
        sphere, X_BT = (part[f"{path}/fingertip"] for part in (recorder.shapes, recorder.poses))
        assert isinstance(sphere, Sphere) and sphere.radius() == TIP
        assert X_BT.translation() == pytest.approx(p_BC - TIP * nhat, abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_friction_cones_open_inward_at_the_friction_angle(name: str) -> None:
    for recorder, path, p_BC, nhat, mu, *_ in contacts_of(name):
        cone, X_BC = (part[f"{path}/friction_cone"] for part in (recorder.shapes, recorder.poses))
        assert isinstance(cone, MeshcatCone)
        assert X_BC.translation() == pytest.approx(p_BC)
        assert X_BC.rotation().col(2) == pytest.approx(nhat, abs=1e-9)
        assert cone.a() / cone.height() == pytest.approx(mu)
        assert cone.a() == cone.b()


@pytest.mark.parametrize("name", NAMES)
def test_force_arrows_are_to_scale_and_balance(name: str) -> None:
    scale = FORCE_SCALE * planned(name)[0].polyhedron.diameter
    drawn = []
    for recorder, path, p_BC, _, _, f_B, _ in contacts_of(name):
        tip = recorder.poses[f"{path}/force/head"].translation()
        assert tip - p_BC == pytest.approx(scale * f_B, abs=1e-12)
        drawn.append(tip - p_BC)
        shaft = f"{path}/force/shaft"
        if shaft in recorder.shapes:
            head = recorder.shapes[f"{path}/force/head"].height()
            length = recorder.shapes[shaft].length()
            assert length + head == pytest.approx(np.linalg.norm(drawn[-1]))
    assert np.abs(np.reshape(drawn, (-1, 3, 3)).sum(axis=1)).max() < 1e-9 * scale


@pytest.mark.parametrize("name", NAMES)
def test_discs_are_as_large_as_the_placement_tolerance_and_lie_on_the_face(name: str) -> None:
    for recorder, path, p_BC, nhat, _, _, certificate in contacts_of(name):
        disc, X_BD = (part[f"{path}/placement"] for part in (recorder.shapes, recorder.poses))
        assert isinstance(disc, Cylinder)
        assert disc.radius() == certificate.placement_tolerance
        assert X_BD.rotation().col(2) == pytest.approx(nhat, abs=1e-9)
        above = (p_BC - X_BD.translation()) @ nhat
        assert 0 < above < 2 * disc.length()


@pytest.mark.parametrize("name", NAMES)
def test_the_plane_that_is_drawn_holds_the_triangle_and_reaches_around_the_object(
    name: str,
) -> None:
    object_, grasps = planned(name)
    for rank, certified in enumerate(grasps, start=1):
        nhat = certified.grasp.grasp_plane.nhat_B
        corners = recorded(name).meshes[f"/mine/grasps/{rank}/plane/area"].reshape(-1, 3)
        triangle = recorded(name).meshes[f"/mine/grasps/{rank}/triangle/area"][0]
        assert (triangle == certified.grasp.p_BC).all()
        assert np.ptp(np.concatenate([corners, triangle]) @ nhat) < 1e-6
        x, y = np.linalg.svd(nhat[None])[2][1:]
        flat = [shapely.MultiPoint(points @ np.array([x, y]).T) for points in (corners, triangle)]
        vertices = object_.polyhedron.triangles_B.reshape(-1, 3) @ np.array([x, y]).T
        rectangle = shapely.convex_hull(flat[0])
        assert rectangle.contains(flat[1])
        assert rectangle.contains(shapely.MultiPoint(vertices))


def test_a_face_that_holds_two_contacts_is_tinted_once() -> None:
    for name in NAMES:
        for rank, certified in enumerate(planned(name)[1], start=1):
            here = f"/mine/grasps/{rank}/"
            tints = [p for p in recorded(name).meshes if p.startswith(here) and p.endswith("/face")]
            assert len(tints) == len(set(certified.grasp.faces))


def test_drawing_touches_nothing_but_its_own_path() -> None:
    assert all(path.startswith("/mine/") for path in recorded("l_bracket").paths)


def test_one_grasp_is_visible_at_a_time() -> None:
    recorder = Recorder()
    for rank in (1, 3, 2):
        show_rank(recorder, rank, 3, "/mine")  # type: ignore[arg-type]
        assert [p for p, on in recorder.visible.items() if on] == [f"/mine/grasps/{rank}"]


def test_a_meshcat_of_ones_own_keeps_what_it_shows() -> None:
    meshcat = Meshcat()
    meshcat.SetObject("/table", Sphere(0.1))
    draw_grasps(meshcat, *planned("l_bracket"))
    draw_grasps(meshcat, planned("l_bracket")[0], planned("l_bracket")[1][:1])
    assert meshcat.HasPath("/table")
    assert meshcat.HasPath("/drake/polygrasp/grasps/1")
    assert not meshcat.HasPath("/drake/polygrasp/grasps/2")


@pytest.mark.parametrize("as_stated", [False, True])
def test_the_page_is_whole_small_and_says_what_the_colours_mean(
    as_stated: bool, tmp_path: Path
) -> None:
    object_, grasps = planned("l_bracket")
    save_grasps(tmp_path / "l.grasp.yaml", object_, grasps, StatedPlan())
    shown = load_grasps(tmp_path / "l.grasp.yaml").grasps if as_stated else grasps
    meshcat = Meshcat()
    draw_grasps(meshcat, object_, shown)
    look_at(meshcat, object_, shown[0])
    page = tmp_path / "page.html"
    save_html(page, meshcat, shown, title="</script><b>")
    html = page.read_text()
    assert page.stat().st_size < 4e6
    assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=\W?http", html)
    assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=\W?http", html)
    assert "</script><b>" not in html
    for colour in (*CONTACTS, PLANE):
        assert colour in html
    assert f"face {grasps[0].grasp.faces[0]}: " in html


def test_a_page_that_cannot_be_written_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        save_html(tmp_path / "missing" / "page.html", Meshcat())


def test_the_panel_says_what_a_grasp_bears(tmp_path: Path) -> None:
    cube = load_object(model("cube"))
    errors = {"placement_error": 0.0025, "tilt_error": 0.1, "friction_error": 0.1, "com_error": 0.0}
    (grasp,) = plan_grasps(cube, top=1, effort="quick", **errors).grasps  # type: ignore[arg-type]
    assert grasp.region is not None and grasp.region.squeeze_force is not None
    save_html(tmp_path / "cube.html", Meshcat(), [grasp])
    page = (tmp_path / "cube.html").read_text()
    for name, value in (
        ("contacts off by", "2.5 mm"),
        ("normals off by", "5.73 degrees"),
        ("friction less by", "10 percent"),
        ("squeeze then, all fingers", f"{grasp.region.squeeze_force:.3g} N"),
    ):
        assert f'["{name}", "{value}"]' in page
    assert FINE not in page and NORMALS_CHANGE not in page


def test_words_say_what_a_placement_under_a_millimetre_means() -> None:
    cube = load_object(model("cube"))
    (grasp,) = plan_grasps(cube, top=1, effort="quick").grasps
    assert grasp.region is not None and grasp.certificate.placement_tolerance > 1e-3
    assert placement_words(grasp) == ""
    narrow = replace(grasp, certificate=replace(grasp.certificate, placement_tolerance=0.0009))
    assert placement_words(narrow) == NORMALS_CHANGE
    assert placement_words(replace(narrow, region=None)) == FINE
    half = replace(grasp.region, placement_error=np.full(3, 0.0005))
    assert placement_words(replace(narrow, region=half)) == FINE


def test_show_plan_draws_in_the_meshcat_it_is_given_or_in_a_new_one() -> None:
    plan = exact_plan(load_object(model("cube")), top=2)
    meshcat = Meshcat()
    assert show_plan(plan, meshcat) is meshcat
    for shown in (meshcat, show_plan(plan)):
        assert shown.HasPath("/drake/polygrasp/grasps/2")
    nothing = exact_plan(load_object(model("tetrahedron")))
    assert not nothing.grasps
    shown = show_plan(nothing)
    assert shown.HasPath("/drake/polygrasp/object")
    assert not shown.HasPath("/drake/polygrasp/grasps/1")


def test_contacts_differ_in_lightness_for_grey_print() -> None:
    lightness = [np.dot((0.2126, 0.7152, 0.0722), np.power(rgb(c), 2.2)) for c in CONTACTS]
    assert min(abs(a - b) for a, b in itertools.combinations(lightness, 2)) > 0.08


def test_show_writes_a_page_for_a_model_and_for_a_grasp_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, file = tmp_path / "cube.html", tmp_path / "cube.grasp.yaml"
    assert main(["show", str(model("cube")), "--html", str(page)]) == 0
    assert capsys.readouterr().out == f"wrote {page}\n"
    assert main(["plan", str(model("cube")), "-o", str(file)]) == 0
    assert main(["show", str(file), "--html", str(tmp_path / "file.html")]) == 0
    rows = [line for line in page.read_text().splitlines() if "const scene" in line]
    again = [
        line for line in (tmp_path / "file.html").read_text().splitlines() if "const scene" in line
    ]
    assert rows[0].replace("cube.sdf", "cube.grasp.yaml") == again[0]


def test_show_draws_an_object_without_grasps_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    assert main(["show", str(model("tetrahedron")), "--html", str(page)]) == 1
    assert "no grasp to show" in capsys.readouterr().err
    assert page.is_file()


@pytest.mark.parametrize("options", [["--mu", "0.5"], ["--body", "box"]])
def test_show_takes_no_options_that_a_grasp_file_states(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show", str(tmp_path / "a.grasp.yaml"), *options]) == 2
    assert "states its body, friction and scale" in capsys.readouterr().err


def test_show_warns_of_a_model_that_changed_and_refuses_one_that_is_gone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sdf, file = tmp_path / "cube.sdf", tmp_path / "cube.grasp.yaml"
    sdf.write_text(model("cube").read_text())
    main(["plan", str(sdf), "-o", str(file)])
    sdf.write_text(sdf.read_text() + "\n")
    assert main(["show", str(file), "--html", str(tmp_path / "page.html")]) == 0
    assert "has changed since" in capsys.readouterr().err
    sdf.unlink()
    assert main(["show", str(file), "--html", str(tmp_path / "page.html")]) == 2
    assert "there is no such model file" in capsys.readouterr().err


def test_show_serves_until_interrupted() -> None:
    command = [sys.executable, "-m", "drake_polygrasp", "show", str(model("cube"))]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            url = next(line.split()[1] for line in process.stdout if line.startswith("open http"))
            with urllib.request.urlopen(url, timeout=300) as page:
                assert page.status == 200
            process.send_signal(signal.SIGINT)
            assert process.wait(timeout=300) == 0
        finally:
            process.kill()  # lest a failure leaves it serving


def test_an_interrupt_that_comes_while_show_still_prints_ends_it_well(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(_: ShownScene) -> Iterator[str]:
        yield "open http://localhost"
        raise KeyboardInterrupt

    monkeypatch.setattr("drake_polygrasp.cli.shown_scene.serve", interrupted)
    assert main(["show", str(model("cube"))]) == 0
    assert capsys.readouterr().out == "open http://localhost\n"
