"""What `polygrasp plan` prints: a table for people, plain documents for machines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drake_polygrasp.cli.table import aligned

if TYPE_CHECKING:
    from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
    from drake_polygrasp.optimality.gap import OptimalityGap
    from drake_polygrasp.pipeline.plan import GraspPlan
from drake_polygrasp.cli.table import friction_hint, head_line, lacking_friction

if TYPE_CHECKING:
    from drake_polygrasp.grasp import CertifiedGrasp


def holds_in_plant(grasp: CertifiedGrasp) -> bool:
    """Whether a plant was asked and all its verdicts are "holds"."""
    return grasp.plant is not None and grasp.plant.holds


def plant_column(grasps: Sequence[CertifiedGrasp]) -> list[tuple[str, ...]]:
    """The last cells of a plan's header, its units and its rows; empty where no plant was asked."""
    if not any(grasp.plant for grasp in grasps):
        return [()] * (2 + len(grasps))
    verdicts = [("-" if grasp.plant is None else str(grasp.plant.verdict),) for grasp in grasps]
    return [("plant",), ("",), *verdicts]


def plan_plant_lines(grasps: Sequence[CertifiedGrasp]) -> list[str]:
    """How many grasps a plant bears out, and for each other one the first verdict against it."""
    asked = [grasp for grasp in grasps if grasp.plant is not None]
    if not asked:
        return []
    ranks: dict[str, list[str]] = {}
    for rank, grasp in enumerate(grasps, start=1):
        if grasp.plant is not None and not grasp.plant.holds:
            against = next(v for v in grasp.plant.verdicts if v.verdict is grasp.plant.verdict)
            reason = f": {against.reason}" if against.reason else ""
            ranks.setdefault(f"{against.name} {against.verdict}{reason}", []).append(str(rank))
    return [
        f"in a plant {sum(map(holds_in_plant, asked))} of {len(asked)} grasps hold",
        *(
            f"grasp{'s' if len(who) > 1 else ''} {', '.join(who)}, {fault}"
            for fault, who in ranks.items()
        ),
    ]


def plan_table(model: str, object_: GraspObject, plan: GraspPlan, output: Path) -> str:
    """The grasps, one a row, best first."""
    header = ("rank", "faces", "kind", "Q", "margin", "epsilon", "mu_min", "placement", "squeeze")
    units = ("", "", "", "", "", "", "", "[mm]", "[N]")
    rows = [_grasp_row(rank, grasp) for rank, grasp in enumerate(plan.grasps, start=1)]
    in_plant = plant_column(plan.grasps)
    num_faces = len(object_.polyhedron.faces)
    head = head_line(model, num_faces, plan.excluded_faces, plan.num_sets)
    return "\n".join(
        [
            f"{head}, {_counts(plan)}",
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


def gap_lines(gap: OptimalityGap) -> list[str]:
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


def gap_document(gap: OptimalityGap) -> dict[str, Any]:
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
    return f"{model}: {result}; {left}{friction_hint(lacking_friction(object_, plan.mu_needed))}"
