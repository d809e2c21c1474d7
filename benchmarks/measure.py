"""One object measured in a process of its own: JSON on standard input, and on standard output.

echo '{"task": "ours", "file": "models/cube/cube.sdf"}' | python -m benchmarks.measure
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.long_search import best_known
from benchmarks.peers import (
    NUM_TRIPLES,
    Stopwatch,
    Surface,
    Triples,
    antipodal_triples,
    best_of,
    closed,
    epsilon_of,
    is_proved,
    random_triples,
    surface_of,
    triples_at,
)
from drake_polygrasp import GraspObject, GraspPlan, load_object, plan_grasps
from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.geometry.regions import PLACEMENT_ERROR, Regions, erode, regions_at
from drake_polygrasp.pipeline.freed_memory import keep_freed_memory
from drake_polygrasp.settings import TIP_RADIUS

CUBE = Path(__file__).resolve().parents[1] / "models" / "cube" / "cube.sdf"
SEED = 0
GAP = 0.005
"""Relative gap of the epsilon that methods are compared by, a quarter of what plans report."""
QUICK = 2.0
"""[s]: what takes longer is not repeated."""

Draw = Callable[[Surface, int, np.random.Generator], Triples]


def ours(file: Path, mu: float | None, repeat: int, **options: Any) -> Any:
    """Seconds (the least of some runs), peak memory and the best grasp of the planner."""
    plan_grasps(load_object(CUBE), **options)  # imports and first calls are not timed
    runs: list[dict[str, float]] = []
    while len(runs) < repeat and (not runs or runs[-1]["plan"] < QUICK):
        stopwatch = Stopwatch()
        object_ = load_object(file, mu=mu)
        stopwatch.lap("load")
        plan = plan_grasps(object_, **options)
        runs.append(stopwatch.seconds | plan.seconds)
    return {
        "faces": len(object_.polyhedron.faces),
        "sets": plan.num_sets,
        "certified": plan.num_certified,
        "seconds": {stage: min(run[stage] for run in runs) for stage in runs[0]},
        "megabytes": peak_memory() / 1e6,
        **_best_grasp(object_, plan),
    }


def _best_grasp(object_: GraspObject, plan: GraspPlan) -> dict[str, Any]:
    if not plan.grasps:
        return {"epsilon": 0.0, "kind": None, "p_BC": None, "face": None}
    grasp = plan.grasps[0].grasp
    found = Triples(
        grasp.p_BC[None], np.array([grasp.faces]), grasp.nhat_TB_B[None], grasp.mu[None]
    )
    return {
        "epsilon": epsilon_of(object_, found, relative_gap=GAP),
        "kind": grasp.kind,
        "p_BC": grasp.p_BC.tolist(),
        "face": list(grasp.faces),
    }


def peak_memory() -> float:
    """The most memory this process ever held [bytes]."""
    status = Path("/proc/self/status")
    if status.exists():  # getrusage would count what the parent held before it started us
        line = next(line for line in status.read_text().splitlines() if "VmHWM" in line)
        return 1024.0 * int(line.split()[1])
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def peers(file: Path, mu: float | None, repeat: int) -> Any:
    """Random and antipodal search, each the fastest of some runs."""
    draws: dict[str, tuple[Draw, int, float]] = {
        "random": (random_triples, NUM_TRIPLES, 0.0),
        "random_x4": (random_triples, 4 * NUM_TRIPLES, 0.0),
        "random_inside": (random_triples, NUM_TRIPLES, PLACEMENT_ERROR),
        "antipodal": (antipodal_triples, NUM_TRIPLES, 0.0),
    }
    results: dict[str, Any] = {}
    for name, asked in draws.items():
        search(load_object(CUBE), *asked)  # first calls are not timed
        # What an object keeps of one run, such as its trees, must not serve the next.
        runs = [search(load_object(file, mu=mu), *asked) for _ in range(repeat)]
        results[name] = min(runs, key=lambda run: run["seconds"]["total"])
    return results


def long_search(file: Path, mu: float | None, num: int, starts: list[dict[str, Any]]) -> Any:
    """The best grasp known, from `num` random triples and what others found: "p_BC", "face"."""
    object_ = load_object(file, mu=mu)
    regions = erode(object_.polyhedron)
    stopwatch = Stopwatch()
    best, _ = best_known(
        object_,
        surface_of(regions),
        _tip_radius(object_),
        np.random.default_rng(SEED),
        join_rows(
            *(_on_regions(regions, np.array(s["p_BC"]), np.array(s["face"])) for s in starts)
        ),
        num,
    )
    stopwatch.lap("total")
    return _summary(object_, best, regions) | {"seconds": stopwatch.seconds}


def search(
    object_: GraspObject, draw: Draw, num: int = NUM_TRIPLES, clearance: float = 0.0
) -> dict[str, Any]:
    """Best of `num` triples, proved; its stages, erosion included, are timed.

    Contacts keep at least `clearance` times the diameter from edges.
    """
    stopwatch = Stopwatch()
    keep_freed_memory()
    L = object_.polyhedron.diameter
    regions = erode(object_.polyhedron, least_clearance=clearance * L)
    surface = surface_of(regions)
    stopwatch.lap("erode")
    triples = draw(surface, num, np.random.default_rng(SEED))
    stopwatch.lap("draw")
    tip_radius = _tip_radius(object_)
    triples = triples.take(closed(object_, triples, tip_radius))
    num_closed = len(triples.mu)
    stopwatch.lap("filter")
    best, _ = best_of(object_, triples)
    stopwatch.lap("rank")
    while len(best.mu) and not is_proved(object_, best, regions.face[best.region], tip_radius):
        triples = triples.take((triples.p_BC != best.p_BC).any(axis=(1, 2)))
        best, _ = best_of(object_, triples)
    stopwatch.lap("prove")
    seconds = stopwatch.seconds | {"total": sum(stopwatch.seconds.values())}
    found = _summary(object_, best, regions)
    return found | {"seconds": seconds, "num_closed": num_closed}


def _tip_radius(object_: GraspObject) -> float:
    return TIP_RADIUS * object_.polyhedron.diameter


def _summary(object_: GraspObject, best: Triples, regions: Regions) -> dict[str, Any]:
    if not len(best.mu):
        return {"epsilon": 0.0, "p_BC": None, "face": None}
    return {
        "epsilon": epsilon_of(object_, best, relative_gap=GAP),
        "p_BC": best.p_BC[0].tolist(),
        "face": regions.face[best.region[0]].tolist(),
    }


def _on_regions(regions: Regions, p_BC: Array, face: Ints) -> Triples:
    """Contacts on faces as those of the nearest of each face's regions."""
    return triples_at(regions, p_BC[None], regions_at(regions, face, p_BC)[None])


def main() -> None:
    request = json.load(sys.stdin)
    tasks: dict[str, Callable[..., Any]] = {"ours": ours, "peers": peers, "long": long_search}
    task = tasks[request.pop("task")]
    print(json.dumps(task(Path(request.pop("file")), **request)))


if __name__ == "__main__":
    main()
