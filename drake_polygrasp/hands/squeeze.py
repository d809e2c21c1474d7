"""Compares how hard a hand squeezes with what the errors that a grasp bears ask for."""

from __future__ import annotations

from drake_polygrasp.arrays import Array
from drake_polygrasp.grasp import Grasp, RegionCertificate
from drake_polygrasp.hand_grasp import HandTorque

_ROUNDING = 1e-4
"""Relative rounding of forces in grasp files."""


def total_normal(grasp: Grasp, f_Bc_B: Array) -> float:
    """Returns the sum of the normal forces at contacts [N].

    Args:
        grasp: three contacts.
        f_Bc_B: forces on B at them [N], shape (3, 3).
    """
    return float((grasp.nhat_TB_B * f_Bc_B).sum())


def region_squeeze(
    region: RegionCertificate | None, object_mass: float | None, mass: float | None
) -> float | None:
    """Returns the total normal force that holds a load under the errors that a grasp bears [N].

    Args:
        region: the errors, with the force for the object's own mass; None for none.
        object_mass: mass of the object [kg]; None if it is unknown.
        mass: mass of the load [kg]; None if it is unknown.

    Returns:
        The force; None where the region states none, or the load has no known mass.
    """
    if region is None or region.squeeze_force is None or object_mass is None or mass is None:
        return None
    return region.squeeze_force * mass / object_mass


def squeeze_remark(
    grasp: Grasp, region: RegionCertificate | None, object_mass: float | None, torque: HandTorque
) -> str:
    """Returns a clause that says that a hand squeezes less than errors ask for; empty otherwise.

    Args:
        grasp: three contacts.
        region: the errors that the grasp bears; None for none.
        object_mass: mass of the object [kg]; None if it is unknown.
        torque: how the hand squeezes.
    """
    needed = region_squeeze(region, object_mass, torque.mass)
    total = total_normal(grasp, torque.f_Bc_B)
    if needed is None or total >= needed * (1 - _ROUNDING):
        return ""
    return (
        f"the hand's efforts reach a squeeze of {total:.3g} N, less than the {needed:.3g} N that "
        "hold the load under all errors of the region"
    )
