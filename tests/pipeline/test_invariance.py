"""Where an object lies, how large it is and how its faces are counted changes no grasp of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import comb
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.certification.certify import prove_many
from drake_polygrasp.geometry import face_sets
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.paper.reasons import CODE
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.settings import Method
from tests.support.convex_polyhedra import (
    boxes,
    ellipsoid_hull,
    holed_prism,
    prism,
    tangent_polyhedron,
)
from tests.support.solids import cube, moved, regions_of, regular_prism, solid, top

MODELS = sorted(Path(__file__).parents[2].glob("models/*/*.*df"))
Grasps = dict[tuple[int, ...], Array]
box = shapely.box

SYMMETRIC = {
    "cube": cube(),
    "brick": solid(prism(box(0, 0, 0.04, 0.08), 0.16)),
    "triangular prism": regular_prism(3),
    "hexagonal prism": regular_prism(6),
    "hexagonal prism at its limit": regular_prism(6, mu=float(np.tan(np.pi / 6))),
    "octagonal prism": regular_prism(8, mu=0.5),
    "U": solid(prism(box(0, 0, 0.1, 0.08) - box(0.03, 0.03, 0.07, 0.09), 0.04)),
    "plate with a hole": solid(prism(box(0, 0, 0.1, 0.08) - box(0.03, 0.03, 0.07, 0.05), 0.02)),
}
ASYMMETRIC = {
    **{f"tangent polyhedron {seed}": solid(tangent_polyhedron(9, seed), mu=0.5) for seed in (0, 1)},
    "ellipsoid": solid(ellipsoid_hull(12, 3), mu=0.4),
}
EQUAL_FACES = {
    "holed prism": solid(holed_prism(6, 1, 3), mu=0.5),
    "skewed boxes": solid(*boxes(2, 4).reshape(2, 12, 3, 3), mu=0.4),
}
"""Without symmetry, but with opposite faces that may hold two contacts just as well."""


@dataclass(frozen=True, eq=False)
class Planned:
    """What the planner makes of an object; rows are its contacts."""

    reasons: Ints
    """Codes of all sets, sorted."""
    Q: Array
    margin: Array
    """0 where the contacts do not hold."""
    face: Ints
    p_BC: Array


@cache
def planned(object_: GraspObject, method: Method) -> Planned:
    regions = erode(object_.polyhedron)
    plan = plan_sets(regions, object_.p_BBcm, object_.polyhedron.diameter, object_.rho, method)
    rows = plan.candidates.take(~np.isnan(plan.candidates.p_BC).any(axis=(1, 2)))
    proofs = prove_many(rows.p_BC, regions.nhat_TB_B[rows.region], regions.mu[rows.region])
    return Planned(
        np.sort(plan.code),
        rows.Q,
        np.array([proof.margin for proof in proofs]),
        regions.face[rows.region],
        rows.p_BC,
    )


def motions(object_: GraspObject) -> dict[str, GraspObject]:
    n = len(object_.polyhedron.faces)
    rng = np.random.default_rng(n)
    R, still = Rotation.random(random_state=n).as_matrix(), np.eye(3)
    L = object_.polyhedron.diameter
    return {
        "rigid motion": moved(object_, R, 3 * L * rng.normal(size=3)),
        "scale": moved(object_, still, np.zeros(3), size=37.0),
        "face order": moved(object_, still, np.zeros(3), order=rng.permutation(n)),
        "frames of the faces": moved(object_, still, np.zeros(3), turn=rng.uniform(0, 6, n)),
        "all at once": moved(
            object_, R.T, rng.normal(size=3), 0.05, rng.permutation(n), rng.uniform(0, 6, n)
        ),
    }


def assert_same_values(here: Planned, there: Planned, atol: float = 1e-6) -> None:
    np.testing.assert_array_equal(here.reasons, there.reasons)
    # Multisets of pairs are equal iff all their weighted sums are: three tell enough.
    for weight in (0.0, 0.4, 1.0):
        np.testing.assert_allclose(
            np.sort(here.Q + weight * here.margin),
            np.sort(there.Q + weight * there.margin),
            atol=atol,
        )


@pytest.mark.parametrize("name", [*SYMMETRIC, *ASYMMETRIC, *EQUAL_FACES])
def test_quality_and_margin_depend_on_neither_frame_scale_nor_order(name: str) -> None:
    object_ = {**SYMMETRIC, **ASYMMETRIC, **EQUAL_FACES}[name]
    elsewhere = motions(object_)
    for there in elsewhere.values():
        assert_same_values(planned(object_, "paper"), planned(there, "paper"))
    there = elsewhere["all at once"]
    assert_same_values(planned(object_, "enriched"), planned(there, "enriched"))


@pytest.mark.parametrize("name", [*SYMMETRIC, *EQUAL_FACES])
def test_a_centre_of_mass_off_the_symmetry_changes_nothing_of_that(name: str) -> None:
    # Ties of shape that a centred object hides behind its symmetry.
    object_ = {**SYMMETRIC, **EQUAL_FACES}[name]
    offset = 0.3 * object_.rho * np.random.default_rng(0).normal(size=3)
    heavier = replace(
        object_,
        p_BBcm=frozen(object_.p_BBcm + offset),
        rho=object_.rho + float(np.linalg.norm(offset)),
    )
    elsewhere = motions(heavier)
    for motion in ("rigid motion", "face order"):
        assert_same_values(planned(heavier, "paper"), planned(elsewhere[motion], "paper"))


def here_and_there(object_: GraspObject) -> tuple[Grasps, Grasps]:
    """The contacts of the moved object, moved by us and constructed there."""
    n = len(object_.polyhedron.faces)
    rng = np.random.default_rng(n)
    R, p, size = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3), 2.5
    order = rng.permutation(n)
    there = planned(moved(object_, R, p, size, order, rng.uniform(0, 6, n)), "paper")
    here = planned(object_, "paper")
    return grasps(here.face, size * here.p_BC @ R.T + p), grasps(order[there.face], there.p_BC)


@pytest.mark.parametrize("name", ASYMMETRIC)
def test_grasps_of_objects_without_symmetry_move_with_them(name: str) -> None:
    here, there = here_and_there(ASYMMETRIC[name])
    assert len(here) > 50
    assert here.keys() == there.keys()
    for faces, contacts in here.items():
        np.testing.assert_allclose(there[faces], contacts, atol=1e-7)


@pytest.mark.parametrize("name", EQUAL_FACES)
def test_only_equal_faces_may_exchange_one_contact_for_two(name: str) -> None:
    here, there = here_and_there(EQUAL_FACES[name])
    assert sorted(map(set, here), key=sorted) == sorted(map(set, there), key=sorted)
    same = here.keys() & there.keys()
    assert len(same) > 0.9 * len(here)
    for faces in same:
        np.testing.assert_allclose(there[faces], here[faces], atol=1e-7)


def grasps(face: Ints, p_BC: Array) -> Grasps:
    """Contacts by their faces, in an order that does not depend on labels of regions."""
    order = [
        sorted(range(3), key=lambda i: (faces[i], *np.round(points[i], 6)))
        for faces, points in zip(face, p_BC, strict=True)
    ]
    found = {
        tuple(faces[key].tolist()): points[key]
        for faces, points, key in zip(face, p_BC, order, strict=True)
    }
    assert len(found) == len(face)
    return found


@pytest.mark.parametrize("model_file", MODELS, ids=lambda file: file.parent.name)
def test_models_are_grasped_alike_wherever_they_lie(model_file: Path) -> None:
    object_ = load_object(model_file)
    there = motions(object_)["all at once"]
    assert_same_values(planned(object_, "enriched"), planned(there, "enriched"))
    # Eq. 7 divides by d_2max, which on the hexagonal prism is its file's rounding, 1e-8 m.
    assert_same_values(planned(object_, "paper"), planned(there, "paper"), atol=1e-4)


def test_sets_are_the_same_however_many_are_evaluated_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for object_ in (SYMMETRIC["U"], EQUAL_FACES["holed prism"]):
        whole = planned(object_, "paper")
        with monkeypatch.context() as patch:
            patch.setattr(face_sets, "CHUNK", 10)
            in_parts = planned.__wrapped__(object_, "paper")
        np.testing.assert_array_equal(in_parts.p_BC, whole.p_BC)
        np.testing.assert_array_equal(in_parts.Q, whole.Q)
        np.testing.assert_array_equal(in_parts.reasons, whole.reasons)


@pytest.mark.parametrize("num_regions", [0, 1, 2, 3])
def test_few_regions_are_few_sets(num_regions: int) -> None:
    # Erosion may leave no region at all; here all are level and face up.
    faces = [top(box(0, 0, 1, 1), z) for z in range(3)]
    regions = first_regions(regions_of(faces), num_regions)
    for method in ("paper", "enriched"):
        plan = plan_sets(regions, np.zeros(3), 2.0, 2.0, method)
        assert len(plan.sets) == comb(num_regions, 3) + comb(num_regions, 2)
        assert (plan.code == CODE["orientation"]).all()
        assert plan.candidates.p_BC.shape == (0, 3, 3)
        assert plan.candidates.Q.shape == (0,)


def first_regions(regions: Regions, n: int) -> Regions:
    num_rings = regions.region_offsets[n]
    return Regions(
        polygon_F=regions.polygon_F[:n],
        face=regions.face[:n],
        R_BF=regions.R_BF[:n],
        p_BF=regions.p_BF[:n],
        nhat_TB_B=regions.nhat_TB_B[:n],
        mu=regions.mu[:n],
        area=regions.area[:n],
        p_BV=regions.p_BV[: regions.ring_offsets[num_rings]],
        ring_offsets=regions.ring_offsets[: num_rings + 1],
        region_offsets=regions.region_offsets[: n + 1],
        num_left_out=0,
    )


def test_an_object_a_kilometre_away_is_grasped_alike() -> None:
    for object_ in (SYMMETRIC["U"], ASYMMETRIC["tangent polyhedron 0"]):
        here = planned(object_, "paper")
        there = planned(moved(object_, np.eye(3), [1000.0, 0, 0]), "paper")
        np.testing.assert_array_equal(here.reasons, there.reasons)
        np.testing.assert_allclose(np.sort(here.Q), np.sort(there.Q), atol=1e-5)
