"""The figure of `polygrasp explain`: why a set of faces ended as it did."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.reasons import MEANING, REASONS
from drake_polygrasp.paper.trace import trace
from drake_polygrasp.paper.trace_result import SetTrace
from drake_polygrasp.pipeline.explain import Explanation
from drake_polygrasp.pipeline.request import TIP_RADIUS
from drake_polygrasp.visualization.figures import draw_reasons, draw_trace


def draw_explanation(
    object_: GraspObject,
    explanation: Explanation,
    faces: Sequence[int] | None = None,
    edge_clearance: float | None = None,
    tip_radius: float | None = None,
) -> Figure:
    """What became of one set of faces, by the paper; of all of them, where none is named.

    Args:
        object_: what to grasp.
        explanation: what `explain_sets` says of it.
        faces: two or three indices, or None.
        edge_clearance: as of `explain_sets` [m].
        tip_radius: as of `explain_sets` [m].
    """
    if faces is None:
        counts = explanation.counts
        figure = Figure(figsize=(7.0, 0.8 + 0.4 * len(counts)), layout="constrained")
        draw_reasons(figure.add_subplot(), counts)
        return figure
    its = trace(object_, faces, edge_clearance)
    tip = TIP_RADIUS * object_.polyhedron.diameter if tip_radius is None else tip_radius
    return draw_trace(its, object_, tip, _ending(its, explanation))


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
