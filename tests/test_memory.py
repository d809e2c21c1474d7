"""Memory does not grow with points times triangles."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely

from drake_polygrasp import geometry
from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.inradius import inradius
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import diameter, unit_normals
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.solids import regular_polygon

LOAD = """
import sys
from pathlib import Path
from drake_polygrasp.loading.object_model import load_object
polyhedron = load_object(sys.argv[1]).polyhedron
print(len(polyhedron.triangles_B), polyhedron.watertight)
# The usage that the system counts begins with that of the process which started this one.
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
print(status["VmHWM"].split()[0])
"""


def fine_pins(num_sides: int) -> Array:
    """Two dowel pins along an oblique axis, 12 cm long: needles across all axes of B."""
    axis, u = np.ones(3) / np.sqrt(3), np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    R_BP = np.stack([u, np.cross(axis, u), axis], axis=1)
    pin = prism(regular_polygon(num_sides, 0.01), 0.12) @ R_BP.T
    return np.concatenate([pin, pin + np.array([0.03, 0.0, 0.0])])


def test_fine_oblique_pins_load_in_little_memory(tmp_path: Path) -> None:
    path = tmp_path / "pins.obj"
    triangles = fine_pins(1200)
    write_obj(path, triangles)
    ending = subprocess.run(
        [sys.executable, "-c", LOAD, str(path)], capture_output=True, text=True, check=False
    )
    assert ending.returncode == 0, ending.stderr
    surface, peak = ending.stdout.splitlines()
    assert surface == f"{len(triangles)} True"
    # Comparing all samples with all triangles took more than 4 GB.
    assert int(peak) < 400 * 1024


def winding() -> None:
    body = fine_pins(1000)
    outside = body.mean(axis=1) + 1e-6 * unit_normals(body)[0]
    assert not TriangleSoup(body).winding_numbers(outside).any()


def distances() -> None:
    body = fine_pins(1000)
    assert TriangleSoup(body).within(body.mean(axis=1), 1e-3).all()


def greatest_distance() -> None:
    turn = np.linspace(0, 2 * np.pi, 6001)
    ring = np.c_[1e-4 * np.cos(turn), 1e-4 * np.sin(turn), np.zeros_like(turn)]
    points = np.concatenate([ring, ring + np.array([0.0, 0.0, 1.0])])
    assert diameter(points) == pytest.approx(np.hypot(1.0, 2e-4), rel=1e-12)


@pytest.mark.parametrize("compute", [winding, distances, greatest_distance])
def test_arrays_stay_small(compute: Callable[[], None]) -> None:
    # All pairs at once would take 250 MB for a single array of coordinates, and ten of them.
    assert peak_of(compute) < 200e6


def peak_of(compute: Callable[[], object]) -> int:
    """The bytes that arrays take at most meanwhile."""
    tracemalloc.start()
    try:
        compute()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_the_largest_disc_is_the_same_for_few_starts_at_a_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Two circles of radius 1, their centres 0.9 apart: between them is a crescent.
    disc = regular_polygon(200, 1.0)
    crescent = np.array([disc - shapely.affinity.translate(disc, 0.9)], dtype=object)
    whole = peak_of(lambda: inradius(crescent))
    monkeypatch.setattr(geometry.inradius, "_SIDES_AT_ONCE", 1 << 12)
    assert peak_of(lambda: inradius(crescent)) < whole / 4
    assert inradius(crescent) == pytest.approx([0.45], rel=1e-3)
