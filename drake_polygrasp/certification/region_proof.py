"""States proofs of bounds over regions as plain data, for `exact_cycle` to check."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.region_epsilon import FacetProof, RegionProof
from drake_polygrasp.certification.region_pieces import RegionPiece


def stated_proof(
    proof: RegionProof,
    regions: Sequence[Sequence[RegionPiece]],
    mu: Array,
    p_BBcm: Array,
    rho: float,
    *,
    tilt_error: float = 0.0,
    friction_error: float = 0.0,
    com_error: float = 0.0,
) -> dict[str, Any]:
    """Returns all that `exact_cycle.check_region_proof` asks, of types that JSON knows.

    Args:
        proof: of `region_epsilon`, for the arguments that follow.
        regions: the pieces on one of which each contact is.
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        tilt_error: angle by which normals may differ from the surface's [rad].
        friction_error: share by which friction coefficients may be less.
        com_error: how far the centre of mass may be off [m].
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
            for region in regions
        ],
        "mu": mu.tolist(),
        "p_BBcm": p_BBcm.tolist(),
        "rho": float(rho),
        "tilt_error": float(tilt_error),
        "friction_error": float(friction_error),
        "com_error": float(com_error),
        "generators": [
            {"contact": i, "force": force[: len(regions[i])].tolist()}
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
