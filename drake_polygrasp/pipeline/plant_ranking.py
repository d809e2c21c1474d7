"""Ranks the grasps of a plan by their verdicts in a plant: those that fail come last."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from drake_polygrasp.arguments import Progress, check_count, check_instance, check_progress
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject, PlantRecord, Verdict
from drake_polygrasp.pipeline.plan import GraspPlan

if TYPE_CHECKING:
    from drake_polygrasp.loading.surroundings import Surroundings


_ORDER = (Verdict.HOLDS, Verdict.UNDECIDED, Verdict.FAILS)


def rank_in_plant(
    object_: GraspObject,
    plan: GraspPlan,
    *,
    top: int | None = None,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    surroundings: Surroundings | None = None,
    progress: Progress | None = None,
) -> GraspPlan:
    """Checks the grasps of a plan in Drake plants, best first, until enough of them hold.

        plan = plan_grasps(bracket, top=20)
        plan = rank_in_plant(bracket, plan, top=10)

    Args:
        object_: object of the plan, loaded from a file.
        plan: plan of `plan_grasps`, whose grasps are checked in their order.
        top: number of grasps that hold after which checking ends (default: all are checked). It
            also ends after as many that are all undecided for one reason, such as a model without
            a mass.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
        surroundings: other bodies of the user's scene, which no fingertip may penetrate; see
            `surroundings_from_plant`.
        progress: called with the number of grasps that are checked and the number of all.

    Returns:
        The plan with the checked grasps, whose `plant` has their verdicts: first those that hold,
        then those that are undecided, then those that fail, each in the plan's order.

    Raises:
        UsageError: when an argument has the wrong type or value.
        ModelError: when the object came from no file, or the file cannot be read again.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    check_instance("plan", plan, GraspPlan, "as plan_grasps returns it")
    wanted = len(plan.grasps) if top is None else check_count("top", top)
    tell = check_progress("progress", progress)
    # Simulation is loaded only if it is asked for.
    from drake_polygrasp.plant.certify_in_plant import certify_in_plant

    start = perf_counter()
    asked: list[tuple[Verdict, CertifiedGrasp]] = []
    for grasp in plan.grasps:
        if _are_enough([grasp.plant for _, grasp in asked], wanted):
            break
        tell(len(asked), len(plan.grasps))
        report = certify_in_plant(
            object_,
            grasp,
            package_paths=package_paths,
            packages=packages,
            surroundings=surroundings,
        )
        record = PlantRecord(report.verdicts, report.settings, report.equilibria)
        asked.append((record.verdict, replace(grasp, plant=record)))
    asked.sort(key=lambda pair: _ORDER.index(pair[0]))  # stable
    return replace(
        plan,
        grasps=tuple(grasp for _, grasp in asked),
        seconds=plan.seconds | {"plant": perf_counter() - start},
        settings=replace(plan.settings, top_in_plant=wanted),
    )


def _are_enough(records: Sequence[PlantRecord | None], wanted: int) -> bool:
    """Returns whether enough grasps hold, or as many are all undecided for one reason."""
    found = [record for record in records if record is not None]
    if sum(record.holds for record in found) >= wanted:
        return True
    reasons = {tuple(verdict.reason for verdict in record.verdicts) for record in found}
    undecided = all(record.verdict is Verdict.UNDECIDED for record in found)
    return undecided and len(found) >= wanted and len(reasons) == 1
