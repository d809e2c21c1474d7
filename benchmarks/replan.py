"""How often a moving body among obstacles can be planned for anew.

    python -m benchmarks.replan [MODEL ...] [--cycles 10]

The body moves over a table and along a wall, in a plant. In each cycle it has another pose:
obstacles are taken from the plant's context, and one grasp is planned with `effort="quick"` and the
default errors, or with none. The object is loaded once, before. Seconds are the processor's.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.framework import DiagramBuilder

from benchmarks.objects import ROOT
from benchmarks.objects import models as own_models
from drake_polygrasp import GraspObject, load_object, obstacles_from_plant, plan_grasps
from drake_polygrasp.settings import NO_ERRORS

_APART = 0.02
"""Our choice: distance of the table and the wall from the body [m]."""


def main() -> None:
    arguments = _arguments()
    models = arguments.models or [subject.file for subject in own_models()]
    print("| model | faces | with errors [s] | slowest | without | slowest | grasps |")
    print("|---|---|---|---|---|---|---|")
    for model in models:
        object_ = load_object(model)
        times = {
            name: list(cycles(model, object_, arguments.cycles, options))
            for name, options in {"errors": {}, "none": dict(NO_ERRORS)}.items()
        }
        columns = [
            f"{of([seconds for seconds, _ in times[name]]):.3f}"
            for name in ("errors", "none")
            for of in (statistics.median, max)
        ]
        found = sum(num for _, num in times["errors"])
        cells = [model.stem, str(len(object_.polyhedron.faces)), *columns]
        print(f"| {' | '.join(cells)} | {found} of {arguments.cycles} |", flush=True)


def cycles(
    model: Path, object_: GraspObject, count: int, options: dict[str, Any]
) -> Iterator[tuple[float, int]]:
    """Yields the seconds of each cycle but the first, and the number of grasps."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
    parser = Parser(plant)
    parser.package_map().PopulateFromFolder(str(ROOT / "models"))
    (instance,) = parser.AddModels(str(model))
    corners = object_.polyhedron.triangles_B.reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    friction = CoulombFriction(0.3, 0.3)
    table = RigidTransform([0.0, 0.0, low[2] - _APART - 0.05])
    wall = RigidTransform([0.0, high[1] + _APART + 0.05, 0.0])
    for name, X_WG, shape in (
        ("table", table, Box(4.0, 4.0, 0.1)),
        ("wall", wall, Box(4.0, 0.1, 4.0)),
    ):
        plant.RegisterCollisionGeometry(plant.world_body(), X_WG, shape, name, friction)
    plant.Finalize()
    diagram = builder.Build()
    context = plant.GetMyContextFromRoot(diagram.CreateDefaultContext())
    body = plant.get_body(plant.GetBodyIndices(instance)[0])
    for k in range(count + 1):
        # It turns a little each time.
        R_WB = RotationMatrix.MakeZRotation(0.05 * np.sin(k))
        plant.SetFreeBodyPose(context, body, RigidTransform(R_WB, [0.01 * k, -0.02, 0.0]))
        start = time.process_time()
        obstacles = obstacles_from_plant(plant, body, context)
        plan = plan_grasps(object_, effort="quick", top=1, obstacles=obstacles, **options)
        if k:
            yield time.process_time() - start, len(plan.grasps)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", type=Path, metavar="MODEL")
    parser.add_argument("--cycles", type=int, default=10)
    return parser.parse_args()


if __name__ == "__main__":
    main()
