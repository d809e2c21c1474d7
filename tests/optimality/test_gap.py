"""No contacts hold better than the bound says, and the bound comes near to what contacts reach."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.optimize import linprog

from drake_polygrasp import UsageError, epsilon_gap, load_object
from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.certification.robustness import epsilon_interval
from drake_polygrasp.cli.main import main
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.optimality.branch_and_bound import TOLERANCE, Optimum, _halved, bound_optimum
from drake_polygrasp.optimality.cell_bounds import (
    KEPT,
    CellTriples,
    bounded,
    corner_values,
    game_bound,
    turning,
)
from drake_polygrasp.search.face_support import points_on
from drake_polygrasp.search.triples import Triples
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import critical_directions, epsilon_upper_bound
from drake_polygrasp.wrenches.support import cone_wrenches, support
from tests.support.convex_polyhedra import ellipsoid_hull
from tests.support.planned import exact_plan
from tests.support.solids import cube, face, regions_of, solid

MODELS = Path(__file__).parents[2] / "models"
NONE = Triples(np.empty((0, 3), dtype=np.int64), np.empty((0, 3, 3)))
CENTRE = np.zeros(3)
CUBE = cube()


def bound_of(object_: GraspObject, nodes: int, incumbent: float = 0.0) -> Optimum:
    regions = erode(object_.polyhedron)
    return bound_optimum(regions, object_.p_BBcm, object_.rho, NONE, incumbent, nodes)


def epsilons(regions: Regions, region: Ints, p_BC: Array, rho: float) -> Array:
    """Upper estimates of epsilon about the origin, 0 where contacts do not hold."""
    contacts = p_BC, regions.nhat_TB_B[region], regions.mu[region]
    return np.where(force_closure(*contacts), epsilon_upper_bound(*contacts, CENTRE, rho), 0.0)


def random_cells(num: int, seed: int, size: float = 0.5) -> tuple[Regions, CellTriples]:
    """Triangles on the cube's planes, some of them beyond its edges."""
    regions, rng = erode(CUBE.polyhedron), np.random.default_rng(seed)
    region = rng.integers(0, 6, (num, 3))
    p_FV = 0.02 * rng.uniform(-1, 1, (num, 3, 1, 2)) + 0.02 * size * rng.normal(size=(num, 3, 3, 2))
    r_CmV = points_on(regions, region[..., None], p_FV) / CUBE.rho
    w = rng.normal(size=(num, KEPT, 6))
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    return regions, CellTriples(region, r_CmV, np.full(num, np.inf), w)


def random_places(cells: CellTriples, seed: int) -> tuple[Array, Array]:
    """Weights of the corners (N, 3, 3), and the places of contacts that they make."""
    weights = np.random.default_rng(seed).dirichlet(np.ones(3), (len(cells.bound), 3))
    return weights, np.einsum("niv,niva->nia", weights, cells.r_CmV)


def holds_all(cells: CellTriples, r: Array) -> Bools:
    """Whether each cell holds its place r, shape (N, 3, 3), for all three; shape (N,)."""
    first, second, third = np.moveaxis(cells.r_CmV, 2, 0)
    axes = np.stack([second - first, third - first], axis=-1)
    weights = (np.linalg.pinv(axes) @ (r - first)[..., None])[..., 0]
    inside = (weights.min(axis=-1) >= -1e-9) & (weights.sum(axis=-1) <= 1 + 1e-9)
    return np.asarray(inside.all(axis=1))


def areas(cells: CellTriples) -> Array:
    """Of each cell, shape (N, 3)."""
    first, second, third = np.moveaxis(cells.r_CmV, 2, 0)
    return np.asarray(np.linalg.norm(np.cross(second - first, third - first), axis=-1) / 2)


def three_strips(width: float, length: float) -> Regions:
    """Walls of an upright triangular prism, a strip around the middle of each."""
    strip = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    turn = 2 * np.pi * np.arange(3) / 3
    outward = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    along = np.stack([-np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    up = (0, 0, 1)
    return regions_of([face(strip, a, up, 0.5 * n) for n, a in zip(outward, along, strict=True)])


@pytest.mark.parametrize("size", [0.02, 0.3, 2.0])
def test_no_contacts_in_cells_hold_better_than_the_cells_bound(size: float) -> None:
    regions, cells = random_cells(150, 1, size)
    bound = bounded(regions, cells, 0.0)[0].bound
    for seed in range(20):
        _, r = random_places(cells, seed)
        nhat, mu = regions.nhat_TB_B[cells.region], regions.mu[cells.region]
        holds = np.flatnonzero(force_closure(r, nhat, mu))
        estimate = epsilon_upper_bound(r[holds], nhat[holds], mu[holds], CENTRE, 1.0)
        for row in holds[estimate > bound[holds]]:
            contacts = r[row], nhat[row], mu[row]
            assert epsilon_interval(*contacts, CENTRE, 1.0, relative_gap=1e-4).lower <= bound[row]


def test_a_direction_that_turns_bounds_what_lies_between_the_corners() -> None:
    regions, cells = random_cells(200, 2)
    w = cells.w[:, :4]
    B = turning(regions, cells, w)
    assert np.abs(np.einsum("nka,nkaic->nkic", w, B)).max() < 1e-9 * np.abs(B).max()
    F = corner_values(regions, cells, w, B).reshape(-1, 4, 3, 3, 3)
    nhat, mu = regions.nhat_TB_B[cells.region], regions.mu[cells.region]
    for seed in range(10):
        weights, r = random_places(cells, seed)
        turned = w + np.einsum("nkaic,nic->nka", B, r - cells.middle)
        assert (np.linalg.norm(turned, axis=-1) >= 1 - 1e-9).all()
        h = support(cone_wrenches(r, nhat, mu, CENTRE, 1.0), turned)[0].max(axis=-1)
        between = np.einsum("nkabc,na,nb,nc->nk", F, *weights.transpose(1, 0, 2))
        assert (h <= between + 1e-9).all()


def test_turning_directions_come_much_nearer_than_fixed_ones() -> None:
    regions = three_strips(1e-3, 0.1)
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [0.0, 2.0]])
    error = []
    for size in (0.05, 0.025):
        region = np.array([[0, 1, 2]])
        r = points_on(regions, region[..., None], size * corners[None, None])
        w, epsilon = critical_directions(
            r.mean(axis=2), regions.nhat_TB_B[region], regions.mu[region], CENTRE, 1.0
        )
        cells = CellTriples(region, r, np.full(1, np.inf), w[:, :KEPT])
        turned = corner_values(regions, cells, w, turning(regions, cells, w))
        fixed = corner_values(regions, cells, w, None)
        error.append([game_bound(F)[0] - epsilon[0] for F in (turned, fixed)])
    assert error[1][0] < 0.5 * error[1][1]
    assert error[1][0] / error[0][0] < 0.85 * error[1][1] / error[0][1]


@pytest.mark.parametrize("shape", [(1, 27), (9, 27), (20, 5)])
def test_the_game_is_that_of_a_linear_program_and_never_below(shape: tuple[int, int]) -> None:
    K, M = shape
    F = np.random.default_rng(K).normal(size=(30, K, M))
    for own, bound in zip(F, game_bound(F), strict=True):
        rows = np.hstack([own.T, -np.ones((M, 1))])
        equal = np.append(np.ones(K), 0.0)[None]
        limits = [(0, None)] * K + [(None, None)]
        value = linprog(np.eye(K + 1)[K], rows, np.zeros(M), equal, [1.0], limits).fun
        assert value - 1e-9 <= bound <= value + 5e-3


def test_faces_as_small_as_points_have_the_epsilon_of_these_points() -> None:
    regions = three_strips(1e-6, 1e-6)
    region = np.array([0, 1, 2])
    contacts = regions.p_BF[region], regions.nhat_TB_B[region], regions.mu[region]
    interval = epsilon_interval(*contacts, CENTRE, 0.7, relative_gap=1e-3)
    optimum = bound_optimum(regions, CENTRE, 0.7, NONE, interval.lower, 2000)
    assert optimum.complete
    assert interval.lower <= optimum.bound <= (1 + TOLERANCE) * interval.upper


def test_upright_walls_resist_lifting_by_friction_alone() -> None:
    # Along z every contact on an upright wall gives mu at most; torques are large by a small rho.
    regions = three_strips(0.1, 0.1)
    region = np.array([0, 1, 2])
    contacts = regions.p_BF[region], regions.nhat_TB_B[region], regions.mu[region]
    reached = epsilon_interval(*contacts, CENTRE, 0.02, relative_gap=1e-3).lower
    assert reached == pytest.approx(0.3, rel=0.05)
    optimum = bound_optimum(regions, CENTRE, 0.02, NONE, reached, 100)
    assert optimum.bound == pytest.approx(0.3, rel=1e-9)


def test_a_grid_on_strips_finds_what_is_said_to_be_best() -> None:
    regions, num = three_strips(1e-6, 0.2), 9
    steps = np.indices((num, num, num)).reshape(3, -1).T
    along = np.linspace(-0.1, 0.1, num)[steps]
    region = np.tile([0, 1, 2], (len(along), 1))
    p_BC = points_on(regions, region, np.stack([along, np.zeros_like(along)], axis=-1))
    epsilon = epsilons(regions, region, p_BC, 1.0)
    assert along[epsilon.argmax()] == pytest.approx(0.0)
    optimum = bound_optimum(regions, CENTRE, 1.0, NONE, epsilon.max(), 4000)
    assert epsilon.max() <= optimum.bound <= 1.02 * epsilon.max()


def test_halves_hold_every_grasp_of_their_cells_in_some_order() -> None:
    _, cells = random_cells(60, 3)
    r, region = cells.r_CmV.copy(), cells.region.copy()
    r[:, 1], region[:, 1] = r[:, 0], region[:, 0]
    cells = replace(cells, r_CmV=r, region=region)
    for _ in range(4):
        _, places = random_places(cells, 7)
        halves = _halved(cells)
        twice = np.concatenate([places, places])
        swapped = twice[:, [1, 0, 2]]
        found = holds_all(halves, twice) | holds_all(halves, swapped)
        assert found.reshape(2, -1).any(axis=0).all()
        whole = np.tile(areas(cells).prod(axis=1), 2)
        assert (areas(halves).prod(axis=1) <= (0.5 + 1e-9) * whole).all()
        cells = halves.take(np.arange(0, len(halves.bound), 2))
        cells = cells.take(np.flatnonzero(cells.region[:, 0] == cells.region[:, 1]))


def test_no_random_contacts_hold_better_than_the_bound() -> None:
    regions = erode(CUBE.polyhedron)
    bound = bound_of(CUBE, 600).bound
    rng = np.random.default_rng(4)
    half = np.abs(shapely.get_coordinates(regions.polygon_F[0])).max()
    region = rng.integers(0, 6, (3000, 3))
    p_BC = points_on(regions, region, rng.uniform(-half, half, (3000, 3, 2)))
    assert epsilons(regions, region, p_BC, CUBE.rho).max() <= bound


def test_more_nodes_never_raise_the_bound_and_few_are_honest() -> None:
    bounds = [bound_of(CUBE, nodes) for nodes in (1, 100, 600, 1200)]
    values = [optimum.bound for optimum in bounds]
    assert values == sorted(values, reverse=True)
    assert values[0] > values[-1] > 0.1
    assert [optimum.nodes for optimum in bounds] == [0, 100, 600, 1200]
    assert not any(optimum.complete for optimum in bounds)


def test_the_same_budget_gives_the_same_bits() -> None:
    assert bound_of(CUBE, 400).bound == bound_of(CUBE, 400).bound


def test_the_bound_does_not_depend_on_the_objects_size() -> None:
    object_ = solid(ellipsoid_hull(8, 3))
    scaled = solid(4 * ellipsoid_hull(8, 3))
    assert bound_of(scaled, 500).bound == pytest.approx(bound_of(object_, 500).bound, rel=1e-3)


def test_an_incumbent_above_the_truth_spoils_nothing() -> None:
    assert bound_of(CUBE, 400, incumbent=0.25).bound <= 0.25 * (1 + TOLERANCE)
    assert bound_of(CUBE, 400, incumbent=0.25).complete


def test_a_plan_is_below_its_bound_and_the_better_grasp_is_one() -> None:
    block = load_object(MODELS / "skewed_block" / "skewed_block.sdf")
    plan = exact_plan(block, top=1)
    gap = epsilon_gap(block, plan, nodes=1500)
    assert gap.rank == 1
    assert plan.grasps[0].certificate.epsilon_lower <= gap.epsilon <= gap.epsilon_bound
    assert gap.relative_gap == pytest.approx(gap.epsilon_bound / gap.epsilon - 1)
    # A plan without grasps is beaten by any.
    empty = epsilon_gap(block, replace(plan, grasps=()), nodes=1500)
    assert (empty.rank, empty.epsilon, empty.relative_gap) == (0, 0.0, None)
    assert empty.better is not None
    assert 0 < empty.better.epsilon <= empty.epsilon_bound


def test_excluded_faces_are_excluded_from_the_bound_too() -> None:
    brick = load_object(MODELS / "brick" / "brick.urdf")
    everywhere = epsilon_gap(brick, exact_plan(brick, top=1), nodes=100)
    none = epsilon_gap(brick, exact_plan(brick, top=1, exclude_faces=range(1, 6)), nodes=100)
    assert (none.epsilon_bound, none.complete) == (0.0, True)
    assert everywhere.epsilon_bound > 0


def run(arguments: Sequence[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_the_command_states_the_gap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = str(MODELS / "frustum" / "frustum.sdf")
    arguments = ["plan", model, "--gap", "300", "--top", "1", "-o", str(tmp_path / "g.grasp.yaml")]
    code, out, _ = run(arguments, capsys)
    last = out.splitlines()[-1]
    assert code == 0
    assert last.startswith("gap: the best possible epsilon is at most 0.")
    assert last.endswith("(300 nodes; more would lower it)")
    _, out, _ = run([*arguments, "--json"], capsys)
    gap = json.loads(out)["gap"]
    assert f"{gap['epsilon_bound']:.4f}" in last
    assert f"within {100 * gap['relative_gap']:.1f} percent" in last
    assert (gap["nodes"], gap["complete"]) == (300, False)


def test_curved_bodies_have_no_gap_and_are_told_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "ball.sdf"
    model.write_text(
        "<sdf version='1.7'><model name='ball'><link name='ball'><collision name='c'><geometry>"
        "<sphere><radius>0.05</radius></sphere></geometry></collision></link></model></sdf>"
    )
    output = tmp_path / "ball.grasp.yaml"
    code, _, err = run(["plan", str(model), "--gap", "-o", str(output)], capsys)
    assert code == 2
    assert "the bound of epsilon is for planar faces" in err
    assert not output.exists()


def test_nodes_are_a_positive_number() -> None:
    with pytest.raises(UsageError, match="nodes is 0; it must be at least 1"):
        epsilon_gap(CUBE, exact_plan(CUBE, top=1), nodes=0)


def test_progress_is_told_in_nodes() -> None:
    object_ = load_object(MODELS / "l_bracket" / "l_bracket.sdf")
    told: list[tuple[int, int]] = []
    gap = epsilon_gap(
        object_,
        exact_plan(object_, top=1),
        nodes=3000,
        progress=lambda done, total: told.append((done, total)),
    )
    done = [count for count, _ in told]
    assert done[0] == 0
    assert done == sorted(set(done))
    assert done[-1] < gap.nodes <= 3000
    assert {total for _, total in told} == {3000}
