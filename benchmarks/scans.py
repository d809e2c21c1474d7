"""Whether Drake finds fingertips on scans where the planner puts them.

    python -m benchmarks.scans [--top 15]

Plans on 20 generated scans (rounded boxes, blobs, cans, bottles of 2,000 to 16,000 triangles, with
noise of 0 to 0.3 mm) and asks the geometry check of the plant about each of the `--top` best grasps
of each.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

from benchmarks.objects import MU
from drake_polygrasp import load_object, plan_grasps
from drake_polygrasp.arrays import Array
from drake_polygrasp.plant.contact_geometry import check_geometry
from drake_polygrasp.plant.scratch_plant import make_scene
from tests.support.convex_polyhedra import write_obj
from tests.support.scanned import Radius, blob, bottle, can, rounded_box, scan

SIZES = (2000, 4000, 8000, 12_000, 16_000)
NOISES = (0.0, 5e-5, 1e-4, 2e-4, 3e-4)
"""[m]"""


class Scan(NamedTuple):
    """A generated scan."""

    shape: str
    num_triangles: int
    noise: float
    """[m]"""
    triangles: Array
    """[m], shape (T, 3, 3)."""


class Result(NamedTuple):
    """What became of a scan's grasps."""

    faults: list[str]
    """The first fault of each that Drake finds one in."""
    num_grasps: int
    epsilon: float | None
    """Of the best grasp."""
    seconds: float
    """That planning took."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scans", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--top", type=int, default=15, help="grasps of each scan (default: 15)")
    top = parser.parse_args().top
    print("| scan | triangles | noise [mm] | grasps | pass | epsilon of the best | plan [s] |")
    print("|---|---|---|---|---|---|---|")
    asked, faults = 0, list[str]()
    for scan_ in scans():
        shape, size, noise = scan_.shape, scan_.num_triangles, f"{1e3 * scan_.noise:g}"
        found, num, epsilon, seconds = result(scan_, top)
        best = "none" if epsilon is None else f"{epsilon:.4f}"
        cells = shape, size, noise, num, num - len(found), best, f"{seconds:.2f}"
        print(f"| {' | '.join(map(str, cells))} |", flush=True)
        asked += num
        faults += [f"{shape} of {size} triangles, {noise} mm: {fault}" for fault in found]
    share = 1 - len(faults) / asked
    print(f"\nOf {asked} ranked grasps {asked - len(faults)} pass, {share:.1%}.", *faults, sep="\n")


def result(scan_: Scan, top: int) -> Result:
    """Plans on a scan and asks Drake about its `top` best grasps."""
    with tempfile.TemporaryDirectory() as folder:
        write_obj(file := Path(folder) / "scan.obj", scan_.triangles)
        object_ = load_object(file, mu=MU)
        start = perf_counter()
        plan = plan_grasps(object_, top=top)
        seconds = perf_counter() - start
        if not plan.grasps:
            return Result([], 0, None, seconds)
        scene = make_scene(object_, plan.grasps[0].grasp, plan.settings.tip_radius)
        fits = [check_geometry(replace(scene, grasp=found.grasp)) for found in plan.grasps]
    faults = [fit.faults[0] for fit in fits if fit.faults]
    return Result(faults, len(fits), plan.grasps[0].certificate.epsilon_lower, seconds)


def scans() -> Iterator[Scan]:
    """Each shape once in each size and once with each noise."""
    for s, shape in enumerate(("box", "blob", "can", "bottle")):
        for k, size in enumerate(SIZES):
            noise, seed = NOISES[(2 * k + s) % len(NOISES)], len(SIZES) * s + k
            yield Scan(shape, size, noise, scan(outline(shape, seed), size, noise, seed))


def outline(shape: str, seed: int) -> Radius:
    """Of a shape of 5 to 10 cm; a bottle is longer by its neck."""
    a, b, c = np.random.default_rng(seed).uniform(0.025, 0.05, 3)
    if shape == "box":
        return rounded_box(np.array([a, b, c]), 0.006)
    if shape == "blob":
        return blob(b, seed)
    return can(a, c, 0.003) if shape == "can" else bottle(a, c, 0.004)


if __name__ == "__main__":
    main()
