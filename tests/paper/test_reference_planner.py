"""The reference planner against what is known by hand, and the batched planner against it."""

from __future__ import annotations

from collections import Counter
from functools import cache
from math import asin, comb, tan
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation
from shapely.affinity import affine_transform

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.paper.reasons import REASONS, SetPlan
from drake_polygrasp.paper.stages import plan_sets
from tests.support.convex_polyhedra import (
    boxes,
    ellipsoid_hull,
    holed_prism,
    prism,
    tangent_polyhedron,
)
from tests.support.reference_geometry import Doubts, angle
from tests.support.reference_planner import (
    Outcome,
    force_closure,
    least_cap,
    parallel_axis,
    reference_plan,
    spans_space,
)

Plan = dict[tuple[int, ...], Outcome]
Input = tuple[Regions, Array, float, float]
BUILT = "has contacts"
JUDGED = ("collinear", "tip_blocked", "not_force_closure", "certified")
MODELS = Path(__file__).parents[2] / "models"


def polygon(num_sides: int, radius: float = 0.04) -> shapely.Polygon:
    turn = 2 * np.pi * np.arange(num_sides) / num_sides
    return shapely.Polygon(radius * np.c_[np.cos(turn), np.sin(turn)])


def box(x0: float, y0: float, x1: float, y1: float, z0: float, z1: float) -> Array:
    return slab(shapely.box(x0, y0, x1, y1), z0, z1)


def slab(profile: shapely.Polygon, z0: float, z1: float) -> Array:
    return np.add(prism(profile, z1 - z0), [0.0, 0.0, z0])


CHANNEL = shapely.box(0, 0, 0.1, 0.08) - shapely.box(0.03, 0.03, 0.07, 0.09)
COMB = CHANNEL | shapely.box(0.045, 0.02, 0.055, 0.06)
FRAME = shapely.box(0, 0, 0.1, 0.1) - shapely.box(0.03, 0.03, 0.07, 0.07)
FACETS = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
TETRAHEDRON = 0.04 * np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1.0]])[FACETS]

SOLIDS: dict[str, tuple[float, list[Array]]] = {
    "cube": (0.3, [box(0, 0, 0.06, 0.06, 0, 0.06)]),
    "brick": (0.3, [box(0, 0, 0.04, 0.08, 0, 0.16)]),
    "tetrahedron": (0.36, [TETRAHEDRON]),
    "triangular prism": (0.3, [prism(polygon(3), 0.05)]),
    "hexagonal prism at its limit": (np.tan(np.pi / 6), [prism(polygon(6), 0.05)]),
    "octagonal prism": (0.5, [prism(polygon(8), 0.05)]),
    "T": (0.3, [box(0, 0, 0.1, 0.03, 0, 0.04), box(0.035, 0.03, 0.065, 0.08, 0, 0.04)]),
    "channel": (0.3, [prism(CHANNEL, 0.04)]),
    "frame": (0.3, [prism(FRAME, 0.02)]),
    "triangular tube": (0.4, [prism(polygon(3) - polygon(3, 0.02), 0.05)]),
    "tongue behind a channel": (
        0.3,
        [slab(CHANNEL, 0.02, 0.04), box(0.04, 0.01, 0.06, 0.075, 0, 0.02)],
    ),
    "tongue behind a comb": (
        0.3,
        [slab(COMB, 0.02, 0.04), box(0.032, 0.01, 0.068, 0.075, 0, 0.02)],
    ),
    "blind hole over a boss": (
        0.3,
        [
            slab(FRAME, 0.02, 0.04),
            box(0, 0, 0.1, 0.1, 0.01, 0.02),
            box(0.04, 0.04, 0.06, 0.055, 0, 0.01),
        ],
    ),
    "tangent polyhedron": (0.35, [tangent_polyhedron(9, 1)]),
    "ellipsoid": (0.4, [ellipsoid_hull(12, 1)]),
    "crossed boxes": (0.4, np.split(boxes(2, 4), 2)),
    "steps": (0.3, np.split(boxes(3, 3, aligned=True), 3)),
    "skewed prism with a hole": (0.5, [holed_prism(5, 1, 11)]),
    "faces that share a hole": (0.4, [holed_prism(5, 1, 17)]),
}
LARGE = {"tongue behind a comb", "blind hole over a boss", "crossed boxes", "steps"}


@cache
def planner_input(name: str, mu: float | None = None) -> Input:
    """The arguments of both planners."""
    own_mu, parts = SOLIDS[name]
    polyhedron = build_polyhedron([Part(part, mu or own_mu) for part in parts])
    triangles = np.concatenate(parts)
    volumes = np.linalg.det(triangles)
    p_BBcm = np.einsum("t,tvi->i", volumes, triangles) / (4 * volumes.sum())
    rho = float(np.linalg.norm(triangles - p_BBcm, axis=2).max())
    return erode(polyhedron), p_BBcm, polyhedron.diameter, rho


@cache
def reference(name: str, mu: float | None = None) -> Plan:
    return reference_plan(*planner_input(name, mu))


def certified(plan: Plan) -> list[tuple[int, ...]]:
    return [members for members, outcome in plan.items() if outcome.reason == "certified"]


def test_every_triple_and_every_pair_has_an_outcome() -> None:
    assert Counter(map(len, reference("channel"))) == {3: comb(10, 3), 2: comb(10, 2)}


def test_a_cube_is_held_wherever_two_faces_are_opposite() -> None:
    plan = reference("cube")
    n = planner_input("cube")[0].nhat_TB_B
    opposite = [m for m in plan if any(n[i] @ n[j] < -0.9 for i in m for j in m)]
    assert certified(plan) == opposite
    assert Counter(map(len, opposite)) == {3: 12, 2: 3}
    assert all(plan[m].reason == "orientation" for m in plan if m not in opposite)


def test_a_cube_is_pinched_at_a_centre_and_at_two_quarters_of_the_eroded_face() -> None:
    regions, p_BBcm, L, _ = planner_input("cube")
    quarter = (0.06 - 2 * 0.01 * L) / 4
    for members in filter(lambda m: len(m) == 2, certified(reference("cube"))):
        p = reference("cube")[members].p_BC - p_BBcm
        normal = regions.nhat_TB_B[members[0]]
        assert np.abs(p @ normal) == pytest.approx([0.03] * 3)
        aside = np.linalg.norm(p - np.outer(p @ normal, normal), axis=1)
        assert aside == pytest.approx([0, quarter, quarter])


def test_three_walls_of_a_triangular_prism_are_the_best_set_and_touched_at_their_centres() -> None:
    regions, p_BBcm, *_ = planner_input("triangular prism")
    walls = tuple(int(i) for i in np.flatnonzero(np.abs(regions.nhat_TB_B[:, 2]) < 0.5))
    best = reference("triangular prism")[walls]
    assert best.q == pytest.approx([1] * 5)
    assert best.p_BC == pytest.approx(p_BBcm - 0.02 * regions.nhat_TB_B[list(walls)])


def test_a_regular_tetrahedron_needs_friction_above_the_tangent_of_asin_one_third() -> None:
    limit = tan(asin(1 / 3))
    for mu in (0.3, limit - 1e-6, limit):
        assert {outcome.reason for outcome in reference("tetrahedron", mu).values()} == {
            "orientation"
        }
    oriented = [m for m, o in reference("tetrahedron", limit + 1e-6).items() if o.q is not None]
    assert len(oriented) == 4
    assert certified(reference("tetrahedron", 0.36)) == oriented


def test_normals_at_120_degrees_oppose_only_above_a_friction_of_tan_30_degrees() -> None:
    name = "hexagonal prism at its limit"
    n = planner_input(name)[0].nhat_TB_B
    apart = [m for m in reference(name) if len(m) == 2 and abs(n[m[0]] @ n[m[1]] + 0.5) < 1e-9]
    assert len(apart) == 6
    assert all(reference(name)[m].reason == "orientation" for m in apart)
    assert all(reference(name, 0.578)[m].reason != "orientation" for m in apart)


def test_a_tongue_is_opposed_by_the_legs_of_the_channel_before_it() -> None:
    regions, p_BBcm, *_ = planner_input("tongue behind a channel")
    n, z = regions.nhat_TB_B[:, 2], regions.p_BF[:, 2]
    tongue = int(np.flatnonzero((n > 0.5) & (np.abs(z) < 1e-9))[0])
    channel = int(np.flatnonzero((n < -0.5) & (z > 0.03))[0])
    outcome = reference("tongue behind a channel")[tuple(sorted((tongue, channel)))]
    assert outcome.regions == (tongue, channel, channel)
    assert outcome.p_BC[0] == pytest.approx([0.05, p_BBcm[1], 0])
    assert sorted(outcome.p_BC[1:, 0]) == pytest.approx([0.015, 0.085])


def test_the_hull_of_proposition_2_is_the_cap_test() -> None:
    rng = np.random.default_rng(0)
    passed = 0
    for _ in range(1000):
        n = list(Rotation.random(3, random_state=rng).as_matrix()[:, 0])
        alpha = rng.uniform(0.1, 1.2)
        doubts = Doubts()
        answer = spans_space(n, alpha, doubts)
        passed += answer
        assert doubts or answer == (least_cap(n)[1] > np.pi / 2 - alpha)
    assert 100 < passed < 900


def test_the_axis_of_a_parallel_set_lies_in_all_its_cones() -> None:
    rng = np.random.default_rng(1)
    for _ in range(500):
        n = list(Rotation.random(3, random_state=rng).as_matrix()[:, 0])
        if found := parallel_axis(n, 0.6, Doubts()):
            k, n_bs = found
            assert all(angle(n_bs, -a if i == k else a) < 0.6 for i, a in enumerate(n))


@pytest.mark.parametrize(
    ("p_BC", "n", "holds"),
    [
        ([[0, 0, 1], [1, 0, 0], [-1, 0, 0]], [[0, 0, -1], [0, 0, 1], [0, 0, 1]], True),
        ([[2, 0, 1], [1, 0, 0], [-1, 0, 0]], [[0, 0, -1], [0, 0, 1], [0, 0, 1]], False),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1], [0, 0, 1], [0, 0, 1]], False),
    ],
    ids=["opposed in order", "opposed out of order", "on one face"],
)
def test_the_linear_program_knows_force_closure(
    p_BC: list[list[float]], n: list[list[float]], holds: bool
) -> None:
    assert force_closure(np.array(p_BC, float), np.array(n, float), np.full(3, 0.3)) == holds


@pytest.mark.parametrize("name", SOLIDS)
def test_contacts_of_opposed_or_surrounding_forces_are_force_closure(name: str) -> None:
    for members, outcome in reference(name).items():
        if outcome.reason == "not_force_closure":
            # q_5 = 0: the normals' projections do not surround the origin.
            assert (outcome.kind, outcome.q[4]) == ("three_faces", 0), members


def moved(regions: Regions, X: tuple[Array, Array, float], order: Array, turn: Array) -> Regions:
    """The regions of the turned, shifted and scaled object in `order`, their frames turned too."""
    R, p, size = X
    c, s = size * np.cos(turn), size * np.sin(turn)
    turned = [
        affine_transform(polygon_F, [c_i, s_i, -s_i, c_i, 0, 0])
        for polygon_F, c_i, s_i in zip(regions.polygon_F, c, s, strict=True)
    ]
    R_turn = Rotation.from_rotvec(np.outer(turn, [0, 0, 1])).as_matrix()
    nothing = frozen([0], np.int64)
    return Regions(
        polygon_F=frozen(np.array(turned, dtype=object)[order], object),
        face=regions.face[order],
        R_BF=frozen((R @ regions.R_BF @ R_turn)[order]),
        p_BF=frozen((size * regions.p_BF @ R.T + p)[order]),
        nhat_TB_B=frozen((regions.nhat_TB_B @ R.T)[order]),
        mu=regions.mu[order],
        area=frozen(size**2 * regions.area[order]),
        p_BV=frozen(np.empty((0, 3))),  # The reference reads polygons only.
        ring_offsets=nothing,
        region_offsets=nothing,
        num_left_out=regions.num_left_out,
    )


@pytest.mark.parametrize("name", sorted(SOLIDS.keys() - LARGE))
def test_no_reason_or_quality_depends_on_frame_scale_or_order(name: str) -> None:
    regions, p_BBcm, L, rho = planner_input(name)
    n = len(regions.face)
    rng = np.random.default_rng(n)
    R, p, order = (
        Rotation.random(random_state=n).as_matrix(),
        rng.normal(size=3),
        rng.permutation(n),
    )
    there = moved(regions, (R, p, 7.0), order, rng.uniform(0, 6, n))
    for members, outcome in reference_plan(there, 7 * R @ p_BBcm + p, 7 * L, 7 * rho).items():
        here = reference(name)[tuple(sorted(int(order[i]) for i in members))]
        if not (here.marginal or outcome.marginal):
            assert (outcome.reason, outcome.kind) == (here.reason, here.kind), members
            assert (outcome.q or ()) == pytest.approx(here.q or (), abs=1e-7), members


def differences(
    expected: Plan, plan: SetPlan, diameter: float, q_tolerance: float
) -> dict[tuple[int, ...], str]:
    """How the batched planner and the reference see sets, where not alike."""
    sets = [tuple(int(i) for i in row if i >= 0) for row in plan.sets]
    assert sorted(sets) == sorted(expected)
    row_of = {sets[k]: row for row, k in enumerate(plan.candidates.set_index)}
    assert len(row_of) == len(plan.candidates.set_index)
    found = {}
    for members, code in zip(sets, plan.code, strict=True):
        outcome, row = expected[members], row_of.get(members)
        reason = BUILT if REASONS[code] == "not_evaluated" else REASONS[code]
        if reason != (BUILT if outcome.reason in JUDGED else outcome.reason):
            found[members] = f"{reason}, not {outcome.reason}"
        elif (row is None) != (outcome.q is None):
            found[members] = f"{reason} {'without' if row is None else 'with'} a quality"
        elif row is not None and np.abs(plan.candidates.q[row] - outcome.q).max() > q_tolerance:
            found[members] = f"q = {plan.candidates.q[row]}, not {np.array(outcome.q)}"
        elif outcome.alternatives:
            region, p_BC = tuple(plan.candidates.region[row]), plan.candidates.p_BC[row]
            if not any(
                region == other and np.abs(p_BC - points).max() <= 1e-6 * diameter
                for other, points in outcome.alternatives
            ):
                found[members] = f"contacts {region} {p_BC}, not {outcome.alternatives}"
    return found


def assert_agreement(expected: Plan, planner_input: Input) -> None:
    """Every difference is one that rounding can make, and those are few."""
    # The maxima of eq. 6-8 may be those of a doubtful set.
    doubtful_scale = any(outcome.marginal and outcome.q for outcome in expected.values())
    q_tolerance = 1e-4 if doubtful_scale else 1e-6
    diameter = planner_input[2]
    different = differences(expected, plan_sets(*planner_input), diameter, q_tolerance)
    assert {m: how for m, how in different.items() if not expected[m].marginal} == {}
    assert len(different) <= 1 + 0.02 * len(expected)


@pytest.mark.parametrize("name", SOLIDS)
def test_the_batched_planner_agrees_on_every_set(name: str) -> None:
    assert_agreement(reference(name), planner_input(name))


@pytest.mark.parametrize(
    "name", sorted(path.name for path in MODELS.iterdir() if path.is_dir() and path.name != "hands")
)
def test_the_batched_planner_agrees_on_every_set_of_the_models(name: str) -> None:
    (model,) = [p for p in (MODELS / name).iterdir() if p.suffix in (".sdf", ".urdf")]
    thing = load_object(model)
    if len(thing.polyhedron.faces) > 12:
        pytest.skip("more than twelve faces take the reference too long")
    model_input = erode(thing.polyhedron), thing.p_BBcm, thing.polyhedron.diameter, thing.rho
    assert_agreement(reference_plan(*model_input), model_input)
