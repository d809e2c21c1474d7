"""States the proofs of what grasps withstand under errors, for a reader to check."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.region_bounds.region_epsilon import region_epsilons
from drake_polygrasp.region_bounds.region_proof import stated_proof
from drake_polygrasp.region_bounds.region_task import task_of


def region_proofs(object_: GraspObject, grasps: Sequence[CertifiedGrasp]) -> list[dict[str, Any]]:
    """Returns proofs of the bounds of epsilon and squeeze that grasps' regions state.

    The surfaces that prove them are found anew, for a plan does not keep them.

    Args:
        object_: object that is grasped.
        grasps: grasps of it, best first, as planned for it.

    Returns:
        For each grasp with a bound above 0 all that `exact_cycle` asks, with the grasp's rank
        from 1, its faces and the bounds that are proved.
    """
    bearing = [
        (rank, certified, region)
        for rank, certified in enumerate(grasps, start=1)
        if (region := certified.region) is not None and region.epsilon_lower
    ]
    body = object_.p_BBcm, object_.rho, object_.mass
    tasks = [task_of(region, certified.grasp, *body) for _, certified, region in bearing]
    proofs = []
    for (rank, certified, region), task, found in zip(
        bearing, tasks, region_epsilons(tasks), strict=True
    ):
        states: dict[str, Any] = {
            "rank": rank,
            "faces": list(certified.grasp.faces),
            "epsilon_lower": region.epsilon_lower,
        }
        if region.squeeze_force is not None:
            states |= {"mass": object_.mass, "squeeze_force": region.squeeze_force}
        proofs.append({"states": states, **stated_proof(found.proof, task)})
    return proofs
