"""Draws the hand that holds a grasp, at the grasp and before it closes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from pydrake.geometry import Meshcat, Rgba, Role, Shape, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RigidBody

from drake_polygrasp.arrays import Array
from drake_polygrasp.hand_grasp import HandPlacement
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.visualization.palette import CONTACTS, rgb
from drake_polygrasp.visualization.scene import PATH

_GHOST = 0.15
"""Opacity of the hand before it closes. Our choice."""
_SOLID = 0.9
_LARGER = 1.03
"""Radius of marked fingertips over the hand's own. Our choice."""
_PALM = 0.03
"""Part of a palm behind its frame [m], about."""
_PLAIN = Rgba(0.75, 0.77, 0.8, 1.0)
"""Colour of what the hand's model gives none."""


def draw_hands(
    meshcat: Meshcat, hand: Hand, placements: Sequence[HandPlacement | None], *, path: str = PATH
) -> None:
    """Draws a hand at each of several ranked grasps: solid at the grasp, faint before it closes.

        draw_grasps(meshcat, box, [each.certified for each in plan.grasps])
        draw_hands(meshcat, hand, plan.grasps)

    Args:
        meshcat: Meshcat in which `draw_grasps` has drawn the grasps.
        hand: the hand.
        placements: how it holds each of them, in their order; None where it does not.
        path: path below which they were drawn.
    """
    for rank, placement in enumerate(placements, start=1):
        for name, opacity in (("hand", _SOLID), ("pregrasp", _GHOST)):
            meshcat.Delete(f"{path}/grasps/{rank}/{name}")
            if placement is not None:
                _draw_bodies(meshcat, hand, f"{path}/grasps/{rank}/{name}", opacity)
        if placement is not None:
            _enlarge_tips(meshcat, hand, placement, f"{path}/grasps/{rank}")
            move_hand(meshcat, hand, placement, rank, 1.0, path=path)
            before = hand.joint_array(placement.pregrasp.q)
            _pose(meshcat, hand, placement.X_BPalm, before, f"{path}/grasps/{rank}/pregrasp")


def reach_of_hands(placements: Sequence[HandPlacement | None]) -> float:
    """Returns the distance from B's origin within which hands are, about, at their grasps [m].

    Args:
        placements: how hands hold grasps; None for grasps without a hand.
    """
    held = [placement.p_BPalm for placement in placements if placement is not None]
    return max((float(np.linalg.norm(p)) for p in held), default=-_PALM) + _PALM


def _enlarge_tips(meshcat: Meshcat, hand: Hand, placement: HandPlacement, path: str) -> None:
    """Draws the marks of fingertips around the hand's own tips, since equal spheres flicker."""
    radii = {tip.name: tip.radius for tip in hand.tips}
    for i, (name, colour) in enumerate(zip(placement.fingers, CONTACTS, strict=True), start=1):
        sphere = Sphere(_LARGER * radii[name])
        meshcat.SetObject(f"{path}/contact_{i}/fingertip", sphere, Rgba(*rgb(colour), 0.5))


def move_hand(
    meshcat: Meshcat,
    hand: Hand,
    placement: HandPlacement,
    rank: int,
    share: float,
    *,
    path: str = PATH,
) -> None:
    """Moves a hand that `draw_hands` has drawn along its way to the grasp.

    Args:
        meshcat: Meshcat in which it is drawn.
        hand: the hand.
        placement: how it holds the grasp.
        rank: rank of the grasp, from 1.
        share: 0 for the far end of its straight way, 0.5 for the open hand at the grasp, 1 for the
            closed one.
        path: path below which it was drawn.
    """
    before = placement.pregrasp
    along = before.distance * max(0.0, 1.0 - 2.0 * share)
    closed = min(max(2.0 * share - 1.0, 0.0), 1.0)
    opened, last = hand.joint_array(before.q), hand.joint_array(placement.q)
    X_BPalm = RigidTransform(np.asarray(along * before.direction_B)) @ placement.X_BPalm
    q = opened + closed * (last - opened)
    _pose(meshcat, hand, X_BPalm, q, f"{path}/grasps/{rank}/hand")


def _bodies(hand: Hand) -> Iterator[RigidBody]:
    plant = hand.in_plant.plant
    for index in plant.GetBodyIndices(hand.in_plant.instance):
        yield plant.get_body(index)


def _pose(meshcat: Meshcat, hand: Hand, X_BPalm: RigidTransform, q: Array, path: str) -> None:
    """Sets the poses of the hand's bodies in B."""
    context = hand.set_positions(q)
    for body in _bodies(hand):
        X_PalmL = body.body_frame().CalcPose(context, hand.in_plant.palm)
        meshcat.SetTransform(f"{path}/{body.name()}", X_BPalm @ X_PalmL)


def _draw_bodies(meshcat: Meshcat, hand: Hand, path: str, opacity: float) -> None:
    """Draws the shapes of the hand's bodies, each in its body's frame."""
    for body in _bodies(hand):
        for k, (shape, X_LG, colour) in enumerate(_shapes(hand, body)):
            here = f"{path}/{body.name()}/{k}"
            faded = Rgba(colour.r(), colour.g(), colour.b(), opacity * colour.a())
            meshcat.SetObject(here, shape, faded)
            meshcat.SetTransform(here, X_LG)


def _shapes(hand: Hand, body: RigidBody) -> Iterator[tuple[Shape, RigidTransform, Rgba]]:
    """Yields what a body looks like; its collision geometry where the model says nothing else."""
    plant, inspector = hand.in_plant.plant, hand.query(hand.lower).inspector()
    frame = plant.GetBodyFrameIdOrThrow(body.index())
    seen = inspector.GetGeometries(frame, Role.kIllustration)
    for geometry in seen or inspector.GetGeometries(frame, Role.kProximity):
        colour = _PLAIN
        properties = inspector.GetIllustrationProperties(geometry)
        if properties is not None:
            colour = properties.GetPropertyOrDefault("phong", "diffuse", _PLAIN)
        yield inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry), colour
