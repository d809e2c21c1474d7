"""Contacts on the true surface, their distance from edges, and room for fingertips."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import shapely
from pydrake.math import RollPitchYaw, RotationMatrix

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.geometry.surface_contact import (
    edge_distance,
    face_at,
    fingertip_fits,
    fingertips_are_apart,
    project_contacts,
)
from drake_polygrasp.loading.object_model import load_object
from tests.support.convex_polyhedra import boxes, holed_prism, prism
from tests.support.solids import random_contacts
from tests.support.surface_judge import distance, on_surface

L_PROFILE = shapely.Polygon([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.2), (0, 0.2)])
X, Y, Z = np.eye(3)


def build(*parts: Array) -> Polyhedron:
    return build_polyhedron([Part(part, 0.3) for part in parts])


def test_contacts_of_an_exact_face_stay_and_keep_its_normal() -> None:
    polyhedron = build(prism(L_PROFILE, 0.1))
    p_BC, nhat_TB_B, face = random_contacts(polyhedron, 200, seed=0)
    projected = project_contacts(polyhedron, p_BC, face)
    assert projected.ok.all()
    assert (projected.p_BC == p_BC).all()
    assert (projected.nhat_TB_B == nhat_TB_B).all()


@pytest.mark.parametrize("seed", range(3))
def test_contacts_of_a_rounded_face_move_to_its_triangles(seed: int) -> None:
    rounded = holed_prism(6, 1, seed).round(6)
    polyhedron = build(rounded)
    p_BC, _, face = random_contacts(polyhedron, 40, seed)
    projected = project_contacts(polyhedron, p_BC, face)
    assert projected.ok.all()
    for p, nhat in zip(projected.p_BC, projected.nhat_TB_B, strict=True):
        assert on_surface(p, nhat, [rounded], polyhedron.diameter)
    assert (face_at(polyhedron, projected.p_BC, projected.nhat_TB_B) == face).all()


def test_a_point_beside_its_face_has_no_seat() -> None:
    polyhedron = build(prism(shapely.box(0, 0, 1, 1), 1.0))
    top = next(k for k, face in enumerate(polyhedron.faces) if face.R_BF[2, 2] == 1)
    projected = project_contacts(
        polyhedron, np.array([[0.5, 0.5, 1.0], [1.5, 0.5, 1.0]]), np.array([top, top])
    )
    assert projected.ok.tolist() == [True, False]


def test_a_contact_is_on_a_face_only_with_its_point_and_its_normal() -> None:
    polyhedron = build(prism(shapely.box(-0.1, -0.1, 0.1, 0.1), 0.2))
    L, p = polyhedron.diameter, np.array([0.1, 0.02, 0.05])
    tilted = np.array([-np.cos(1e-5), np.sin(1e-5), 0])
    contacts = {
        "on the wall": (p, -X, True),
        "a rounding error off": (p + 1e-7 * L * X, -X, True),
        "above it": (p + 1e-5 * L * X, -X, False),
        "below it": (p - 1e-5 * L * X, -X, False),
        "normal outward": (p, X, False),
        "normal tilted": (p, tilted, False),
        "normal of another face": (p, -Y, False),
        "beside it": (p + 0.2 * Y, -X, False),
    }
    points, normals, expected = zip(*contacts.values(), strict=True)
    found = face_at(polyhedron, np.array(points), np.array(normals))
    assert dict(zip(contacts, found >= 0, strict=True)) == dict(
        zip(contacts, expected, strict=True)
    )


def test_a_covered_wall_is_no_face() -> None:
    column = prism(shapely.box(-0.05, -0.05, 0.05, 0.05), 0.3)
    plate = prism(shapely.box(-0.2, -0.2, 0.2, 0.2), 0.1)
    p_BC = np.array([[0.05, 0, 0.05], [0.05, 0, 0.2]])
    found = face_at(build(column, plate), p_BC, np.array([-X, -X]))
    assert found[0] == -1
    assert found[1] >= 0


@pytest.mark.parametrize("seed", range(3))
def test_faces_of_random_contacts_are_found(seed: int) -> None:
    parts = [boxes(1, 5 * seed + k) for k in range(3)]
    polyhedron = build(*parts)
    p_BC, nhat_TB_B, face = random_contacts(polyhedron, 30, seed)
    assert (face_at(polyhedron, p_BC, nhat_TB_B) == face).all()
    for p, nhat in zip(p_BC, nhat_TB_B, strict=True):
        assert on_surface(p, nhat, parts, polyhedron.diameter)


def test_edge_distance_on_a_face_with_a_hole() -> None:
    plate = build(prism(shapely.box(0, 0, 0.4, 0.4) - shapely.box(0.1, 0.1, 0.3, 0.3), 0.02))
    top = next(k for k, face in enumerate(plate.faces) if face.R_BF[2, 2] == 1)
    p_BC = np.array([[0.05, 0.2, 0.02], [0.02, 0.2, 0.02], [0.08, 0.2, 0.02], [0.2, 0.2, 0.02]])
    found = edge_distance(plate, p_BC, np.full(4, top))
    np.testing.assert_allclose(found, [0.05, 0.02, 0.02, 0], atol=1e-12)


def test_a_tip_fits_in_a_notch_that_is_wider_than_it() -> None:
    u_profile = shapely.box(0, 0, 0.3, 0.2) - shapely.box(0.1, 0.05, 0.2, 0.3)
    channel = build(prism(u_profile, 0.1))
    floor, wall = np.array([0.15, 0.05, 0.05]), np.array([0.1, 0.15, 0.05])
    for p, nhat in ((floor, -Y), (wall, -X)):
        for radius, fits in ((0.049, True), (0.051, False)):
            assert fingertip_fits(channel, p[None], nhat[None], radius).tolist() == [fits]


def test_a_tip_beside_a_step_fits_when_it_is_a_radius_away() -> None:
    bracket = build(prism(L_PROFILE, 0.1))
    for gap, fits in ((0.0201, True), (0.0199, False)):
        p = np.array([[0.1 + gap, 0.1, 0.05]])
        assert fingertip_fits(bracket, p, -Y[None], 0.02).tolist() == [fits]


@pytest.mark.parametrize("seed", range(3))
def test_tips_fit_where_the_judge_measures_their_radius(seed: int) -> None:
    parts = [boxes(1, 7 * seed + k) for k in range(3)]
    polyhedron = build(*parts)
    p_BC, nhat_TB_B, _ = random_contacts(polyhedron, 60, seed)
    radius = 0.1 * polyhedron.diameter
    found = fingertip_fits(polyhedron, p_BC, nhat_TB_B, radius)
    room = np.array([distance(p, parts) for p in p_BC - radius * nhat_TB_B])
    assert (found == (room > radius * (1 - 1e-3))).all()
    assert 0 < found.sum() < len(found)


def test_any_tip_fits_on_a_convex_solid() -> None:
    polyhedron = build(prism(shapely.box(0, 0, 1, 1), 1.0))
    p_BC, nhat_TB_B, _ = random_contacts(polyhedron, 10, seed=0)
    assert fingertip_fits(polyhedron, p_BC, nhat_TB_B, 10.0).all()


def test_ten_thousand_tips_among_a_thousand_triangles_take_seconds() -> None:
    polyhedron = build(*(boxes(1, k) + 0.05 * k * X for k in range(80)))
    p_BC, nhat_TB_B, _ = random_contacts(polyhedron, 10_000, seed=0)
    start = time.process_time()
    fingertip_fits(polyhedron, p_BC, nhat_TB_B, 0.02 * polyhedron.diameter)
    assert time.process_time() - start < 10


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_tip_beside_a_concave_edge_touches_its_own_facet_first(share: float) -> None:
    # Of a groove whose floor rises by theta, a sphere beside the edge touches the other side first
    # where it is nearer to the edge than r tan(theta / 2), by microns only.
    theta, radius = 0.2, 0.004
    height = 0.1 * np.tan(theta)
    profile = [(-0.1, -0.1), (0.1, -0.1), (0.1, height), (0, 0), (-0.1, 0)]
    groove = build(prism(shapely.Polygon(profile), 0.1))
    p = np.array([[-share * radius * np.tan(theta / 2), 0, 0.05]])
    room = radius * np.cos(theta) - p[0, 0] * np.sin(theta)
    assert abs(room - radius) < 2e-5 * groove.diameter
    assert fingertip_fits(groove, p, -Y[None], radius).tolist() == [share > 1]


def test_tips_overlap_where_their_centres_are_nearer_than_two_radii() -> None:
    plate = build(prism(shapely.box(-0.1, -0.1, 0.1, 0.1), 0.01))
    top, bottom = np.array([0, 0, 0.01]), np.zeros(3)
    nhat = np.array([-Z, -Z, Z])
    for gap, apart in ((0.0101, True), (0.0099, False)):
        p_BC = np.array([[top, top + gap * X, bottom]])
        assert fingertips_are_apart(plate, p_BC, nhat[None], 0.005).tolist() == [apart]
    # Points must not even meet.
    assert not fingertips_are_apart(plate, np.array([[top, top, bottom]]), nhat[None], 0.0)[0]
    assert fingertips_are_apart(plate, np.array([[top, top + 1e-3 * X, bottom]]), nhat[None], 0.0)[
        0
    ]


def test_no_contact_of_a_face_touches_a_nearly_coincident_cap_of_less_friction(
    tmp_path: Path,
) -> None:
    """Where the two ends differ by less than `FLATNESS`, which is outermost changes in the face."""
    height, friction = 0.01, {0: 1.2, 1: 0.2}
    pose = {0: "0 0 0 0 0 0", 1: "0 0 0 4.674e-05 2.408e-05 8.173e-05"}
    cylinder = f"<cylinder><radius>0.004</radius><length>{height}</length></cylinder>"
    parts = "".join(
        f'<collision name="c{k}"><pose>{pose[k]}</pose><geometry>{cylinder}</geometry><surface>'
        f"<friction><ode><mu>{mu}</mu><mu2>{mu}</mu2></ode></friction></surface></collision>"
        for k, mu in friction.items()
    )
    file = tmp_path / "cylinders.sdf"
    file.write_text(
        f'<sdf version="1.9"><model name="m"><link name="b">{parts}</link></model></sdf>'
    )
    polyhedron = load_object(file).polyhedron
    slippery = RotationMatrix(RollPitchYaw(4.674e-05, 2.408e-05, 8.173e-05)).matrix()[:, 2]
    rng, seen = np.random.default_rng(0), 0
    for k, face in enumerate(polyhedron.faces):
        if face.primitive is None and face.mu == 1.2:
            low, high = np.array(face.polygon_F.bounds).reshape(2, 2)
            xy = rng.uniform(low, high, (400, 2))
            xy = xy[shapely.contains_xy(face.polygon_F, *xy.T)]
            p_BC = face.p_BF + xy @ face.R_BF[:, :2].T
            found = project_contacts(polyhedron, p_BC, np.full(len(xy), k))
            off = np.abs(np.abs(found.p_BC @ slippery) - height / 2)
            assert (off[found.ok] > 1e-11).all()
            seen += int(found.ok.sum())
    assert seen > 100
