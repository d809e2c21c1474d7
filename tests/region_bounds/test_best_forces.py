"""What forces pair to with twists at most, and that the best contact is found by it."""

from __future__ import annotations

import numpy as np
import pytest

from drake_polygrasp.arrays import Array
from drake_polygrasp.region_bounds import best_forces
from drake_polygrasp.region_bounds.best_forces import BestForces, _greatest
from drake_polygrasp.region_bounds.ranging_contacts import LeaningCones, ranging_contacts
from drake_polygrasp.region_bounds.swept_generators import SweptGenerators
from tests.region_bounds.test_region_epsilon import grasps_that_hold, leaning_pieces
from tests.support.common import random_rotations


def cones(mu: list[float], tangent: list[float]) -> LeaningCones:
    frames = random_rotations(len(mu), np.random.default_rng(2))
    return LeaningCones(frames, np.array(mu), np.array(tangent))


def test_no_force_pairs_to_more_than_the_limit_and_some_to_as_much() -> None:
    some = cones([0.3, 0.6, 0.2, 0.0, 0.5], [0.1, 0.0, 0.4, 0.2, 1e9])
    velocities = np.random.default_rng(3).normal(size=(3, 400, 5))
    turns, shares = np.meshgrid(np.linspace(0.0, 2 * np.pi, 721), np.linspace(0.0, 1.0, 61))
    forces = some.forces(
        np.repeat(turns.reshape(-1, 1), 5, axis=1), np.repeat(shares.reshape(-1, 1), 5, axis=1)
    )
    most = np.einsum("fpk,kvp->fvp", forces, velocities).max(axis=0)
    limits = some.limits(velocities)
    assert (most <= limits + 1e-12).all()
    # Steps of 0.5 degrees and of 1/60 of the friction miss the best force by their squares.
    np.testing.assert_allclose(most, limits, atol=2e-4)


def test_the_limit_is_the_length_of_a_velocity_along_which_a_force_may_be() -> None:
    cone = LeaningCones(np.eye(3)[None], np.array([0.5]), np.array([0.2]))
    velocities = np.array([[2.0, 0.3, 0.0], [1.0, 0.0, 2.0]]).T[:, :, None]
    # The second one pairs with (1, 0, 0.5) to 2, and normals reach (1, 0, 0.2) / sqrt(1.04).
    second = 2.0 / ((1.0 + 0.2 * 0.5) / np.sqrt(1.04))
    np.testing.assert_allclose(cone.limits(velocities)[:, 0], [np.sqrt(4.09), second], rtol=1e-12)


def test_contacts_that_are_left_out_are_not_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    twists = np.random.default_rng(5).normal(size=(40, 6))
    works = []
    for p, n, mu in grasps_that_hold()[:3]:
        regions = leaning_pieces(p, n, 0.03, 0.05, 0.02)
        contacts = ranging_contacts(regions, np.repeat(mu, 3), 0.05, np.zeros(3), 1.0)
        works.append(BestForces(SweptGenerators(contacts), twists))
    found = BestForces.together(works)
    searched = []

    def greatest(velocities: Array, cones: LeaningCones) -> tuple[Array, Array]:
        searched.append(len(cones.mu))
        return _greatest(velocities, cones)

    monkeypatch.setattr(best_forces, "_greatest", greatest)
    BestForces.together(works)
    monkeypatch.setattr(LeaningCones, "limits", lambda _, v: np.full(v.shape[1:], np.inf))
    few = sum(searched)
    everywhere = BestForces.together(works)
    # Of three contacts mostly one is searched.
    assert few < 1.2 * 3 * 3 * 40 and sum(searched) - few == 3 * 9 * 40
    for one, other in zip(found, everywhere, strict=True):
        for values, others in zip(one, other, strict=True):
            np.testing.assert_array_equal(values, others)
    assert set(np.concatenate([contact for contact, _, _ in found]).tolist()) == {0, 1, 2}
