"""The output of `polygrasp explain`: a document for JSON, and tables made from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.table import align_columns, friction_hint, head_line, lacking_friction
from drake_polygrasp.errors import UsageError
from drake_polygrasp.paper.reasons import MEANING

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject
    from drake_polygrasp.pipeline.explain import Explanation


def explain_document(
    model: str, object_: GraspObject, explanation: Explanation, faces: Sequence[int] | None
) -> dict[str, Any]:
    """Returns every set of faces and its reason, or only the sets of the faces asked for.

    Args:
        model: the model's name.
        object_: the object.
        explanation: what became of every set of faces.
        faces: two or three face indices; None for all sets.

    Raises:
        UsageError: when no set has these faces.
    """
    wanted = None if faces is None else sorted(set(faces))
    sets = [
        {"faces": row, "reason": str(reason)}
        for row, reason in zip(
            _distinct_faces(explanation.faces.tolist()), explanation.reasons, strict=True
        )
        if wanted is None or row == wanted
    ]
    if wanted is not None and not sets:
        raise UsageError(
            f"{model}: no set of faces {','.join(map(str, wanted))}: one is not there, or has "
            "no point as far from its edges as --edge-clearance asks; its faces are 0 to "
            f"{len(object_.polyhedron.faces) - 1}"
        )
    return {
        "model": model,
        "num_faces": len(object_.polyhedron.faces),
        "excluded_faces": explanation.excluded_faces,
        "num_sets": len(explanation.reasons),
        "reasons": dict(explanation.counts),
        "mu_needed": lacking_friction(object_, explanation.mu_needed),
        "sets": sets,
    }


def _distinct_faces(sets: list[list[int]]) -> list[list[int]]:
    """Returns the faces of each set, ascending: some have two regions on one face."""
    return [sorted({face for face in row if face >= 0}) for row in sets]


def all_sets_table(document: Mapping[str, Any]) -> str:
    """Returns a table of how many sets of faces end with each reason.

    Args:
        document: what `explain_document` returns.
    """
    rows = [(str(n), reason, *MEANING[reason]) for reason, n in document["reasons"].items()]
    header = ("sets", "reason", "step", "meaning")
    lines = [_document_head(document), *align_columns([header, *rows])]
    if not document["reasons"].get("certified"):
        lines.append(f"no certified grasp{friction_hint(document['mu_needed'])}")
    return "\n".join(lines)


def one_set_table(document: Mapping[str, Any]) -> str:
    """Returns a table of the reasons of the sets asked for, one row for each set of regions.

    A face that the edge clearance cuts in parts has several regions.

    Args:
        document: what `explain_document` returns.
    """
    rows = [
        (",".join(map(str, item["faces"])), item["reason"], *MEANING[item["reason"]])
        for item in document["sets"]
    ]
    header = ("faces", "reason", "step", "meaning")
    return "\n".join([_document_head(document), *align_columns([header, *rows])])


def _document_head(document: Mapping[str, Any]) -> str:
    keys = ("model", "num_faces", "excluded_faces", "num_sets")
    return head_line(*(document[key] for key in keys))
