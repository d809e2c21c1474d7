"""The objects of models/ are what their READMEs say: faces, volume, mass properties, friction."""

from __future__ import annotations

from collections import Counter
from math import cos, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import shapely
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from scipy.spatial import ConvexHull, Delaunay

from drake_polygrasp import GraspObject, load_object
from drake_polygrasp.arrays import Array

MODELS = Path(__file__).parents[1] / "models"


class Solid(NamedTuple):
    num_faces: int
    density: float  # [kg/m^3]
    volume: float  # [m^3]


SOLIDS = {
    "boxes": Solid(  # base and post keep 6 and 5 faces; the bar's 4 long ones are cut in two
        6 + 5 + 2 + 4 * 2,
        700,
        0.16 * 0.1 * 0.03 + 0.04**2 * 0.09 + 0.02**2 * (0.12 - 0.04 / cos(0.35)),
    ),
    "brick": Solid(6, 1900, 0.2 * 0.1 * 0.05),
    "concave_mesh": Solid(  # a prismatoid without a pyramid
        1 + 4 + 4,
        1200,
        0.07 / 6 * (0.1 * 0.08 + 4 * 0.09 * 0.07 + 0.08 * 0.06) - 0.045 / 3 * 0.08 * 0.06,
    ),
    "cube": Solid(6, 700, 0.06**3),
    "frustum": Solid(6, 1200, 0.08 / 3 * (0.1**2 + 0.1 * 0.06 + 0.06**2)),
    "hexagonal_prism": Solid(6 + 2, 500, 1.5 * sqrt(3) * 0.04**2 * 0.1),
    "l_bracket": Solid(6 + 2, 2700, 0.06 * (0.12 * 0.1 - 0.1 * 0.08)),
    "octagonal_prism": Solid(8 + 2, 1140, 2 * (sqrt(2) - 1) * 0.1**2 * 0.06),
    "octahedron": Solid(8, 950, 4 / 3 * 0.06**3),
    "off_hull_com": Solid(6, 700, 0.02 * 0.03 * 0.14),
    "plate_with_hole": Solid(6 + 4, 2700, (0.12**2 - 0.05**2) * 0.02),
    "rod": Solid(6, 7850, 0.3 * 0.005**2),
    "skewed_block": Solid(6, 1050, 631.314e-6),
    "staircase": Solid(8 + 2, 750, 0.08 * 0.04 * (0.03 + 0.06 + 0.09)),
    "t_block": Solid(8 + 2, 700, 0.04 * (0.12 * 0.03 + 0.04 * 0.06)),
    "tetrahedron": Solid(4, 500, 0.08**3 / 3),
    "triangular_prism": Solid(3 + 2, 1050, 0.08 * 0.07 / 2 * 0.12),
    "two_materials": Solid(5 + 5, 1150, 0.05**2 * 0.14),
    "u_channel": Solid(8 + 2, 2700, 0.12 * (0.1 * 0.07 - 0.07 * 0.055)),
    "wedge": Solid(3 + 2, 700, 0.12 * 0.035 / 2 * 0.06),
}

every_model = pytest.mark.parametrize("name", SOLIDS)


def model_file(name: str) -> Path:
    (file,) = (path for path in (MODELS / name).iterdir() if path.suffix in {".sdf", ".urdf"})
    return file


@pytest.fixture(scope="module")
def objects() -> dict[str, GraspObject]:
    return {name: load_object(model_file(name)) for name in SOLIDS}


def surface_triangles(thing: GraspObject) -> Array:
    """The exposed faces as triangles, counter-clockwise from outside [m], shape (T, 3, 3)."""
    triangles = []
    for face in thing.polyhedron.faces:
        cover = shapely.constrained_delaunay_triangles(face.polygon_F)
        ring = shapely.get_coordinates(shapely.orient_polygons(cover)).reshape(-1, 4, 2)[:, :3]
        triangles.append(face.p_BF + ring @ face.R_BF[:, :2].T)
    return np.concatenate(triangles)


def solid_inertia(triangles: Array, density: float) -> SpatialInertia:
    """Mass properties about Bo, in B, of the solid inside: tetrahedra from Bo, signed."""
    corners = np.concatenate([triangles, np.zeros_like(triangles[:, :1])], axis=1)
    volume = np.linalg.det(triangles) / 6
    mass = density * volume.sum()
    total = corners.sum(axis=1)
    squares = np.einsum("tci,tcj->tij", corners, corners) + np.einsum("ti,tj->tij", total, total)
    second = density * np.einsum("t,tij->ij", volume, squares) / 20
    unit = (np.trace(second) * np.eye(3) - second) / mass
    return SpatialInertia(
        mass,
        density * volume @ total / 4 / mass,
        UnitInertia(*np.diag(unit), unit[0, 1], unit[0, 2], unit[1, 2]),
    )


def stated_inertia(name: str) -> SpatialInertia:
    """What Drake reads in the file, about Bo, in B."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(str(MODELS / "package.xml"))
    (model,) = parser.AddModels(str(model_file(name)))
    plant.Finalize()
    body = plant.get_body(plant.GetBodyIndices(model)[0])
    return body.CalcSpatialInertiaInBodyFrame(plant.CreateDefaultContext())


def assert_same_inertia(a: SpatialInertia, b: SpatialInertia) -> None:
    """To the digits that the files print: six of masses and moments, nanometres."""
    assert a.get_mass() == pytest.approx(b.get_mass(), rel=1e-6)
    np.testing.assert_allclose(a.get_com(), b.get_com(), atol=1e-9)
    central_a, central_b = (
        x.Shift(x.get_com()).CalcRotationalInertia().CopyToFullMatrix3() for x in (a, b)
    )
    np.testing.assert_allclose(central_a, central_b, rtol=1e-5, atol=1e-6 * np.trace(central_b))


def test_every_folder_is_one_model_with_one_line_of_provenance() -> None:
    assert {path.name for path in MODELS.iterdir() if path.is_dir()} == {*SOLIDS, "hands"}
    table = (MODELS / "README.md").read_text(encoding="utf-8")
    for name, solid in SOLIDS.items():
        assert model_file(name).stem == name
        assert len((MODELS / name / "README.md").read_text(encoding="utf-8").splitlines()) == 1
        (row,) = (line for line in table.splitlines() if line.startswith(f"| `{name}`"))
        assert int(row.split("|")[2]) == solid.num_faces


@every_model
def test_it_loads_without_warnings_as_the_body_of_its_name(
    name: str, objects: dict[str, GraspObject]
) -> None:
    thing = objects[name]
    assert thing.warnings == ()
    assert thing.source is not None
    assert (thing.source.model_name, thing.source.body_name) == (name, name)


@every_model
def test_it_has_the_faces_of_its_solid(name: str, objects: dict[str, GraspObject]) -> None:
    assert len(objects[name].polyhedron.faces) == SOLIDS[name].num_faces


@every_model
def test_its_exposed_faces_enclose_its_volume(name: str, objects: dict[str, GraspObject]) -> None:
    triangles = surface_triangles(objects[name])
    # Seven digits: those of the meshes' coordinates.
    assert np.linalg.det(triangles).sum() / 6 == pytest.approx(SOLIDS[name].volume, rel=1e-7)
    # A closed surface has no vector area: nothing is missing that the volume would not miss.
    a, b, c = np.moveaxis(triangles, 1, 0)
    area = np.cross(b - a, c - a)
    np.testing.assert_allclose(area.sum(axis=0), 0, atol=1e-9 * np.linalg.norm(area, axis=1).sum())


@every_model
def test_its_mass_properties_are_those_of_a_uniform_solid(
    name: str, objects: dict[str, GraspObject]
) -> None:
    inertia = solid_inertia(surface_triangles(objects[name]), SOLIDS[name].density)
    if name == "off_hull_com":
        inertia += SpatialInertia.SolidBoxWithDensity(7850, 0.03, 0.08, 0.03).Shift([0, 0, -0.155])
    assert_same_inertia(stated_inertia(name), inertia)
    assert objects[name].mass == stated_inertia(name).get_mass()
    np.testing.assert_allclose(objects[name].p_BBcm, inertia.get_com(), atol=1e-9)


@every_model
def test_its_package_uri_is_the_same_object(name: str, objects: dict[str, GraspObject]) -> None:
    uri = f"package://drake_polygrasp_models/{name}/{model_file(name).name}"
    thing = load_object(uri, package_paths=[MODELS])
    assert thing.source is not None
    assert objects[name].source is not None
    assert thing.source.sha256 == objects[name].source.sha256
    np.testing.assert_array_equal(
        thing.polyhedron.triangles_B, objects[name].polyhedron.triangles_B
    )


def test_drake_finds_the_package_below_a_folder() -> None:
    packages = PackageMap.MakeEmpty()
    packages.PopulateFromFolder(str(MODELS.parent))
    assert Path(packages.GetPath("drake_polygrasp_models")).samefile(MODELS)


@every_model
def test_its_friction_is_stated(name: str, objects: dict[str, GraspObject]) -> None:
    mu = Counter(face.mu for face in objects[name].polyhedron.faces)
    expected = {0.3: 5, 0.6: 5} if name == "two_materials" else {0.3: SOLIDS[name].num_faces}
    assert mu == expected


def test_the_skewed_blocks_volume_is_that_of_its_corners_hull() -> None:
    lines = (MODELS / "skewed_block" / "skewed_block.obj").read_text().splitlines()
    corners = [[float(x) for x in line.split()[1:]] for line in lines if line.startswith("v ")]
    assert 1e-9 * ConvexHull(corners).volume == pytest.approx(SOLIDS["skewed_block"].volume)


def test_no_two_faces_of_the_skewed_block_are_parallel(objects: dict[str, GraspObject]) -> None:
    normals = np.array([face.nhat_TB_B for face in objects["skewed_block"].polyhedron.faces])
    cosines = np.abs(normals @ normals.T)[np.triu_indices(6, 1)]
    assert np.degrees(np.arccos(cosines.max())) > 5


def test_the_hammers_centre_of_mass_is_outside_the_hull_of_its_handle(
    objects: dict[str, GraspObject],
) -> None:
    thing = objects["off_hull_com"]
    hull = Delaunay(thing.polyhedron.triangles_B.reshape(-1, 3))
    assert hull.find_simplex(thing.p_BBcm) == -1
    assert hull.find_simplex([0, 0, 0.07]) >= 0


def test_the_rod_is_one_to_sixty(objects: dict[str, GraspObject]) -> None:
    assert objects["rod"].polyhedron.diameter == pytest.approx(0.005 * sqrt(60**2 + 2))
