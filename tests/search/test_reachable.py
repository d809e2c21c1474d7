"""Triples that a hand reaches are force closure, as far apart as its tips, and the best of them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from drake_polygrasp.arrays import Array
from drake_polygrasp.search.reach import Reach, tip_distances
from drake_polygrasp.search.reachable import TipPlaces, reachable_triples, within_span
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates

RADIUS = 0.01
FINGERS = ((0, 1, 2),)


def around_a_cylinder(num: int, mu: float = 0.5) -> TipPlaces:
    """Points on a circle of 5 cm radius at three heights, each in a region of its own."""
    turn = 2 * np.pi * np.arange(num) / num
    outward = np.stack([np.cos(turn), np.sin(turn), np.zeros(num)], axis=1)
    p_BC = np.concatenate([0.05 * outward + [0, 0, z] for z in (-0.02, 0.0, 0.02)])
    nhat = np.tile(-outward, (3, 1))
    return TipPlaces(np.arange(3 * num), p_BC, p_BC - RADIUS * nhat, nhat, np.full(3 * num, mu))


def reach_of_span(least: float, most: float) -> Reach:
    """A hand of three tips on a line, with two postures: these two distances between neighbours."""
    p = np.zeros((2, 3, 3))
    p[0, :, 0], p[1, :, 0] = least * np.arange(3), 0.5 * most * np.arange(3)
    return Reach(np.zeros((2, 1)), p, np.zeros((2, 3, 3)))


def contacts(places: TipPlaces, rows: Array) -> tuple[Array, Array, Array]:
    return places.p_BC[rows], places.nhat_TB_B[rows], places.mu[rows]


def test_all_triples_of_few_points_are_tried() -> None:
    places = around_a_cylinder(8)
    reach = reach_of_span(0.05, 0.13)
    found = reachable_triples(places, reach, FINGERS, np.zeros(3), 0.06, kept=10_000)
    every = np.array(list(combinations(range(24), 3)))
    inside = within_span(places.p_BT[every], tip_distances(reach, FINGERS))
    expected = every[inside & force_closure(*contacts(places, every))]
    assert {*map(tuple, np.sort(found.region, axis=1).tolist())} == {*map(tuple, expected.tolist())}
    assert len(expected)
    estimate = epsilon_estimates(*contacts(places, found.region), np.zeros(3), 0.06)
    # Ties are equal to 1e-5 of the best.
    assert (np.diff(estimate) <= 1e-5 * estimate.max()).all()


@pytest.mark.parametrize("most", [0.09, 0.12])
def test_tips_are_no_farther_apart_than_the_hand_spans(most: float) -> None:
    places = around_a_cylinder(40)
    found = reachable_triples(places, reach_of_span(0.02, most), FINGERS, np.zeros(3), 0.06)
    if most < 0.06 * 3**0.5:  # the longest side of the smallest triangle around the axis
        assert not len(found.region)
        return
    p_BT = places.p_BT[found.region]
    sides = np.linalg.norm(p_BT - np.roll(p_BT, 1, axis=1), axis=-1)
    assert len(found.region)
    assert sides.max() <= most


def test_drawn_triples_depend_on_the_seed_alone() -> None:
    places, reach = around_a_cylinder(60), reach_of_span(0.05, 0.12)
    one, same, other = (
        reachable_triples(
            places, reach, FINGERS, np.zeros(3), 0.06, seed=seed, num_drawn=20_000, kept=300
        )
        for seed in (0, 0, 1)
    )
    assert (one.region == same.region).all()
    assert (one.p_BC == same.p_BC).all()
    assert not np.array_equal(one.region, other.region)
    assert len(one.region) == 300


def test_a_hand_without_postures_or_points_without_room_have_no_triples() -> None:
    places, reach = around_a_cylinder(8), reach_of_span(0.05, 0.11)
    for some, hand in ((places.take(slice(2)), reach), (places, reach.take(slice(0)))):
        assert not len(reachable_triples(some, hand, FINGERS, np.zeros(3), 0.06).region)
