"""An independent judge of three contacts: linear programs over polygonal friction cones.

It shares no code with the package. A regular polygon inside the friction circle judges too
strictly, one around it too leniently; what holds strictly holds, what fails leniently fails.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Array = NDArray[np.float64]


def polygon_wrenches(
    p: Array, n: Array, mu: Array, *, sides: int, around: bool, centre: Array, length: float
) -> Array:
    """Wrenches (force, torque / length) of the cones' edges, shape (6, 3 * sides)."""
    angles = 2 * np.pi * np.arange(sides) / sides
    columns = []
    for p_i, n_i, mu_i in zip(p, n, mu, strict=True):
        _, _, tangents = np.linalg.svd(n_i[None])
        radius = mu_i / np.cos(np.pi / sides) if around else mu_i
        rim = np.outer(np.cos(angles), tangents[1]) + np.outer(np.sin(angles), tangents[2])
        forces = n_i + radius * rim
        columns.append(np.hstack([forces, np.cross(p_i - centre, forces) / length]).T)
    return np.hstack(columns)


def _natural(p: Array) -> dict[str, Array | float]:
    centre = p.mean(axis=0)
    return {"centre": centre, "length": np.linalg.norm(p - centre, axis=1).max()}


def is_force_closure(p: Array, n: Array, mu: Array, *, around: bool, sides: int = 24) -> bool:
    """Whether strictly positive combinations of the edges balance and the edges span."""
    G = polygon_wrenches(p, n, mu, sides=sides, around=around, **_natural(p))
    singular = np.linalg.svd(G, compute_uv=False)
    if singular[5] < 1e-6 * singular[0]:
        return False
    num = G.shape[1]
    # Edge forces are t + s with s >= 0: all of them at least t.
    A = np.vstack([np.hstack([G, G.sum(axis=1, keepdims=True)]), np.append(np.ones(num), num)])
    best = linprog(
        np.append(np.zeros(num), -1.0), A_eq=A, b_eq=np.append(np.zeros(6), 1.0), method="highs"
    )
    return best.status == 0 and -best.fun > 1e-8


def greatest_margin(p: Array, n: Array, mu: Array, *, around: bool, sides: int = 64) -> float:
    """The largest t with (nhat.f - t / 3, tangential f) in every polygonal cone, sum nhat.f = 1."""
    G = polygon_wrenches(p, n, mu, sides=sides, around=around, **_natural(p))
    plain = polygon_wrenches(p, n, 0 * mu, sides=1, around=False, **_natural(p))
    num = G.shape[1]
    A = np.vstack([np.hstack([G, plain.sum(axis=1, keepdims=True) / 3]), np.ones(num + 1)])
    best = linprog(
        np.append(np.zeros(num), -1.0), A_eq=A, b_eq=np.append(np.zeros(6), 1.0), method="highs"
    )
    return -best.fun if best.status == 0 else -np.inf


def least_normal_force(
    p: Array, n: Array, mu: Array, force: Array, p_cm: Array, *, around: bool, sides: int = 64
) -> float:
    """The least total normal force that applies a force through the centre of mass."""
    G = polygon_wrenches(p, n, mu, sides=sides, around=around, centre=p_cm, length=1.0)
    wrench = np.append(force, np.zeros(3))
    best = linprog(np.ones(G.shape[1]), A_eq=G, b_eq=wrench, method="highs")
    return best.fun if best.status == 0 else np.inf
