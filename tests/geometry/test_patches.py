"""Patches of curved and noisy surfaces, and contacts on the true surface under them."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.patches import PATCH_ANGLE, PATCH_DEPTH
from drake_polygrasp.geometry.polyhedron import Polyhedron, volume_centroid
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.geometry.surface_contact import (
    edge_distance,
    face_at,
    fingertip_fits,
    project_contacts,
)
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import diameter, unit_normals
from tests.support.common import damaged, random_rotations, round_body
from tests.support.convex_polyhedra import boxes, ellipsoid_hull, holed_prism, prism
from tests.support.lp_judge import is_force_closure
from tests.support.planned import exact_plan
from tests.support.solids import object_of, random_contacts
from tests.support.surface_judge import is_exposed, nearest_point, on_surface

X, Y, Z = np.eye(3)


def build(*parts: Array, mu: float = 0.3) -> Polyhedron:
    return build_polyhedron([Part(part, mu) for part in parts])


def scan(num_facets: int = 3000) -> Array:
    """An egg with noise of a sixth of its facets' size: neighbours lean by ten degrees."""
    return round_body(num_facets, (0.03, 0.04, 0.05), noise=1.5e-4)


def test_facets_of_a_sphere_make_few_patches_within_the_tolerances() -> None:
    ball = build(round_body(5000))
    L = ball.diameter
    assert len(ball.faces) <= 300
    assert (ball.triangle_face >= 0).mean() > 0.9
    nhat, _ = unit_normals(ball.triangles_B)
    for k, patch in enumerate(ball.faces):
        own = ball.triangle_face == k
        assert 0 < patch.reach <= 2 * PATCH_DEPTH * L
        lean = np.arccos((nhat[own] @ patch.R_BF[:, 2]).min(initial=1.0))
        assert lean <= 2 * PATCH_ANGLE
        height = (ball.triangles_B[own] - patch.p_BF) @ patch.R_BF[:, 2]
        assert np.abs(height).max(initial=0) <= patch.reach * (1 + 1e-9)


def test_patches_leave_most_of_the_surface_to_grasp() -> None:
    regions = erode(build(scan()))
    assert len(regions.face) < 400
    assert regions.area.sum() > 0.5 * 4 * np.pi * 0.04**2


def test_wider_tolerances_make_larger_patches() -> None:
    parts = [Part(round_body(3000), 0.3)]
    widths = [
        max(face.polygon_F.area for face in build_polyhedron(parts, angle, depth).faces)
        for angle, depth in ((0.14, 2e-4), (PATCH_ANGLE, 5e-4), (0.35, 2e-3))
    ]
    assert widths == sorted(widths)


@pytest.mark.parametrize("num_facets", [100, 1000])
def test_a_body_of_not_too_many_facets_keeps_them(num_facets: int) -> None:
    hull = build(ellipsoid_hull(num_facets, seed=0))
    assert len(hull.faces) >= 0.99 * num_facets, "but for pairs that happen to be coplanar"
    assert not any(face.reach for face in hull.faces)


def test_planar_faces_stay_exact_beside_patches() -> None:
    turn = 2 * np.pi * np.arange(1500) / 1500
    disc = shapely.Polygon(0.05 * np.c_[np.cos(turn), np.sin(turn)])
    can = build(prism(disc, 0.1))
    exact = [face for face in can.faces if not face.reach]
    assert [face.polygon_F.area for face in exact] == pytest.approx([disc.area] * 2, rel=1e-4)
    assert [face.R_BF[2, 2] for face in exact] == [-1, 1]
    assert 10 < len(can.faces) < 60
    for face in can.faces:
        assert abs(face.R_BF[2, 2]) in (0, 1)


@pytest.mark.parametrize("triangles", [round_body(1600), scan(1600)], ids=["sphere", "scan"])
def test_contacts_on_patches_move_to_a_facet_and_off_its_edges(triangles: Array) -> None:
    body = build(triangles)
    p_BC, _, face = random_contacts(body, 40, seed=1)
    projected = project_contacts(body, p_BC, face)
    assert projected.ok.mean() > 0.9
    p_BC, nhat_TB_B, face = (x[projected.ok] for x in (projected.p_BC, projected.nhat_TB_B, face))
    assert (face_at(body, p_BC, nhat_TB_B) >= 0).all()
    clearance = edge_distance(body, p_BC, face)
    assert (clearance > 2e-6 * body.diameter).all()
    for p, nhat, distance in zip(p_BC[:6], nhat_TB_B, clearance, strict=False):
        assert on_surface(p, nhat, [triangles], body.diameter)
        gaps = [np.linalg.norm(p - nearest_point(p, t)) for t in triangles]
        assert np.sort(gaps)[1] >= distance * 0.5


def test_a_contact_off_the_surface_or_its_normal_is_on_no_patch() -> None:
    body = build(scan())
    p_BC, _, face = random_contacts(body, 20, seed=2)
    projected = project_contacts(body, p_BC, face)
    p_BC, nhat = projected.p_BC[projected.ok], projected.nhat_TB_B[projected.ok]
    assert (face_at(body, p_BC + 3e-6 * body.diameter * nhat, nhat) == -1).all()
    leaning = nhat + 1e-5 * np.cross(nhat, X)
    leaning /= np.linalg.norm(leaning, axis=1, keepdims=True)
    assert (face_at(body, p_BC, leaning) == -1).all()


def test_no_contact_is_inside_another_shell() -> None:
    parts = [round_body(2000), round_body(2000) + 0.05 * X]
    peanut = build(*parts)
    p_BC, _, face = random_contacts(peanut, 200, seed=3)
    projected = project_contacts(peanut, p_BC, face)
    assert is_exposed(
        projected.p_BC[projected.ok], projected.nhat_TB_B[projected.ok], parts, 1e-5
    ).all()
    buried = np.array([[0.05, 0.0, 0.0], [0.0, 0.0, 0.0]])
    nearest = parts[0][np.argmin(np.linalg.norm(parts[0].mean(axis=1) - buried[0], axis=1))]
    inward = -np.cross(nearest[1] - nearest[0], nearest[2] - nearest[0])
    inward /= np.linalg.norm(inward)
    assert face_at(peanut, nearest.mean(axis=0)[None], inward[None]).tolist() == [-1]


def test_the_wall_of_a_sealed_cavity_is_no_place_for_a_finger() -> None:
    hollow = build(np.concatenate([round_body(2000), 0.8 * round_body(2000)[:, ::-1]]))
    inner = np.linalg.norm(hollow.triangles_B.mean(axis=1), axis=1) < 0.045
    assert inner.sum() == 2000
    assert (hollow.triangle_face[inner] == -1).all()
    cube = prism(shapely.box(-1, -1, 1, 1), 2.0) - Z
    assert len(build(np.concatenate([cube, 0.5 * cube[:, ::-1]])).faces) == 6


def test_a_crack_narrower_than_a_finger_is_closed_and_a_gap_is_not() -> None:
    cube = prism(shapely.box(0, 0, 0.1, 0.1), 0.1)
    wall, free = np.array([[0.1, 0.05, 0.05]]), np.array([[0.0, 0.05, 0.05]])
    for gap, fits in ((0.5e-3, False), (2e-3, True)):
        L = 0.1 * np.sqrt(6)
        pair = build(cube, cube + (0.1 + gap * L) * X)
        assert fingertip_fits(pair, wall, -X[None], 0.0).tolist() == [fits]
        assert fingertip_fits(pair, free, X[None], 0.0).tolist() == [True]


def test_the_centroid_of_patches_is_that_of_their_facets() -> None:
    egg = scan()
    volume = np.linalg.det(egg) / 6
    expected = volume @ egg.sum(axis=1) / 4 / volume.sum()
    np.testing.assert_allclose(volume_centroid(build(egg)), expected, atol=1e-12)
    two = build(round_body(2000), round_body(2000) + 0.04 * X)
    np.testing.assert_allclose(volume_centroid(two), 0.02 * X, atol=1e-4)


@pytest.mark.parametrize("shape", ["scan", "open scan", "sphere", "shells"])
def test_grasps_of_real_objects_are_on_their_true_surface(shape: str) -> None:
    parts = {
        "scan": [scan(2000)],
        "open scan": [scan(2000)[60:]],
        "sphere": [round_body(2000)],
        "shells": [ellipsoid_hull(60, seed=k) + 0.03 * k * X for k in range(4)],
    }[shape]
    object_ = object_of(build(*parts))
    assert object_.polyhedron.watertight == (shape != "open scan")
    plan = exact_plan(object_, top=3)
    assert len(plan.grasps) == 3
    for certified in plan.grasps:
        grasp = certified.grasp
        assert is_force_closure(grasp.p_BC, grasp.nhat_TB_B, grasp.mu, around=True)
        for p, nhat in zip(grasp.p_BC, grasp.nhat_TB_B, strict=True):
            assert on_surface(p, nhat, parts, object_.polyhedron.diameter)


@settings(max_examples=8, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(st.integers(0, 10**6), st.booleans())
def test_damaged_triangles_yield_no_false_grasp(seed: int, prisms: bool) -> None:
    parts = [holed_prism(5, 1, seed) if prisms else boxes(1, seed), boxes(1, seed + 1)]
    broken = [damaged(part, seed) for part in parts]
    object_ = object_of(build(*broken))
    L = object_.polyhedron.diameter
    for certified in exact_plan(object_, top=2).grasps:
        grasp = certified.grasp
        assert is_force_closure(grasp.p_BC, grasp.nhat_TB_B, grasp.mu, around=True)
        assert is_exposed(grasp.p_BC, grasp.nhat_TB_B, parts, 1e-4 * L).all()
        for p in grasp.p_BC:
            gaps = [np.linalg.norm(p - nearest_point(p, t)) for part in parts for t in part]
            assert min(gaps) <= 3e-6 * L


def test_winding_numbers_are_those_of_solid_angles() -> None:
    from tests.support.surface_judge import winding_number

    rng = np.random.default_rng(0)
    body = np.concatenate([holed_prism(6, 1, 2), boxes(2, 4), boxes(2, 4, aligned=True)])
    points = rng.uniform(-0.08, 0.08, (300, 3))
    points[:50] = body.mean(axis=1)[rng.integers(len(body), size=50)] + 1e-3 * rng.normal(
        size=(50, 3)
    )
    found = TriangleSoup(body).winding_numbers(points)
    np.testing.assert_array_equal(found, np.round(winding_number(points, body)))
    assert set(found.tolist()) >= {0, 1, 2}


def test_rays_through_edges_and_vertices_count_once() -> None:
    cube = prism(shapely.box(-1, -1, 1, 1), 2.0) - Z
    lattice = np.stack(np.meshgrid(*[np.arange(-2, 2.5, 0.5) + 1e-9] * 3), axis=-1).reshape(-1, 3)
    inside = (np.abs(lattice) < 1).all(axis=1)
    np.testing.assert_array_equal(TriangleSoup(cube).winding_numbers(lattice), inside.astype(int))


@pytest.mark.parametrize("seed", range(4))
def test_the_diameter_is_the_greatest_of_all_distances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clouds = [rng.normal(size=(400, 3)), round_body(800).reshape(-1, 3)]
    clouds += [boxes(3, seed).reshape(-1, 3) @ random_rotations(1, rng)[0], np.zeros((3, 3))]
    for points in clouds:
        gaps = np.linalg.norm(points[:, None] - points, axis=2)
        assert diameter(points) == pytest.approx(gaps.max(), rel=1e-13)
