"""What figures of the paper's planes are drawn with: metres here, mm on the axes."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.transforms import ScaledTranslation

from drake_polygrasp.arrays import Array
from drake_polygrasp.visualization.palette import CONTACTS, HATCHES, INK

MM = 1e3
"""Per metre."""


def prepare(ax: Axes, title: str, shapes: Any) -> None:
    """Limits that show all shapes, whatever is drawn across them later."""
    box = MM * shapely.total_bounds(shapes)
    margin = 0.12 * max(box[2] - box[0], box[3] - box[1])
    ax.set_xlim(box[0] - margin, box[2] + margin)
    ax.set_ylim(box[1] - margin, box[3] + margin)
    ax.set_aspect("equal")
    ax.set_title(f"{title} [mm]")


def reach_of(shapes: Any) -> float:
    """Longer than anything in view [m]."""
    return 4 * float(np.abs(shapely.total_bounds(shapes)).max())


def draw_face(ax: Axes, shape: shapely.Geometry, i: int, label: str) -> None:
    """A projected face; a mere segment where the face is orthogonal to the plane."""
    if shapely.area(shape) <= 1e-6 * shapely.length(shape) ** 2:
        ax.plot(*MM * shapely.get_coordinates(shape).T, c=CONTACTS[i], lw=4, label=label)
        return
    style = {"facecolor": CONTACTS[i], "edgecolor": CONTACTS[i], "alpha": 0.35}
    fill(ax, shape, hatch=HATCHES[i], label=label, **style)


def fill(ax: Axes, shape: shapely.Geometry, label: str | None = None, **style: Any) -> None:
    """The polygons of a shape, with their holes, under one label."""
    for polygon in shapely.get_parts(shape):
        if polygon.geom_type == "Polygon" and not polygon.is_empty:
            rings = [MM * shapely.get_coordinates(ring) for ring in shapely.get_rings(polygon)]
            path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            ax.add_patch(PathPatch(path, label=label, **style))
            label = None


def draw_line(ax: Axes, point: Array, along: Array, reach: float, **style: Any) -> None:
    """From `point`, as far as `reach` both ways."""
    ax.plot(*MM * np.array([point - reach * along, point + reach * along]).T, **style)


def draw_cone(
    ax: Axes,
    apex: Array,
    axis: Array,
    half_angle: float,
    size: float,
    unit: float = MM,
    **style: Any,
) -> None:
    """A planar cone with sides of length `size`; `unit` makes of lengths what the axes show."""
    angle = np.arctan2(axis[1], axis[0]) + half_angle * np.linspace(-1, 1, 9)
    rim = apex + size * np.column_stack([np.cos(angle), np.sin(angle)])
    ax.add_patch(Polygon(unit * np.vstack([apex, rim]), linewidth=0, **style))


def mark(ax: Axes, point: Array, marker: str, label: str) -> None:
    """One point."""
    ax.plot(*MM * point, marker, color=INK, markersize=8, label=label, linestyle="none")


def add_legend(ax: Axes) -> None:
    """Below the axes, clear of the ticks however high the axes are."""
    figure = ax.get_figure()
    assert figure is not None
    below = ScaledTranslation(0, -0.25, figure.dpi_scale_trans)
    ax.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=ax.transAxes + below,
        ncols=4,
        frameon=False,
        fontsize=9,
    )
