"""Objects from arrays, and objects of other friction or mass, are those of models that say so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from drake_polygrasp import (
    GraspFileError,
    ModelError,
    UsageError,
    load_object,
    object_from_mesh,
    save_grasps,
)
from drake_polygrasp.grasp import GraspObject
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.planned import exact_plan

MODELS = Path(__file__).parents[2] / "models"
L_PROFILE = shapely.box(0, 0, 0.08, 0.08) - shapely.box(0.02, 0.02, 0.08, 0.08)
TRIANGLES = prism(L_PROFILE, 0.03)
VERTICES, FACES = TRIANGLES.reshape(-1, 3), np.arange(3 * len(TRIANGLES)).reshape(-1, 3)


def assert_same(one: GraspObject, other: GraspObject) -> None:
    assert len(one.polyhedron.faces) == len(other.polyhedron.faces)
    for mine, theirs in zip(one.polyhedron.faces, other.polyhedron.faces, strict=True):
        np.testing.assert_allclose(mine.nhat_TB_B, theirs.nhat_TB_B, atol=1e-12)
        assert shapely.area(mine.polygon_F) == pytest.approx(shapely.area(theirs.polygon_F))
        assert mine.mu == theirs.mu
    np.testing.assert_allclose(one.p_BBcm, other.p_BBcm, atol=1e-9)
    assert one.rho == pytest.approx(other.rho, rel=1e-6)


def test_a_mesh_in_memory_is_the_mesh_of_a_file(tmp_path: Path) -> None:
    write_obj(tmp_path / "l.obj", TRIANGLES)
    loaded = load_object(tmp_path / "l.obj", mu=0.4)
    made = object_from_mesh(VERTICES, FACES, mu=0.4)
    assert_same(made, loaded)
    assert made.mass is None
    # The L is two boxes of 0.08 x 0.02 and 0.02 x 0.06.
    areas, centres = np.array([0.0016, 0.0012]), np.array([[0.04, 0.01], [0.01, 0.05]])
    np.testing.assert_allclose(made.p_BBcm[:2], areas @ centres / areas.sum(), atol=1e-9)
    best = exact_plan(made, top=1).grasps[0].grasp
    np.testing.assert_allclose(best.p_BC, exact_plan(loaded, top=1).grasps[0].grasp.p_BC)


def test_triangles_may_be_turned_and_the_centre_stated() -> None:
    made = object_from_mesh(VERTICES, FACES[:, ::-1], mass=2.0, p_BBcm=(0.01, 0.02, 0.015))
    assert made.mass == 2.0
    np.testing.assert_allclose(made.p_BBcm, [0.01, 0.02, 0.015], atol=1e-9)
    corners = VERTICES - np.array([0.01, 0.02, 0.015])
    assert made.rho == pytest.approx(np.linalg.norm(corners, axis=1).max(), rel=1e-6)
    assert {face.mu for face in made.polyhedron.faces} == {0.3}


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (VERTICES[:, :2], FACES, "vertices"),
        (VERTICES * np.nan, FACES, "vertices"),
        ("mesh", FACES, "vertices"),
        (VERTICES, FACES[:, :2], "faces"),
        (VERTICES, FACES * 1.0, "faces"),
        (VERTICES, FACES + 1, f"indices of the {len(VERTICES)} vertices"),
        (VERTICES, FACES - 1, "indices"),
        (VERTICES, FACES[:0], "indices"),
        (VERTICES, np.zeros((100_001, 3), int), "simplify"),
    ],
)
def test_what_is_no_mesh_is_a_usage_error(vertices: object, faces: object, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        object_from_mesh(vertices, faces)  # type: ignore[arg-type]


def test_a_flat_mesh_is_no_object_and_a_mesh_has_no_grasp_file(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"^plate: "):
        object_from_mesh(VERTICES * [1.0, 1.0, 0.0], FACES, name="plate")
    made = object_from_mesh(VERTICES, FACES)
    plan = exact_plan(made, top=1)
    with pytest.raises(GraspFileError, match="came from no file"):
        save_grasps(tmp_path / "l.grasp.yaml", made, plan.grasps, plan.settings)


@pytest.mark.parametrize("model", ["cube/cube.sdf", "l_bracket/l_bracket.sdf"])
def test_other_friction_needs_no_loading(model: str) -> None:
    object_ = load_object(MODELS / model)
    slippery = object_.with_friction(0.2)
    assert_same(slippery, load_object(MODELS / model, mu=0.2))
    assert {face.mu for face in object_.polyhedron.faces} != {0.2}
    for mu in (0.0, -1.0, np.nan, "0.3", None):
        with pytest.raises(UsageError, match="mu"):
            object_.with_friction(mu)  # type: ignore[arg-type]


def test_another_mass_scales_the_squeeze_and_nothing_else() -> None:
    object_ = load_object(MODELS / "cube" / "cube.sdf")
    assert object_.mass is not None
    light, heavy = (
        exact_plan(body, top=1, effort="quick").grasps[0]
        for body in (object_, object_.with_mass(2 * object_.mass))
    )
    np.testing.assert_array_equal(light.grasp.p_BC, heavy.grasp.p_BC)
    assert light.certificate.squeeze_force is not None
    assert heavy.certificate.squeeze_force is not None
    # Both are rounded up to six digits.
    ratio = heavy.certificate.squeeze_force / light.certificate.squeeze_force
    assert ratio == pytest.approx(2.0, rel=1e-5)
    assert object_.with_mass(None).mass is None
    with pytest.raises(UsageError, match="mass"):
        object_.with_mass(0.0)
