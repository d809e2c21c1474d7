"""The paper's planes for one set of faces, as figures: what Sections 4 to 7 compute on each.

Lengths in mm. Faces and contacts 1, 2, 3 have the colours of the 3-D scene, and hatching of their
own for print.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.transforms import ScaledTranslation

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.convex import find_internal_forces
from drake_polygrasp.errors import UsageError
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.planning.trace import trace
from drake_polygrasp.planning.traced import OnPiL, OnPiP, OnPiS, Trace
from drake_polygrasp.visualization.palette import CONTACTS, INK, OBJECT, PLANE
from drake_polygrasp.wrench import edge_forces

_HATCHES = ("////", "\\\\\\\\", "....")
_MM = 1e3


def draw_explanation(
    object_: GraspObject,
    counts: Mapping[str, int],
    faces: Sequence[int] | None = None,
    edge_clearance: float | None = None,
) -> Figure:
    """What became of one set of faces, by the paper; of all of them, where none is named.

    Args:
        object_: what to grasp.
        counts: how many sets ended with each reason.
        faces: two or three indices, or None.
        edge_clearance: as of `planning.trace.trace` [m].
    """
    if faces is not None:
        return draw_trace(trace(object_, faces, edge_clearance))
    figure = Figure(figsize=(7.0, 0.8 + 0.4 * len(counts)), layout="constrained")
    draw_reasons(figure.add_subplot(), counts)
    return figure


def save_figure(figure: Figure, file: FilePath) -> None:
    """Writes a figure; UsageError when the file's kind is unknown or it cannot be written."""
    try:
        figure.savefig(file, dpi=150)
    except ValueError as error:
        raise UsageError(f"{file}: is no kind of picture that can be drawn: {error}") from error
    except OSError as error:
        raise UsageError(f"{file}: cannot be written: {error.strerror}") from error


def draw_trace(its: Trace) -> Figure:
    """One panel for each plane that the set came to, and one for the forces that hold.

    Args:
        its: what `planning.trace.trace` found.
    """
    panels: list[tuple[Callable[..., None], Any]] = [
        (draw, plane)
        for draw, plane in (
            (draw_pi_l, its.on_pi_l),
            (draw_pi_s, its.on_pi_s),
            (draw_pi_p, its.on_pi_p),
        )
        if plane is not None
    ]
    if its.p_BC is not None:
        panels.append((draw_forces, its))
    rows = max(1, -(-len(panels) // 2))
    figure = Figure(figsize=(10.0, 0.6 + 4.6 * rows), layout="constrained")
    faces = ", ".join(map(str, its.faces))
    end = "contacts found" if its.p_BC is not None else f"rejected: {its.reason}"
    kind = "parallel" if its.is_parallel else "non-parallel"
    figure.suptitle(
        f"faces {faces} ({kind}): phi = {np.degrees(its.phi):.1f}°, "
        f"alpha = {np.degrees(its.alpha):.1f}°; {end}"
    )
    for i, (draw, argument) in enumerate(panels):
        draw(figure.add_subplot(rows, 2, i + 1), argument)
    return figure


def draw_pi_l(ax: Axes, plane: OnPiL) -> None:
    """Projections A_i^l, their strips along n'_i, R^l and the cones C_ri at its centroid."""
    _prepare(ax, r"$\Pi_l$ (4.1): strips, $R^l$, cones $C_{ri}$", plane.faces)
    reach = _reach(plane.faces)
    for i, colour in enumerate(CONTACTS):
        along = plane.nprime[i]
        across = np.array([-along[1], along[0]])
        for bound in (plane.low[i], plane.high[i]):
            _line(ax, bound * across, along, reach, color=colour, linestyle="--", linewidth=0.9)
        _face(ax, plane.faces[i], i, f"$A_{i + 1}^l$")
        if plane.region_l is not None:
            apex = shapely.get_coordinates(plane.region_l.centroid)[0]
            for sign in (1.0, -1.0):
                _cone(ax, apex, sign * along, plane.gamma, reach, color=colour, alpha=0.12)
    if plane.region_l is not None:
        _fill(ax, plane.region_l, facecolor=PLANE, alpha=0.35, edgecolor=PLANE, label="$R^l$")
    _legend(ax)


def draw_pi_s(ax: Axes, plane: OnPiS) -> None:
    """Projections A_i^s and their hull, R^s, the part that Section 5 starts from, and Pi_p."""
    _prepare(ax, r"$\Pi_s$ (4, 5): $R^s$ and $\Pi_p$, edge on", plane.faces)
    reach = _MM * _reach(plane.faces)
    if plane.low is not None and plane.high is not None:
        ax.axhspan(_MM * plane.low, _MM * plane.high, color=PLANE, alpha=0.25, lw=0, label="$R^s$")
    same = shapely.equals(plane.faces[1], plane.faces[2])
    labels = ("$A_1^s$", "$A_2^s = A_3^s$") if same else ("$A_1^s$", "$A_2^s$", "$A_3^s$")
    for i, label in enumerate(labels):
        _face(ax, plane.faces[i], i, label)
    hull = shapely.convex_hull(shapely.GeometryCollection(list(plane.faces)))
    _fill(ax, hull, facecolor="none", edgecolor=OBJECT, linestyle="--", label="hull")
    if not shapely.is_empty(plane.common):
        style = {"facecolor": "none", "edgecolor": INK, "linewidth": 1.8, "linestyle": ":"}
        _fill(ax, plane.common, label=r"$A_{aux2}$ or $R^s_{maxT}$", **style)
    if plane.height is not None:
        level = [_MM * plane.height] * 2
        ax.plot([-reach, reach], level, color=PLANE, linewidth=2.5, label=r"$\Pi_p$")
    _mark(ax, plane.p_cm, "x", "$c_m^s$")
    _legend(ax)


def draw_pi_p(ax: Axes, plane: OnPiP) -> None:
    """Segments a_i, region P, the lines L_i through its centroid, and the contacts P_i."""
    _prepare(ax, r"$\Pi_p$ (6, 7): $a_i$, $P$, $L_i$ and contacts", [*plane.segments])
    _fill(ax, plane.region_p, facecolor=PLANE, alpha=0.3, edgecolor=PLANE, label="$P$")
    reach = _reach(plane.segments)
    concurrent = not np.allclose(plane.directions, plane.directions[0])
    for i, colour in enumerate(CONTACTS):
        for k, segment in enumerate(shapely.get_parts(plane.segments[i])):
            # Pairs have two segments in one place: the second is drawn inside the first.
            label = f"$a_{i + 1}$" if k == 0 else None
            width = 7 - 2 * i
            ax.plot(*_MM * shapely.get_coordinates(segment).T, c=colour, lw=width, label=label)
        if concurrent:
            _line(ax, plane.p_cI, plane.directions[i], reach, color=colour, lw=0.9, ls="--")
    if plane.contacts is not None:
        _draw_contacts(ax, plane, concurrent)
    _mark(ax, plane.p_cI, "+", "$c_I^p$")
    _mark(ax, plane.p_ca, "^", "$c_a$")
    _mark(ax, plane.p_cm, "x", "$c_m^p$")
    _legend(ax)


def _draw_contacts(ax: Axes, plane: OnPiP, concurrent: bool) -> None:
    assert plane.contacts is not None
    triangle = Polygon(_MM * plane.contacts, fill=False, edgecolor=INK, linewidth=1.0)
    ax.add_patch(triangle)
    inward = plane.contacts.mean(axis=0) - plane.contacts
    for i, point in enumerate(plane.contacts):
        ax.plot(*_MM * point, "o", color=CONTACTS[i], markersize=9, markeredgecolor="white")
        x, y = 14 * inward[i] / np.linalg.norm(inward[i])
        style: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "center"}
        ax.annotate(f"$P_{i + 1}$", _MM * point, (x, y), **style)
    if concurrent:
        # Least squares over the lines through P_i along n'_i.
        off = np.column_stack([-plane.nprime[:, 1], plane.nprime[:, 0]])
        P_I = np.linalg.lstsq(off, (off * plane.contacts).sum(axis=1), rcond=None)[0]
        _mark(ax, P_I, "*", "$P_I$")
    else:
        _line(ax, plane.contacts[0], plane.directions[0], 1.0, color=INK, lw=0.9, ls="--")


def draw_forces(ax: Axes, its: Trace) -> None:
    """The planar cones, Pi_p cut with C_fi, and internal forces head to tail: they close.

    Their sizes are parts of the whole normal force; each cone stands where its force begins.
    """
    ax.set_title("forces in balance, in their planar cones")
    ax.set_aspect("equal")
    if its.p_BC is None or its.on_pi_p is None:
        return
    batch = its.p_BC[None], its.nhat_TB_B[None], its.mu[None]
    f_Bc_B = edge_forces(its.p_BC[None], find_internal_forces(*batch))[0]
    if not np.isfinite(f_Bc_B).all():
        ax.text(0.5, 0.5, "no internal force exists", transform=ax.transAxes, ha="center")
        return
    axes_B = its.on_pi_p.axes_B
    f, nprime = f_Bc_B @ axes_B.T, its.on_pi_p.nprime
    # A plane at angle phi_i to the axis cuts the cone of half-angle alpha_i at beta_i.
    cosine = np.linalg.norm(its.nhat_TB_B @ axes_B.T, axis=1)
    beta = np.arccos(np.minimum(1, 1 / np.hypot(1, its.mu) / cosine))
    tail = np.zeros(2)
    # Forces along one line are drawn side by side.
    apart = 0.15 * np.array([f[0, 1], -f[0, 0]]) * (abs(np.linalg.det(f[:2])) < 1e-3)
    for i, colour in enumerate(CONTACTS):
        size = 1.25 * float(np.linalg.norm(f[i]))
        _cone(ax, tail, nprime[i], beta[i], size, unit=1.0, color=colour, alpha=0.25)
        x, y = tail
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.5}
        ax.annotate("", tail + f[i], (x, y), arrowprops=arrow)
        ax.plot([], [], color=colour, linewidth=2.5, label=f"$f_{i + 1}$")
        tail = tail + f[i] + apart
    ax.margins(0.1)
    _legend(ax)


def draw_reasons(ax: Axes, counts: Mapping[str, int]) -> None:
    """How many sets of faces ended with each reason, in the order of the steps."""
    names = list(counts)
    colours = [PLANE if name == "certified" else OBJECT for name in names]
    bars = ax.barh(names, [counts[name] for name in names], color=colours)
    ax.bar_label(bars, padding=3)
    ax.invert_yaxis()
    ax.set_xlabel("sets of faces")
    ax.spines[["top", "right"]].set_visible(False)
    ax.margins(x=0.1)


def _prepare(ax: Axes, title: str, shapes: Any) -> None:
    """Limits that show all shapes, whatever is drawn across them later."""
    box = _MM * shapely.total_bounds(shapes)
    margin = 0.12 * max(box[2] - box[0], box[3] - box[1])
    ax.set_xlim(box[0] - margin, box[2] + margin)
    ax.set_ylim(box[1] - margin, box[3] + margin)
    ax.set_aspect("equal")
    ax.set_title(f"{title} [mm]")


def _reach(shapes: Any) -> float:
    """Longer than anything in view [m]."""
    return 4 * float(np.abs(shapely.total_bounds(shapes)).max())


def _face(ax: Axes, shape: shapely.Geometry, i: int, label: str) -> None:
    """A projected face; a mere segment where the face is orthogonal to the plane."""
    flat = shapely.get_coordinates(shapely.oriented_envelope(shape))
    if shapely.area(shape) < 1e-6 * shapely.length(shape) ** 2 or len(flat) < 4:
        ax.plot(*_MM * shapely.get_coordinates(shape).T, c=CONTACTS[i], lw=4, label=label)
        return
    style = {"facecolor": CONTACTS[i], "edgecolor": CONTACTS[i], "alpha": 0.35}
    _fill(ax, shape, hatch=_HATCHES[i], label=label, **style)


def _fill(ax: Axes, shape: shapely.Geometry, label: str | None = None, **style: Any) -> None:
    for polygon in shapely.get_parts(shape):
        if polygon.geom_type == "Polygon":
            rings = [_MM * shapely.get_coordinates(ring) for ring in shapely.get_rings(polygon)]
            path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            ax.add_patch(PathPatch(path, label=label, **style))
            label = None


def _line(ax: Axes, point: Array, along: Array, reach: float, **style: Any) -> None:
    ax.plot(*_MM * np.array([point - reach * along, point + reach * along]).T, **style)


def _cone(
    ax: Axes,
    apex: Array,
    axis: Array,
    half_angle: float,
    size: float,
    unit: float = _MM,
    **style: Any,
) -> None:
    angle = np.arctan2(axis[1], axis[0]) + half_angle * np.linspace(-1, 1, 9)
    rim = apex + size * np.column_stack([np.cos(angle), np.sin(angle)])
    ax.add_patch(Polygon(unit * np.vstack([apex, rim]), linewidth=0, **style))


def _mark(ax: Axes, point: Array, marker: str, label: str) -> None:
    ax.plot(*_MM * point, marker, color=INK, markersize=8, label=label, linestyle="none")


def _legend(ax: Axes) -> None:
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
