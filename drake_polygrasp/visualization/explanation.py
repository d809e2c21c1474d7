"""The figure of `polygrasp explain`: why a set of faces ended as it did."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.reasons import MEANING, REASONS
from drake_polygrasp.paper.trace import trace_set
from drake_polygrasp.paper.trace_result import SetTrace
from drake_polygrasp.pipeline.explain import Explanation
from drake_polygrasp.visualization.figures import draw_reasons, draw_trace


def draw_explanation(
    object_: GraspObject, explanation: Explanation, faces: Sequence[int] | None = None
) -> Figure:
    """Draws what became of one set of faces, by the paper, or of all of them.

    Args:
        object_: what to grasp.
        explanation: what `explain_sets` says of it.
        faces: indices of two or three faces (default: counts of all sets' ends are drawn).

    Returns:
        The figure.
    """
    if faces is None:
        counts = explanation.counts
        figure = Figure(figsize=(7.0, 0.8 + 0.4 * len(counts)), layout="constrained")
        draw_reasons(figure.add_subplot(), counts)
        return figure
    its = trace_set(object_, faces, explanation.edge_clearance)
    return draw_trace(its, object_, explanation.tip_radius, _ending(its, explanation))


def _ending(its: SetTrace, explanation: Explanation) -> str:
    """The reason and its meaning; of sets of several regions, the best end."""
    wanted = {*its.faces}
    rows = zip(explanation.faces.tolist(), explanation.reasons, strict=True)
    found = {reason for row, reason in rows if {*row} - {-1} == wanted}
    if "certified" in found and its.p_BC is None:
        return f"certified beyond the paper, whose own steps end here: {MEANING[its.reason][1]}"
    if "certified" in found:
        return f"certified: {MEANING['certified'][1]}"
    # Where it is not a step of the paper that ended the set, what did came before or later.
    end = its.reason if its.reason in found else max(found, key=REASONS.index)
    return f"rejected, {end}: {MEANING[end][1]}"
