"""A hand picks up objects from a table, clear of the table and of those beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drake_polygrasp import HandError, object_from_plant, surroundings_from_plant
from examples.clear_table import APART, OBJECTS, OWN_HAND, main, set_table


def test_objects_stand_on_the_table_side_by_side() -> None:
    plant, bodies, context = set_table(OBJECTS)
    assert len(bodies) == 3
    for k, body in enumerate(bodies):
        around = surroundings_from_plant(plant, body, context)
        assert len(around.names) == 3  # The table and two others.
        x, y, z = plant.EvalBodyPoseInWorld(context, body).translation()
        assert (x, y) == pytest.approx((APART * (k - 1), 0.0), abs=1e-12)
        lowest = object_from_plant(plant, body, context).polyhedron.triangles_B[..., 2].min()
        assert z + lowest == pytest.approx(0.0, abs=1e-12)


def test_all_three_are_picked_up(capsys: Any) -> None:
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == [file.stem for file in OBJECTS]
    assert all(": picked up by " in line for line in lines)
    # The palm comes from above the table.
    heights = [float(line.rpartition(",")[2].strip(" ]")) for line in lines]
    assert np.min(heights) > 0.05


def test_a_hand_that_is_not_there_is_an_error_of_ours() -> None:
    with pytest.raises(HandError, match="nowhere"):
        main(["--hand", str(OWN_HAND.with_name("nowhere.hand.yaml"))])
