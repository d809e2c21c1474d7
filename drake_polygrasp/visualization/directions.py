"""Draws why orientation rejects a set of faces: its friction cones on the sphere of directions."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from drake_polygrasp.arrays import Array
from drake_polygrasp.paper.orientation import least_ball_centre
from drake_polygrasp.paper.planar import orthonormal_pair
from drake_polygrasp.paper.trace_result import SetTrace
from drake_polygrasp.vectors import unit
from drake_polygrasp.visualization.palette import CONTACTS, HATCHES, INK, OBJECT


def draw_directions(ax: Axes, trace: SetTrace) -> None:
    """Draws normals n_i and friction cones by their angles from one direction d.

    d is the axis of the least cap around the normals. If all cones are within 90 degrees of d,
    every force in them has a positive component along d, so the forces cannot cancel and
    orientation rejects the set.

    Args:
        ax: axes to draw on; distances from the centre are angles from d [degrees].
        trace: the set of faces, as `trace_set` returns it.
    """
    ax.set_title(r"directions (4): $n_i$ and cones by their angle from $d$")
    ax.set_aspect("equal")
    ax.set_axis_off()
    nhat_B = trace.nhat_TB_B[: len({*trace.faces})]
    dhat_B = unit(least_ball_centre(trace.nhat_TB_B))
    clear = _widest_gap(_angles(dhat_B, nhat_B))
    for angle in (30, 60, 90):
        width = 1.8 if angle == 90 else 0.6
        ax.add_patch(Circle((0, 0), angle, fill=False, edgecolor=INK, linewidth=width))
        at = angle * clear
        blank = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none"}
        ax.text(at[0], at[1], f"{angle}°", ha="center", va="center", fontsize=8, bbox=blank)
    for i, nhat_i in enumerate(nhat_B):
        rim = _angles(dhat_B, _circle(nhat_i, trace.alpha))
        style = {"color": CONTACTS[i], "alpha": 0.35, "hatch": HATCHES[i]}
        ax.add_patch(Polygon(rim, label=f"cone {i + 1}", **style))  # type: ignore[arg-type]
        at = _angles(dhat_B, nhat_i[None])[0]
        ax.plot(*at, "o", color=CONTACTS[i], markeredgecolor="white", markersize=8)
        # Labels are on different sides, because normals may coincide.
        ax.annotate(f"$n_{i + 1}$", at, ((6, 7), (-17, 7), (6, -14))[i], textcoords="offset points")
    ax.plot(0, 0, "+", color=INK, markersize=9, label="$d$", linestyle="none")
    ax.set(xlim=(-100, 100), ylim=(-118, 100))
    text = "all forces have a part along $d$: they cannot cancel"
    ax.text(0, -112, text, ha="center", color=INK)
    ax.legend(loc="upper left", frameon=False, fontsize=9, edgecolor=OBJECT)


def _circle(axis: Array, half_angle: float) -> Array:
    """Returns unit vectors at an angle [rad] from an axis, shape (K, 3)."""
    u, v = (vector[0] for vector in orthonormal_pair(axis[None]))
    turn = np.linspace(0, 2 * np.pi, 72, endpoint=False)[:, None]
    around = np.cos(turn) * u + np.sin(turn) * v
    return np.asarray(np.cos(half_angle) * axis + np.sin(half_angle) * around)


def _widest_gap(points: Array) -> Array:
    """Returns the direction farthest from those of points, shape (K, 2), as a unit vector, (2,)."""
    around = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    gaps = np.diff(around, append=around[0] + 2 * np.pi)
    widest = int(np.argmax(gaps))
    middle = around[widest] + gaps[widest] / 2
    return np.array([np.cos(middle), np.sin(middle)])


def _angles(dhat_B: Array, vhat_B: Array) -> Array:
    """Places unit vectors, shape (K, 3), by their angles from d [degrees], shape (K, 2)."""
    u, v = (vector[0] for vector in orthonormal_pair(dhat_B[None]))
    xy = vhat_B @ np.array([u, v]).T
    sine = np.linalg.norm(xy, axis=1, keepdims=True)
    angle = np.degrees(np.arctan2(sine, (vhat_B @ dhat_B)[:, None]))
    return np.asarray(angle * xy / np.maximum(sine, 1e-12))
