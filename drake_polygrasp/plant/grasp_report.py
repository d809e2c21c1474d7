"""Whether an object was held by the fingertips of a simulation, and how far it moved in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.plant.harness import GraspRecord, tangential

_MAX_SLIP = 0.01
"""Times L, our choice: a contact that slips farther on its fingertip is not held."""


class Event(NamedTuple):
    """When something first happened, and in which phase.

    Attributes:
        time: [s].
        phase: what the hand was doing.
    """

    time: float
    phase: str


@dataclass(frozen=True)
class GraspReport:
    """How an object was held. Drift, turn and slip are the greatest since the squeeze ended.

    Attributes:
        disturbance: how far the centre of mass moved in the hand before [m].
        force_error: of the normal forces by then, over their mean.
        drift: of the centre of mass in the hand [m].
        turn: of the object in the hand [rad].
        slip: of each contact across the normal of its fingertip [m].
        max_slip: slip that still counts as held [m].
        slipped: when a contact first slipped farther, or None.
        lost: for each fingertip, when it first pushed nothing, or None.
        raised: how much higher the centre of mass ended than it started [m].
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
        """Whether no contact slipped and none was lost."""
        return self.slipped is None and not any(self.lost)

    @property
    def verdict(self) -> str:
        """Whether it was held, and if not, since when."""
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
    """Sums up how an object was held from the end of the squeeze on.

    Args:
        record: what was simulated, N samples.
        phases: what the hand was doing, at least N of them.
        start: the sample at which the squeeze has ended and nothing has been lifted yet.
        p_BC: contacts [m], shape (3, 3).
        nhat_H: normals along which the fingertips slide in the hand, shape (3, 3).
        p_BBcm: centre of mass [m], shape (3,).
        diameter: of the object, L [m].

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
