"""Ranks a plan's grasps by what a plant says of them: what fails goes behind what holds."""

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
    """Certifies a plan's grasps in plants, best first, until enough of them hold.

        plan = plan_grasps(bracket, top=20)
        plan = rank_in_plant(bracket, plan, top=10)

    Args:
        object_: what the plan is for, loaded from a file.
        plan: from `plan_grasps`: its grasps are asked about in their order.
        top: how many grasps that hold are enough (default: all of the plan's are asked about). So
            many are, too, where all are undecided for one reason, such as a model without a mass.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
        surroundings: other bodies of the user's scene, as of `certify_in_plant`.
        progress: called with how many grasps were asked about, and how many there are.

    Returns:
        The plan with those grasps that were asked about, each with its verdicts as `plant`: first
        those that hold, then those that are undecided, then those that fail, and within each in
        the plan's order.

    Raises:
        UsageError: when an argument is not what it may be.
        ModelError: when the object came from no file, or the file cannot be read again.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    check_instance("plan", plan, GraspPlan, "as plan_grasps returns it")
    wanted = len(plan.grasps) if top is None else check_count("top", top)
    tell = check_progress("progress", progress)
    # Simulation is loaded by those who ask for it.
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
    """Whether enough grasps hold, or so many are undecided for one reason that others will be."""
    found = [record for record in records if record is not None]
    if sum(record.holds for record in found) >= wanted:
        return True
    reasons = {tuple(verdict.reason for verdict in record.verdicts) for record in found}
    undecided = all(record.verdict is Verdict.UNDECIDED for record in found)
    return undecided and len(found) >= wanted and len(reasons) == 1
