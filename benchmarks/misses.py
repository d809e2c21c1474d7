"""How often a planned grasp holds when fingertips miss: drawn errors, judged independently.

    python -m benchmarks.misses [FILE ...] [--generated N] [--placement M | --share-of-L S]
        [--tilt RAD] [--friction SHARE] [--com SHARE] [--stated] [--on-rim] [--trials 1000]
        [--epsilon N] [--json OUT]

The best grasp of each object (default: our models) is planned in several ways:

    exact      for no errors: the greatest epsilon
    clearance  the same, with contacts at least as far from edges as fingertips may miss
    errors     for the errors that are drawn: so far from edges, with the friction that is left
    default    as the planner does it unasked, for its default errors

Of a grasp file, the first grasp is judged as it stands. With `--stated`, grasps that state what
they bear are judged by that: all of their trials must hold.

In each trial every fingertip is displaced in the plane of its contact, uniformly in a disc, comes
along the nominal normal and touches what it first meets; the normal there is tilted, uniformly in a
cone, and the friction there off by as much as a share of it, either way. The judge has its own code
for all of that and for force closure. P is the share of trials that are force closure, off that of
those in which a fingertip misses the body. With `--on-rim` every error is as large as it may be.
With `--epsilon N` the first N trials' epsilons are
bounded from below, to a percent, the centre of mass off by as much as a share of L: their mean, and
what 95 percent of them reach.

The exit status is 1 when the last way has fewer grasps that hold than `--require MEAN LEAST` says.
"""

from __future__ import annotations

import argparse
import json
import sys
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.objects import in_folder, models
from drake_polygrasp import (
    CertifiedGrasp,
    GraspObject,
    PolygraspError,
    load_grasps,
    load_object,
    plan_grasps,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.files.stated_grasp import GraspFile, StatedGrasp
from drake_polygrasp.grasp import RegionCertificate
from drake_polygrasp.loading.packages import find_packages
from drake_polygrasp.settings import NO_ERRORS
from drake_polygrasp.verification.stated_model import find_stated_model, load_stated_object
from tests.support.convex_polyhedra import (
    boxes,
    ellipsoid_hull,
    holed_prism,
    shells,
    tangent_polyhedron,
)
from tests.support.miss_judge import Errors, Solid, Surface, draw, epsilons
from tests.support.solids import solid

FRICTIONS = (0.3, 0.5, 0.2, 0.8)
SHARE_OF_L, TILT, FRICTION, COM = 0.02, 0.0873, 0.2, 0.05
PLANS = ("exact", "clearance", "errors", "default")
WORST = 3
_ROW = "{:<34}{:>6}{:>8}  {:<10}{:>8}{:>8}{:>10}{:>9}{:>9}"
HEADER = _ROW.format("object", "faces", "r [mm]", "plan", "P", "off", "planned", "mean", "5 %")


class Subject(NamedTuple):
    """An object to plan on."""

    name: str
    make: Callable[[], GraspObject]
    file: GraspFile | None = None
    """Whose first grasp is judged, in place of planned ones."""


@dataclass(frozen=True)
class Result:
    """What became of the best grasp of one object, planned in one way.

    Attributes:
        name: the object's.
        faces: how many it has.
        plan: how the grasp was planned.
        placement: how far fingertips may miss [m].
        holds: share of trials that are force closure; None without a grasp.
        off: share of trials in which a fingertip misses the body.
        planned: lower bound of the grasp's epsilon without errors.
        mean: mean epsilon of trials.
        low: what 95 percent of the trials' epsilons reach.
    """

    name: str
    faces: int
    plan: str
    placement: float
    holds: float | None = None
    off: float | None = None
    planned: float | None = None
    mean: float | None = None
    low: float | None = None

    @property
    def row(self) -> str:
        """A line of the table."""
        share = "none" if self.holds is None else f"{self.holds:.3f}"
        others = (f"{v:.3f}" if v is not None else "" for v in (self.off, self.planned))
        epsilon = (f"{v:.4f}" if v is not None else "" for v in (self.mean, self.low))
        size = f"{1e3 * self.placement:.2f}"
        head = self.name[-33:], self.faces, size, self.plan
        return _ROW.format(*head, share, *others, *epsilon)


def _options(plan: str, errors: Errors) -> dict[str, Any]:
    """What `plan_grasps` is asked for."""
    placement = float(errors.placement.max())
    if plan == "errors":
        return {
            "placement_error": placement,
            "tilt_error": errors.tilt,
            "friction_error": errors.friction,
            "com_error": errors.com,
        }
    exact = {} if plan == "default" else NO_ERRORS
    return exact | ({"edge_clearance": placement} if plan == "clearance" else {})


def surface_of(object_: GraspObject) -> Surface:
    """The body's triangles and curved solids, with the friction of their faces.

    What belongs to no face has the least friction of all; what covers the body may not be touched.
    """
    polyhedron = object_.polyhedron
    triangles = polyhedron.triangles_B
    mu = np.append(polyhedron.mu, polyhedron.mu.min())[polyhedron.triangle_face]
    stands_for = np.zeros(len(triangles), dtype=bool)
    solids = []
    for shape in (*polyhedron.primitives, *polyhedron.covering):
        faces = [face for face in polyhedron.faces if face.primitive is shape]
        friction = min((face.mu for face in faces), default=0.0)
        solids.append(Solid(shape.kind, shape.R_BG, shape.p_BG, shape.radii, friction))
        stands_for |= _is_inscribed(triangles, solids[-1], 1e-8 * polyhedron.diameter)
    if polyhedron.own is not None:
        mu = np.where(polyhedron.own, mu, 0.0)
    return Surface(triangles[~stands_for], mu[~stands_for], solids, polyhedron.diameter)


def _is_inscribed(triangles: Array, solid_: Solid, tolerance: float) -> np.ndarray:
    """Which triangles have all corners on a solid's curved surface, shape (T,)."""
    p_G = (triangles - solid_.p_BG) @ solid_.R_BG
    if solid_.kind == "ellipsoid":
        off = (np.linalg.norm(p_G / solid_.radii, axis=2) - 1) * solid_.radii.min()
    else:
        beyond = np.abs(p_G[..., 2]) - solid_.radii[2]
        rise = np.maximum(beyond, 0) if solid_.kind == "capsule" else 0.0 * beyond
        off = np.sqrt(p_G[..., 0] ** 2 + p_G[..., 1] ** 2 + rise**2) - solid_.radii[0]
        if solid_.kind == "cylinder":
            off = np.maximum(np.abs(off), np.abs(beyond))
    return np.asarray((np.abs(off) <= tolerance).all(axis=1))


def judged(
    name: str,
    plan: str,
    object_: GraspObject,
    found: CertifiedGrasp | StatedGrasp | None,
    errors: Errors,
    trials: int = 1000,
    num_epsilons: int = 0,
    seed: int = 0,
    on_rim: bool = False,
) -> Result:
    """Draws trials of one grasp; the same draws for every plan of an object."""
    faces, placement = len(object_.polyhedron.faces), float(errors.placement.max())
    if found is None:
        return Result(name, faces, plan, placement)
    grasp = found.grasp
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    drawn = draw(
        surface_of(object_),
        *(grasp.p_BC, grasp.nhat_TB_B, grasp.mu, object_.p_BBcm),
        errors,
        trials,
        rng,
        on_rim=on_rim,
    )
    mean = low = None
    if num_epsilons:
        epsilon = np.zeros(min(trials, num_epsilons))
        rows = np.flatnonzero(drawn.holds[: len(epsilon)])
        contacts = drawn.p[rows], drawn.n[rows], drawn.mu[rows], drawn.p_com[rows]
        epsilon[rows] = epsilons(*contacts, object_.rho)
        mean, low = float(epsilon.mean()), float(np.quantile(epsilon, 0.05))
    return Result(
        name,
        faces,
        plan,
        placement,
        float(drawn.holds.mean()),
        float(drawn.off.mean()),
        found.certificate.epsilon_lower,
        mean,
        low,
    )


def of_files(files: list[Path]) -> Iterator[Subject]:
    """Model files, those of folders, and grasp files."""
    for path in files:
        for found in [subject.file for subject in in_folder(path)] if path.is_dir() else [path]:
            name = f"{found.resolve().parent.name}/{found.stem}"
            if found.name.endswith(".grasp.yaml"):
                stated = load_grasps(found)
                file = find_stated_model(stated, find_packages(found, (), None))
                model = partial(load_stated_object, stated, file)
                yield Subject(name, model, stated)
            else:
                yield Subject(name, partial(_load, found))


def _load(file: Path) -> GraspObject:
    return load_object(file)


def generated(count: int, first_seed: int = 0) -> Iterator[Subject]:
    """Random solids of five kinds, some convex, some with holes, some of overlapping parts."""
    for seed in range(first_seed, first_seed + count):
        kind = tuple(_KINDS)[seed % len(_KINDS)]
        yield Subject(f"{kind}_{seed}", partial(_generated, kind, seed))


def _generated(kind: str, seed: int) -> GraspObject:
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    return solid(_KINDS[kind](seed, rng), mu=FRICTIONS[seed // len(_KINDS) % len(FRICTIONS)])


def _hull(seed: int, rng: np.random.Generator) -> Array:
    a, b, c = rng.uniform(0.02, 0.06, 3).tolist()
    return ellipsoid_hull(2 * int(rng.integers(4, 30)), seed, (a, b, c))


def _tangent(seed: int, rng: np.random.Generator) -> Array:
    return tangent_polyhedron(int(rng.integers(6, 40)), seed)


def _prism(seed: int, rng: np.random.Generator) -> Array:
    return holed_prism(int(rng.integers(3, 12)), int(rng.integers(0, 3)), seed)


def _boxes(seed: int, rng: np.random.Generator) -> Array:
    return boxes(int(rng.integers(1, 5)), seed)


def _shells(seed: int, rng: np.random.Generator) -> Array:
    return shells(int(rng.integers(2, 4)), 2 * int(rng.integers(6, 20)), seed)


_KINDS: dict[str, Callable[[int, np.random.Generator], Array]] = {
    "hull": _hull,
    "tangent": _tangent,
    "prism": _prism,
    "boxes": _boxes,
    "shells": _shells,
}


def summary(results: list[Result], plans: list[str]) -> str:
    """P of each way of planning: mean, least and where; and on how many objects it found none."""
    lines = []
    for plan in plans:
        of_plan = [result for result in results if result.plan == plan]
        found = sorted(
            ((result.holds, result.name) for result in of_plan if result.holds is not None),
        )
        if not found:
            lines.append(f"{plan}: no grasp on any of {len(of_plan)} objects")
            continue
        mean = sum(share for share, _ in found) / len(found)
        worst = ", ".join(f"{share:.3f} {name}" for share, name in found[:WORST])
        line = f"{plan}: P {mean:.4f} in the mean of {len(found)} objects; least {worst}"
        if none := len(of_plan) - len(found):
            line += f"; no grasp on {none}"
        means = [result.mean for result in of_plan if result.mean is not None]
        lows = [result.low for result in of_plan if result.low is not None]
        if means:
            line += f"; mean epsilon {np.mean(means):.4f}, 5 percent quantile {np.mean(lows):.4f}"
        lines.append(line)
    return "\n".join(lines)


def holds(results: list[Result], plan: str, mean: float, least: float) -> bool:
    """Whether enough trials hold of the grasps planned in one way."""
    shares = [r.holds for r in results if r.plan == plan and r.holds is not None]
    return bool(shares) and float(np.mean(shares)) >= mean and min(shares) >= least


def stated_errors(region: RegionCertificate) -> Errors:
    """What a grasp states that it bears."""
    return Errors(
        np.array(region.placement_error),
        region.tilt_error,
        region.friction_error,
        region.com_error,
    )


def _errors(arguments: argparse.Namespace, L: float) -> Errors:
    radius = arguments.share_of_L * L if arguments.placement is None else arguments.placement
    return Errors(np.full(3, radius), arguments.tilt, arguments.friction, arguments.com * L)


def _grasps(
    subject: Subject, object_: GraspObject, plans: list[str], errors: Errors
) -> Iterator[tuple[str, CertifiedGrasp | StatedGrasp | None]]:
    """The best grasp of each way of planning, or the first of a grasp file."""
    if subject.file is not None:
        yield "file", next(iter(subject.file.grasps), None)
        return
    for plan in plans:
        try:
            yield plan, next(iter(plan_grasps(object_, **_options(plan, errors)).grasps), None)
        except PolygraspError as error:
            print(f"{subject.name}, {plan}: {error}", flush=True)
            yield plan, None


def main() -> int:
    arguments = _parser().parse_args()
    subjects = list(of_files(arguments.files)) + list(generated(arguments.generated))
    subjects = subjects or [
        Subject(subject.name, partial(_load, subject.file)) for subject in models()
    ]
    print(HEADER)
    results = []
    for subject in subjects:
        object_ = subject.make()
        asked = _errors(arguments, object_.polyhedron.diameter)
        for plan, found in _grasps(subject, object_, arguments.plans, asked):
            errors = asked
            if arguments.stated and found is not None and found.region is not None:
                errors = stated_errors(found.region)
            numbers = arguments.trials, arguments.epsilon, arguments.seed, arguments.on_rim
            results.append(judged(subject.name, plan, object_, found, errors, *numbers))
            print(results[-1].row, flush=True)
    plans = list(dict.fromkeys(result.plan for result in results))
    print("", summary(results, plans), sep="\n")
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(r) for r in results], indent=1) + "\n")
    return 0 if holds(results, plans[-1], *arguments.require) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.misses",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("files", nargs="*", type=Path, metavar="FILE", help="model files or folders of them")
    add("--generated", type=int, default=0, metavar="N", help="N random solids (default: none)")
    radius = parser.add_mutually_exclusive_group()
    radius.add_argument("--placement", type=float, metavar="M", help="how far fingertips miss [m]")
    radius.add_argument(
        "--share-of-L",
        type=float,
        default=SHARE_OF_L,
        metavar="S",
        help=f"the same as a share of the diameter (default: {SHARE_OF_L})",
    )
    add("--tilt", type=float, default=TILT, metavar="RAD", help=f"(default: {TILT}, 5 degrees)")
    add("--friction", type=float, default=FRICTION, help=f"share of mu (default: {FRICTION})")
    add("--com", type=float, default=COM, help=f"share of L, for --epsilon (default: {COM})")
    add("--stated", action="store_true", help="errors are those that a grasp states it bears")
    add("--on-rim", action="store_true", help="errors are as large as they may be")
    add("--plans", nargs="+", choices=PLANS, default=list(PLANS), help="(default: all)")
    add("--trials", type=int, default=1000, help="of each grasp (default: 1000)")
    add("--epsilon", type=int, default=0, metavar="N", help="trials whose epsilon is bounded")
    add("--seed", type=int, default=0, help="of the draws (default: 0)")
    require = "P of the last plan at least: in the mean, and of every object (default: 0 0)"
    add("--require", nargs=2, type=float, default=(0, 0), metavar=("MEAN", "LEAST"), help=require)
    add("--json", type=Path, metavar="FILE", help="write every object's numbers to FILE")
    return parser


if __name__ == "__main__":
    sys.exit(main())
