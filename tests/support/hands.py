"""Hands and hand grasps that several tests share, made once."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from drake_polygrasp import load_object, plan_grasps
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.hand_grasp import HandGrasp
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.hand_search import HandSearch, HoldOptions, hand_grasp
from drake_polygrasp.hands.library import make_reach
from drake_polygrasp.hands.model import load_hand
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.search.reach import Reach

MODELS = Path(__file__).parents[2] / "models"
OWN_HAND = MODELS / "hands" / "three_finger" / "three_finger.hand.yaml"
OWN_MODEL = OWN_HAND.with_name("three_finger.sdf")
CUBE = MODELS / "cube" / "cube.sdf"
TIP_RADIUS = 0.01
"""That of the tips of our own hand [m]."""
PATIENCE = 3600.0
"""A budget of searches for postures [s] that no machine is too slow for."""


@cache
def own_hand() -> Hand:
    return load_hand(OWN_HAND)


@cache
def own_reach() -> Reach:
    return make_reach(own_hand(), num=4000)


@cache
def planned(model: Path) -> tuple[GraspObject, tuple[CertifiedGrasp, ...]]:
    """An object, and grasps of it with room for the tips of our own hand."""
    object_ = load_object(model)
    plan = plan_grasps(object_, tip_radius=TIP_RADIUS, edge_clearance=0.003, top=4)
    return object_, tuple(plan.grasps)


@cache
def own_hand_grasps(model: Path, mass: float = 0.15, up: bool = False) -> tuple[HandGrasp, ...]:
    """How our own hand holds planned grasps of an object."""
    object_, grasps = planned(model)
    scene = HandScene(own_hand(), object_)
    options = HoldOptions(mass=mass, up_B=np.array([0.0, 0.0, 1.0]) if up else None)
    found = dict(HandSearch(scene, own_reach(), grasps, options).run(PATIENCE))
    return tuple(hand_grasp(scene, grasps[k], found[k]) for k in sorted(found))
