"""What first grasps are certified to bear, how near the proofs are to the truth, and their time.

    python -m benchmarks.regions [FILE ...] [--generated N] [--millimetres 2 3 5]
        [--shares 0.02 0.05] [--tilt RAD] [--friction SHARE] [--com SHARE] [--require N ...]

For each object (default: our models; FILE may be a model or a folder of models) it prints

    2 mm, 3 mm, 5 mm   whether the first grasp of a plan for that placement error and, at once, the
                       other errors is certified to bear them: + or -; "none" without a grasp
    radius             of the discs that one internal force is found to serve at the first grasp of
                       the plan for 2 percent of L, over the largest that a search with its own
                       code finds, which knows neither the cutting planes nor the exact check
    L/U 0.02, 0.05     lower over upper bound of epsilon under errors with discs of that share of L;
                       "-" where nothing is certified or the upper bound is 0
    grasps             of how many grasps errors are certified in the timed plan
    more               seconds that the plan for 2 percent of L takes more than one for exact
                       contacts with the same distance from edges, processor time

The exit status is 1 when a lower bound is below 0.9 of the upper one at the first share, or when
fewer objects are certified than `--require` says for each of the millimetres.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.misses import COM, FRICTION, TILT, Subject, generated, of_files
from benchmarks.objects import models
from drake_polygrasp import (
    CertifiedGrasp,
    GraspObject,
    GraspPlan,
    PolygraspError,
    load_object,
    plan_grasps,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification import largest_certified_radius, narrowed_friction
from drake_polygrasp.settings import NO_ERRORS

LEAST_RATIO = 0.9
_LEVELS, _SIDE, _NARROWER, _TANGENTS = 12, 25, 0.3, 720


@dataclass(frozen=True)
class Measured:
    """The numbers of one object.

    Attributes:
        certified: for each placement error whether the first grasp bears it; None without a grasp.
        radius: of one internal force, over the largest that is found; None without a grasp.
        ratios: for each share of L lower over upper bound of epsilon; None where there are none.
        num_grasps: grasps with a region in the plan for the first share.
        seconds: that its errors take.
    """

    name: str
    faces: int
    certified: list[bool | None]
    radius: float | None
    ratios: list[float | None]
    num_grasps: int
    seconds: float


def largest_radius(p_BC: Array, nhat_TB_B: Array, mu: Array) -> float:
    """The largest discs about contacts for which one internal force holds, by nested grids.

    For a half-space u of the cone at contact i, u.f_i falls by at most r times the sum over k of
    |a_ik| |P_k u|, where contact k's displacement enters f_i with the factor a_ik and P_k projects
    on its face. Their least quotient is quasi-concave in x, so grids around the best x close in.
    """
    turns = 2 * np.pi * np.arange(_TANGENTS) / _TANGENTS
    forces, losses = [], []
    sides = p_BC[None] - p_BC[:, None]  # sides[i, k] from i to k
    pairs = [(0, 1), (0, 2), (1, 2)]
    for i in range(3):
        n = nhat_TB_B[i]
        t_1 = np.cross(n, np.eye(3)[np.abs(n).argmin()])
        t_1 /= np.linalg.norm(t_1)
        t_2 = np.cross(n, t_1)
        u = mu[i] * n + np.cos(turns)[:, None] * t_1 + np.sin(turns)[:, None] * t_2
        force = np.zeros((_TANGENTS, 3))
        factors = np.zeros((3, 3))  # of contact k's displacement, by x
        for j, (a, b) in enumerate(pairs):
            if i in (a, b):
                other = b if i == a else a
                force[:, j] = u @ sides[i, other]
                factors[other, j], factors[i, j] = 1.0, -1.0
        across = [np.linalg.norm(u - np.outer(u @ m, m), axis=1) for m in nhat_TB_B]
        forces.append(force)
        losses.append((factors, np.stack(across)))

    def radius(x: Array) -> Array:
        least = np.full(len(x), np.inf)
        for force, (factors, across) in zip(forces, losses, strict=True):
            loss = np.abs(x @ factors.T) @ across
            least = np.minimum(least, ((x @ force.T) / np.maximum(loss, 1e-300)).min(axis=1))
        return least

    # Only the direction of x counts, in either sense: a cube's faces cover all.
    grid = np.linspace(-1.0, 1.0, 2 * _SIDE)
    u, v = (g.ravel() for g in np.meshgrid(grid, grid))
    ones = np.ones_like(u)
    faces = [
        np.roll(np.column_stack([s * ones, u, v]), k, axis=1) for k in range(3) for s in (1, -1)
    ]
    x = np.concatenate(faces)
    found = radius(x)
    best, step = x[found.argmax()], 4.0 / _SIDE
    for _ in range(_LEVELS):
        first, second = np.linalg.svd(best[None])[2][1:]
        offsets = step * np.linspace(-1.0, 1.0, _SIDE)
        u, v = (g.ravel() for g in np.meshgrid(offsets, offsets))
        near = best + np.linalg.norm(best) * (u[:, None] * first + v[:, None] * second)
        best, step = near[radius(near).argmax()], step * _NARROWER
    return float(radius(best[None])[0])


def radius_share(grasp: CertifiedGrasp, size: float, tilt: float, friction: float) -> float:
    """The certified radius over the largest that is found, for the friction that errors leave."""
    contacts = grasp.grasp.p_BC, grasp.grasp.nhat_TB_B
    left = np.array([float(narrowed_friction(m, tilt, friction)) for m in grasp.grasp.mu.tolist()])
    largest = largest_radius(*contacts, left)
    proved = largest_certified_radius(
        *contacts,
        grasp.grasp.mu,
        np.full(3, 2 * largest),
        size=size,
        tilt_error=tilt,
        friction_error=friction,
    )
    return 0.0 if proved is None else float(proved.placement_error.min()) / largest


def _plan(object_: GraspObject, name: str, **options: Any) -> GraspPlan | None:
    try:
        return plan_grasps(object_, **options)
    except PolygraspError as error:
        print(f"{name}: {error}", flush=True)
        return None


def _first(plan: GraspPlan | None) -> CertifiedGrasp | None:
    return next(iter(plan.grasps), None) if plan is not None else None


def measured(subject: Subject, arguments: argparse.Namespace) -> Measured:
    """Plans for each placement error, and compares bounds and times."""
    object_ = subject.make()
    L = object_.polyhedron.diameter
    others = {
        "tilt_error": arguments.tilt,
        "friction_error": arguments.friction,
        "com_error": arguments.com * L,
    }
    certified: list[bool | None] = []
    for millimetres in arguments.millimetres:
        error = 1e-3 * millimetres
        first = _first(_plan(object_, subject.name, placement_error=error, **others))
        region = None if first is None else first.region
        bears = region is not None and bool(region.least_placement_error >= error * (1 - 1e-9))
        certified.append(None if first is None else bears)
    ratios: list[float | None] = []
    radius, num_grasps, seconds = None, 0, 0.0
    for k, share in enumerate(arguments.shares):
        start = process_time()
        plan = _plan(object_, subject.name, placement_error=share * L, **others)
        middle = process_time()
        region = getattr(_first(plan), "region", None)
        ratios.append(
            region.epsilon_lower / region.epsilon_upper if region and region.epsilon_upper else None
        )
        if k == 0 and plan is not None and plan.grasps:
            _plan(object_, subject.name, edge_clearance=share * L, **NO_ERRORS)
            seconds = (middle - start) - (process_time() - middle)
            num_grasps = sum(grasp.region is not None for grasp in plan.grasps)
            radius = radius_share(plan.grasps[0], L, arguments.tilt, arguments.friction)
    faces = len(object_.polyhedron.faces)
    return Measured(subject.name, faces, certified, radius, ratios, num_grasps, seconds)


def _row(result: Measured) -> str:
    marks = {True: "+", False: "-", None: "none"}
    cells = [f"{result.name[-33:]:<34}{result.faces:>6}"]
    cells += [f"{marks[c]:>7}" for c in result.certified]
    numbers = [result.radius, *result.ratios]
    cells += [f"{'-' if number is None else f'{number:.3f}':>9}" for number in numbers]
    return "".join([*cells, f"{result.num_grasps:>8}{result.seconds:>9.2f}"])


def summary(results: list[Measured], arguments: argparse.Namespace) -> str:
    """Counts, medians and extremes of all objects."""
    num, lines = len(results), []
    for k, millimetres in enumerate(arguments.millimetres):
        count = sum(result.certified[k] is True for result in results)
        lines.append(f"{millimetres:g} mm: {count} of {num} first grasps certified")
    radii = [result.radius for result in results if result.radius is not None]
    columns = [("radius", radii)]
    for k, share in enumerate(arguments.shares):
        ratios = [result.ratios[k] for result in results]
        columns.append((f"L/U at {share:g} L", [ratio for ratio in ratios if ratio is not None]))
    for label, values in columns:
        if values:
            tenth, median = np.quantile(values, [0.1, 0.5])
            lines.append(
                f"{label}: median {median:.4f}, tenth {tenth:.3f}, least {min(values):.3f} "
                f"of {len(values)}"
            )
    more = [result.seconds for result in results]
    lines.append(f"seconds more: median {np.median(more):.2f}, most {max(more):.2f}")
    return "\n".join(lines)


def is_enough(results: list[Measured], required: list[int]) -> bool:
    """Whether bounds are near enough and enough objects certified."""
    near = all(result.ratios[0] is None or result.ratios[0] >= LEAST_RATIO for result in results)
    counts = [
        sum(c is True for c in column)
        for column in zip(*(r.certified for r in results), strict=True)
    ]
    return near and all(count >= least for count, least in zip(counts, required, strict=False))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.regions",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("files", nargs="*", type=Path, metavar="FILE", help="model files or folders of them")
    add("--generated", type=int, default=0, metavar="N", help="N random solids (default: none)")
    add("--millimetres", type=float, nargs="+", default=[2, 3, 5], help="(default: 2 3 5)")
    add("--shares", type=float, nargs="+", default=[0.02, 0.05], help="(default: 0.02 0.05)")
    add("--tilt", type=float, default=TILT, metavar="RAD", help=f"(default: {TILT}, 5 degrees)")
    add("--friction", type=float, default=FRICTION, help=f"share of mu (default: {FRICTION})")
    add("--com", type=float, default=COM, help=f"share of L (default: {COM})")
    add("--require", type=int, nargs="+", default=[], metavar="N", help="first grasps certified")
    return parser


def main() -> int:
    arguments = _parser().parse_args()
    subjects = list(of_files(arguments.files)) + list(generated(arguments.generated))
    subjects = subjects or [Subject(s.name, partial(load_object, s.file)) for s in models()]
    heads = [f"{mm:g} mm" for mm in arguments.millimetres]
    titles = ["radius", *(f"L/U {share:g}" for share in arguments.shares)]
    print(
        f"{'object':<34}{'faces':>6}{''.join(f'{head:>7}' for head in heads)}"
        f"{''.join(f'{title:>9}' for title in titles)}{'grasps':>8}{'more [s]':>9}"
    )
    results = []
    for subject in subjects:
        results.append(measured(subject, arguments))
        print(_row(results[-1]), flush=True)
    print("", summary(results, arguments), sep="\n")
    return 0 if is_enough(results, arguments.require) else 1


if __name__ == "__main__":
    sys.exit(main())
