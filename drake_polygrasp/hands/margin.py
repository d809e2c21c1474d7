"""Measures how far a hand's grasp is from what it must not do."""

from __future__ import annotations

import numpy as np

from drake_polygrasp.hand_grasp import HandTorque
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.measured_posture import Posture


def hand_margin(hand: Hand, posture: Posture, torque: HandTorque, least_clearance: float) -> float:
    """Returns the least of what is left of efforts, joint limits, clearance and tip angle, 0 to 1.

    Each is 0 at its bound, and 1 as far from it as may be, or at twice the least clearance.

    Args:
        hand: the hand.
        posture: a posture of it that keeps all bounds.
        torque: torques that hold the object; unknown shares are left out.
        least_clearance: least clearance with which postures are accepted [m].
    """
    half = (hand.upper - hand.lower) / 2
    room = np.minimum(posture.q - hand.lower, hand.upper - posture.q)
    limited = np.isfinite(half) & (half > 0)
    left = [
        *(room[limited] / half[limited]).tolist(),
        1.0 - posture.tip_angle / hand.description.max_angle,
        1.0 if least_clearance == 0 else posture.clearance / least_clearance - 1.0,
    ]
    if torque.share is not None:
        left.append(1.0 - torque.share)
    return float(np.clip(min(left), 0.0, 1.0))
