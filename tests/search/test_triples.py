"""The search finds the best triples of points there are, as an exhaustive one would."""

from __future__ import annotations

import warnings
from itertools import combinations

import numpy as np
import pytest
import shapely

from benchmarks import measure
from benchmarks.hard_objects import stellated
from benchmarks.peers import random_triples
from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.geometry.face_sets import first_of_each_set, sets_of
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.geometry.surface_contact import fingertip_fits
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.search import set_cover, triples
from drake_polygrasp.search.effort import FULL, QUICK
from drake_polygrasp.search.face_support import face_twists, points_in_faces, points_on
from drake_polygrasp.search.fingertip_room import with_tip_room
from drake_polygrasp.search.sample_points import num_points, sample_points
from drake_polygrasp.search.set_cover import best_covering_triples
from drake_polygrasp.search.triples import Triples, best_triples
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound
from drake_polygrasp.wrenches.support import cone_wrenches, support
from tests.support.convex_polyhedra import ellipsoid_hull, holed_prism, prism, shells
from tests.support.planned import exact_plan
from tests.support.solids import cube, solid


def heights(h: Array, triples: Array) -> Array:
    return np.asarray(h[triples].max(axis=1).min(axis=1))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("num_directions", [1, 40, 64, 200])
def test_the_cover_finds_what_comparing_all_triples_finds(seed: int, num_directions: int) -> None:
    h = np.random.default_rng(seed).normal(size=(30, num_directions))
    everything = np.array(list(combinations(range(30), 3)))
    best = np.sort(heights(h, everything))[::-1]
    found = best_covering_triples(h, 20)
    assert len(found) >= set_cover.ENOUGH * 20
    assert heights(h, found) == pytest.approx(best[: len(found)])
    assert (np.diff(found, axis=1) > 0).all()
    assert len(np.unique(found, axis=0)) == len(found)


def test_raising_the_threshold_on_the_way_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    h = np.random.default_rng(1).normal(size=(40, 100))
    everything = np.array(list(combinations(range(40), 3)))
    monkeypatch.setattr(set_cover, "_BLOCK", 10)
    monkeypatch.setattr(set_cover, "_thresholds", lambda *_: [-10.0])
    assert heights(h, best_covering_triples(h, 25)) == pytest.approx(
        np.sort(heights(h, everything))[::-1][:25]
    )


def test_support_on_faces_is_that_of_the_wrench_cones() -> None:
    object_ = cube()
    regions = erode(object_.polyhedron)
    rng = np.random.default_rng(0)
    region, w = np.array([[0, 3, 5], [1, 1, 2]]), rng.normal(size=(2, 7, 6))
    p_FC = 0.01 * rng.normal(size=(2, 3, 2))
    p_BC = points_on(regions, region, p_FC)
    assert points_in_faces(regions, region, p_BC) == pytest.approx(p_FC)
    scale = object_.p_BBcm, object_.rho
    h = face_twists(regions, region, w[:, None], *scale).support(p_FC[:, :, None])[:, :, 0]
    cones = cone_wrenches(p_BC, regions.nhat_TB_B[region], regions.mu[region], *scale)
    assert h.transpose(0, 2, 1) == pytest.approx(support(cones, w)[0])


def test_sample_points_lie_in_their_regions_in_every_one_of_them_and_at_the_corners() -> None:
    regions = erode(solid(holed_prism(6, 1, 0)).polyhedron)
    region, p_FC = sample_points(regions, 120)
    gaps = shapely.distance(regions.polygon_F[region], shapely.points(p_FC))
    assert gaps.max() < 1e-9
    assert set(region.tolist()) == set(range(len(regions.face)))
    assert 60 < len(region) < 240
    largest = int(np.argmax(regions.area))
    corners = shapely.get_coordinates(regions.polygon_F[largest])
    own = shapely.multipoints(p_FC[region == largest])
    assert shapely.distance(own, shapely.points(corners)).max() < 1e-9


def test_of_more_regions_than_points_the_largest_have_one() -> None:
    regions = erode(solid(ellipsoid_hull(60, 1)).polyhedron)
    region, _ = sample_points(regions, 20)
    assert sorted(region.tolist()) == sorted(np.argsort(-regions.area)[:20].tolist())


def test_few_regions_have_as_many_points_as_asked_for_and_many_no_more_than_that() -> None:
    numbers = [num_points(n, FULL) for n in (6, 40, 60, 100, 150, 300, 900, 2000)]
    assert numbers == [100, 100, 150, 250, 250, 390, 1170, 1300]
    assert num_points(400, QUICK) == QUICK.most_points


def test_without_regions_there_are_no_triples() -> None:
    regions = erode(cube().polyhedron, edge_clearance=1.0)
    points = sample_points(regions, FULL.points)
    assert not len(best_triples(regions, points, np.zeros(3), 1.0).region)


@pytest.mark.parametrize(
    "object_", [cube(), solid(ellipsoid_hull(12, 1), mu=0.4)], ids=["cube", "ellipsoid"]
)
def test_triples_hold_and_beat_random_ones_of_the_same_points(object_: GraspObject) -> None:
    regions, scale = erode(object_.polyhedron), (object_.p_BBcm, object_.rho)

    def bounds(triples: Triples) -> Array:
        nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
        holds = force_closure(triples.p_BC, nhat, mu)
        bound = np.zeros(len(holds))
        bound[holds] = epsilon_upper_bound(triples.p_BC[holds], nhat[holds], mu[holds], *scale)
        return bound

    region, p_FC = points = sample_points(regions, FULL.points)
    found = best_triples(regions, points, *scale)
    assert (bounds(found) > 0).all()
    rows = np.random.default_rng(5).integers(0, len(region), (2000, 3))
    drawn = Triples(region[rows], points_on(regions, region, p_FC)[rows])
    assert bounds(found).max() >= 0.97 * bounds(drawn).max()


@pytest.mark.parametrize(("shells", "num"), [((2, 4), 312), ((2, 4, 6), 856)])
def test_directions_are_even_where_wrenches_are(shells: tuple[int, ...], num: int) -> None:
    cones = np.random.default_rng(1).normal(size=(4000, 3, 6))
    w = triples.spread_directions(cones, shells)
    assert len(w) == num
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0)
    np.testing.assert_allclose(w.T @ w / len(w), np.eye(6) / 6, atol=0.01)
    # As many drawn at random have some within 10 degrees of each other.
    closest = (w @ w.T - 2 * np.eye(num)).max(axis=1)
    assert np.degrees(np.arccos(closest.max())) > 25


@pytest.mark.parametrize("reach", [0.1, 0.0])
def test_more_directions_are_those_that_wrenches_reach_less_far_in(reach: float) -> None:
    """As of a rod, about whose axis contacts apply little torque; or none, without friction."""
    cones = np.random.default_rng(1).normal(size=(400, 3, 6)) * [1, 1, 1, reach, 1, 1]
    square = (triples.spread_directions(cones) ** 2).mean(axis=0)
    assert square[3] > 0.5
    assert square[[0, 1, 2, 4, 5]].max() < 1 / 6


def test_sets_name_each_region_once() -> None:
    rows = np.array([[3, 1, 2], [2, 2, 5], [5, 2, 5], [1, 2, 3], [4, 4, 4]])
    assert sets_of(rows).tolist() == [[1, 2, 3], [2, 5, -1], [2, 5, -1], [1, 2, 3], [4, 4, -1]]
    assert first_of_each_set(rows).tolist() == [0, 1, 4]


def test_room_for_tips_is_what_the_true_surface_says() -> None:
    channel = shapely.box(0, 0, 0.1, 0.08) - shapely.box(0.03, 0.03, 0.07, 0.09)
    object_ = solid(prism(channel, 0.04))
    polyhedron, regions = object_.polyhedron, erode(object_.polyhedron)
    radius = 0.02 * polyhedron.diameter
    clear = with_tip_room(regions, polyhedron, radius)
    assert clear.area.sum() < regions.area.sum()
    for some, inside_only in ((clear, True), (regions, False)):
        region, p_FC = sample_points(some, 300)
        p_BC, nhat = points_on(some, region, p_FC), some.nhat_TB_B[region]
        fits = fingertip_fits(polyhedron, p_BC, nhat, radius)
        assert fits.all() == inside_only
        gap = shapely.distance(clear.polygon_F[region], shapely.points(p_FC))
        # Walls are upright: nothing is removed in vain, but beside the circle's corners.
        assert ((gap < 0.1 * radius) == fits).mean() > 0.97


def test_convex_objects_and_points_for_fingers_have_room_everywhere() -> None:
    regions = erode(cube().polyhedron)
    assert with_tip_room(regions, cube().polyhedron, 0.01) is regions
    holed = solid(holed_prism(6, 1, 0)).polyhedron
    regions = erode(holed)
    assert with_tip_room(regions, holed, 0.0) is regions


def test_tips_of_a_giant_have_the_room_of_a_dwarf_and_nothing_is_said() -> None:
    corner = shapely.box(0, 0, 120, 20).union(shapely.box(0, 0, 20, 60))
    areas = []
    for scale in (1e-3, 1.0):
        polyhedron = solid(prism(corner, 30.0) * scale).polyhedron
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            clear = with_tip_room(erode(polyhedron), polyhedron, 3.0 * scale)
        areas.append(clear.area / scale**2)
    np.testing.assert_allclose(areas[0], areas[1], rtol=1e-6)


def test_on_hundreds_of_faces_random_search_finds_much_worse() -> None:
    object_ = solid(*shells(6, 80, 0).reshape(6, 80, 3, 3))
    assert len(object_.polyhedron.faces) > 300
    best = exact_plan(object_, top=1).grasps[0].certificate.epsilon_lower
    assert best > 1.3 * measure.search(object_, random_triples)["epsilon"]


def test_while_nothing_holds_the_search_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    box, looked = cube(), []
    regions = erode(box.polyhedron)

    def short_sighted(regions: Regions, triples: Triples) -> Ints:
        """Sees nothing that holds in the passes that are made in any case."""
        looked.append(len(triples.region))
        return holding(regions, triples)[: None if len(looked) > passes else 0]

    holding, passes = triples._holding, len(FULL.strides) - 1
    monkeypatch.setattr(triples, "_holding", short_sighted)
    points = sample_points(regions, FULL.points)
    assert len(best_triples(regions, points, box.p_BBcm, box.rho).region)
    assert len(looked) == 1 + passes <= triples.MOST_PASSES


def test_faces_of_equal_size_all_have_corners_where_too_few_points_would_be_left() -> None:
    octahedron = 0.05 * np.concatenate([np.eye(3), -np.eye(3)])
    regions = erode(solid(stellated(octahedron, 1.5)).polyhedron)
    assert len(regions.face) == 24
    one_each, _ = sample_points(regions, 100)
    assert np.bincount(one_each).tolist() == [1] * 24
    region, p_FC = sample_points(regions, 100, may_exceed=True)
    count = np.bincount(region)
    assert 4 <= count.min() == count.max() <= 8
    corners = shapely.get_coordinates(regions.polygon_F[0])
    own = shapely.multipoints(p_FC[region == 0])
    assert shapely.distance(own, shapely.points(corners)).max() < 1e-9
