"""Draws the parts of figures of the paper's planes: arguments in m, axes in mm."""

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
"""Millimetres in a metre."""


def prepare(ax: Axes, title: str, shapes: Any) -> None:
    """Sets the title, equal scales, and limits that show all shapes with a margin.

    Args:
        ax: axes to draw on.
        title: title, to which the unit is added.
        shapes: shapely geometries to show [m].
    """
    box = MM * shapely.total_bounds(shapes)
    margin = 0.12 * max(box[2] - box[0], box[3] - box[1])
    ax.set_xlim(box[0] - margin, box[2] + margin)
    ax.set_ylim(box[1] - margin, box[3] + margin)
    ax.set_aspect("equal")
    ax.set_title(f"{title} [mm]")


def reach_of(shapes: Any) -> float:
    """Returns a length greater than all in view [m].

    Args:
        shapes: shapely geometries in view [m].
    """
    return 4 * float(np.abs(shapely.total_bounds(shapes)).max())


def draw_face(ax: Axes, shape: shapely.Geometry, i: int, label: str) -> None:
    """Draws a projected face, as a segment if it is orthogonal to the plane.

    Args:
        ax: axes to draw on.
        shape: projection of the face [m].
        i: index of the face in the set, 0 to 2, for its colour and hatching.
        label: its entry in the legend.
    """
    if shapely.area(shape) <= 1e-6 * shapely.length(shape) ** 2:
        ax.plot(*MM * shapely.get_coordinates(shape).T, c=CONTACTS[i], lw=4, label=label)
        return
    style = {"facecolor": CONTACTS[i], "edgecolor": CONTACTS[i], "alpha": 0.35}
    fill(ax, shape, hatch=HATCHES[i], label=label, **style)


def fill(ax: Axes, shape: shapely.Geometry, label: str | None = None, **style: Any) -> None:
    """Draws the polygons of a shape, with their holes.

    Args:
        ax: axes to draw on.
        shape: shapely geometry [m].
        label: one entry in the legend for all of them.
        style: properties of matplotlib's patches.
    """
    for polygon in shapely.get_parts(shape):
        if polygon.geom_type == "Polygon" and not polygon.is_empty:
            rings = [MM * shapely.get_coordinates(ring) for ring in shapely.get_rings(polygon)]
            path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            ax.add_patch(PathPatch(path, label=label, **style))
            label = None


def draw_line(ax: Axes, point: Array, along: Array, reach: float, **style: Any) -> None:
    """Draws a line through a point.

    Args:
        ax: axes to draw on.
        point: the point [m], shape (2,).
        along: unit vector along the line, shape (2,).
        reach: length on either side of the point [m].
        style: properties of matplotlib's lines.
    """
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
    """Draws a planar cone.

    Args:
        ax: axes to draw on.
        apex: its apex [m], shape (2,).
        axis: direction of its axis, shape (2,).
        half_angle: angle between axis and sides [rad].
        size: length of its sides [m].
        unit: number of the axes' units in a unit of `apex` and `size`.
        style: properties of matplotlib's patches.
    """
    angle = np.arctan2(axis[1], axis[0]) + half_angle * np.linspace(-1, 1, 9)
    rim = apex + size * np.column_stack([np.cos(angle), np.sin(angle)])
    ax.add_patch(Polygon(unit * np.vstack([apex, rim]), linewidth=0, **style))


def mark(ax: Axes, point: Array, marker: str, label: str) -> None:
    """Draws one point.

    Args:
        ax: axes to draw on.
        point: the point [m], shape (2,).
        marker: matplotlib's marker.
        label: its entry in the legend.
    """
    ax.plot(*MM * point, marker, color=INK, markersize=8, label=label, linestyle="none")


def add_legend(ax: Axes) -> None:
    """Adds a legend below the axes, clear of the ticks at any height of the axes.

    Args:
        ax: axes with labelled parts.
    """
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
