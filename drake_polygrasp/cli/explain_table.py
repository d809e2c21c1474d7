"""What `polygrasp explain` prints: a plain document for machines, from which tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.table import aligned, friction_hint, head_line, lacking_friction
from drake_polygrasp.errors import UsageError
from drake_polygrasp.paper.reasons import MEANING

if TYPE_CHECKING:
    from drake_polygrasp.grasp import GraspObject
    from drake_polygrasp.pipeline.explain import Explanation


def explain_document(
    model: str, object_: GraspObject, explanation: Explanation, faces: Sequence[int] | None
) -> dict[str, Any]:
    """Every set of faces and its reason, or only the sets of the faces asked for.

    Raises:
        UsageError: when no set has these faces.
    """
    wanted = None if faces is None else sorted(set(faces))
    sets = [
        {"faces": row, "reason": str(reason)}
        for row, reason in zip(
            _distinct(explanation.faces.tolist()), explanation.reasons, strict=True
        )
        if wanted is None or row == wanted
    ]
    if wanted is not None and not sets:
        raise UsageError(
            f"{model}: no set of faces {','.join(map(str, wanted))} wide enough for fingers; "
            f"its faces are 0 to {len(object_.polyhedron.faces) - 1}"
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


def _distinct(sets: list[list[int]]) -> list[list[int]]:
    return [sorted({face for face in row if face >= 0}) for row in sets]


def all_sets_table(document: Mapping[str, Any]) -> str:
    """How many sets of faces end with each reason."""
    rows = [(str(n), reason, *MEANING[reason]) for reason, n in document["reasons"].items()]
    lines = [_document_head(document), *aligned([("sets", "reason", "step", "meaning"), *rows])]
    if not document["reasons"].get("certified"):
        lines.append(f"no certified grasp{friction_hint(document['mu_needed'])}")
    return "\n".join(lines)


def one_set_table(document: Mapping[str, Any]) -> str:
    """The end of each set of the faces asked for, one row a set of their regions."""
    rows = [
        (",".join(map(str, item["faces"])), item["reason"], *MEANING[item["reason"]])
        for item in document["sets"]
    ]
    return "\n".join(
        [_document_head(document), *aligned([("faces", "reason", "step", "meaning"), *rows])]
    )


def _document_head(document: Mapping[str, Any]) -> str:
    keys = ("model", "num_faces", "excluded_faces", "num_sets")
    return head_line(*(document[key] for key in keys))
