"""How the hand moves: from rest to rest, in steps of smooth acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAMPLE = 0.01
"""[s] between commands, and between what is recorded."""
STROKE = 0.25
"""[s] for a stroke of the shaking."""
X, Y, Z = np.eye(3)


@dataclass(frozen=True)
class Task:
    """What to do with an object that has been squeezed."""

    lift: float = 0.1
    """[m]"""
    shake: float = 3.0
    """Greatest acceleration [m/s^2]."""
    rounds: int = 2
    """Of shaking: out and back along x and along y, every other one to the other side."""
    hold: float = 2.0
    """At rest, after all else [s]."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Of the carriage H, N samples."""

    phase: tuple[str, ...]
    """approach, squeeze, lift, shake or hold."""
    progress: Array
    """Within each step, above 0 and up to 1, shape (N,)."""
    p_WH: Array
    """[m], shape (N, 3)."""
    a_WH: Array
    """[m/s^2], shape (N, 3)."""

    @property
    def time(self) -> Array:
        """[s], shape (N,)."""
        return SAMPLE * np.arange(len(self.phase), dtype=np.float64)

    @property
    def lift_off(self) -> int:
        """The last sample before the lift."""
        return self.phase.index("lift") - 1

    def progress_in(self, phase: str) -> Array:
        """0 before a phase, its progress in it, 1 after it, shape (N,)."""
        during = np.array(self.phase) == phase
        after = np.arange(len(during)) > np.flatnonzero(during)[-1]
        return np.asarray(np.where(during, self.progress, after.astype(float)))


def plan_motion(task: Task) -> Motion:
    """Each step takes one period of a sine of acceleration."""
    reach = task.shake * STROKE**2 / (2 * np.pi)
    sides = [s * (-1) ** k for k in range(task.rounds) for s in (1, -1)]
    shake = [side * reach * axis for axis in (X, Y) for side in sides]
    steps = [
        ("approach", 0.5, 0 * Z),
        ("squeeze", 0.4, 0 * Z),
        ("lift", 0.3 + 7.0 * task.lift, task.lift * Z),
        *(("shake", STROKE, stroke) for stroke in shake),
        ("hold", task.hold, 0 * Z),
    ]
    phase: list[str] = []
    progress, p_WH, a_WH = [], [np.zeros((1, 3))], []
    for name, duration, stroke in steps:
        n = round(duration / SAMPLE)
        tau = np.arange(1, n + 1) / n
        phase += [name] * n
        progress.append(tau - np.sin(2 * np.pi * tau) / (2 * np.pi))
        p_WH.append(p_WH[-1][-1] + np.outer(progress[-1], stroke))
        a_WH.append(np.outer(2 * np.pi * np.sin(2 * np.pi * tau), stroke) / (n * SAMPLE) ** 2)
    return Motion(
        tuple(phase), np.concatenate(progress), np.concatenate(p_WH[1:]), np.concatenate(a_WH)
    )
