"""Whether a grasp holds the real object: five verdicts, of mathematics and of Drake's plant.

The mathematics assumes points, normals and friction. In scratch plants with the object from its
own file and fingertips of the plan's radius, SceneGraph confirms them (`geometry`), `statics` has
the plant hold the weight along every axis, and `simulation` does so through time. What disagrees
is reported as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CalcContactFrictionFromSurfaceProperties,
)
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp.certification import exact, simulation, statics
from drake_polygrasp.certification.certify import prove
from drake_polygrasp.certification.holding import Holding, hold
from drake_polygrasp.certification.scratch_plant import (
    Scene,
    add_surface,
    add_tip,
    make_scene,
)
from drake_polygrasp.certification.wrench_space import GRAVITY, epsilon_interval, squeeze_force
from drake_polygrasp.grasp import Array, Grasp, GraspObject, Verdict, frozen
from drake_polygrasp.seating import ON_SURFACE, face_of

LOAD_SHARE = 0.8
"""Ours: of what the squeeze bears in the worst direction. The hand squeezes with the squeeze force
over this; disturbances, the weight included, are this times squeeze times epsilon."""
ROUNDING = 1e-9
"""Ours, relative: what a combination of friction coefficients may be off."""


@dataclass(frozen=True)
class PlantVerdict:
    """One answer to the question whether a grasp holds."""

    name: str
    """exact, convex, geometry, statics or simulation."""
    verdict: Verdict
    """Undecided where the check could not be run."""
    margin: float | None
    """What is left until it would not hold; None where the check was not run."""
    unit: str
    reason: str = ""


@dataclass(frozen=True, eq=False)
class PlantReport:
    """What a plant says of a grasp, and what it was asked."""

    verdicts: tuple[PlantVerdict, ...]
    settings: dict[str, Any]
    equilibria: tuple[statics.Equilibrium, ...] = ()
    """Of the weight along +x, +y, +z, -x, -y, -z of B."""
    trace: simulation.Trace | None = None
    loads: tuple[str, ...] = ()
    """What the trace's loads are."""

    @property
    def holds(self) -> bool:
        """Whether all five verdicts are "holds"."""
        return all(verdict.verdict is Verdict.HOLDS for verdict in self.verdicts)


def certify_in_plant(
    object_: GraspObject,
    grasp: Grasp,
    internal_force: Array | None = None,
    *,
    tip_radius: float,
    package_paths: Sequence[str | Path] = (),
    meshcat: Meshcat | None = None,
) -> PlantReport:
    """Check a grasp by mathematics, and in scratch plants with the object's own model.

    Args:
        object_: what is grasped, loaded from a file.
        grasp: three contacts.
        internal_force: its proof x_12, x_13, x_23 [1/m], shape (3,); found here if None.
        tip_radius: of spherical fingertips [m]; 0 for points, which small probes stand for.
        package_paths: folders searched for the packages of package:// URIs.
        meshcat: the caller's own, where a recording of the simulation is published.

    Raises:
        ModelError: when the object came from no file, or the file cannot be read again.
    """
    scene = make_scene(object_, grasp, tip_radius, package_paths)
    mathematics = _exact(grasp, internal_force), _convex(grasp)
    geometry = check_geometry(scene)
    settings: dict[str, Any] = {
        "drake": metadata.version("drake"),
        "tip_radius": scene.tip_radius,
        "simulated_on": "surface" if scene.solid.is_hulls else "pads",
        "pad_width": scene.pad_width,
        "load_share": LOAD_SHARE,
        **simulation.settings(),
    }
    plan, obstacle = _plan_loads(scene)
    if geometry.verdict is not Verdict.HOLDS:
        plan, obstacle = None, _Obstacle(Verdict.UNDECIDED, "not run: the geometry does not hold")
    if plan is None:
        rest = (
            PlantVerdict("statics", obstacle.verdict, None, "N", obstacle.reason),
            PlantVerdict("simulation", obstacle.verdict, None, "1", obstacle.reason),
        )
        return PlantReport((*mathematics, geometry, *rest), settings)
    settings["squeeze"] = plan.holding.squeeze
    equilibria = statics.find_equilibria(scene, plan.weight)
    trace = simulation.simulate(scene, plan.squeeze_f_B, plan.holding, meshcat)
    verdicts = _statics(plan, equilibria), _simulation(scene, plan, trace)
    return PlantReport(
        (*mathematics, geometry, *verdicts), settings, equilibria, trace, plan.labels
    )
