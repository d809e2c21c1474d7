"""Cavities that the parts of a body seal: their walls are no faces, whatever the parts are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.spatial import ConvexHull

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.cavities import enclose_nothing, find_cavities
from drake_polygrasp.geometry.polyhedron import Polyhedron, volume_centroid
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.geometry.surface import Part, build_polyhedron, curved_part
from drake_polygrasp.geometry.surface_contact import face_at, fingertip_fits, project_contacts
from drake_polygrasp.geometry.triangles import diameter, unit_normals
from tests.support.common import random_rotations, round_body
from tests.support.convex_polyhedra import prism, tangent_polyhedron
from tests.support.planned import exact_plan
from tests.support.solids import object_of
from tests.support.surface_judge import on_surface

X, Y, Z = np.eye(3)
SIDE, WALL = 0.1, 0.01
"""Of a box of plates [m]; its diameter is 0.173 m."""


def box(low: Sequence[float], high: Sequence[float]) -> Array:
    return prism(shapely.box(*low[:2], *high[:2]), high[2] - low[2]) + low[2] * Z


def plates(gap: float = 0.0, lid: float = 0.0) -> list[Array]:
    """A box of six plates: all edges `gap` apart, or overlapping, and the lid `lid` more."""
    s, t, g = SIDE, WALL, gap
    low, high = t + g, s - t - g
    return [
        box((0, 0, 0), (s, s, t)),
        box((0, 0, s - t + lid), (s, s, s + lid)),
        box((0, 0, low), (t, s, high)),
        box((s - t, 0, low), (s, s, high)),
        box((low, 0, low), (high, t, high)),
        box((low, s - t, low), (high, s, high)),
    ]


def build(parts: Sequence[Array]) -> Polyhedron:
    return build_polyhedron([Part(part, 0.3) for part in parts])


def facing(parts: Sequence[Array], p_BC: Array, nhat: Array) -> Bools:
    """Whether contacts at points with inward normals are on faces."""
    return face_at(build(parts), np.atleast_2d(p_BC), np.atleast_2d(nhat)) >= 0


MIDDLE = SIDE / 2
INNER = np.array([[WALL, MIDDLE, MIDDLE], [MIDDLE, SIDE - WALL, MIDDLE], [MIDDLE, MIDDLE, WALL]])
INTO_INNER = np.array([-X, Y, -Z])
OUTER = np.array([[0, MIDDLE, MIDDLE], [MIDDLE, SIDE, MIDDLE], [MIDDLE, MIDDLE, 0]])
INTO_OUTER = np.array([X, -Y, Z])


@pytest.mark.parametrize(
    "gap",
    [0.0, -2e-3, 1.7e-6, 1e-4, 1e-3],
    ids=["flush", "overlapping", "micrometres", "thin", "mm"],
)
def test_no_finger_touches_the_inside_of_a_box_of_plates(gap: float) -> None:
    parts = plates(gap)
    assert facing(parts, OUTER, INTO_OUTER).all()
    assert not facing(parts, INNER, INTO_INNER).any()


@pytest.mark.parametrize(
    ("slit", "tip_radius", "reached"), [(5e-3, 2e-3, True), (1e-3, 0.0, False)]
)
def test_a_way_in_is_one_that_is_wider_than_a_cell(
    slit: float, tip_radius: float, reached: bool
) -> None:
    """A cell is 1.35 mm; how wide a tip may be is then asked at each contact, not on its way."""
    assert (facing(plates(lid=slit), INNER, INTO_INNER) == reached).all()
    if reached:
        assert fingertip_fits(build(plates(lid=slit)), INNER, INTO_INNER, tip_radius).all()


def test_without_its_lid_the_box_is_open() -> None:
    cup = plates()
    del cup[1]
    assert facing(cup, INNER, INTO_INNER).all()
    assert facing(cup, OUTER, INTO_OUTER).all()


def test_the_inside_of_a_tube_is_open_until_both_ends_are_shut() -> None:
    tube = plates()[2:]
    for ends, open_ in (((), True), ((0,), True), ((0, 1), False)):
        parts = tube + [plates()[k] for k in ends]
        assert (facing(parts, INNER[:2], INTO_INNER[:2]) == open_).all()


def test_half_shells_seal_what_each_alone_leaves_open() -> None:
    cup = prism(shapely.box(0, 0, 0.1, 0.1) - shapely.box(0.01, 0.01, 0.09, 0.09), 0.04)
    low, high = [box((0, 0, -0.01), (0.1, 0.1, 0)), cup], [box((0, 0, 0.08), (0.1, 0.1, 0.09))]
    high.append(cup + 0.04 * Z)
    wall, into = np.array([0.01, 0.05, 0.02]), -X
    assert facing(low, wall, into).all()
    assert not facing(low + high, wall, into).any()
    apart = [part + 0.01 * Z for part in high]
    assert facing(low + apart, wall, into).all()


def test_of_nested_boxes_only_the_outer_walls_are_touched() -> None:
    inner = [0.5 * part + 0.025 for part in plates()]
    assert facing(inner, 0.5 * OUTER + 0.025, INTO_OUTER).all()
    nested = plates() + inner
    assert facing(nested, OUTER, INTO_OUTER).all()
    for points, into in ((INNER, INTO_INNER), (OUTER, INTO_OUTER), (INNER, INTO_INNER)):
        assert not facing(nested, 0.5 * points + 0.025, into).any()
    assert not facing(nested, INNER, INTO_INNER).any()


def test_many_facets_and_curved_solids_in_a_cavity_are_sealed_too() -> None:
    for ball in (
        Part(round_body(2000, (0.02, 0.02, 0.02)) + MIDDLE, 0.3),
        curved_part(Primitive("ellipsoid", np.eye(3), np.full(3, MIDDLE), np.full(3, 0.02)), 0.3),
    ):
        shut = build_polyhedron([*(Part(part, 0.3) for part in plates()), ball])
        alone = build(plates())
        assert len(shut.faces) == len(alone.faces) == 6
        cup = [part for k, part in enumerate(plates()) if k != 1]
        open_ = build_polyhedron([*(Part(part, 0.3) for part in cup), ball])
        assert any(face.reach > 0 for face in open_.faces)
        np.testing.assert_allclose(volume_centroid(shut), np.full(3, MIDDLE), atol=1e-12)


def test_a_face_that_is_partly_in_a_cavity_seats_contacts_outside_only() -> None:
    """Walls that hover half a millimetre above a wide plate leave its top in one piece."""
    table = box((-0.1, -0.1, 0), (0.2, 0.2, WALL))
    polyhedron = build([table, *plates(5e-4)[1:]])
    p_BC = np.array([[MIDDLE, MIDDLE, WALL], [-0.05, MIDDLE, WALL]])
    top = face_at(polyhedron, p_BC[1:], -Z[None])
    assert face_at(polyhedron, p_BC, np.array([-Z, -Z])).tolist() == [-1, top[0]]
    assert project_contacts(polyhedron, p_BC, np.repeat(top, 2)).ok.tolist() == [False, True]


@pytest.mark.parametrize("seed", range(3))
def test_cavities_do_not_depend_on_the_frame_nor_on_the_scale(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (R,), p, size = random_rotations(1, rng), rng.normal(size=3), 10 ** rng.uniform(-2, 2)
    for parts, sealed in ((plates(), True), (plates()[:5], False)):
        moved = [size * part @ R.T + p for part in parts]
        found = facing(moved, size * INNER[[0, 2]] @ R.T + p, INTO_INNER[[0, 2]] @ R.T)
        assert (found != sealed).all()


def test_what_a_ball_reaches_from_outside_is_not_sealed() -> None:
    """A labyrinth of two bends, as wide as the ball that the grid promises to let through."""
    width = 2 * 0.02 * np.linalg.norm([0.2, 0.1, 0.1])
    assert width < 0.01
    slot = shapely.LineString([(0.02, 0.12), (0.02, 0.05), (0.18, 0.05)]).buffer(width / 2)
    outline = shapely.box(0, 0, 0.2, 0.1) - slot - shapely.box(0.15, 0.03, 0.19, 0.08)
    parts = [prism(outline, 0.08) + 0.01 * Z]
    parts += [box((0, 0, 0), (0.2, 0.1, 0.01)), box((0, 0, 0.09), (0.2, 0.1, 0.1))]
    wall, into = np.array([0.19, 0.055, 0.05]), X
    assert facing(parts, wall, into).all()
    plug = box((0.08, 0.03, 0.005), (0.1, 0.08, 0.095))
    assert not facing([*parts, plug], wall, into).any()


def test_grasps_of_a_box_of_plates_are_on_its_outside() -> None:
    parts = plates(1.7e-6)
    crate = object_of(build(parts))
    plan = exact_plan(crate, top=5)
    assert len(plan.grasps) == 5
    for certified in plan.grasps:
        assert (np.abs(certified.grasp.p_BC - MIDDLE).max(axis=1) >= MIDDLE - 1e-6).all()
        for p, nhat in zip(certified.grasp.p_BC, certified.grasp.nhat_TB_B, strict=True):
            assert on_surface(p, nhat, parts, crate.polyhedron.diameter)
    blind = object_of(replace(crate.polyhedron, cavities=None))
    assert len(erode(blind.polyhedron).face) == len(erode(crate.polyhedron).face)


def shells_of(parts: Sequence[Array]) -> tuple[Array, Ints, Ints, Bools]:
    """Vertices, corners, the shell of each triangle, and which shells are closed."""
    triangles = np.concatenate(parts)
    shell = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    corners = np.arange(3 * len(triangles)).reshape(-1, 3)
    return triangles.reshape(-1, 3), corners, shell, np.ones(len(parts), dtype=bool)


@pytest.mark.parametrize("seed", range(6))
def test_three_convex_solids_enclose_nothing_as_the_grid_finds_too(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = [
        tangent_polyhedron(8, 3 * seed + k) @ R.T + 0.05 * rng.normal(size=3)
        for k, R in enumerate(random_rotations(3, rng))
    ]
    L = diameter(np.concatenate(parts).reshape(-1, 3))
    vertices, corners, shell, closed = shells_of(parts)
    assert enclose_nothing(vertices, corners, shell, closed, L)
    triangles = np.concatenate(parts)
    every = np.ones(len(triangles), dtype=bool)
    found = find_cavities(triangles, every, (), L, every)
    if found is not None:  # Cells that the surface cuts off, in which no sphere has room.
        nhat, _ = unit_normals(triangles)
        weights = rng.dirichlet(np.ones(3), size=(50, len(triangles)))
        points = np.einsum("ktc,tcd->ktd", weights, triangles)
        for p_BC in points:
            assert not found.sealed_at(p_BC, -nhat).any()


def test_four_convex_solids_may_enclose_a_cavity() -> None:
    corners = 0.05 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    plates_ = []
    for k in range(4):
        rim = np.delete(corners, k, axis=0)
        outward = -corners[k] / np.linalg.norm(corners[k])
        hull = ConvexHull(np.concatenate([1.3 * rim, 1.3 * rim + 0.01 * outward]))
        triangles = hull.points[hull.simplices]
        turned = np.einsum("ti,ti->t", unit_normals(triangles)[0], hull.equations[:, :3]) < 0
        triangles[turned] = triangles[turned][:, ::-1]
        plates_.append(triangles)
    for k in range(4):
        wall = np.delete(corners, k, axis=0).mean(axis=0)
        into = wall / np.linalg.norm(wall)
        assert not facing(plates_, 1.3 * wall, into).any()
        # Without the plate opposite, the wall is reached.
        assert facing(
            [p for j, p in enumerate(plates_) if j != (k + 1) % 4], 1.3 * wall, into
        ).all()


def test_solids_that_are_not_convex_or_not_closed_may_enclose_a_cavity() -> None:
    notched = prism(shapely.box(0, 0, 0.1, 0.1) - shapely.box(0.04, 0.04, 0.06, 0.1), 0.05)
    whole = box((0, 0, 0), (0.1, 0.1, 0.1))
    for parts, expected in (([whole], True), ([whole, notched], False), ([whole] * 4, False)):
        assert enclose_nothing(*shells_of(parts), 0.2) == expected
    vertices, corners, shell, closed = shells_of([whole])
    assert not enclose_nothing(vertices, corners, shell, ~closed, 0.2)
    assert not enclose_nothing(vertices, corners[:, ::-1], shell, closed, 0.2)  # a hollow
