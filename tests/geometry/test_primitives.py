"""Curved solids in closed form, and grasps of bodies made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.geometry.polyhedron import farthest_distance
from drake_polygrasp.geometry.primitives import Primitive, tessellation
from drake_polygrasp.geometry.surface import Part, build_polyhedron, curved_part
from drake_polygrasp.geometry.surface_contact import (
    edge_distance,
    face_at,
    fingertip_fits,
    project_contacts,
)
from drake_polygrasp.loading.object_model import load_object
from tests.support.common import random_rotations
from tests.support.convex_polyhedra import prism
from tests.support.planned import exact_plan
from tests.support.solids import object_of, random_contacts

R = random_rotations(1, np.random.default_rng(0))[0]
P = np.array([0.1, -0.2, 0.3])
X, Y, Z = np.eye(3)


def solid(kind: str, radii: tuple[float, float, float]) -> Primitive:
    return Primitive(kind, frozen(R), frozen(P), frozen(radii))  # type: ignore[arg-type]


SOLIDS = {
    "sphere": solid("ellipsoid", (0.05, 0.05, 0.05)),
    "ellipsoid": solid("ellipsoid", (0.03, 0.05, 0.07)),
    "cylinder": solid("cylinder", (0.03, 0.03, 0.05)),
    "capsule": solid("capsule", (0.03, 0.03, 0.05)),
}
FARTHEST = {
    "sphere": lambda z: z + 0.05,
    "ellipsoid": lambda z: z + 0.07,
    "cylinder": lambda z: np.hypot(0.03, z + 0.05),
    "capsule": lambda z: z + 0.05 + 0.03,
}
every = pytest.mark.parametrize("name", SOLIDS)


def volume(triangles: Array) -> float:
    return float(np.linalg.det(triangles - P).sum() / 6)


@every
def test_the_tessellation_is_inscribed_and_encloses_most_of_the_solid(name: str) -> None:
    triangles = tessellation(SOLIDS[name])
    np.testing.assert_allclose(SOLIDS[name].distance(triangles.reshape(-1, 3)), 0, atol=1e-15)
    true = {
        "sphere": 4 / 3 * np.pi * 0.05**3,
        "ellipsoid": 4 / 3 * np.pi * 0.03 * 0.05 * 0.07,
        "cylinder": np.pi * 0.03**2 * 0.1,
        "capsule": np.pi * 0.03**2 * (0.1 + 4 / 3 * 0.03),
    }[name]
    assert 0.94 * true < volume(triangles) < true
    body = build_polyhedron([curved_part(SOLIDS[name], 0.3)])
    assert body.watertight
    assert len(body.faces) == {"cylinder": 20, "capsule": 164}.get(name, 146)


@every
def test_projected_points_are_on_the_surface_and_normals_are_its_gradient(name: str) -> None:
    body = SOLIDS[name]
    rng = np.random.default_rng(1)
    p, nhat = body.project(P + rng.uniform(-0.04, 0.04, (50, 3)) @ R.T)
    assert body.on_curve(p, 1e-12).all()
    np.testing.assert_allclose(body.distance(p), 0, atol=1e-15)
    step = 1e-4
    np.testing.assert_allclose(body.distance(p + step * nhat), step, rtol=1e-6)
    for t in np.cross(nhat, X), np.cross(nhat, np.cross(nhat, X)):
        rise = body.distance(p + step * nhat + 1e-7 * t) - body.distance(p + step * nhat - 1e-7 * t)
        np.testing.assert_allclose(rise, 0, atol=1e-12)


@every
def test_distance_is_that_of_a_dense_sample(name: str) -> None:
    body = SOLIDS[name]
    rng = np.random.default_rng(2)
    surface = body.project(P + rng.uniform(-0.08, 0.08, (60_000, 3)) @ R.T)[0]
    if name == "cylinder":
        surface = _cylinder_sample(rng)
    points = P + rng.uniform(-0.15, 0.15, (40, 3)) @ R.T
    outside = points[body.distance(points) > 0.02]
    gaps = np.linalg.norm(outside[:, None] - surface, axis=2).min(axis=1)
    found = body.distance(outside)
    assert (found <= gaps + 1e-12).all()
    np.testing.assert_allclose(found, gaps, atol=2e-3 * 0.1)
    assert (body.distance(P + 0.5 * (surface - P)) < 0).all()


def _cylinder_sample(rng: np.random.Generator) -> Array:
    turn, z, r = rng.uniform(0, 1, (3, 60_000)) * np.array([[2 * np.pi], [0.1], [1]])
    side = np.c_[0.03 * np.cos(turn), 0.03 * np.sin(turn), z - 0.05]
    flat = np.c_[0.03 * np.sqrt(r)[:, None] * np.c_[np.cos(turn), np.sin(turn)], z]
    flat[:, 2] = np.where(z > 0.05, 0.05, -0.05)
    sample: Array = P + np.concatenate([side, flat]) @ R.T
    return sample


@every
def test_the_farthest_point_in_closed_form(name: str) -> None:
    body = build_polyhedron([curved_part(SOLIDS[name], 0.3)])
    for z in (0.0, 0.02, 0.2):
        found = farthest_distance(body, P - z * R[:, 2])
        assert found == pytest.approx(FARTHEST[name](z), rel=1e-12)


@every
def test_contacts_of_patches_take_the_true_point_and_normal(name: str) -> None:
    primitive = SOLIDS[name]
    body = build_polyhedron([curved_part(primitive, 0.3)])
    p_BC, planned, face = random_contacts(body, 60, seed=0)
    projected = project_contacts(body, p_BC, face)
    assert projected.ok.all()
    np.testing.assert_allclose(primitive.distance(projected.p_BC), 0, atol=1e-15)
    assert (np.einsum("ij,ij->i", projected.nhat_TB_B, planned) > np.cos(0.35)).all()
    assert (face_at(body, projected.p_BC, projected.nhat_TB_B) >= 0).all()
    assert fingertip_fits(body, projected.p_BC, projected.nhat_TB_B, 0.01).all()
    assert (edge_distance(body, projected.p_BC, face) > 0).all()
    off = projected.p_BC - 3e-6 * body.diameter * projected.nhat_TB_B
    assert (face_at(body, off, projected.nhat_TB_B) == -1).all()


def test_the_ends_of_a_cylinder_are_true_faces() -> None:
    body = build_polyhedron([curved_part(SOLIDS["cylinder"], 0.3)])
    ends = [face for face in body.faces if not face.reach]
    assert sorted(face.R_BF[:, 2] @ R[:, 2] for face in ends) == pytest.approx([-1, 1])
    area = 18 / 2 * np.sin(2 * np.pi / 18) * 0.03**2
    assert [face.polygon_F.area for face in ends] == pytest.approx([area] * 2)


def test_what_another_part_covers_is_no_seat() -> None:
    ball = Primitive("ellipsoid", frozen(np.eye(3)), frozen(np.zeros(3)), frozen([0.05] * 3))
    slab = prism(shapely.box(-0.1, -0.1, 0.1, 0.1), 0.06)
    body = build_polyhedron([curved_part(ball, 0.3), Part(slab, 0.6)])
    p_BC, _, face = random_contacts(body, 200, seed=0)
    projected = project_contacts(body, p_BC, face)
    on_ball = np.abs(ball.distance(projected.p_BC)) < 1e-12
    assert 20 < on_ball.sum() < 190
    assert (projected.p_BC[on_ball & projected.ok, 2] < 0).all()
    assert (ball.distance(projected.p_BC[~on_ball & projected.ok]) > 0).all()
    pole = np.array([[0.0, 0.0, 0.05], [0.0, 0.0, -0.05]])
    assert (face_at(body, pole, np.array([-Z, Z])) >= 0).tolist() == [False, True]
    beside = np.array([[0.0499, 0.0, 0.0], [0.06, 0.0, 0.0]])
    assert (face_at(body, beside, np.array([Z, Z])) >= 0).tolist() == [False, True]


SHAPES = {
    "sphere": "<sphere><radius>0.05</radius></sphere>",
    "ellipsoid": "<ellipsoid><radii>0.03 0.05 0.07</radii></ellipsoid>",
    "cylinder": "<cylinder><radius>0.03</radius><length>0.1</length></cylinder>",
    "capsule": "<capsule><radius>0.03</radius><length>0.1</length></capsule>",
}


@every
def test_curved_shapes_of_a_model_are_grasped_on_their_true_surface(
    name: str, tmp_path: Path
) -> None:
    model = tmp_path / "model.sdf"
    model.write_text(
        '<sdf version="1.9"><model name="m"><link name="b"><collision name="c">'
        f"<pose>1 2 3 0.1 0.2 0.3</pose><geometry>{SHAPES[name]}</geometry>"
        "</collision></link></model></sdf>"
    )
    thing = load_object(model, mu=0.3)
    (primitive,) = thing.polyhedron.primitives
    np.testing.assert_allclose(thing.p_BBcm, [1, 2, 3], atol=1e-9)
    assert thing.rho == pytest.approx(FARTHEST[name](0.0), rel=1e-9)
    plan = exact_plan(thing, top=2)
    assert len(plan.grasps) == 2
    for certified in plan.grasps:
        p, nhat = certified.grasp.p_BC, certified.grasp.nhat_TB_B
        np.testing.assert_allclose(primitive.distance(p), 0, atol=1e-12)
        np.testing.assert_allclose(primitive.distance(p - 1e-3 * nhat), 1e-3, rtol=1e-6)


def test_a_round_rod_of_one_to_sixty_is_graspable() -> None:
    rod = Primitive("cylinder", frozen(np.eye(3)), frozen(np.zeros(3)), frozen([0.005, 0.005, 0.3]))
    (best,) = exact_plan(object_of(build_polyhedron([curved_part(rod, 0.3)])), top=1).grasps
    # Of three fingertips of 12 mm two have no room on an end, so the grasp is on the side.
    assert np.abs(best.grasp.p_BC[:, 2]).max() < 0.3
    np.testing.assert_allclose(np.hypot(*best.grasp.p_BC[:, :2].T), 0.005, rtol=1e-9)
