"""Draws a hand in postures in Meshcat."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import GeometryId, Meshcat, Rgba, Role, Sphere
from pydrake.math import RigidTransform

from drake_polygrasp.arrays import Array
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.visualization.marks import draw_arrow
from drake_polygrasp.visualization.palette import CONTACTS, rgb
from drake_polygrasp.visualization.scene import PATH

_BODY = Rgba(0.75, 0.77, 0.8, 1.0)
_ARROW = 3.0
"""Length of the arrow along a tip's axis, over the tip's radius. Our choice."""
_LARGER = 1.01
"""Radius of drawn tips over the tip's: equal spheres flicker. Our choice."""
_APART = 1.2
"""Distance between two postures side by side, over the hand's width. Our choice."""


def draw_hand(
    meshcat: Meshcat,
    hand: Hand,
    q: Array,
    *,
    path: str = f"{PATH}/hand",
    X_BPalm: RigidTransform | None = None,
) -> None:
    """Draws a hand's collision geometry in one posture, its tips' spheres and where they look.

    Args:
        meshcat: the Meshcat.
        hand: the hand.
        q: positions of its joints [rad or m], shape (n,).
        path: path below which it is drawn.
        X_BPalm: pose of the palm in the frame of `path` (default: identity).
    """
    query = hand.query(q)
    inspector = query.inspector()
    X_WP = hand.in_plant.palm.CalcPoseInWorld(hand.set_positions(q))
    X_BW = (X_BPalm or RigidTransform()) @ X_WP.inverse()
    geometries: list[GeometryId] = sorted(
        inspector.GetAllGeometryIds(Role.kProximity), key=lambda g: g.get_value()
    )
    for number, geometry in enumerate(geometries):
        name = f"{path}/links/{number}"
        meshcat.SetObject(name, inspector.GetShape(geometry), _BODY)
        meshcat.SetTransform(name, X_BW @ query.GetPoseInWorld(geometry))
    p_PT, axis_P = hand.tip_points(q)
    X_BP = X_BPalm or RigidTransform()
    for i, tip in enumerate(hand.tips):
        name, colour = f"{path}/tips/{tip.name}", CONTACTS[i % len(CONTACTS)]
        meshcat.SetObject(f"{name}/sphere", Sphere(_LARGER * tip.radius), Rgba(*rgb(colour), 0.6))
        meshcat.SetTransform(f"{name}/sphere", RigidTransform(X_BP @ p_PT[i]))
        axis_B = _ARROW * tip.radius * (X_BP.rotation() @ axis_P[i])
        draw_arrow(meshcat, f"{name}/axis", X_BP @ p_PT[i], axis_B, 0.1 * tip.radius, colour)


def draw_hand_postures(meshcat: Meshcat, hand: Hand, q: Array, *, path: str = PATH) -> None:
    """Draws a hand in several postures side by side.

    Args:
        meshcat: the Meshcat.
        hand: the hand.
        q: the postures [rad or m], shape (N, n).
        path: path below which they are drawn.
    """
    tips = np.array([hand.tip_points(posture)[0] for posture in q]).reshape(-1, 3)
    width = _APART * 2 * float(np.abs(tips).max(initial=0.05))
    for k, posture in enumerate(q):
        offset = RigidTransform([width * (k - 0.5 * (len(q) - 1)), 0.0, 0.0])
        draw_hand(meshcat, hand, posture, path=f"{path}/posture {k + 1}", X_BPalm=offset)
