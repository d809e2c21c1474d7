"""One object measured in a process of its own: JSON on standard input, and on standard output.

echo '{"task": "ours", "file": "models/cube/cube.sdf"}' | python -m benchmarks.measure
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely

from benchmarks.long_search import best_known, joined
from benchmarks.peers import (
    NUM_TRIPLES,
    Stopwatch,
    Surface,
    Triples,
    antipodal_triples,
    best_of,
    closed,
    epsilon_of,
    random_triples,
    surface_of,
    triples_at,
)
from drake_polygrasp import GraspObject, GraspPlan, load_object, plan_grasps
from drake_polygrasp.grasp import Array
from drake_polygrasp.pipeline import TIP_RADIUS
from drake_polygrasp.polyhedron import Regions, erode

CUBE = Path(__file__).resolve().parents[1] / "models" / "cube" / "cube.sdf"
SEED = 0
GAP = 0.005
"""Relative gap of the epsilon that methods are compared by, a quarter of what plans report."""
QUICK = 2.0
"""[s]: what takes longer is not repeated."""

Draw = Callable[[Surface, int, np.random.Generator], Triples]


def ours(file: Path, mu: float | None, method: Literal["enriched", "paper"], repeat: int) -> Any:
    """Seconds (the least of some runs), peak memory and the best grasp of the planner."""
    plan_grasps(load_object(CUBE), method=method)  # imports and first calls are not timed
    runs: list[dict[str, float]] = []
    while len(runs) < repeat and (not runs or runs[-1]["plan"] < QUICK):
        stopwatch = Stopwatch()
        object_ = load_object(file, mu=mu)
        stopwatch.lap("load")
        plan = plan_grasps(object_, method=method)
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


def peers(
    file: Path,
    mu: float | None,
    num_long: int,
    p_BC: list[list[float]] | None = None,
    face: list[int] | None = None,
) -> Any:
    """Random, antipodal and long search; the last starts from all winners and the grasp given."""
    object_ = load_object(file, mu=mu)
    tip_radius = TIP_RADIUS * object_.polyhedron.diameter
    winners: list[Triples] = []
    results: dict[str, Any] = {}
    draws: dict[str, Draw] = {"random": random_triples, "antipodal": antipodal_triples}
    for name, draw in draws.items():
        search(object_, draw, tip_radius, num=50)  # first calls are not timed
        best, results[name] = search(object_, draw, tip_radius)
        winners.append(best)
    regions = erode(object_.polyhedron)
    if p_BC is not None and face is not None:
        winners.append(_on_regions(regions, np.array(p_BC), np.array(face)))
    if num_long:
        stopwatch = Stopwatch()
        best, _ = best_known(
            object_,
            surface_of(regions),
            tip_radius,
            np.random.default_rng(SEED),
            joined(*winners),
            num_long,
        )
        stopwatch.lap("total")
        results["best"] = _summary(object_, best) | {"seconds": stopwatch.seconds}
    return results


def search(
    object_: GraspObject, draw: Draw, tip_radius: float, num: int = NUM_TRIPLES
) -> tuple[Triples, dict[str, Any]]:
    """Best of `num` triples; its stages, erosion included, are timed."""
    stopwatch = Stopwatch()
    surface = surface_of(erode(object_.polyhedron))
    stopwatch.lap("erode")
    triples = draw(surface, num, np.random.default_rng(SEED))
    stopwatch.lap("draw")
    triples = triples.take(closed(object_, triples, tip_radius))
    stopwatch.lap("filter")
    best, _ = best_of(object_, triples)
    stopwatch.lap("rank")
    seconds = stopwatch.seconds | {"total": sum(stopwatch.seconds.values())}
    return best, _summary(object_, best) | {"seconds": seconds, "closed": len(triples.mu)}


def _summary(object_: GraspObject, best: Triples) -> dict[str, Any]:
    epsilon = epsilon_of(object_, best, relative_gap=GAP) if len(best.mu) else 0.0
    return {"epsilon": epsilon, "p_BC": best.p_BC.tolist(), "region": best.region.tolist()}


def _on_regions(regions: Regions, p_BC: Array, face: Array) -> Triples:
    """Contacts on faces as those of the nearest of each face's regions."""
    p_FC = np.einsum("rij,cri->crj", regions.R_BF, p_BC[:, None] - regions.p_BF)
    distance = shapely.distance(regions.polygon_F, shapely.points(p_FC[..., :2]))
    distance[regions.face != face[:, None]] = np.inf
    return triples_at(regions, p_BC[None], distance.argmin(axis=1)[None])


def main() -> None:
    request = json.load(sys.stdin)
    tasks: dict[str, Callable[..., Any]] = {"ours": ours, "peers": peers}
    task = tasks[request.pop("task")]
    print(json.dumps(task(Path(request.pop("file")), **request)))


if __name__ == "__main__":
    main()
