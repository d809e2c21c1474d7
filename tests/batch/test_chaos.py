"""The promise of a batch under kills, on a few objects; `benchmarks.chaos` asks of hundreds."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from benchmarks.chaos import chaos

PATIENCE = {"alive_seconds": 300.0, "timeout": 60.0}
"""Times that no machine needs [s]; the second is what an object that hangs is waited for."""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads the processes of /proc")


@pytest.mark.parametrize(("engine", "num_objects"), [("local", 24), ("threads", 14)])
def test_each_object_has_one_result_however_often_the_driver_is_killed(
    tmp_path: Path, engine: str, num_objects: int
) -> None:
    assert chaos(tmp_path, num_objects, 3, engine, seed=1, **PATIENCE) == []


def test_each_object_has_one_result_though_workers_of_dask_are_killed(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="Dask is optional: pip install '.[dask]'")
    assert chaos(tmp_path, 20, 3, "dask", seed=1, **PATIENCE) == []
