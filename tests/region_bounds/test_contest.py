"""Searches for bounds end where these cannot be as great as is asked, and no others do."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from drake_polygrasp.region_bounds.contest import Contest, LostError
from drake_polygrasp.region_bounds.region_epsilon import greatest_epsilons, region_epsilon
from drake_polygrasp.region_bounds.region_task import RegionTask
from tests.region_bounds.test_region_epsilon import grasps_that_hold, polygons


def test_a_search_is_lost_to_as_many_better_ones_as_are_wanted() -> None:
    contest = Contest(2)
    contest.enter(0, -math.inf, lower=0.3, ceiling=0.5)
    contest.enter(1, -math.inf, lower=0.1, ceiling=0.2)
    contest.enter(2, -math.inf, lower=0.0, ceiling=0.11)
    contest.enter(1, -math.inf, lower=0.12, ceiling=0.13)
    contest.enter(1, -math.inf, lower=0.05, ceiling=0.13)  # What was proved stays proved.
    with pytest.raises(LostError):
        contest.enter(2, -math.inf, lower=0.0, ceiling=0.11)
    contest.enter(3, -math.inf, lower=0.0, ceiling=0.12)  # A tie is not lost.


def test_a_search_is_lost_below_what_it_is_to_prove() -> None:
    contest = Contest(1)
    with pytest.raises(LostError):
        contest.enter(0, 0.2, lower=0.1, ceiling=0.19)
    # It does not stand in the way of others either.
    contest.enter(1, 0.0, lower=0.0, ceiling=0.05)


@cache
def tasks() -> list[RegionTask]:
    """Six whose lower bounds differ, the best neither first nor last."""
    chosen = [grasps_that_hold()[k] for k in (8, 0, 20, 4, 16, 12)]
    origin = np.zeros(3)
    return [RegionTask(polygons(p, n, 0.02), mu, origin, 1.0, mass=1.0) for p, n, mu in chosen]


@pytest.mark.parametrize("wanted", [1, 3, 6])
def test_the_greatest_bounds_are_those_of_each_grasp_alone(wanted: int) -> None:
    alone = [region_epsilon(task) for task in tasks()]
    found = greatest_epsilons(tasks(), [-math.inf] * 6, wanted)
    order = sorted(range(6), key=lambda k: -alone[k].epsilon_lower)
    for k in order[:wanted]:
        assert found[k] is not None
    for bounds, own in zip(found, alone, strict=True):
        if bounds is not None:
            assert bounds.epsilon_lower == own.epsilon_lower
            assert bounds.squeeze_force == own.squeeze_force
    assert (None in found) == (wanted < 6)


def test_bounds_below_what_is_asked_are_left_out() -> None:
    alone = [region_epsilon(task).epsilon_lower for task in tasks()]
    middle = float(np.median(alone))
    found = greatest_epsilons(tasks(), [middle] * 6, 6)
    assert [bounds is not None for bounds in found] == [lower >= middle for lower in alone]
