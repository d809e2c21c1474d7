"""States proofs of bounds over regions as plain data, for `exact_cycle` to check."""

from __future__ import annotations

from typing import Any

from drake_polygrasp.region_bounds.region_epsilon import FacetProof, RegionProof
from drake_polygrasp.region_bounds.region_task import RegionTask


def stated_proof(proof: RegionProof, task: RegionTask) -> dict[str, Any]:
    """Returns all that `exact_cycle.check_region_proof` asks, of types that JSON knows.

    Args:
        proof: of `region_epsilon` for the task.
        task: the grasp and its errors.
    """
    return {
        "regions": [
            [
                {
                    "p_BV": piece.p_BV.tolist(),
                    "nhat_TB_B": piece.nhat_TB_B.tolist(),
                    "tan_spread": piece.tan_spread,
                }
                for piece in region
            ]
            for region in task.regions
        ],
        "mu": task.mu.tolist(),
        "p_BBcm": task.p_BBcm.tolist(),
        "rho": float(task.rho),
        "tilt_error": float(task.tilt_error),
        "friction_error": float(task.friction_error),
        "com_error": float(task.com_error),
        "generators": [
            {"contact": i, "force": force[: len(task.regions[i])].tolist()}
            for i, force in zip(proof.contact.tolist(), proof.force, strict=True)
        ],
        "epsilon": _stated(proof.epsilon),
        "weight": _stated(proof.weight),
    }


def _stated(proof: FacetProof | None) -> dict[str, Any] | None:
    if proof is None:
        return None
    return {
        "bound": proof.bound,
        "simplices": proof.simplices.tolist(),
        "twists": proof.twists.tolist(),
    }
