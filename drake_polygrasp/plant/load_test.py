"""Simulates planned loads on a grasp and judges the simulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from pydrake.geometry import Meshcat

from drake_polygrasp.grasp import PlantVerdict, Verdict
from drake_polygrasp.plant import simulation
from drake_polygrasp.plant.drake_calls import Refusal, ask_drake
from drake_polygrasp.plant.loads import LoadPlan, LoadsUnavailable
from drake_polygrasp.plant.scratch_plant import ScratchScene

PADS = "on flat pads at the contacts"
"""The reason given when pads replace the object's surface."""
REFINEMENT = 4
"""By how much the time step is finer where a grasp does not hold. Our choice."""


def ask_for_loads(plan: Callable[[], LoadPlan | LoadsUnavailable]) -> LoadPlan | LoadsUnavailable:
    """Returns planned loads, with an error of Drake as a reason.

    Args:
        plan: plans them.
    """
    planned = ask_drake(plan)
    if isinstance(planned, Refusal):
        reason = f"not run: Drake plans no forces: {planned.reason}"
        return LoadsUnavailable(Verdict.UNDECIDED, reason)
    return planned


class LoadTest(NamedTuple):
    """The simulation of planned loads on a grasp, and its verdict.

    Attributes:
        verdict: the verdict "simulation".
        trace: the simulation; None if it was not run.
        time_step: time step of the simulation [s].
    """

    verdict: PlantVerdict
    trace: simulation.SimulationRecord | None
    time_step: float


def simulate_loads(scene: ScratchScene, plan: LoadPlan, meshcat: Meshcat | None = None) -> LoadTest:
    """Simulates loads on a grasp.

    A grasp that does not hold is simulated once more with a finer time step, whose result counts:
    with the usual one a hard squeeze may move contacts for numerical reasons.

    Args:
        scene: object and grasp.
        plan: squeeze and loads.
        meshcat: Meshcat in which a recording is published (default: none).

    Returns:
        The verdict and the simulation.
    """
    squeeze = plan.holding.squeeze
    step = simulation.time_step(scene, squeeze)
    if step < simulation.MIN_TIME_STEP:
        reason = (
            f"not run: a squeeze of {squeeze:.2g} N on this mass and inertia needs time steps of "
            f"{step:.1g} s, below the least of {simulation.MIN_TIME_STEP:.1g} s"
        )
        return LoadTest(_verdict(Verdict.UNDECIDED, None, reason), None, step)
    test = _simulated(scene, plan, meshcat, 1)
    finer = step / REFINEMENT
    if test.verdict.verdict is Verdict.FAILS and finer >= simulation.MIN_TIME_STEP:
        return _simulated(scene, plan, meshcat, REFINEMENT)
    return test


def _simulated(
    scene: ScratchScene, plan: LoadPlan, meshcat: Meshcat | None, refinement: int
) -> LoadTest:
    """Simulates the loads with the usual time step over `refinement`."""
    step = simulation.time_step(scene, plan.holding.squeeze) / refinement
    trace = ask_drake(
        lambda: simulation.simulate(scene, plan.squeeze_f_B, plan.holding, meshcat, refinement)
    )
    if isinstance(trace, Refusal):
        reason = f"Drake refuses it: {trace.reason}"
        return LoadTest(_verdict(Verdict.UNDECIDED, None, reason), None, step)
    outcome = simulation.judge(trace, len(plan.labels), scene.object_.polyhedron.diameter)
    reason = "" if scene.solid.is_hulls else PADS
    if outcome.lost is not None:
        under = plan.labels[outcome.lost] if outcome.lost >= 0 else "squeeze"
        reason = f"a fingertip loses the object: {under}"
    elif outcome.margin < 0:
        left = {"slip": outcome.slip, "creep": outcome.creep, "force": outcome.force}
        reason = f"the bound of {min(left, key=lambda name: left[name])} is exceeded"
    verdict = Verdict.HOLDS if outcome.margin >= 0 else Verdict.FAILS
    return LoadTest(_verdict(verdict, outcome.margin, reason), trace, step)


def _verdict(verdict: Verdict, margin: float | None, reason: str) -> PlantVerdict:
    return PlantVerdict("simulation", verdict, margin, "1", reason)
