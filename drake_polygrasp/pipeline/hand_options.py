"""The options of a hand's grasps, checked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy.typing as npt

from drake_polygrasp.arguments import (
    check_instance,
    check_items,
    check_length,
    check_number,
    refuse,
)
from drake_polygrasp.arrays import frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.body_identity import check_same_body
from drake_polygrasp.geometry.exclusion import unit_direction
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.hand_search import HoldOptions
from drake_polygrasp.loading.surroundings import Surroundings, obstacles_of


def with_fingers(hand: Hand, fingers: Iterable[Iterable[str]] | None) -> Hand:
    """Returns a hand with the triples of tips that the user asks for.

    Args:
        hand: the hand.
        fingers: triples of names of tips; None for the hand's own.

    Raises:
        UsageError: when an item is no triple of the hand's tips, or there is none.
    """
    if fingers is None:
        return hand
    names = [tip.name for tip in hand.tips]
    triples = set()
    for item in check_items("fingers", fingers):
        triple = check_items("an item of fingers", item)
        if len(triple) != 3 or not all(name in names for name in triple) or len({*triple}) != 3:
            raise refuse(
                "an item of fingers", item, f"three different tips of the hand: {', '.join(names)}"
            )
        i, j, k = sorted(names.index(name) for name in triple)
        triples.add((i, j, k))
    if not triples:
        raise UsageError("fingers is empty; name at least one triple of tips, or leave it out")
    return replace(hand, fingers=tuple(sorted(triples)))


def hold_options(
    up_B: npt.ArrayLike | None,
    load_mass: float | None,
    friction_share: float,
    clearance: float,
    approach: float,
) -> HoldOptions:
    """Returns the checked options of postures and torques.

    Args:
        up_B: direction against gravity, shape (3,); None for every orientation.
        load_mass: mass that the torques must hold [kg]; None for the object's.
        friction_share: share of the contacts' friction that forces may use.
        clearance: distance that the hand keeps from all but its contacts [m].
        approach: length of the palm's straight way [m].

    Raises:
        UsageError: when one has the wrong type or value.
    """
    share = "a share of the friction, above 0 and at most 1"
    return HoldOptions(
        mass=None
        if load_mass is None
        else check_number("load_mass", load_mass, "a mass in kg, above 0", above=0.0),
        up_B=None if up_B is None else frozen(unit_direction(up_B, "up_B")),
        friction_share=check_number("friction_share", friction_share, share, above=0.0, most=1.0),
        clearance=check_length("clearance", clearance),
        approach=check_length("approach", approach),
    )


def obstacles_around(
    object_: GraspObject, surroundings: Surroundings | None, tip_radius: float
) -> Obstacles | None:
    """Returns the surroundings as what fingertips must not penetrate.

    Args:
        object_: the object.
        surroundings: what is around it; None for nothing.
        tip_radius: radius of the fingertips [m].

    Raises:
        UsageError: when the surroundings are none, or another body's.
        ModelError: when a shape has no surface.
    """
    if surroundings is None:
        return None
    source = "as surroundings_from_plant returns them"
    check_instance("surroundings", surroundings, Surroundings, source)
    check_same_body("surroundings", surroundings.body, object_.body)
    return obstacles_of(surroundings, object_, object_.polyhedron.diameter + 4 * tip_radius)
