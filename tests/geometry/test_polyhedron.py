"""Faces of the exposed surface, and the regions that erosion leaves of them."""

from __future__ import annotations

import warnings
from math import sqrt

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.errors import ModelError
from drake_polygrasp.geometry.inradius import inradius
from drake_polygrasp.geometry.polygons import shrunk
from drake_polygrasp.geometry.polyhedron import Face, Polyhedron, surface_vertices, volume_centroid
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.geometry.shells import without_doubles
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from tests.support.convex_polyhedra import (
    boxes,
    ellipsoid_hull,
    holed_prism,
    prism,
    tangent_polyhedron,
)
from tests.support.scanned import blob, scan
from tests.support.solids import regular_polygon
from tests.support.surface_judge import is_exposed

L_PROFILE = shapely.Polygon([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.2), (0, 0.2)])
HOLED_SQUARE = shapely.box(0, 0, 0.4, 0.4) - shapely.box(0.1, 0.1, 0.2, 0.3)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Array:
    triangles = prism(shapely.box(low[0], low[1], high[0], high[1]), high[2] - low[2])
    return triangles + np.array([0, 0, low[2]])


def build(*parts: Array, mu: float = 0.3) -> Polyhedron:
    return build_polyhedron([Part(part, mu) for part in parts])


def area(polyhedron: Polyhedron) -> float:
    return sum(face.polygon_F.area for face in polyhedron.faces)


def corners_B(face: Face) -> set[tuple[float, ...]]:
    """The face's vertices in B [m], to the nanometre."""
    vertices = face.p_BF + shapely.get_coordinates(face.polygon_F) @ face.R_BF[:, :2].T
    return {tuple(v) for v in (vertices.round(9) + 0.0).tolist()}


BLOCK = box((-0.05, -0.1, -0.2), (0.05, 0.1, 0.2))


def test_a_box_has_six_faces_sorted_by_outward_normal() -> None:
    faces = build(BLOCK).faces
    outward = [(-face.nhat_TB_B).tolist() for face in faces]
    assert outward == [[-1, 0, 0], [0, -1, 0], [0, 0, -1], [0, 0, 1], [0, 1, 0], [1, 0, 0]]
    assert [face.polygon_F.area for face in faces] == pytest.approx(
        [0.08, 0.04, 0.02, 0.02, 0.04, 0.08]
    )
    assert all(len(face.polygon_F.exterior.coords) == 5 for face in faces)


def test_the_frame_of_an_axis_aligned_face_is_axis_aligned() -> None:
    for face in build(BLOCK).faces:
        assert sorted(np.abs(face.R_BF).ravel().tolist()) == [0] * 6 + [1] * 3
        assert np.linalg.det(face.R_BF) == 1


def test_diameter_is_the_greatest_distance_of_two_vertices() -> None:
    assert build(BLOCK).diameter == pytest.approx(sqrt(0.1**2 + 0.2**2 + 0.4**2), rel=1e-14)


def test_a_triangle_knows_its_face() -> None:
    polyhedron = build(BLOCK, box((-0.01, -0.01, -0.01), (0.01, 0.01, 0.01)))
    nhat = np.cross(*np.diff(polyhedron.triangles_B, axis=1).swapaxes(0, 1))
    for normal, k in zip(nhat[:12], polyhedron.triangle_face[:12], strict=True):
        assert normal @ polyhedron.faces[k].nhat_TB_B == pytest.approx(-np.linalg.norm(normal))
    assert (polyhedron.triangle_face[12:] == -1).all(), "the inner box is wholly covered"


@pytest.mark.parametrize("seed", range(4))
def test_the_order_and_sense_of_triangles_do_not_matter(seed: int) -> None:
    triangles = holed_prism(5, 1, seed)
    rng = np.random.default_rng(seed)
    shuffled = np.roll(rng.permutation(triangles), 1, axis=1)
    flip = rng.random(len(shuffled)) < 0.5
    shuffled[flip] = shuffled[flip, ::-1]
    for a, b in zip(build(triangles).faces, build(shuffled).faces, strict=True):
        np.testing.assert_allclose(a.R_BF, b.R_BF, atol=1e-12)
        assert a.polygon_F.symmetric_difference(b.polygon_F).area < 1e-12


# Two boxes, their exposed area and number of faces by hand; BLOCK's own area is 0.28.
PAIRS = {
    "far apart": (box((1, 0, 0), (1.1, 0.1, 0.1)), 0.28 + 0.06, 12),
    "doubled": (BLOCK, 0.28, 6),
    "inside": (box((-0.01, -0.01, -0.01), (0.01, 0.01, 0.01)), 0.28, 6),
    "inside against a wall": (box((0, 0, 0), (0.05, 0.05, 0.05)), 0.28, 6),
    "standing on top": (box((-0.02, -0.02, 0.2), (0.02, 0.02, 0.3)), 0.28 + 4 * 0.004, 11),
    "sunk into the top": (box((-0.02, -0.02, 0.1), (0.02, 0.02, 0.3)), 0.28 + 4 * 0.004, 11),
    "stacked flush": (box((-0.05, -0.1, 0.2), (0.05, 0.1, 0.3)), 0.28 + 0.6 * 0.1, 6),
    "overlapping flush": (box((-0.05, -0.1, 0.0), (0.05, 0.1, 0.3)), 0.28 + 0.6 * 0.1, 6),
    "offset along y": (box((-0.05, 0.0, 0.2), (0.05, 0.2, 0.3)), 0.28 + 0.08, 10),
    "through": (box((-0.2, -0.05, -0.05), (0.2, 0.05, 0.05)), 0.28 + 0.4 * 0.3, 6 + 10),
    "touching along an edge": (box((0.05, 0.1, -0.2), (0.1, 0.2, 0.2)), 0.28 + 0.13, 12),
    "touching at a corner": (box((0.05, 0.1, 0.2), (0.1, 0.2, 0.3)), 0.28 + 0.04, 12),
    "micrometres off a wall": (box((0.05 + 4e-6, -0.1, -0.2), (0.1, 0.1, 0.2)), 0.34, 10),
}


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("one_mesh", [False, True], ids=["two parts", "one mesh"])
def test_exposed_area_of_two_boxes(name: str, one_mesh: bool) -> None:
    other, expected, num_faces = PAIRS[name]
    solid = build(np.concatenate([BLOCK, other])) if one_mesh else build(BLOCK, other)
    assert area(solid) == pytest.approx(expected, rel=1e-4 if "micrometres" in name else 1e-8)
    assert len(solid.faces) == num_faces
    assert solid.watertight


def test_an_l_bracket_of_two_boxes_is_the_l_bracket_of_one_mesh() -> None:
    one = build(prism(L_PROFILE, 0.1))
    two = build(box((0, 0, 0), (0.3, 0.1, 0.1)), box((0, 0.1, 0), (0.1, 0.2, 0.1)))
    overlapping = build(box((0, 0, 0), (0.3, 0.1, 0.1)), box((0, 0, 0), (0.1, 0.2, 0.1)))
    assert len(one.faces) == 8
    for a, b, c in zip(one.faces, two.faces, overlapping.faces, strict=True):
        assert corners_B(a) == corners_B(b) == corners_B(c)


def test_a_through_hole_is_a_hole_of_two_faces_and_has_four_walls() -> None:
    plate = build(prism(HOLED_SQUARE, 0.02))
    assert sorted(len(face.polygon_F.interiors) for face in plate.faces) == [0] * 8 + [1] * 2
    assert area(plate) == pytest.approx(2 * (0.16 - 0.02) + 0.02 * (1.6 + 0.6))


def test_a_face_cut_in_two_is_two_faces() -> None:
    wall = box((-0.06, -0.2, 0.1), (0.06, 0.2, 0.3))
    tops = [f for f in build(BLOCK, wall).faces if -f.nhat_TB_B[0] == 1]
    assert sorted(f.polygon_F.area for f in tops) == pytest.approx([0.06, 0.08])


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(*[st.lists(st.integers(0, 4), min_size=2, max_size=2, unique=True)] * 3),
        min_size=1,
        max_size=5,
    ),
    st.booleans(),
)
def test_exposed_area_of_boxes_on_a_lattice_is_what_voxels_say(
    solids: list[tuple[list[int], ...]], one_mesh: bool
) -> None:
    voxels = np.zeros((6, 6, 6), dtype=int)
    parts = []
    for ranges in solids:
        low, high = zip(*(sorted(r) for r in ranges), strict=True)
        parts.append(0.1 * box(low, high))
        voxels[tuple(slice(a + 1, b + 1) for a, b in zip(low, high, strict=True))] = 1
    polyhedron = build(np.concatenate(parts)) if one_mesh else build(*parts)
    for axis in range(3):
        steps = np.diff(voxels, axis=axis)
        for sign in (1, -1):
            found = sum(f.polygon_F.area for f in polyhedron.faces if -f.nhat_TB_B[axis] == sign)
            assert found == pytest.approx(0.01 * (steps == -sign).sum(), rel=1e-7)


@pytest.mark.parametrize("seed", range(6))
def test_faces_of_turned_boxes_are_where_random_points_are_exposed(seed: int) -> None:
    parts = [boxes(1, 10 * seed + k) for k in range(3)]
    polyhedron = build(*parts)
    rng = np.random.default_rng(seed)
    for triangle in np.concatenate(parts):
        points = rng.dirichlet(np.ones(3), size=40) @ triangle
        inward = -np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        inward = np.tile(inward / np.linalg.norm(inward), (40, 1))
        on_face = np.zeros(40, dtype=bool)
        for face in polyhedron.faces:
            p_FC = (points - face.p_BF) @ face.R_BF
            if face.nhat_TB_B @ inward[0] > 1 - 1e-9 and np.abs(p_FC[:, 2]).max() < 1e-9:
                on_face |= shapely.contains_xy(face.polygon_F, p_FC[:, :2])
        assert (on_face == is_exposed(points, inward, parts, 1e-9)).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_exposed_surface_is_closed(seed: int) -> None:
    for polyhedron in (build(boxes(4, seed)), build(boxes(4, seed, aligned=True))):
        vector_area = sum(face.polygon_F.area * face.nhat_TB_B for face in polyhedron.faces)
        np.testing.assert_allclose(vector_area, 0, atol=1e-8 * polyhedron.diameter**2)


@pytest.mark.parametrize("num_faces", [4, 10, 30])
def test_a_convex_polyhedron_keeps_its_faces_and_is_convex(num_faces: int) -> None:
    polyhedron = build(tangent_polyhedron(num_faces, seed=num_faces))
    assert len(polyhedron.faces) == num_faces
    assert polyhedron.is_convex
    assert not build(prism(L_PROFILE, 0.1)).is_convex


@pytest.mark.parametrize("seed", range(5))
def test_six_decimals_do_not_part_a_face(seed: int) -> None:
    triangles = holed_prism(6, 1, seed)
    exact, rounded = build(triangles), build(triangles.round(6))
    assert len(rounded.faces) == len(exact.faces) == 12
    assert area(rounded) == pytest.approx(area(exact), rel=1e-4)


def test_a_ridge_of_a_thousandth_is_no_plane() -> None:
    roof = np.array([(0, 0.1), (0.1, 0.1002), (0.2, 0.1), (0.2, 0), (0, 0)])
    assert len(build(prism(shapely.Polygon(roof), 0.1)).faces) == 7


def test_a_shell_inside_out_is_turned() -> None:
    assert build(BLOCK[:, ::-1]).faces[0].polygon_F.area == pytest.approx(0.08)
    mirrored = BLOCK * [-1, 1, 1]
    assert [f.nhat_TB_B.tolist() for f in build(mirrored).faces] == [
        f.nhat_TB_B.tolist() for f in build(BLOCK).faces
    ]


def test_coplanar_neighbours_merge_only_when_their_friction_is_the_same() -> None:
    half, other_half = box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (2, 1, 1))
    assert len(build(half, other_half).faces) == 6
    polyhedron = build_polyhedron([Part(half, 0.3), Part(other_half, 0.6)])
    assert sorted(face.mu for face in polyhedron.faces) == [0.3] * 5 + [0.6] * 5


def test_where_faces_coincide_the_lesser_friction_holds() -> None:
    low, high = box((0, 0, 0), (2, 1, 1)), box((1, 0, 0), (3, 1, 1))
    polyhedron = build_polyhedron([Part(high, 0.6), Part(low, 0.3)])
    areas = {mu: sum(f.polygon_F.area for f in polyhedron.faces if f.mu == mu) for mu in (0.3, 0.6)}
    assert areas == pytest.approx({0.3: 4 * 2 + 1, 0.6: 4 * 1 + 1})


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_a_rigid_motion_moves_the_faces_and_changes_nothing(seed: int) -> None:
    parts = [boxes(1, seed), boxes(1, seed + 1)]
    R, p = Rotation.random(random_state=seed).as_matrix(), np.array([0.3, -0.2, 0.5])
    still, moved = build(*parts), build(*(part @ R.T + p for part in parts))
    assert moved.diameter == pytest.approx(still.diameter, rel=1e-12)

    def figures(polyhedron: Polyhedron) -> Array:
        polygons = np.array([f.polygon_F for f in polyhedron.faces])
        return np.sort([shapely.area(polygons), inradius(polygons)])

    np.testing.assert_allclose(figures(moved), figures(still), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(volume_centroid(moved), R @ volume_centroid(still) + p, atol=1e-9)


def test_what_overlaps_counts_once_in_the_centroid() -> None:
    polyhedron = build(box((0, 0, 0), (2, 1, 1)), box((1, 0, 0), (4, 1, 1)), BLOCK + 0.5)
    np.testing.assert_allclose(volume_centroid(polyhedron), [2, 0.5, 0.5], atol=1e-8)
    l_bracket = build(prism(L_PROFILE, 0.1))
    expected = [*np.ravel(L_PROFILE.centroid.coords), 0.05]
    np.testing.assert_allclose(volume_centroid(l_bracket), expected, atol=1e-12)


def test_surface_vertices_are_those_of_the_faces() -> None:
    vertices = {tuple(v) for v in surface_vertices(build(BLOCK)).round(12).tolist()}
    assert vertices == {(x, y, z) for x in (-0.05, 0.05) for y in (-0.1, 0.1) for z in (-0.2, 0.2)}


def test_a_mesh_with_a_missing_triangle_is_not_watertight() -> None:
    assert not build(BLOCK[1:]).watertight


def test_what_encloses_nothing_is_no_polyhedron() -> None:
    with pytest.raises(ModelError, match="no triangles"):
        build(np.empty((0, 3, 3)))
    with pytest.raises(ModelError, match="encloses no volume"):
        build(np.tile(np.array([0.0, 0.5, 1.0])[:, None], (4, 1, 3)))


def test_inradius_in_closed_form() -> None:
    turn = 2 * np.pi * np.arange(7) / 7
    polygons = {
        shapely.box(0, 0, 3, 1): 0.5,
        shapely.Polygon([(0, 0), (4, 0), (0, 3)]): 1.0,
        shapely.Polygon(np.c_[np.cos(turn), np.sin(turn)]): np.cos(np.pi / 7),
        shapely.Polygon([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]): sqrt(2) / (1 + sqrt(2)),
        shapely.box(0, 0, 4, 4) - shapely.box(1, 1, 3, 3): sqrt(2) / (1 + sqrt(2)),
        shapely.Polygon([(0, 0), (1, 0), (0, 1e-3)]): 1e-3 / (1 + 1e-3 + sqrt(1 + 1e-6)),
    }
    found = inradius(np.array(list(polygons)))
    np.testing.assert_allclose(found, list(polygons.values()), rtol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_inradius_is_no_less_than_a_search_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    triangles = shapely.polygons(rng.normal(size=(6, 3, 2)))
    polygons = shapely.get_parts(shapely.union_all(triangles))
    search = shapely.length(shapely.maximum_inscribed_circle(polygons, tolerance=1e-4))
    found = inradius(polygons)
    assert (found >= search * (1 - 1e-12)).all()
    assert (found <= search + 2e-4).all()


def test_erosion_takes_the_clearance_from_every_edge() -> None:
    regions = erode(build(BLOCK), edge_clearance=0.01)
    assert regions.face.tolist() == list(range(6))
    assert regions.area == pytest.approx(
        [0.18 * 0.38, 0.08 * 0.38, 0.08 * 0.18, 0.08 * 0.18, 0.08 * 0.38, 0.18 * 0.38]
    )
    assert regions.num_left_out == 0


def test_nothing_is_said_of_corners_that_are_one_but_for_rounding() -> None:
    """GEOS divides by zero there, of which numpy warns."""
    corners = [
        [-0.028540548048067355, 0.04854054804806736],
        [0.04854054804806736, 0.04854054804806736],
        [0.03297608861204079, -0.02854054804806736],
        [0.03297608861204079, 0.0038270690691771594],
        [0.032976088612040794, 0.003827069069177194],
        [0.032976088612040794, 0.04],
    ]
    polygon = np.array([shapely.Polygon(corners)])
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        wide, narrow = (shrunk(polygon, by)[0] for by in (0.0379, 0.001))
    assert wide.is_empty
    assert shapely.distance(narrow, polygon[0].boundary) == pytest.approx(0.001)


def test_the_default_clearance_is_a_hundredth_of_the_diameter_or_a_fifth_of_the_inradius() -> None:
    polyhedron = build(box((0, 0, 0), (0.5, 0.5, 0.02)))
    wide, narrow = 0.01 * polyhedron.diameter, 0.01 / 5
    areas = erode(polyhedron).area
    assert sorted(areas) == pytest.approx(
        [(0.5 - 2 * narrow) * (0.02 - 2 * narrow)] * 4 + [(0.5 - 2 * wide) ** 2] * 2
    )


def test_narrow_faces_are_left_out_and_counted() -> None:
    sheet = build(box((0, 0, 0), (0.5, 0.5, 0.002)))
    assert erode(sheet).num_left_out == 4
    assert erode(sheet, min_inradius=0.0).num_left_out == 0
    nothing = erode(sheet, edge_clearance=0.3)
    assert nothing.num_left_out == 6
    assert nothing.p_BV.shape == (0, 3)


def test_erosion_may_leave_several_regions_of_a_face() -> None:
    dumbbell = shapely.box(0, 0, 1, 1) | shapely.box(1, 0.45, 2, 0.55) | shapely.box(2, 0, 3, 1)
    regions = erode(build(prism(dumbbell, 1.0)), edge_clearance=0.06)
    faces, count = np.unique(regions.face, return_counts=True)
    assert sorted(count) == [1] * (len(faces) - 2) + [2, 2]
    assert regions.num_left_out == 0
    centroids = [p.centroid.x for p in regions.polygon_F[regions.face == faces[count == 2][0]]]
    assert centroids == sorted(centroids)


@pytest.mark.parametrize("seed", range(5))
def test_regions_keep_the_clearance_and_tell_their_rings(seed: int) -> None:
    polyhedron = build(holed_prism(7, 2, seed))
    regions = erode(polyhedron, edge_clearance=0.002)
    assert len(regions.face) >= len(polyhedron.faces) - regions.num_left_out
    for r, k in enumerate(regions.face):
        face, polygon = polyhedron.faces[k], regions.polygon_F[r]
        gap = shapely.distance(face.polygon_F.boundary, shapely.points(polygon.exterior.coords))
        assert gap.min() >= 0.002 * (1 - 1e-6)
        assert face.polygon_F.contains(polygon)
        first, last = regions.region_offsets[r : r + 2]
        assert last - first == 1 + len(polygon.interiors)
        ring = regions.p_BV[regions.ring_offsets[first] : regions.ring_offsets[first + 1]]
        assert (ring[0] == ring[-1]).all()
        np.testing.assert_allclose((ring - face.p_BF) @ face.R_BF[:, 2], 0, atol=1e-12)
        outline = shapely.Polygon((ring - face.p_BF) @ face.R_BF[:, :2])
        assert outline.symmetric_difference(shapely.Polygon(polygon.exterior)).area < 1e-12


def test_values_are_read_only() -> None:
    polyhedron = build(BLOCK)
    for array in (polyhedron.triangles_B, polyhedron.faces[0].R_BF, erode(polyhedron).p_BV):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_the_faces_of_a_triangulated_hull_are_its_triangles() -> None:
    assert len(build(ellipsoid_hull(40, seed=1)).faces) == 40


@pytest.mark.parametrize("turn", np.linspace(0, 1, 5))
def test_a_hole_may_touch_the_rim_of_its_face(turn: float) -> None:
    """A column on a plate, one of its edges above the plate's rim."""
    R = Rotation.from_euler("z", turn).as_matrix()
    plate = prism(shapely.box(-0.04, -0.05, 0.02, 0.05), 0.02)
    column = prism(regular_polygon(4, 0.02), 0.1)
    polyhedron = build(plate @ R.T, column @ R.T)
    assert all(shapely.is_valid(face.polygon_F) for face in polyhedron.faces)
    top = [face for face in polyhedron.faces if face.R_BF[2, 2] == 1 and face.p_BF[2] < 0.05]
    found = sum(face.polygon_F.area for face in top)
    assert found == pytest.approx(0.06 * 0.1 - 2 * 0.02**2, rel=1e-6)


def test_copies_of_triangles_are_dropped_unless_solids_share_them() -> None:
    """By vertex index: a tetrahedron, copies of its sides, and another on the same side."""
    one = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    beyond = np.array([[0, 2, 1], [0, 1, 4], [1, 2, 4], [2, 0, 4]])
    above = np.array([[0, 1, 2], [0, 5, 1], [1, 5, 2], [2, 5, 0]])

    def sides(corners: Ints) -> list[tuple[int, ...]]:
        return sorted(map(tuple, np.sort(corners, axis=1).tolist()))

    for copies in ([0], [0, 0], [1, 2], [3, 3, 1]):
        for extra in (one[copies], one[copies][:, ::-1]):
            assert sides(without_doubles(np.concatenate([one, extra]))) == sides(one)
    for shared in (np.concatenate([one, beyond]), np.concatenate([one, above]), one.repeat(2, 0)):
        assert sides(without_doubles(shared)) == sides(shared)
        collapsed = np.array([[4, 4, 2], [3, 3, 3]])
        assert sides(without_doubles(np.concatenate([collapsed, shared]))) == sides(shared)


@pytest.mark.parametrize("seed", range(3))
def test_triangles_near_a_line_are_those_that_projections_show(seed: int) -> None:
    rng = np.random.default_rng(seed)
    polyhedron = build(scan(blob(0.05, seed), 400, 0.0, seed))
    triangles = polyhedron.own_triangles_B
    R = Rotation.random(random_state=seed).as_matrix()
    p_BQ, distance = triangles[7].mean(axis=0), float(rng.uniform(0.002, 0.02))
    seen = shapely.polygons(((triangles - p_BQ) @ R)[..., :2])
    off = shapely.distance(seen, shapely.Point(0, 0))
    found = polyhedron.own_triangles_near(p_BQ, R[:, 2], distance)
    assert set(np.flatnonzero(off <= distance)) <= set(found)
    # A triangle is in a ball around its centroid with two thirds of its longest median at most.
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    assert (off[found] <= distance + 2 * sides[found]).all()
    assert len(found) < len(triangles)
