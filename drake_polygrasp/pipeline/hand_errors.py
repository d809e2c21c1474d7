"""Proves the errors that grasps of a hand bear, and lets the hand squeeze as much as they ask for.

The search of postures knows no default errors: they are proved of the grasps that it returns, so
that none is lost for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.hand_grasp import HandGrasp, HandTorque
from drake_polygrasp.hands.hand_search import (
    HeldGrasp,
    HoldOptions,
    hand_grasp,
    hand_load,
    posture_torque,
)
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.hands.squeeze import squeeze_remark
from drake_polygrasp.pipeline.error_levels import bounded_levels, first_levels
from drake_polygrasp.pipeline.region_certificates import Errors


def hand_grasp_under_errors(
    object_: GraspObject,
    scene: HandScene,
    certified: CertifiedGrasp,
    held: HeldGrasp,
    errors: Sequence[Errors],
    hold: HoldOptions,
) -> tuple[int, HandGrasp]:
    """Returns a grasp that a hand holds with the greatest errors that leave it enough.

    Args:
        object_: the object, with the friction of contacts.
        scene: hand, object and what is around it.
        certified: the grasp, for exact contacts.
        held: how the hand holds it.
        errors: what it is tried for, greatest first.
        hold: what the hand's grasps must do.

    Returns:
        Index of the errors, their number for none; and the grasp, whose squeeze is as hard as its
        `region` asks for, where the hand's efforts allow that.
    """
    grasp = certified.grasp
    (found,) = first_levels(object_, [[grasp]], errors, range(len(errors)))
    if found is None:
        return len(errors), hand_grasp(scene, certified, held, hold.clearance)
    (bounded,) = bounded_levels(object_, [found[1]], errors, 1)
    certified = replace(certified, region=bounded.region)
    load = hand_load(scene, certified, hold)
    torque = posture_torque(scene, grasp, held.posture, load, hold.friction_share)
    assert isinstance(torque, HandTorque)  # the loads are those that it holds already
    held = held._replace(torque=torque)
    return bounded.level, hand_grasp(scene, certified, held, hold.clearance)


def weak_squeezes(object_: GraspObject, grasps: Sequence[HandGrasp]) -> tuple[str, ...]:
    """Returns sentences on grasps whose hand squeezes less than the errors that they bear ask for.

    Args:
        object_: the object.
        grasps: its grasps, best first.
    """
    remarks = [
        squeeze_remark(g.certified.grasp, g.certified.region, object_.mass, g.torque)
        for g in grasps
    ]
    return tuple(f"grasp {rank}: {remark}" for rank, remark in enumerate(remarks, 1) if remark)
