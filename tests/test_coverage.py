"""The benchmark of hard solids: the objects are what they are called, and it counts right."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.coverage import Comparison, best_of_paper, compare, holds, share, summary
from benchmarks.hard_objects import hard_objects, stellated
from tests.support.planned import exact_plan
from tests.support.solids import cube, solid


def volume(triangles: np.ndarray) -> float:
    a, b, c = np.moveaxis(triangles, 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)


def test_there_are_two_hundred_hard_objects_of_low_and_high_friction() -> None:
    objects = list(hard_objects())
    assert len({subject.name for subject in objects}) == len(objects) >= 200
    assert min(Counter(subject.family for subject in objects).values()) >= 12
    frictions = [subject.mu for subject in objects]
    assert (min(frictions), max(frictions)) == (0.1, 0.8)


def test_a_cube_with_pyramids_half_as_high_as_it_is_deep_is_a_rhombic_dodecahedron() -> None:
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    triangles = stellated(corners, 1.0)  # apices at distance 2
    assert volume(triangles) == pytest.approx(16.0)
    polyhedron = solid(0.03 * triangles).polyhedron
    assert len(polyhedron.faces) == 12
    # Its normals are the directions (0, 1, 1) and the like.
    normals = np.array([face.R_BF[:, 2] for face in polyhedron.faces])
    assert np.sort(np.abs(normals), axis=1) == pytest.approx(
        np.tile([0.0, 0.5**0.5, 0.5**0.5], (12, 1)), abs=1e-9
    )


def test_the_hard_objects_are_solids_of_one_friction_and_the_same_each_time() -> None:
    for subject, again in zip(hard_objects(5, 1), hard_objects(5, 1), strict=True):
        polyhedron = subject.make().polyhedron
        assert volume(polyhedron.triangles_B) > 0, subject.name
        assert {face.mu for face in polyhedron.faces} == {subject.mu}
        assert (polyhedron.triangles_B == again.make().polyhedron.triangles_B).all()


def test_the_best_of_the_paper_is_no_worse_than_its_grasp_of_best_quality() -> None:
    best = best_of_paper(cube())
    plan = exact_plan(cube(), method="paper", top=100)
    assert len(plan.grasps) == 12 + 3
    assert best >= max(found.certificate.epsilon_lower for found in plan.grasps) > 0


def test_one_object_is_compared_with_both_others() -> None:
    subject = next(s for s in hard_objects(1, 1) if s.family == "prism")
    result = compare(subject)
    assert min(result.default, result.paper, result.random) > 0
    assert result.ratio("paper") == result.default / result.paper >= 0.98


def test_shares_misses_and_the_verdict_are_as_stated() -> None:
    good = Comparison("tray", "good", 11, 0.2, 0.1, 0.16, 3, 0.1)
    as_good = replace(good, name="as good", paper=0.204)  # within two percent
    nothing = replace(good, name="nothing", default=0.0, paper=0.0, random=0.0)
    assert holds([good, as_good, nothing])
    assert share([good, as_good, nothing], "paper") == 1.0
    worse = replace(good, name="worse", paper=0.25)
    assert share([good, worse], "paper") == 0.5
    assert not holds([good, worse])
    assert "0.800  worse, 11 faces: 0.20000, paper 0.25000" in summary([good, worse])
    missed = replace(nothing, name="missed", random=1e-4)
    assert not holds([missed, *[good] * 200])
    assert "finds none where random finds a grasp: 1" in summary([missed, good])
    # One in a hundred may be worse than random triples.
    beaten = replace(good, name="beaten", random=0.3)
    assert holds([beaten, *[good] * 99])
    assert not holds([beaten, *[good] * 98])
