"""What regions are measured against: the largest discs in closed form, and whole runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.regions import Measured, is_enough, largest_radius

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize("mu", [0.3, 0.8])
def test_the_largest_discs_of_three_contacts_on_a_circle_are_those_of_the_closed_form(mu):
    """By symmetry x is (1, 1, 1), where f_i = 3 R n_i; the worst half-space is across the plane.

    There u = mu n_i + z, which the own face's disc lowers by 2 r, and those of the other two, whose
    normals are at 120 degrees, by r sqrt(1 + mu^2 - mu^2 / 4) each.
    """
    R = 0.05
    turns = 2 * np.pi * np.arange(3) / 3
    p_BC = R * np.stack([np.cos(turns), np.sin(turns), np.zeros(3)], axis=1)
    found = largest_radius(p_BC, -p_BC / R, np.full(3, mu))
    exact = 3 * mu * R / (2 + 2 * np.sqrt(1 + 0.75 * mu**2))
    assert found == pytest.approx(exact, rel=1e-5)


def test_what_is_required_is_counted():
    def result(certified, ratio):
        return Measured("", 6, certified, 1.0, [ratio], 10, 0.1)

    both = [result([True, False], 0.95), result([True, None], None)]
    assert is_enough(both, [2, 0]) and is_enough(both, [])
    assert not is_enough(both, [2, 1])
    assert not is_enough([*both, result([True, True], 0.89)], [2, 1])


def test_the_command_says_what_a_cube_is_certified_to_bear():
    command = [sys.executable, "-m", "benchmarks.regions", "models/cube/cube.sdf"]
    # No disc of 40 mm radius is on a face of 60 mm.
    options = ["--millimetres", "2", "40", "--shares", "0.02", "--require", "1", "0"]
    result = subprocess.run(
        [*command, *options], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert "2 mm: 1 of 1 first grasps certified" in result.stdout
    assert "40 mm: 0 of 1 first grasps certified" in result.stdout
