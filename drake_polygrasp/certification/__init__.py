"""Proves force closure and bounds what a grasp withstands: mathematics without files or plants.

| file | what it holds |
|---|---|
| exact.py | checks proofs of force closure in exact arithmetic, with the standard library alone |
| convex.py | finds the internal forces and escaping twists that `exact` checks |
| region_pieces.py | the pieces of regions, and their exact check |
| half_spaces.py | maximises the room that half-spaces leave to the internal forces of many grasps |
| region_search.py | finds one internal force for regions of contacts |
| contact_regions.py | certifies grasps for regions of contacts, and for the largest discs |
| exact_cycle.py | checks these proofs in exact arithmetic, with the standard library alone |
| certify.py | proves grasps, and computes the certificates of those that are force closure |
| radii.py | bounds the radii of balls inside the wrench sets of many grasps |
| robustness.py | bounds of epsilon, the tolerances and the squeeze force |
| holding_forces.py | contact forces that hold the object against a load |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drake_polygrasp import lazy_names

if TYPE_CHECKING:
    from drake_polygrasp.certification.certify import Proof, prove, prove_many
    from drake_polygrasp.certification.contact_regions import largest_certified_radius
    from drake_polygrasp.certification.exact import (
        attained_margin,
        check_force_closure,
        check_region,
        narrowed_friction,
    )
    from drake_polygrasp.certification.holding_forces import (
        Holding,
        HoldingProgram,
        friction_needed,
        hold,
        normal_forces,
    )
    from drake_polygrasp.certification.radii import Interval
    from drake_polygrasp.certification.robustness import GRAVITY, epsilon_interval

__all__ = [
    "GRAVITY",
    "Holding",
    "HoldingProgram",
    "Interval",
    "Proof",
    "attained_margin",
    "check_force_closure",
    "check_region",
    "epsilon_interval",
    "friction_needed",
    "hold",
    "largest_certified_radius",
    "narrowed_friction",
    "normal_forces",
    "prove",
    "prove_many",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "certify": ("Proof", "prove", "prove_many"),
        "contact_regions": ("largest_certified_radius",),
        "exact": ("attained_margin", "check_force_closure", "check_region", "narrowed_friction"),
        "holding_forces": ("Holding", "HoldingProgram", "friction_needed", "hold", "normal_forces"),
        "radii": ("Interval",),
        "robustness": ("GRAVITY", "epsilon_interval"),
    },
)
