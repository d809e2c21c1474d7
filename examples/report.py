"""What became of an object that was picked up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.math import RigidTransform

from drake_polygrasp.arrays import Array, Bools
from examples.motion import Motion

MAX_SLIP = 0.01
"""Times L: a contact that slips farther on its fingertip is not held."""


@dataclass(frozen=True, eq=False)
class Record:
    """What was seen, N samples; fewer than commanded when the object was lost."""

    X_HB: tuple[RigidTransform, ...]
    """Of the object in the carriage."""
    height: Array
    """Of its centre of mass above the table [m], shape (N,)."""
    push: Array
    """Of the tips on the object, along the normals [N], shape (N, 3)."""
    command: Array
    """What the tips were told to push [N], shape (N, 3)."""


class Event(NamedTuple):
    """When something first happened."""

    time: float
    """[s]"""
    phase: str


@dataclass(frozen=True)
class Report:
    """How it went. Drift, turn and slip are the greatest from the end of the squeeze on."""

    disturbance: float
    """How far the object was moved before it was lifted [m]."""
    push_error: float
    """Of the normal forces by then, over their mean."""
    drift: float
    """Of the centre of mass in the carriage [m]."""
    turn: float
    """Of the object in the carriage [rad]."""
    slip: tuple[float, float, float]
    """Of each contact across the normal of its tip [m]."""
    max_slip: float
    """What still counts as held [m]."""
    slipped: Event | None
    """When a contact first went beyond."""
    lost: tuple[Event | None, ...]
    """When each tip first pushed nothing."""
    raised: float
    """The object, in the end [m]."""

    @property
    def held(self) -> bool:
        """Whether no contact slipped and none was lost."""
        return self.slipped is None and not any(self.lost)

    def __str__(self) -> str:
        turn = np.rad2deg(self.turn)
        slip = ", ".join(f"{1e3 * s:.2f}" for s in self.slip)
        lost = [f"{i} in {e.time:.2f} s ({e.phase})" for i, e in enumerate(self.lost, 1) if e]
        return "\n".join(
            [
                f"moved before the lift  {1e3 * self.disturbance:.3f} mm",
                f"normal forces off by   {1e2 * self.push_error:.1f} %",
                f"drift in the hand      {1e3 * self.drift:.2f} mm, {turn:.2f} deg",
                f"slip of the contacts   {slip} mm, of at most {1e3 * self.max_slip:.2f}",
                f"contacts lost          {', '.join(lost) or 'none'}",
                f"raised by              {1e3 * self.raised:.1f} mm",
                self.verdict,
            ]
        )

    @property
    def verdict(self) -> str:
        """Whether it was held, and if not, since when."""
        if self.held:
            return "HELD"
        first = min(event for event in (self.slipped, *self.lost) if event)
        what = "slips" if first == self.slipped else "is let go"
        return f"DROPPED: it {what} at {first.time:.2f} s, in {first.phase}"


def judge(
    record: Record, motion: Motion, p_BC: Array, nhat_H: Array, p_BBcm: Array, diameter: float
) -> Report:
    """Sum up what was seen.

    Args:
        record: what was seen.
        motion: what the hand did.
        p_BC: contacts [m], shape (3, 3).
        nhat_H: normals along which the tips slide in the carriage, shape (3, 3).
        p_BBcm: centre of mass [m], shape (3,).
        diameter: of the object, L [m].
    """
    points = np.vstack([p_BC, p_BBcm])
    p_H = np.array([X_HB.multiply(points.T).T for X_HB in record.X_HB])
    start = motion.lift_off
    moved = p_H - p_H[start]
    along = np.einsum("nij,ij->ni", moved[:, :3], nhat_H)
    slip = np.linalg.norm(moved[:, :3] - along[..., None] * nhat_H, axis=2)
    R_HB = [X_HB.rotation() for X_HB in record.X_HB]
    turn = [R_HB[start].InvertAndCompose(R).ToAngleAxis().angle() for R in R_HB[start:]]
    error = np.abs(record.push[start] - record.command[start]).max() / record.command[start].mean()
    a, b, c = slip[start:].max(axis=0).tolist()
    return Report(
        disturbance=float(np.linalg.norm(p_H[start, 3] - p_H[0, 3])),
        push_error=float(error),
        drift=float(np.linalg.norm(moved[start:, 3], axis=1).max()),
        turn=float(max(turn)),
        slip=(a, b, c),
        max_slip=MAX_SLIP * diameter,
        slipped=_first((slip > MAX_SLIP * diameter).any(axis=1), motion),
        lost=tuple(_first(push <= 0, motion) for push in record.push.T),
        raised=float(record.height[-1] - record.height[0]),
    )


def _first(happens: Bools, motion: Motion) -> Event | None:
    """From the last sample before the lift on."""
    when = np.flatnonzero(happens[motion.lift_off :]) + motion.lift_off
    return Event(float(motion.time[when[0]]), motion.phase[when[0]]) if len(when) else None
