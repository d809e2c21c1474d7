"""Draws the planes on which Sections 4 to 7 of the paper plan for one set of faces.

Axes are in mm. Faces and contacts 1, 2, 3 have the colours of the 3-D scene, and their own hatching
for print.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.convex import find_internal_forces
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.surface_contact import fingertip_fits, project_contacts
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.trace_result import OnPiL, OnPiP, OnPiS, SetTrace
from drake_polygrasp.visualization.directions import draw_directions
from drake_polygrasp.visualization.meshes import section_lines
from drake_polygrasp.visualization.palette import CONTACTS, INK, OBJECT, PLANE
from drake_polygrasp.visualization.plane_axes import (
    MM,
    add_legend,
    draw_cone,
    draw_face,
    draw_line,
    fill,
    mark,
    prepare,
    reach_of,
)
from drake_polygrasp.visualization.sketch import draw_faces
from drake_polygrasp.wrenches.contacts import edge_forces

_Tip = tuple[shapely.Polygon, bool]
"""A fingertip seen along N, as a disc on Pi_p [m], and whether it fits beside the object."""


def save_figure(figure: Figure, file: Path) -> None:
    """Writes a figure to a file.

    Args:
        figure: the figure.
        file: file to write; its ending says the format (.png, .pdf, .svg).

    Raises:
        UsageError: when the format is unknown or the file cannot be written.
    """
    try:
        figure.savefig(file, dpi=150)
    except ValueError as error:
        raise UsageError(f"{file}: is no kind of picture that can be drawn: {error}") from error
    except OSError as error:
        raise UsageError(f"{file}: cannot be written: {error.strerror}") from error


def draw_trace(
    trace: SetTrace,
    object_: GraspObject | None = None,
    tip_radius: float = 0.0,
    ending: str | None = None,
) -> Figure:
    """Draws a panel for each plane that the paper reaches for a set, and one for contact forces.

        draw_trace(trace_set(box, (0, 1, 4)), box).savefig("planes.png")

    Args:
        trace: the set of faces, as `trace_set` returns it.
        object_: its object, drawn in 3-D and where Pi_p cuts it (default: not drawn).
        tip_radius: radius of the fingertips drawn on Pi_p [m]; 0 for none.
        ending: text on how the set ends (default: the trace's reason).

    Returns:
        The figure.
    """
    on_pi_p = partial(_draw_pi_p, object_=object_, tips=_tips(trace, object_, tip_radius))
    panels: list[tuple[Callable[..., None], Any]] = [
        (draw, plane)
        for draw, plane in (
            (draw_directions, trace if trace.reason == "orientation" else None),
            (_draw_pi_l, trace.on_pi_l),
            (_draw_pi_s, trace.on_pi_s),
            (on_pi_p, trace.on_pi_p),
            (_draw_forces, None if trace.p_BC is None else trace),
        )
        if plane is not None
    ]
    count = len(panels) + (object_ is not None)
    columns = max(2, -(-count // 2))
    rows = -(-count // columns)
    figure = Figure(figsize=(5.0 * columns, 0.8 + 4.6 * rows), layout="constrained")
    if object_ is not None:
        ax = figure.add_subplot(rows, columns, 1, projection="3d")
        draw_faces(ax, object_, trace.faces)
        ax.set_title("the set of faces")
    figure.suptitle(f"{_what(trace)}\n{ending or _end(trace)}")
    for i, (draw, argument) in enumerate(panels, start=count - len(panels) + 1):
        draw(figure.add_subplot(rows, columns, i), argument)
    return figure


def _what(trace: SetTrace) -> str:
    faces = ", ".join(map(str, dict.fromkeys(trace.faces)))
    pair = len({*trace.faces}) == 2
    kind = "two faces" if pair else "parallel" if trace.is_parallel else "non-parallel"
    if trace.reason == "orientation":
        kind = "two faces" if pair else "three faces"
    angles = f"phi = {np.degrees(trace.phi):.1f}°, alpha = {np.degrees(trace.alpha):.1f}°"
    drawn = "The paper's steps for" if trace.p_BC is None else "The paper's own grasp of"
    return f"{drawn} faces {faces} ({kind}): {angles}"


def _end(trace: SetTrace) -> str:
    return "contacts found" if trace.p_BC is not None else f"rejected: {trace.reason}"


def _draw_pi_l(ax: Axes, plane: OnPiL) -> None:
    """Draws projections A_i^l, their strips along n'_i, R^l and the cones C_ri at its centroid."""
    prepare(ax, r"$\Pi_l$ (4.1): strips, $R^l$, cones $C_{ri}$", plane.faces)
    reach = reach_of(plane.faces)
    for i, colour in enumerate(CONTACTS):
        along = plane.nprime[i]
        across = np.array([-along[1], along[0]])
        for bound in (plane.low[i], plane.high[i]):
            draw_line(ax, bound * across, along, reach, color=colour, linestyle="--", linewidth=0.9)
        draw_face(ax, plane.faces[i], i, f"$A_{i + 1}^l$")
        if plane.region_l is not None:
            apex = shapely.get_coordinates(plane.region_l.centroid)[0]
            for sign in (1.0, -1.0):
                draw_cone(ax, apex, sign * along, plane.gamma, reach, color=colour, alpha=0.12)
    if plane.region_l is not None:
        fill(ax, plane.region_l, facecolor=PLANE, alpha=0.35, edgecolor=PLANE, label="$R^l$")
    add_legend(ax)


def _draw_pi_s(ax: Axes, plane: OnPiS) -> None:
    """Draws projections A_i^s and their hull, R^s, the part where Section 5 starts, and Pi_p."""
    prepare(ax, r"$\Pi_s$ (4, 5): $R^s$ and $\Pi_p$, edge on", plane.faces)
    reach = MM * reach_of(plane.faces)
    if plane.low is not None and plane.high is not None:
        ax.axhspan(MM * plane.low, MM * plane.high, color=PLANE, alpha=0.25, lw=0, label="$R^s$")
    same = shapely.equals(plane.faces[1], plane.faces[2])
    labels = ("$A_1^s$", "$A_2^s = A_3^s$") if same else ("$A_1^s$", "$A_2^s$", "$A_3^s$")
    for i, label in enumerate(labels):
        draw_face(ax, plane.faces[i], i, label)
    hull = shapely.convex_hull(shapely.GeometryCollection(list(plane.faces)))
    fill(ax, hull, facecolor="none", edgecolor=OBJECT, linestyle="--", label="hull")
    if not shapely.is_empty(plane.common):
        style = {"facecolor": "none", "edgecolor": INK, "linewidth": 1.8, "linestyle": ":"}
        fill(ax, plane.common, label=r"$A_{aux2}$ or $R^s_{maxT}$", **style)
    if plane.height is not None:
        level = [MM * plane.height] * 2
        ax.plot([-reach, reach], level, color=PLANE, linewidth=2.5, label=r"$\Pi_p$")
    if plane.heights is not None:
        _draw_heights(ax, plane.heights)
    mark(ax, plane.p_cm, "x", "$c_m^s$")
    add_legend(ax)


def _draw_heights(ax: Axes, heights: Array) -> None:
    """Draws the heights of portions A_li beside the faces; R^s is their intersection."""
    left, right = ax.get_xlim()
    step = 0.06 * (right - left)
    for i, (low, high) in enumerate(MM * heights):
        x = right + (i + 0.5) * step
        label = f"heights of $A_{{l{i + 1}}}$" if low < high else f"$A_{{l{i + 1}}}$ is empty"
        shown = (low, high) if low < high else ()
        ax.plot([x] * len(shown), shown, color=CONTACTS[i], linewidth=5, label=label)
        for height in shown:
            ax.axhline(height, color=CONTACTS[i], linewidth=0.8, linestyle=":")
    ax.set_xlim(left, right + 3.5 * step)


def _tips(trace: SetTrace, object_: GraspObject | None, radius: float) -> list[_Tip]:
    if object_ is None or trace.p_BC is None or trace.on_pi_p is None or not radius:
        return []
    # Contacts on patches are near the surface, not on it.
    projected = project_contacts(object_.polyhedron, trace.p_BC, np.array(trace.faces))
    fits = projected.ok & fingertip_fits(
        object_.polyhedron, projected.p_BC, projected.nhat_TB_B, radius
    )
    p_BT = (trace.p_BC - radius * trace.nhat_TB_B) @ trace.on_pi_p.axes_B.T
    return list(zip(shapely.buffer(shapely.points(p_BT), radius), fits.tolist(), strict=True))


def _draw_pi_p(
    ax: Axes, plane: OnPiP, object_: GraspObject | None = None, tips: Sequence[_Tip] = ()
) -> None:
    """Draws segments a_i, region P, the lines L_i through its centroid, and the contacts P_i.

    If P is empty, the strips that do not meet are drawn instead of L_i.
    """
    shapes = [*plane.segments, *(disc for disc, _ in tips)]
    if object_ is not None:
        N = np.cross(*plane.axes_B)
        lines = section_lines(object_.polyhedron, N, plane.height) @ plane.axes_B.T
        shapes.append(shapely.multilinestrings(list(lines)))
    prepare(ax, r"$\Pi_p$ (6, 7): $a_i$, $P$, $L_i$ and contacts", shapes)
    if object_ is not None:
        ax.add_collection(LineCollection(list(MM * lines), colors=OBJECT, label="object"))
    for name, hatch in (("fingertip", ""), ("no room for it", "xxxxx")):
        discs = shapely.MultiPolygon([disc for disc, fits in tips if fits == (not hatch)])
        fill(ax, discs, name, facecolor="none", edgecolor=INK, hatch=hatch)
    fill(ax, plane.region_p, facecolor=PLANE, alpha=0.3, edgecolor=PLANE, label="$P$")
    reach = reach_of(shapes)
    concurrent = not np.allclose(plane.directions, plane.directions[0])
    for i, colour in enumerate(CONTACTS):
        for k, segment in enumerate(shapely.get_parts(plane.segments[i])):
            # Pairs have two segments in one place: the second is drawn inside the first.
            label = f"$a_{i + 1}$" if k == 0 else None
            width = 7 - 2 * i
            ax.plot(*MM * shapely.get_coordinates(segment).T, c=colour, lw=width, label=label)
        for point in _starts(plane, i, concurrent):
            draw_line(ax, point, plane.directions[i], reach, color=colour, lw=0.9, ls="--")
    if plane.contacts is not None:
        _draw_contacts(ax, plane, concurrent)
    if plane.p_cI is not None:
        mark(ax, plane.p_cI, "+", "$c_I^p$")
    mark(ax, plane.p_ca, "^", "$c_a$")
    mark(ax, plane.p_cm, "x", "$c_m^p$")
    add_legend(ax)


def _starts(plane: OnPiP, i: int, concurrent: bool) -> Array:
    """Points of the lines along n'_i: L_i, or the borders of the strip where P is empty."""
    if not concurrent and i > 0:
        return np.empty((0, 2))
    if plane.p_cI is not None:
        return plane.p_cI[None]
    ends: Array = shapely.get_coordinates(plane.segments[i])
    across = ends @ np.array([-plane.directions[i, 1], plane.directions[i, 0]])
    return ends[[np.argmin(across), np.argmax(across)]] if len(ends) else ends


def _draw_contacts(ax: Axes, plane: OnPiP, concurrent: bool) -> None:
    assert plane.contacts is not None
    triangle = Polygon(MM * plane.contacts, fill=False, edgecolor=INK, linewidth=1.0)
    ax.add_patch(triangle)
    inward = plane.contacts.mean(axis=0) - plane.contacts
    for i, point in enumerate(plane.contacts):
        ax.plot(*MM * point, "o", color=CONTACTS[i], markersize=9, markeredgecolor="white")
        x, y = 14 * inward[i] / np.linalg.norm(inward[i])
        style: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "center"}
        ax.annotate(f"$P_{i + 1}$", MM * point, (x, y), **style)
    if concurrent:
        # P_I by least squares over the lines through P_i along n'_i.
        off = np.column_stack([-plane.nprime[:, 1], plane.nprime[:, 0]])
        P_I = np.linalg.lstsq(off, (off * plane.contacts).sum(axis=1), rcond=None)[0]
        mark(ax, P_I, "*", "$P_I$")


def _draw_forces(ax: Axes, trace: SetTrace) -> None:
    """Draws the planar cones, in which Pi_p cuts C_fi, and internal forces head to tail.

    The forces close to a triangle. Sizes are fractions of the total normal force; each cone has its
    apex where its force begins.
    """
    ax.set_title("planar cones, and forces that cancel head to tail")
    ax.set_aspect("equal")
    if trace.p_BC is None or trace.on_pi_p is None:
        return
    batch = trace.p_BC[None], trace.nhat_TB_B[None], trace.mu[None]
    f_Bc_B = edge_forces(trace.p_BC[None], find_internal_forces(*batch))[0]
    if not np.isfinite(f_Bc_B).all():
        ax.text(0.5, 0.5, "no internal force exists", transform=ax.transAxes, ha="center")
        return
    normal = (f_Bc_B * trace.nhat_TB_B).sum(axis=1)
    if (normal * np.hypot(1, trace.mu) < np.linalg.norm(f_Bc_B, axis=1)).any():
        ax.set_title("forces that cancel leave the cones")
    axes_B = trace.on_pi_p.axes_B
    f, nprime = f_Bc_B @ axes_B.T, trace.on_pi_p.nprime
    # A plane at angle phi_i to a cone's axis cuts the cone of half-angle alpha_i at beta_i.
    cosine = np.linalg.norm(trace.nhat_TB_B @ axes_B.T, axis=1)
    beta = np.arccos(np.minimum(1, 1 / np.hypot(1, trace.mu) / cosine))
    tail = np.zeros(2)
    # Forces along one line are drawn beside each other.
    apart = 0.15 * np.array([f[0, 1], -f[0, 0]]) * (abs(np.linalg.det(f[:2])) < 1e-3)
    for i, colour in enumerate(CONTACTS):
        size = 1.25 * float(np.linalg.norm(f[i]))
        draw_cone(ax, tail, nprime[i], beta[i], size, unit=1.0, color=colour, alpha=0.25)
        x, y = tail
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.5}
        ax.annotate("", tail + f[i], (x, y), arrowprops=arrow)
        ax.plot([], [], color=colour, linewidth=2.5, label=f"$f_{i + 1}$")
        tail = tail + f[i] + apart
    ax.margins(0.1)
    add_legend(ax)


def draw_reasons(ax: Axes, counts: Mapping[str, int]) -> None:
    """Draws a bar chart of how many sets of faces ended with each reason.

    Args:
        ax: axes to draw on.
        counts: number of sets by reason, in the order of the bars: `Explanation.counts`.
    """
    names = list(counts)
    colours = [PLANE if name == "certified" else OBJECT for name in names]
    bars = ax.barh(names, [counts[name] for name in names], color=colours)
    ax.bar_label(bars, padding=3)
    ax.invert_yaxis()
    ax.set_xlabel("sets of faces")
    ax.spines[["top", "right"]].set_visible(False)
    ax.margins(x=0.1)
