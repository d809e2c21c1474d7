"""Reports whether the fingertips of a simulation held the object, and how far it slipped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.plant.harness import GraspRecord, tangential

_MAX_SLIP = 0.01
"""Times L: an object of which a contact slips farther is not held. Our choice."""


class Event(NamedTuple):
    """The first time at which a contact slips or is lost.

    Attributes:
        time: time [s].
        phase: name of the phase of the hand's motion.
    """

    time: float
    phase: str


@dataclass(frozen=True)
class GraspReport:
    """Motion of an object in the hand since the squeeze ended, and whether it was held.

    Drift, turn and slip are maxima over the time since the squeeze ended.

    Attributes:
        disturbance: distance that the centre of mass moved in the hand during the squeeze [m].
        force_error: greatest deviation of a normal force at its end, over the mean planned force.
        drift: displacement of the centre of mass in the hand [m].
        turn: rotation angle of the object in the hand [rad].
        slip: displacement of each contact across the normal of its fingertip [m].
        max_slip: greatest slip that counts as held [m].
        slipped: when a contact first slipped farther than `max_slip`, or None.
        lost: for each fingertip, when its normal force was first zero, or None.
        raised: height of the centre of mass in W at the end, minus that at the start [m].
    """

    disturbance: float
    force_error: float
    drift: float
    turn: float
    slip: tuple[float, float, float]
    max_slip: float
    slipped: Event | None
    lost: tuple[Event | None, ...]
    raised: float

    @property
    def held(self) -> bool:
        """Whether no contact slipped farther than `max_slip` and none was lost."""
        return self.slipped is None and not any(self.lost)

    @property
    def verdict(self) -> str:
        """The verdict as text: "HELD", or "DROPPED" with what happened first and when."""
        if self.held:
            return "HELD"
        first = min(event for event in (self.slipped, *self.lost) if event)
        what = "slips" if first == self.slipped else "is let go"
        return f"DROPPED: it {what} at {first.time:.2f} s, in {first.phase}"

    def __str__(self) -> str:
        turn = np.rad2deg(self.turn)
        slip = ", ".join(f"{1e3 * s:.2f}" for s in self.slip)
        lost = [f"{i} in {e.time:.2f} s ({e.phase})" for i, e in enumerate(self.lost, 1) if e]
        return "\n".join(
            [
                f"moved before the lift  {1e3 * self.disturbance:.3f} mm",
                f"normal forces off by   {1e2 * self.force_error:.1f} %",
                f"drift in the hand      {1e3 * self.drift:.2f} mm, {turn:.2f} deg",
                f"slip of the contacts   {slip} mm, of at most {1e3 * self.max_slip:.2f}",
                f"contacts lost          {', '.join(lost) or 'none'}",
                f"raised by              {1e3 * self.raised:.1f} mm",
                self.verdict,
            ]
        )


def report_grasp(
    record: GraspRecord,
    phases: Sequence[str],
    start: int,
    p_BC: Array,
    nhat_H: Array,
    p_BBcm: Array,
    diameter: float,
) -> GraspReport:
    """Reports how far an object moved in the hand after the squeeze, and whether it was held.

    Args:
        record: the simulation, N samples.
        phases: name of the phase of the hand's motion at each sample, at least N.
        start: index of the sample at which the squeeze has ended and the lift has not begun.
        p_BC: contact points [m], shape (3, 3).
        nhat_H: unit normals in H along which the fingertips slide, shape (3, 3).
        p_BBcm: centre of mass [m], shape (3,).
        diameter: diameter L of the object [m].

    Returns:
        The report.
    """
    points = np.vstack([p_BC, p_BBcm])
    p_H = np.array([X_HB.multiply(points.T).T for X_HB in record.X_HB])
    across = tangential(p_H[:, :3], nhat_H)
    slip = np.linalg.norm(across - across[start], axis=2)
    drift = np.linalg.norm(p_H[:, 3] - p_H[start, 3], axis=1)
    R_HB = [X_HB.rotation() for X_HB in record.X_HB]
    turn = [R_HB[start].InvertAndCompose(R).ToAngleAxis().angle() for R in R_HB[start:]]
    planned = record.planned_force[start]
    height = [X_WB.multiply(p_BBcm)[2] for X_WB in (record.X_WB[0], record.X_WB[-1])]

    def first(happens: Bools) -> Event | None:
        when = np.flatnonzero(happens[start:]) + start
        return Event(float(record.time[when[0]]), phases[when[0]]) if len(when) else None

    a, b, c = slip[start:].max(axis=0).tolist()
    return GraspReport(
        disturbance=float(drift[0]),
        force_error=float(np.abs(record.normal_force[start] - planned).max() / planned.mean()),
        drift=float(drift[start:].max()),
        turn=float(max(turn)),
        slip=(a, b, c),
        max_slip=_MAX_SLIP * diameter,
        slipped=first((slip > _MAX_SLIP * diameter).any(axis=1)),
        lost=tuple(first(force <= 0) for force in record.normal_force.T),
        raised=float(height[1] - height[0]),
    )
