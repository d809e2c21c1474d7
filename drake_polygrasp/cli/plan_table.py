"""The output of `polygrasp plan`: a table, the lines of `--gap`, and the gap's part of the JSON."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, floor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.table import align_columns, friction_hint, head_line, lacking_friction
from drake_polygrasp.visualization.precision import FINE, placement_words

if TYPE_CHECKING:
    from drake_polygrasp.grasp import CertifiedGrasp, GraspObject, RegionCertificate
    from drake_polygrasp.optimality.gap import OptimalityGap
    from drake_polygrasp.pipeline.plan import GraspPlan
    from drake_polygrasp.settings import PlanSettings


def holds_in_plant(grasp: CertifiedGrasp) -> bool:
    """Returns whether a grasp was checked in a plant and every verdict is "holds".

    Args:
        grasp: a planned grasp.
    """
    return grasp.plant is not None and grasp.plant.holds


def _plant_column(grasps: Sequence[CertifiedGrasp]) -> list[tuple[str, ...]]:
    """Returns the cells "plant" of header, units and rows; empty rows without a plant check."""
    if not any(grasp.plant for grasp in grasps):
        return [()] * (2 + len(grasps))
    verdicts = [("-" if grasp.plant is None else str(grasp.plant.verdict),) for grasp in grasps]
    return [("plant",), ("",), *verdicts]


def _plant_lines(grasps: Sequence[CertifiedGrasp]) -> list[str]:
    """Returns how many grasps hold in the plant, and the ranks of the others by first fault."""
    checked = [grasp for grasp in grasps if grasp.plant is not None]
    if not checked:
        return []
    ranks_by_fault: dict[str, list[str]] = {}
    for rank, grasp in enumerate(grasps, start=1):
        if grasp.plant is not None and not grasp.plant.holds:
            first = next(v for v in grasp.plant.verdicts if v.verdict is grasp.plant.verdict)
            reason = f": {first.reason}" if first.reason else ""
            fault = f"{first.name} {first.verdict}{reason}"
            ranks_by_fault.setdefault(fault, []).append(str(rank))
    return [
        f"in a plant {sum(map(holds_in_plant, checked))} of {len(checked)} grasps hold",
        *(
            f"grasp{'s' if len(ranks) > 1 else ''} {', '.join(ranks)}, {fault}"
            for fault, ranks in ranks_by_fault.items()
        ),
    ]


_LESS = "less than was asked is stated where more is not proved or leaves under a tenth of epsilon"
_THEN = "epsilon and squeeze are of exact contacts, then: of the worst of all these errors"
_RANKED = "; grasps that bear as much are ranked by that epsilon"


def error_columns(
    settings: PlanSettings, grasps: Sequence[CertifiedGrasp]
) -> list[tuple[str, ...]]:
    """Returns the cells "bears" and twice "then" of header, units and rows; none without errors.

    Args:
        settings: those of the plan.
        grasps: its grasps, best first.
    """
    if not settings.has_errors:
        return [()] * (2 + len(grasps))
    cells = [_bears_cells(grasp.region) for grasp in grasps]
    return [("bears", "then", "then"), ("[mm]", "epsilon", "[N]"), *cells]


def _bears_cells(region: RegionCertificate | None) -> tuple[str, str, str]:
    """Returns the misses that a grasp bears, and its epsilon and squeeze under all errors."""
    if region is None:
        return "-", "-", "-"
    squeeze = "-" if region.squeeze_force is None else f"{region.squeeze_force:.1f}"
    epsilon = f"{floor(1e4 * (region.epsilon_lower or 0.0)) / 1e4:.4f}"
    return f"{1e3 * region.least_placement_error:.2f}", epsilon, squeeze


def error_lines(
    settings: PlanSettings, grasps: Sequence[CertifiedGrasp], squeeze: str
) -> list[str]:
    """Returns what "bears" stands for, and which grasps bear less than was asked, and why.

    Args:
        settings: those of the plan.
        grasps: its grasps, best first.
        squeeze: line on epsilon and squeeze under these errors.
    """
    if not settings.has_errors:
        return []
    errors = ["" if g.region is None else _errors_text(g.region) for g in grasps]
    asked = _errors_text(settings)
    lines = [
        "bears: proved to hold with each contact off by this much along its face and, at once, "
        f"{asked}",
        squeeze,
    ]
    lines += [
        f"{which}: {text or 'not proved to bear any errors'}"
        for which, text in _by_ranks(errors)
        if text != asked
    ]
    is_less = any(text not in ("", asked) for text in errors)
    return lines + [_LESS] * is_less


def _by_ranks(texts: Sequence[str]) -> list[tuple[str, str]]:
    """Returns the different texts on ranked grasps, each with the grasps that it is about."""
    ranks_by_text: dict[str, list[int]] = {}
    for rank, text in enumerate(texts, start=1):
        ranks_by_text.setdefault(text, []).append(rank)
    return [
        (f"grasp{'s' if len(ranks) > 1 else ''} {_ranges(ranks)}", text)
        for text, ranks in ranks_by_text.items()
    ]


def _ranges(ranks: list[int]) -> str:
    """Returns ascending ranks as text, those in a row as "4 to 7"."""
    firsts = [rank for rank in ranks if rank - 1 not in ranks]
    lasts = [rank for rank in ranks if rank + 1 not in ranks]
    rows = zip(firsts, lasts, strict=True)
    return ", ".join(f"{a} to {b}" if b > a else str(a) for a, b in rows)


def _errors_text(errors: RegionCertificate | PlanSettings) -> str:
    """Returns the errors of normals, friction and centre of mass in words."""
    return (
        f"normals by {degrees(errors.tilt_error):.3g} degrees, friction less by "
        f"{100 * errors.friction_error:.3g} percent and the centre of mass off by "
        f"{_length_text(errors.com_error)}"
    )


def _length_text(length: float) -> str:
    """Returns a length with three digits, without an exponent."""
    in_metres = float(f"{length:.3g}") >= 1
    value = float(f"{length if in_metres else 1e3 * length:.3g}")
    return f"{value:.12f}".rstrip("0").rstrip(".") + (" m" if in_metres else " mm")


def plan_table(model: str, object_: GraspObject, plan: GraspPlan, output: Path) -> str:
    """Returns the table of a plan's grasps, best first, one per row.

    Args:
        model: the model's name.
        object_: the object.
        plan: its plan, with at least one grasp.
        output: the grasp file that was written.
    """
    header = ("rank", "faces", "kind", "Q", "margin", "epsilon", "mu_min", "placement", "squeeze")
    units = ("", "", "", "", "", "", "", "[mm]", "[N]")
    rows = [_grasp_row(rank, grasp) for rank, grasp in enumerate(plan.grasps, start=1)]
    cells = [
        (*row, *bears, *plant)
        for row, bears, plant in zip(
            [header, units, *rows],
            error_columns(plan.settings, plan.grasps),
            _plant_column(plan.grasps),
            strict=True,
        )
    ]
    then = _THEN + (_RANKED if plan.settings.rank == "epsilon" else "")
    num_faces = len(object_.polyhedron.faces)
    head = head_line(model, num_faces, plan.excluded_faces, plan.num_sets)
    return "\n".join(
        [
            f"{head}, {_counts(plan)}",
            *align_columns(cells),
            *error_lines(plan.settings, plan.grasps, then),
            *_plant_lines(plan.grasps),
            *_placement_lines(object_, plan.grasps),
            f"wrote {output}",
        ]
    )


def _counts(plan: GraspPlan) -> str:
    """Returns how many sets have a proved grasp, "so far" where others were not evaluated."""
    if not plan.num_not_evaluated:
        return f"{plan.num_certified} certified, all evaluated"
    return f"{plan.num_certified} proved so far, {plan.num_not_evaluated} not evaluated"


def _placement_lines(object_: GraspObject, grasps: Sequence[CertifiedGrasp]) -> list[str]:
    """Returns what small placement tolerances mean, and why they are small on patches."""
    words = _by_ranks([placement_words(grasp) for grasp in grasps])
    lines = [f"{ranks}: {text}" for ranks, text in words if text == FINE]
    faces = object_.polyhedron.faces
    if any(faces[k].reach > 0 for certified in grasps for k in certified.grasp.faces):
        note = (
            "placement holds only as far as normals stay the same: on curved or scanned surfaces, "
            "within a contact's own facet or a milliradian of the curve"
        )
        if any(certified.region for certified in grasps):
            note += "; bears is of all facets around, with their normals"
        lines.append(note)
    return lines


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


def gap_lines(gap: OptimalityGap) -> list[str]:
    """Returns lines on how close the plan is to the optimum, and on a better grasp if one is known.

    Args:
        gap: what branch and bound found.
    """
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
            f"a better grasp exists: epsilon {gap.better.epsilon:.4f} on faces "
            f"{' '.join(map(str, gap.better.faces))} at {points}"
        )
    return lines


def gap_document(gap: OptimalityGap) -> dict[str, Any]:
    """Returns the gap as a document for JSON.

    Args:
        gap: what branch and bound found.
    """
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
    """Returns the message of a plan without grasps: whether all sets were evaluated, and why.

    Args:
        model: the model's name.
        object_: the object.
        plan: its plan, without grasps.
        output: the grasp file that is not written.
    """
    reasons = ", ".join(f"{count} {reason}" for reason, count in plan.reasons.items())
    # Default errors cost no grasp, so that they are not why there is none.
    is_given = plan.settings.placement_error_share_of_inradius is None
    misses = is_given and plan.settings.placement_error > 0
    kept = "edge clearance and placement error" if misses else "edge clearance"
    why = f" ({reasons})" if reasons else f": no two faces have room within the {kept}"
    if plan.outcome == "none_found":
        result = (
            f"no grasp found; {plan.num_not_evaluated} of {plan.num_sets} sets of faces were not "
            f"evaluated{why}; --effort complete evaluates all, --exclude-faces leaves fewer"
        )
    else:
        result = f"no certified grasp; all {plan.num_sets} sets of faces were evaluated{why}"
    left = f"{output} is left as it was" if output.exists() else "no file is written"
    return f"{model}: {result}; {left}{friction_hint(lacking_friction(object_, plan.mu_needed))}"
