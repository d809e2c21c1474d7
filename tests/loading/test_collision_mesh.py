"""Meshes are what their files mean, also where Drake makes something else of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import Mesh, ReadObjToTriangleSurfaceMesh
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import ModelError
from drake_polygrasp.geometry.face_triangles import triangulate
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.collision_mesh import read_collision_mesh
from drake_polygrasp.loading.object_model import load_object, load_solid
from drake_polygrasp.loading.plant_object import object_from_plant
from drake_polygrasp.plant.certify_in_plant import certify_in_plant
from tests.support.planned import exact_plan
from tests.support.solids import star

T_SECTION = np.array(
    [[5, 0], [5, 6], [8, 6], [8, 8], [0, 8], [0, 6], [3, 6], [3, 0]], dtype=float
)  # cm
SHALLOW_ARROW = np.array([[0.0, 0.0], [10.0, -0.5], [2.0, 0.0], [10.0, 0.5]])
HEIGHT = 0.03

Faces = Sequence[Sequence[int]]


def extrusion(
    outline: Array, first: int = 0, height: float = HEIGHT
) -> tuple[Array, list[list[int]]]:
    """A prism on a counter-clockwise outline, its lids written from corner `first` on."""
    n = len(outline)
    vertices = np.vstack([np.c_[outline, np.full(n, z)] for z in (0.0, height)])
    top = [n + (first + k) % n for k in range(n)]
    bottom = [k - n for k in reversed(top)]
    walls = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    return vertices, [bottom, top, *walls]


def write(path: Path, vertices: Array, faces: Faces) -> Path:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += ["f " + " ".join(str(k + 1) for k in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def surface_area(triangles: Array) -> float:
    return float(unit_normals(triangles)[1].sum())


def volume(triangles: Array) -> float:
    return float(np.linalg.det(triangles).sum() / 6)


def exposed_area(object_: GraspObject) -> float:
    return sum(face.polygon_F.area for face in object_.polyhedron.faces)


@pytest.mark.parametrize("first", range(8))
def test_a_t_section_is_a_t_whatever_corner_its_lids_start_at(first: int, tmp_path: Path) -> None:
    path = write(tmp_path / "t.obj", *extrusion(T_SECTION / 100, first))
    object_ = load_object(path)
    # Two lids of 0.0028 m2, and walls 0.32 m long and 0.03 m high.
    assert exposed_area(object_) == pytest.approx(0.0152, rel=1e-9)
    assert object_.polyhedron.watertight
    assert len(object_.polyhedron.faces) == 10
    # Stem 12 cm2 at y = 3 cm, bar 16 cm2 at y = 7 cm.
    assert object_.p_BBcm == pytest.approx([0.04, 0.37 / 7, 0.015], rel=1e-9)
    outline = shapely.Polygon(T_SECTION / 100)
    for grasp in exact_plan(object_, top=20).grasps:
        on = shapely.distance(outline, shapely.points(grasp.grasp.p_BC[:, :2]))
        assert (on <= 1e-9).all()


@pytest.mark.parametrize("outline", [T_SECTION, SHALLOW_ARROW], ids=["t", "arrow"])
def test_it_is_said_where_drake_triangulates_otherwise(outline: Array, tmp_path: Path) -> None:
    path = write(tmp_path / "thing.obj", *extrusion(outline / 100))
    mesh = ReadObjToTriangleSurfaceMesh(path)
    polygon = shapely.Polygon(outline / 100)
    true = 2 * polygon.area + HEIGHT * polygon.length
    assert mesh.total_area() > 1.02 * true  # Why we do not take Drake's.
    found = read_collision_mesh(Mesh(str(path)))
    assert surface_area(found.triangles_G) == pytest.approx(true, rel=1e-12)
    assert volume(found.triangles_G) == pytest.approx(polygon.area * HEIGHT, rel=1e-12)
    (warning,) = found.warnings
    assert str(path) in warning
    assert "export triangles" in warning
    # What our own plants have is the same surface.
    again = read_collision_mesh(found.shape)
    assert volume(again.triangles_G) == pytest.approx(polygon.area * HEIGHT, rel=1e-12)
    assert not again.warnings


def test_faces_that_drake_cuts_rightly_are_drakes(tmp_path: Path) -> None:
    square = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]])
    path = write(tmp_path / "box.obj", *extrusion(square))
    found = read_collision_mesh(Mesh(str(path)))
    mesh = ReadObjToTriangleSurfaceMesh(path)
    corners = [[t.vertex(k) for k in range(3)] for t in mesh.triangles()]
    assert np.array_equal(found.triangles_G, np.array(mesh.vertices())[corners])
    assert not found.warnings


@given(seed=st.integers(0, 10**6), num_sides=st.integers(4, 30), first=st.integers(0, 29))
def test_any_prism_has_the_area_and_volume_of_its_outline(
    seed: int, num_sides: int, first: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    polygon = shapely.orient_polygons(star(np.random.default_rng(seed), num_sides))
    outline = shapely.get_coordinates(polygon)[:-1]
    path = tmp_path_factory.mktemp("prism") / "prism.obj"
    write(path, *extrusion(outline, first % len(outline)))
    for scale in ([1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]):
        triangles = read_collision_mesh(Mesh(str(path), scale)).triangles_G
        area = 2 * polygon.area + HEIGHT * polygon.length
        assert surface_area(triangles) == pytest.approx(area, rel=1e-9)
        assert volume(triangles) == pytest.approx(polygon.area * HEIGHT, rel=1e-9)


def test_a_face_with_a_hole_that_a_bridge_joins_to_its_rim_has_the_hole(tmp_path: Path) -> None:
    rim = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], dtype=float) / 100
    hole = np.array([[1, 1], [3, 1], [3, 3], [1, 3]], dtype=float) / 100
    flat = np.vstack([rim, hole])
    vertices = np.vstack([np.c_[flat, np.zeros(8)], np.c_[flat, np.full(8, HEIGHT)]])
    top = [8, 9, 10, 11, 8, 12, 15, 14, 13, 12]
    bottom = [k - 8 for k in reversed(top)]
    walls = [[k, (k + 1) % 4, 8 + (k + 1) % 4, 8 + k] for k in range(4)]
    walls += [[4 + (k + 1) % 4, 4 + k, 12 + k, 12 + (k + 1) % 4] for k in range(4)]
    object_ = load_object(write(tmp_path / "frame.obj", vertices, [bottom, top, *walls]))
    assert object_.polyhedron.watertight
    assert exposed_area(object_) == pytest.approx(2 * 12e-4 + 24e-2 * HEIGHT, rel=1e-9)


def test_collinear_corners_are_kept_so_that_neighbours_fit() -> None:
    outline = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 0], [1, 1, 0], [0, 2, 0]], float)
    triangles = triangulate(outline)
    assert set(triangles.ravel()) == set(range(6))
    assert surface_area(outline[triangles]) == pytest.approx(3.0)


def test_a_corner_stated_twice_is_one() -> None:
    outline = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0]], float)
    assert surface_area(outline[triangulate(outline)]) == pytest.approx(2.5)


def test_a_nearly_plane_face_keeps_its_corners() -> None:
    rng = np.random.default_rng(3)
    outline = np.c_[T_SECTION, rng.uniform(-1e-3, 1e-3, 8)]
    triangles = triangulate(outline)
    assert len(triangles) == 6
    assert surface_area(outline[triangles]) == pytest.approx(28.0, rel=1e-4)
    assert (unit_normals(outline[triangles])[0][:, 2] > 0.99).all()


def test_a_sliver_keeps_its_sides_though_rounding_makes_them_cross() -> None:
    outline = np.array([[0, 0, 0], [0.1, 0, 0], [0.05, -1e-7, 0], [0.02, 1e-7, 0]])
    triangles = triangulate(outline, flatness=1e-6)
    sides = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1], strict=True)}
    assert sides >= {(0, 1), (1, 2), (2, 3), (3, 0)}


def test_a_face_that_crosses_itself_is_named(tmp_path: Path) -> None:
    vertices, faces = extrusion(T_SECTION / 100)
    faces[1][3], faces[1][5] = faces[1][5], faces[1][3]
    path = write(tmp_path / "crossed.obj", vertices, faces)
    with pytest.raises(ModelError, match=r"crossed\.obj: face 2: its outline crosses itself"):
        load_object(path)


CUBE = extrusion(np.array([[-3, -3], [3, -3], [3, 3], [-3, 3]], dtype=float) / 100, height=0.06)
SDF = """<sdf version="1.9"><model name="cube"><link name="cube"><inertial><mass>0.2</mass>
<inertia><ixx>1.2e-4</ixx><iyy>1.2e-4</iyy><izz>1.2e-4</izz></inertia></inertial>
<collision name="c"><geometry><mesh><uri>cube.obj</uri>{}</mesh></geometry></collision>
</link></model></sdf>"""


def cube(folder: Path, turned: Sequence[int], scale: str = "") -> Path:
    """A model of a cube of which some faces run the wrong way."""
    folder.mkdir()
    vertices, faces = CUBE
    vertices = vertices - [0.0, 0.0, 0.03]
    faces = [face[::-1] if k in turned else face for k, face in enumerate(faces)]
    write(folder / "cube.obj", vertices, faces)
    (folder / "cube.sdf").write_text(SDF.format(scale))
    return folder / "cube.sdf"


@pytest.mark.parametrize(
    ("turned", "scale", "said"),
    [
        (range(6), "", "cube.obj: its triangles face inward"),
        (range(6), "<scale>-1 1 1</scale>", "cube.obj: its triangles face inward"),
        ((0, 3), "", "cube.obj: 4 of its 12 triangles face inward"),
        ((), "<scale>1 -1 1</scale>", ""),
    ],
    ids=["all", "all, mirrored", "some", "none, mirrored"],
)
def test_plants_have_faces_that_run_the_wrong_way_turned(
    turned: Sequence[int], scale: str, said: str, tmp_path: Path
) -> None:
    right = load_object(cube(tmp_path / "right", ()))
    wrong = load_object(cube(tmp_path / "wrong", turned, scale))
    new = [warning for warning in wrong.warnings if "inward" in warning]
    assert len(new) == bool(said)
    assert all(said in warning and "reverse the faces" in warning for warning in new)
    assert exposed_area(wrong) == pytest.approx(6 * 0.06**2)
    grasp = exact_plan(right, top=1).grasps[0].grasp
    verdicts = [
        {v.name: v.verdict for v in certify_in_plant(o, grasp, tip_radius=0.002).verdicts}
        for o in (right, wrong)
    ]
    assert verdicts[0] == verdicts[1]
    assert set(verdicts[0].values()) == {"holds"}


@pytest.mark.parametrize("shift", [0, 1], ids=["same diagonals", "other diagonals"])
def test_a_solid_of_two_sided_faces_is_the_solid(shift: int, tmp_path: Path) -> None:
    """Some programs export each face twice, once each way round, perhaps cut along the other
    diagonal. Signed volumes then add up to 0."""
    vertices, faces = CUBE
    turned = [face[::-1][shift:] + face[::-1][:shift] for face in faces]
    object_ = load_object(write(tmp_path / "cube.obj", vertices, [*faces, *turned]))
    assert exposed_area(object_) == pytest.approx(6 * 0.06**2)
    assert object_.polyhedron.watertight
    assert object_.p_BBcm == pytest.approx([0.0, 0.0, 0.03])
    assert any("24 of its 24 triangles" in warning for warning in object_.warnings)
    assert not any("inward" in warning for warning in object_.warnings)
    # Three pairs of opposite sides, as of any cube: (2, 1) or (1, 2) contacts on each.
    found = {tuple(sorted(set(p.grasp.faces))) for p in exact_plan(object_, top=40).grasps}
    assert {(0, 5), (1, 4), (2, 3)} <= found
    assert object_.source is not None
    assert load_solid(object_.source).M_BBo_B.get_mass() == pytest.approx(1000 * 0.06**3)


def test_a_two_sided_sheet_has_no_centre_of_volume(tmp_path: Path) -> None:
    vertices, faces = CUBE
    open_box = list(faces[1:])
    path = write(tmp_path / "bin.obj", vertices, [*open_box, *(f[::-1] for f in open_box)])
    with pytest.raises(ModelError, match="encloses no volume; state its mass"):
        load_object(path)


def test_a_mesh_that_is_inside_out_has_mass_and_centre_all_the_same(tmp_path: Path) -> None:
    vertices, faces = CUBE
    path = write(
        tmp_path / "cube.obj", vertices + np.array([1.0, 0.0, 0.0]), [f[::-1] for f in faces]
    )
    object_ = load_object(path)
    assert object_.p_BBcm == pytest.approx([1.0, 0.0, 0.03])
    assert object_.source is not None
    M_BBo_B = load_solid(object_.source).M_BBo_B
    assert M_BBo_B.get_mass() == pytest.approx(1000 * 0.06**3)
    assert M_BBo_B.get_com() == pytest.approx([1.0, 0.0, 0.03])


def test_the_walls_of_a_cavity_face_inward_by_right(tmp_path: Path) -> None:
    vertices, faces = CUBE
    inner = (vertices - [0.0, 0.0, 0.03]) / 2 + [0.0, 0.0, 0.03]
    cavity = [[k + 8 for k in reversed(face)] for face in faces]
    hollow = write(tmp_path / "hollow.obj", np.vstack([vertices, inner]), [*faces, *cavity])
    assert not read_collision_mesh(Mesh(str(hollow))).warnings


def test_vertices_of_no_face_are_left_out_and_said(tmp_path: Path) -> None:
    vertices, faces = CUBE
    path = write(tmp_path / "cube.obj", np.vstack([vertices, [[7.0, 7.0, 7.0]]]), faces)
    found = read_collision_mesh(Mesh(str(path)))
    assert "no face uses 1 of its 9 vertices" in found.warnings[0]
    hull = found.shape.GetConvexHull()
    assert max(np.abs(hull.vertex(k)).max() for k in range(hull.num_vertices())) <= 0.06


def test_a_volume_mesh_is_its_boundary_without_a_word(tmp_path: Path) -> None:
    # A tetrahedron in four, about a vertex inside that no boundary triangle uses.
    path = tmp_path / "four.vtk"
    path.write_text(
        "# vtk DataFile Version 3.0\nfour\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n"
        "0 0 0\n1 0 0\n0 1 0\n0 0 1\n.2 .2 .2\nCELLS 4 20\n4 0 1 2 4\n4 0 2 3 4\n4 0 3 1 4\n"
        "4 1 3 2 4\nCELL_TYPES 4\n10\n10\n10\n10\n"
    )
    found = read_collision_mesh(Mesh(str(path)))
    assert not found.warnings
    assert len(found.triangles_G) == 4
    assert volume(found.triangles_G) == pytest.approx(1 / 6, rel=1e-12)


def test_a_body_of_a_live_plant_is_what_its_file_means(tmp_path: Path) -> None:
    path = write(tmp_path / "t.obj", *extrusion(T_SECTION / 100))
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.GetMyContextFromRoot(builder.Build().CreateDefaultContext())
    object_ = object_from_plant(plant, "t", context)
    assert exposed_area(object_) == pytest.approx(0.0152, rel=1e-9)
    assert any("export triangles" in warning for warning in object_.warnings)
