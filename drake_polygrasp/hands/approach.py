"""Finds how a hand comes to its posture: fingers open along the normals, and a straight way."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.digits import at_most
from drake_polygrasp.geometry.triangles import face_frame
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.hand_grasp import HandRefusal, Pregrasp
from drake_polygrasp.hands.measured_posture import Posture, tip_places
from drake_polygrasp.hands.scene import Fingers, HandScene
from drake_polygrasp.vectors import unit

DISTANCE = 0.10
"""Length of the straight way of the palm [m]. Our choice."""
OPENINGS = (0.015, 0.025, 0.008)
"""How far tips back off along their normals, tried in turn [m]. Our choice."""
WAY_SAMPLES, CLOSING_SAMPLES = 12, 6
"""Postures that are checked on the way, and while the fingers close. Our choice."""
TILTS = (math.radians(25.0), math.radians(50.0))
"""Angles between ways and the palm's axis, tried last. Our choice."""
_AZIMUTHS = 8
"""Ways of each tilt."""
_TURN_LENGTH = 0.02
"""Turning a tip by 1 rad counts as much as moving it by this [m]. Our choice."""
_STEPS, _DAMPING = 12, 0.005
"""Steps of the iteration that opens fingers, and its damping [m/rad]. Our choice."""
_LEAST_PART = 0.5
"""Part of an opening that every tip must have moved along its normal. Our choice: it moves less
where a joint reaches its limit, and never more sideways than along the normal."""
_TOUCH = 1e-4
"""How far a tip's sphere may be in the true surface while it moves [m]: its place is known to
less than that."""
_DECIMALS = 7
"""Decimals of joint positions [rad], as for postures."""


def find_pregrasp(
    scene: HandScene,
    grasp: Grasp,
    posture: Posture,
    distance: float = DISTANCE,
    up_B: Array | None = None,
) -> Pregrasp | HandRefusal:
    """Finds a posture before closing and a straight way of the palm, both free of overlaps.

    Args:
        scene: hand, object and what is around it.
        grasp: three contacts.
        posture: the posture in which tips touch them.
        distance: length of the way [m].
        up_B: unit vector against gravity, shape (3,), along which ways are tried too (default:
            unknown).

    Returns:
        The pregrasp; or a refusal, "no_opening" or "no_approach".
    """
    opened = False
    for q, opening in _openings(scene, grasp, posture):
        if not closes_freely(scene, posture.fingers, posture.X_BPalm, q, posture.q):
            continue
        opened = True
        for direction_B in _ways(scene, posture.X_BPalm, up_B):
            way = frozen(np.round(direction_B, _DECIMALS + 2))
            if way_is_free(scene, posture.fingers, posture.X_BPalm, q, way, distance):
                return Pregrasp(scene.hand.joint_dict(q), way, distance, at_most(opening))
    if not opened:
        return HandRefusal("no_opening", "the fingers find no room to open along the normals", {})
    return HandRefusal(
        "no_approach",
        f"no straight way of {100 * distance:.0f} cm to the object is free for the open hand",
        {"distance": distance},
    )


def closes_freely(
    scene: HandScene, fingers: Fingers, X_BPalm: RigidTransform, q_open: Array, q_closed: Array
) -> bool:
    """Returns whether nothing overlaps while the joints move straight from one posture to another.

    Args:
        scene: hand, object and what is around it.
        fingers: indices of the tips that touch the object in the end.
        X_BPalm: pose of the palm frame in B.
        q_open: joint positions before [rad or m], shape (n,).
        q_closed: joint positions in the end, shape (n,).
    """
    shares = np.arange(CLOSING_SAMPLES) / CLOSING_SAMPLES
    return all(
        _is_free(scene, fingers, X_BPalm, q_open + share * (q_closed - q_open)) for share in shares
    )


def way_is_free(
    scene: HandScene,
    fingers: Fingers,
    X_BPalm: RigidTransform,
    q: Array,
    direction_B: Array,
    distance: float,
) -> bool:
    """Returns whether nothing overlaps while the palm moves straight, its joints at rest.

    Args:
        scene: hand, object and what is around it.
        fingers: indices of the tips that will touch the object.
        X_BPalm: pose of the palm frame in B at the near end of the way.
        q: joint positions [rad or m], shape (n,).
        direction_B: unit vector away from the object, shape (3,).
        distance: length of the way [m].
    """
    for along in np.linspace(0.0, distance, WAY_SAMPLES):
        moved = RigidTransform(np.asarray(along * direction_B)) @ X_BPalm
        if not _is_free(scene, fingers, moved, q):
            return False
    return True


def _is_free(scene: HandScene, fingers: Fingers, X_BPalm: RigidTransform, q: Array) -> bool:
    """Returns whether the hand overlaps nothing, its exact tips measured to the true surface."""
    context = scene.context(fingers)
    scene.place(context, X_BPalm, q)
    if scene.overlap(context) > 0:
        return False
    for k in fingers:
        if any(d < 0 for d in scene.distances(context, scene.link_pairs(k))):
            return False
        if any(d < -scene.misfits[k] for d in scene.distances(context, scene.tip_pairs(k))):
            return False
    p_BT, _ = scene.tips(context, fingers)
    polyhedron = scene.object_.polyhedron
    for p, k in zip(p_BT, fingers, strict=True):
        room = scene.hand.tips[k].radius - _TOUCH
        if polyhedron.surface.within(p[None], room)[0]:
            return False
        for solid in (*polyhedron.primitives, *polyhedron.covering):
            if solid.distance(p[None])[0] < room:
                return False
    return True


def _openings(scene: HandScene, grasp: Grasp, posture: Posture) -> Iterator[tuple[Array, float]]:
    """Yields joint positions whose tips are backed off along their normals, and by how much."""
    for opening in OPENINGS:
        for turn_length in (_TURN_LENGTH, 0.0):
            found = _back_off(scene, grasp, posture, opening, turn_length)
            if found is not None:
                yield found


def _back_off(
    scene: HandScene, grasp: Grasp, posture: Posture, opening: float, turn_length: float
) -> tuple[Array, float] | None:
    """Moves the used tips off the object; returns also how far, or None if it is too little."""
    hand, context = scene.hand, scene.context(posture.fingers)
    independent = scene.independent
    lower, upper, units = hand.lower[independent], hand.upper[independent], hand.joint_units
    target = tip_places(scene, grasp, posture.fingers) - opening * grasp.nhat_TB_B
    z = posture.q[independent]
    scene.place(context, posture.X_BPalm, posture.q)
    R_start = [scene.tip_rotation(context, k) for k in posture.fingers]
    for _ in range(_STEPS):
        scene.place(context, posture.X_BPalm, hand.E @ z + hand.e0)
        p_BT, _ = scene.tips(context, posture.fingers)
        J = scene.jacobians(context, posture.fingers, p_BT) @ hand.E * units
        J[:, :3] *= turn_length
        turned = [
            turn_length * _small_turn(R @ scene.tip_rotation(context, k).inverse())
            for R, k in zip(R_start, posture.fingers, strict=True)
        ]
        missing = np.hstack([turned, target - p_BT]).ravel()
        room = (z - lower) / units, (upper - z) / units
        z = np.clip(z + units * _step(J.reshape(18, -1), missing, *room), lower, upper)
    z = np.round(z, _DECIMALS)
    q = np.round(hand.E @ z + hand.e0, _DECIMALS + 3)
    scene.place(context, posture.X_BPalm, q)
    p_BT, _ = scene.tips(context, posture.fingers)
    moved = p_BT - tip_places(scene, grasp, posture.fingers)
    along = -(moved * grasp.nhat_TB_B).sum(axis=1)
    sideways = np.linalg.norm(moved + along[:, None] * grasp.nhat_TB_B, axis=1)
    within = (q >= hand.lower - 1e-9).all() and (q <= hand.upper + 1e-9).all()
    if not within or (along < _LEAST_PART * opening).any() or (sideways > along).any():
        return None
    return q, float(along.min())


def _step(J: Array, missing: Array, room_below: Array, room_above: Array) -> Array:
    """Returns a damped Gauss-Newton step in joint units that moves no joint out of its limits."""
    free = np.ones(J.shape[1], dtype=bool)
    step = np.zeros(J.shape[1])
    for _ in range(2):  # Joints that the first step moves out stay where they are in the second.
        part = J[:, free]
        step[:] = 0.0
        step[free] = part.T @ np.linalg.solve(
            part @ part.T + _DAMPING**2 * np.eye(len(part)), missing
        )
        free = (step <= room_above) & (step >= -room_below)
        if free.all():
            break
    return np.asarray(np.clip(step, -room_below, room_above))


def _small_turn(R: RotationMatrix) -> Array:
    """Returns the rotation vector of a small rotation, about."""
    skew = (R.matrix() - R.matrix().T) / 2
    return np.array([skew[2, 1], skew[0, 2], skew[1, 0]])


def _ways(scene: HandScene, X_BPalm: RigidTransform, up_B: Array | None) -> Iterator[Array]:
    """Yields directions in which the palm may leave the object, the likeliest first."""
    back_B = X_BPalm.rotation().multiply(-scene.hand.approach_P)
    yield back_B
    if up_B is not None:
        yield up_B
        halfway = back_B + up_B
        if halfway @ halfway > 0:
            yield unit(halfway)
    u, v, _ = face_frame(back_B).T
    for tilt in TILTS:
        for k in range(_AZIMUTHS):
            angle = 2 * math.pi * k / _AZIMUTHS
            across = math.cos(angle) * u + math.sin(angle) * v
            yield math.cos(tilt) * back_B + math.sin(tilt) * across
