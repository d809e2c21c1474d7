"""Draws why a set of faces has a grasp or none: the figure of `polygrasp explain`."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.reasons import MEANING, REASONS
from drake_polygrasp.paper.trace import trace_set
from drake_polygrasp.paper.trace_result import SetTrace
from drake_polygrasp.pipeline.explain import Explanation
from drake_polygrasp.pipeline.friction_left import with_friction_left
from drake_polygrasp.visualization.figures import draw_reasons, draw_trace


def draw_explanation(
    object_: GraspObject, explanation: Explanation, faces: Sequence[int] | None = None
) -> Figure:
    """Draws the paper's steps for one set of faces and how they end, or the ends of all sets.

        figure = draw_explanation(box, explain_sets(box, method="paper"), (0, 1, 4))
        figure.savefig("why.png")

    Args:
        object_: object to grasp.
        explanation: result of `explain_sets` for it.
        faces: indices of two or three faces (default: a bar chart of the reasons of all sets).

    Returns:
        The figure.
    """
    if faces is None:
        counts = explanation.counts
        figure = Figure(figsize=(7.0, 0.8 + 0.4 * len(counts)), layout="constrained")
        draw_reasons(figure.add_subplot(), counts)
        return figure
    left = with_friction_left(object_, explanation.tilt_error, explanation.friction_error)
    clearances = explanation.edge_clearance, explanation.placement_error
    trace = trace_set(left, faces, *clearances)
    return draw_trace(trace, object_, explanation.tip_radius, _ending(trace, explanation))


def _ending(trace: SetTrace, explanation: Explanation) -> str:
    """Says how a set ended and what that means; if it has several regions, the best of its ends."""
    wanted = {*trace.faces}
    rows = zip(explanation.faces.tolist(), explanation.reasons, strict=True)
    found = {reason for row, reason in rows if {*row} - {-1} == wanted}
    if "certified" in found and trace.p_BC is None:
        return f"certified beyond the paper, whose own steps end here: {MEANING[trace.reason][1]}"
    if "certified" in found:
        return f"certified: {MEANING['certified'][1]}"
    # A set may also be ended before the paper's steps, or after them.
    end = trace.reason if trace.reason in found else max(found, key=REASONS.index)
    return f"rejected, {end}: {MEANING[end][1]}"
