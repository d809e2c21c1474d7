"""What the command line prints: tables for people, plain documents for machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drake_polygrasp.errors import UsageError
from drake_polygrasp.plant_block import plant_document
from drake_polygrasp.plant_table import (
    aligned,
    plan_plant_lines,
    plant_column,
    verified_plant_column,
    verified_plant_lines,
)

if TYPE_CHECKING:
    from drake_polygrasp.explain import Explanation
    from drake_polygrasp.gap import Gap
    from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
    from drake_polygrasp.pipeline import GraspPlan
    from drake_polygrasp.verification_report import GraspReport, Report
from drake_polygrasp.planning.reasons import MEANING

MOST_NAMED = 12
"""Faces that a line names by their indices, ours; of more it tells how many."""


def plan_table(model: str, object_: GraspObject, plan: GraspPlan, output: Path) -> str:
    """The grasps, one a row, best first."""
    header = ("rank", "faces", "kind", "Q", "margin", "epsilon", "mu_min", "placement", "squeeze")
    units = ("", "", "", "", "", "", "", "[mm]", "[N]")
    rows = [_grasp_row(rank, grasp) for rank, grasp in enumerate(plan.grasps, start=1)]
    in_plant = plant_column(plan.grasps)
    return "\n".join(
        [
            f"{_head(model, len(object_.polyhedron.faces), plan.excluded_faces, plan.num_sets)}, "
            f"{_counts(plan)}",
            *aligned(
                [(*row, *cell) for row, cell in zip([header, units, *rows], in_plant, strict=True)]
            ),
            *plan_plant_lines(plan.grasps),
            *_placement_note(object_, plan.grasps),
            f"wrote {output}",
        ]
    )


def _counts(plan: GraspPlan) -> str:
    """How many sets have a proved grasp; "so far" where more may have one."""
    if not plan.num_not_evaluated:
        return f"{plan.num_certified} certified, all evaluated"
    return f"{plan.num_certified} proved so far, {plan.num_not_evaluated} not evaluated"


def _placement_note(object_: GraspObject, grasps: Sequence[CertifiedGrasp]) -> list[str]:
    """Why placement tolerances are small where contacts are on patches."""
    faces = object_.polyhedron.faces
    if not any(faces[k].reach > 0 for certified in grasps for k in certified.grasp.faces):
        return []
    return [
        "placement is promised only as far as normals stay the same: on patches of curved or "
        "scanned surfaces, within a contact's own facet or a milliradian of the curve"
    ]


def _grasp_row(rank: int, certified: CertifiedGrasp) -> tuple[str, ...]:
    grasp, certificate = certified.grasp, certified.certificate
    squeeze = certificate.squeeze_force
    return (
        str(rank),
        " ".join(map(str, grasp.faces)),
        grasp.kind,
        "-" if grasp.quality is None else f"{grasp.quality.Q:.3f}",
        f"{certificate.margin:.3f}",
        f"{certificate.epsilon_lower:.4f}-{certificate.epsilon_upper:.4f}",
        f"{certificate.mu_min:.4f}",
        f"{1e3 * certificate.placement_tolerance:.2f}",
        "-" if squeeze is None else f"{squeeze:.1f}",
    )


def gap_lines(gap: Gap) -> list[str]:
    """How near the plan is to the best possible grasp, and a better one if it was met."""
    end = "nodes" if gap.complete else "nodes; more would lower it"
    within = (
        ""
        if gap.relative_gap is None
        else f": grasp {gap.rank} is within {100 * gap.relative_gap:.1f} percent"
    )
    lines = [
        f"gap: the best possible epsilon is at most {gap.epsilon_bound:.4f}{within} "
        f"({gap.nodes:,} {end})"
    ]
    if gap.better is not None:
        points = ", ".join(" ".join(f"{x:.4f}" for x in p) for p in gap.better.p_BC.tolist())
        lines.append(
            f"a better one exists: epsilon {gap.better.epsilon:.4f} on faces "
            f"{' '.join(map(str, gap.better.faces))} at {points}"
        )
    return lines


def gap_document(gap: Gap) -> dict[str, Any]:
    """The gap for machines."""
    better = gap.better
    return {
        "epsilon_bound": gap.epsilon_bound,
        "epsilon": gap.epsilon,
        "rank": gap.rank,
        "relative_gap": gap.relative_gap,
        "nodes": gap.nodes,
        "complete": gap.complete,
        "better": None
        if better is None
        else {"faces": better.faces, "p_BC": better.p_BC.tolist(), "epsilon": better.epsilon},
    }


def no_grasp_message(model: str, object_: GraspObject, plan: GraspPlan, output: Path) -> str:
    """That there is no grasp, or that none was found; why, and what might mend it."""
    reasons = ", ".join(f"{count} {reason}" for reason, count in plan.reasons.items())
    why = f" ({reasons})" if reasons else ": no two are wide enough for fingers"
    if plan.outcome == "none_found":
        result = (
            f"no grasp found; {plan.num_not_evaluated} of {plan.num_sets} sets of faces were not "
            f"evaluated{why}; --effort complete evaluates all, --exclude-faces leaves fewer"
        )
    else:
        result = f"no certified grasp; all {plan.num_sets} sets of faces were evaluated{why}"
    left = f"{output} is left as it was" if output.exists() else "no file is written"
    return f"{model}: {result}; {left}{_friction_hint(_lacking_friction(object_, plan.mu_needed))}"


def _lacking_friction(object_: GraspObject, mu_needed: float | None) -> float | None:
    """`mu_needed` where the object has less: else it is not friction that is lacking."""
    if mu_needed is None or mu_needed <= max(face.mu for face in object_.polyhedron.faces):
        return None
    return mu_needed


def _friction_hint(mu_needed: float | None) -> str:
    if mu_needed is None:
        return ""
    return f"; the first set of faces passes orientation at a friction above {mu_needed:.4f}"


def verify_table(report: Report) -> str:
    """One row a grasp, and below it a sentence for each line that has something to say."""
    in_plant = verified_plant_column(report)
    rows = [
        (str(rank), *(str(line.status) for line in grasp.lines.values()), *cell)
        for rank, (grasp, cell) in enumerate(zip(report.grasps, in_plant[1:], strict=True), start=1)
    ]
    remarks = [
        f"grasp {rank}, {name}: {line.reason}"
        for rank, grasp in enumerate(report.grasps, start=1)
        for name, line in grasp.lines.items()
        if line.reason
    ]
    summary = "something does not hold" if report.holds is False else "all that was checked holds"
    if report.holds is None:
        summary += "" if report.model_checked else "; SURFACE was not checked"
        summary += "" if report.plant_decided else "; a plant leaves grasps undecided"
    return "\n".join(
        [
            f"{report.path}: {len(rows)} grasp{'' if len(rows) == 1 else 's'}",
            *aligned([("rank", "FORCES", "SURFACE", "NUMBERS", *in_plant[0]), *rows]),
            *remarks,
            *verified_plant_lines(report),
            summary if rows else "the file holds no grasp",
        ]
    )


def verify_document(report: Report, holds: bool | None) -> dict[str, Any]:
    """The report for machines; `holds` is that of the report or, as more was asked for, False."""
    return {
        "file": str(report.path),
        "holds": holds,
        "model_checked": report.model_checked,
        "warnings": list(report.warnings),
        "grasps": [_verified_document(grasp) for grasp in report.grasps],
    }


def _verified_document(grasp: GraspReport) -> dict[str, Any]:
    document: dict[str, Any] = {
        name: {"status": str(line.status), "reason": line.reason}
        for name, line in grasp.lines.items()
    }
    if grasp.plant is not None:
        document["plant"] = plant_document(grasp.plant)
    if grasp.stated_plant is not None:
        document["stated_plant"] = {"status": "stated", "verdict": str(grasp.stated_plant.verdict)}
    return document


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
        "mu_needed": _lacking_friction(object_, explanation.mu_needed),
        "sets": sets,
    }


def _distinct(sets: list[list[int]]) -> list[list[int]]:
    return [sorted({face for face in row if face >= 0}) for row in sets]


def all_sets_table(document: Mapping[str, Any]) -> str:
    """How many sets of faces end with each reason."""
    rows = [(str(n), reason, *MEANING[reason]) for reason, n in document["reasons"].items()]
    lines = [_document_head(document), *aligned([("sets", "reason", "step", "meaning"), *rows])]
    if not document["reasons"].get("certified"):
        lines.append(f"no certified grasp{_friction_hint(document['mu_needed'])}")
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
    return _head(*(document[key] for key in keys))


def _head(model: str, num_faces: int, excluded: Sequence[int], num_sets: int) -> str:
    named = (
        " ".join(map(str, excluded)) if len(excluded) <= MOST_NAMED else f"{len(excluded)} faces"
    )
    avoided = f" (excluded: {named})" if excluded else ""
    return f"{model}: {num_faces} faces{avoided}, {num_sets} sets of faces"
