"""Points around contacts are where rays from outside land, on facets that lean away from there."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.geometry.landing_points import landing_points
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface_contact import project_contacts
from tests.geometry.test_placement_regions import first_met
from tests.support.common import round_body
from tests.support.solids import cube, random_contacts, solid

RADIUS = 0.005


def seats_on(polyhedron: Polyhedron, count: int) -> tuple[Array, Array, Ints]:
    p_BC, _, face = random_contacts(polyhedron, count, seed=3)
    seats = project_contacts(polyhedron, p_BC, face)
    return seats.p_BC[seats.ok], seats.nhat_TB_B[seats.ok], face[seats.ok]


def thorns(body: Array, size: float, every: int) -> Array:
    """A body with a thorn, that leans far over its neighbours, on some of its facets."""
    a, b, c = np.moveaxis(body, 1, 0)
    tip = np.where(np.arange(len(body)) % every == 0, 1.0, np.nan)[:, None]
    outward = np.cross(b - a, c - a)
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    side = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    tip = tip * ((a + b + c) / 3 + size * (outward + 2 * side))
    faces = np.stack([[a, b, tip], [b, c, tip], [c, a, tip]], axis=0).transpose(0, 2, 1, 3)
    grown = np.isfinite(tip[:, 0])
    return np.concatenate([body[~grown], *faces[:, grown]])


@pytest.mark.parametrize(
    "body",
    [
        round_body(4000, noise=1e-4, seed=5),
        thorns(round_body(4000), 2e-3, 40),
    ],
    ids=["scan", "thorns"],
)
def test_fingertips_from_outside_meet_the_points_first(body: Array) -> None:
    polyhedron = solid(body).polyhedron
    p_BC, nhat_TB_B, face = seats_on(polyhedron, 30)
    radius = np.full(len(face), RADIUS)
    points, normals = landing_points(polyhedron, p_BC, nhat_TB_B, face, radius)
    np.testing.assert_array_equal(points[:, 0], p_BC)
    np.testing.assert_array_equal(normals[:, 0], nhat_TB_B)
    others = 0
    for p, n, there, inward in zip(p_BC, nhat_TB_B, points, normals, strict=True):
        for q, nhat in zip(there[1:], inward[1:], strict=True):
            if (q == p).all():
                continue
            others += 1
            across = (q - p) - ((q - p) @ n) * n
            assert np.linalg.norm(across) <= RADIUS * (1 + 1e-9)
            met = first_met(q - 2 * polyhedron.diameter * n, n, polyhedron.triangles_B)
            assert met is not None
            np.testing.assert_allclose(met[0], q, atol=1e-12)
            np.testing.assert_allclose(met[1], nhat, atol=1e-9)
    assert others > 30


def test_points_are_where_a_sphere_is_steepest() -> None:
    polyhedron = solid(round_body(20_000)).polyhedron
    p_BC, nhat_TB_B, face = seats_on(polyhedron, 20)
    _, normals = landing_points(polyhedron, p_BC, nhat_TB_B, face, np.full(len(face), RADIUS))
    # At the rim of the disc the sphere of radius 0.05 leans by asin(0.1); facets are 0.04 wide.
    lean = np.linalg.norm(np.cross(normals[:, 1:], nhat_TB_B[:, None]), axis=2)
    np.testing.assert_allclose(lean, RADIUS / 0.05, atol=0.04)
    # They lean to all sides.
    np.testing.assert_allclose((normals[:, 1:].mean(axis=1) * nhat_TB_B).sum(axis=1), 1, atol=0.01)


def test_contacts_between_two_parts_have_no_points_beyond_the_other_part() -> None:
    ball = round_body(4000)
    polyhedron = solid(ball, ball + np.array([0.12, 0.0, 0.0])).polyhedron
    p_BC, nhat_TB_B, face = seats_on(polyhedron, 800)
    between = (p_BC[:, 0] < 0.06) & (nhat_TB_B[:, 0] < -0.97)
    p_BC, nhat_TB_B, face = p_BC[between], nhat_TB_B[between], face[between]
    points, _ = landing_points(polyhedron, p_BC, nhat_TB_B, face, np.full(len(face), RADIUS))
    assert len(p_BC) > 1 and (points[..., 0] < 0.06).all()


def test_planar_faces_have_no_points_but_the_contact() -> None:
    polyhedron = cube().polyhedron
    p_BC, nhat_TB_B, face = seats_on(polyhedron, 5)
    points, normals = landing_points(polyhedron, p_BC, nhat_TB_B, face, np.full(len(face), RADIUS))
    np.testing.assert_array_equal(points, np.repeat(p_BC[:, None], 7, axis=1))
    np.testing.assert_array_equal(normals, np.repeat(nhat_TB_B[:, None], 7, axis=1))
