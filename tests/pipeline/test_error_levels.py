"""Which grasps are asked what they bear, and in which order: as if one at a time."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from drake_polygrasp.pipeline import error_levels, ranking
from drake_polygrasp.pipeline.error_levels import ProvedLevel, first_levels


@pytest.mark.parametrize("seed", range(20))
def test_groups_tried_together_find_what_they_find_one_at_a_time(monkeypatch, seed: int) -> None:
    rng = np.random.default_rng(seed)
    # On face 0 errors of all levels from 1 on are the same.
    errors = [
        SimpleNamespace(level=k, on=lambda face, k=k: (min(k, 1) if face[0] == 0 else k,))
        for k in range(4)
    ]
    groups = [
        [SimpleNamespace(name=(g, i), faces=(g % 2, 1, 2)) for i in range(rng.integers(1, 4))]
        for g in range(8)
    ]
    holds = {
        (grasp.name, k): rng.random() < 0.2
        for group in groups
        for grasp in group
        for k in range(len(errors))
    }
    asked: list[tuple[tuple[int, int], int]] = []

    def prove(_, grasps):
        names = [(grasp.name, level.level) for grasp, level in grasps]
        asked.extend(names)
        return [name if holds[name] else None for name in names]

    monkeypatch.setattr(error_levels, "prove_errors", prove)
    levels = range(int(rng.integers(0, 2)), 4)
    found = first_levels(None, groups, errors, levels)
    expected_asked = []
    for group, each in zip(groups, found, strict=True):
        distinct = [k for k in levels if k < 2 or group[0].faces[0]]
        order = [(i, k) for k in distinct for i in range(len(group))]
        first = next((j for j, (i, k) in enumerate(order) if holds[group[i].name, k]), None)
        tried = order if first is None else order[: first + 1]
        expected_asked += [(group[i].name, k) for i, k in tried]
        if first is None:
            assert each is None
        else:
            i, k = order[first]
            assert each is not None
            assert (each[0], each[1].level) == (i, k)
            assert each[1].proved == (group[i].name, k)
    assert sorted(asked) == sorted(expected_asked)


@pytest.mark.parametrize("seed", range(20))
def test_sets_that_bear_the_greatest_errors_come_before_the_best_others(
    monkeypatch, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    bears = rng.random(12) < 0.5
    groups = [[SimpleNamespace(row=row)] for row in range(len(bears))]
    asked: list[int] = []

    def levels_of(_, grasps, __, levels):
        if 0 not in levels:
            return [(0, ProvedLevel(row, 1, "less")) if row % 2 else None for (row,) in grasps]
        asked.extend(row for (row,) in grasps)
        return [(0, ProvedLevel(row, 0, "all")) if bears[row] else None for (row,) in grasps]

    monkeypatch.setattr(ranking, "first_levels", levels_of)
    monkeypatch.setattr(ranking, "_grasp", lambda _, row: row)
    judge = SimpleNamespace(work=SimpleNamespace(request=SimpleNamespace(object_=None)))
    wanted = int(rng.integers(1, 10))
    found = ranking._first_bearing(judge, groups, ["all", "less"], wanted)
    holding = np.flatnonzero(bears)[:wanted].tolist()
    last = holding[-1] if len(holding) == wanted else len(bears) - 1
    others = [row for row in range(last + 1) if not bears[row]][: wanted - len(holding)]
    assert [bearing.held.grasp for bearing in found] == holding + others
    assert [bearing.held.level for bearing in found] == [0] * len(holding) + [
        1 if row % 2 else 2 for row in others
    ]
    assert asked == list(range(last + 1))
