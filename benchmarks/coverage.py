"""Does the default planner miss what others find: on solids where a search fails most easily.

    python -m benchmarks.coverage [FAMILY ...] [--seeds 18] [--first-seed 0] [--json OUT.json]

Each object is planned by default and searched in two other ways. Their epsilons are bounded within
half a percent, and compared as plans report them, within two.

    paper    the best of all grasps that the paper's stages construct, not only of its ten of best Q
    random   the best of 5,000 random triples of contacts

It prints on what share of the objects the default's best grasp is at least as good as theirs, on
how many it finds none where they find one, and the worst cases. The exit status is 1 when the
default misses a grasp, is worse than the paper anywhere, or than the random triples on more than
one percent.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.hard_objects import SEEDS, HardObject, hard_objects
from benchmarks.measure import GAP, search
from benchmarks.peers import ROUNDING, Triples, epsilon_of, random_triples
from drake_polygrasp.certification.robustness import RELATIVE_GAP
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.pipeline.judge import Judge
from drake_polygrasp.pipeline.plan import plan_grasps
from drake_polygrasp.pipeline.proposals import constructed
from drake_polygrasp.pipeline.request import make_request
from drake_polygrasp.settings import NO_ERRORS, PlanOptions
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates

SHARE_OF_RANDOM = 0.99
WORST = 10


@dataclass(frozen=True)
class Comparison:
    """Best epsilons of one object; 0 where no grasp was found."""

    family: str
    name: str
    faces: int
    default: float
    paper: float
    random: float
    not_evaluated: int
    """Sets that the default plan leaves out."""
    seconds: float
    """Of the default plan."""

    def ratio(self, other: str) -> float:
        """The default's epsilon over another's; inf where the other finds none."""
        theirs: float = getattr(self, other)
        return self.default / theirs if theirs > 0 else math.inf

    def misses(self, other: str) -> bool:
        """Whether the default finds no grasp and the other does."""
        theirs: float = getattr(self, other)
        return self.default == 0 < theirs


def compare(subject: HardObject) -> Comparison:
    """Plans and searches one object."""
    object_ = subject.make()
    start = perf_counter()
    plan = plan_grasps(object_, **NO_ERRORS)
    seconds = perf_counter() - start
    ours = 0.0
    if plan.grasps:
        grasp = plan.grasps[0].grasp
        contacts = grasp.p_BC[None], np.array([grasp.faces]), grasp.nhat_TB_B[None], grasp.mu[None]
        ours = epsilon_of(object_, Triples(*contacts), relative_gap=GAP)
    return Comparison(
        subject.family,
        subject.name,
        len(object_.polyhedron.faces),
        ours,
        best_of_paper(object_),
        _best_of_random(object_),
        plan.reasons.get("not_evaluated", 0),
        seconds,
    )


def best_of_paper(object_: GraspObject) -> float:
    """The greatest epsilon of all that the paper's stages construct and that is proved."""
    work = constructed(make_request(object_, PlanOptions(method="paper")))
    judge = Judge(work)
    rows = judge.open_rows
    estimate = epsilon_estimates(*work.contacts_of(rows), object_.p_BBcm, object_.rho)
    best = 0.0
    for k in np.argsort(-estimate, kind="stable"):
        if estimate[k] * (1 + ROUNDING) <= best:
            break
        row = rows[k : k + 1]
        judge.judge(row)
        if int(row[0]) in judge.proofs:
            contacts = Triples(
                work.candidates.p_BC[row], work.face[row], work.nhat_TB_B[row], work.mu[row]
            )
            best = max(best, epsilon_of(object_, contacts, at_least=best, relative_gap=GAP))
    return best


def _best_of_random(object_: GraspObject) -> float:
    try:
        return float(search(object_, random_triples)["epsilon"])
    except IndexError:  # No face is wide enough for fingers.
        return 0.0


def share(results: list[Comparison], other: str) -> float:
    """Of the objects on which the other finds a grasp, those on which ours is as good."""
    found = [result for result in results if getattr(result, other) > 0]
    as_good = [result for result in found if result.ratio(other) >= 1 - RELATIVE_GAP]
    return len(as_good) / len(found) if found else 1.0


def summary(results: list[Comparison]) -> str:
    """Shares, misses and the worst cases."""
    lines = [f"{len(results)} objects, {sum(r.default > 0 for r in results)} with grasps"]
    for other in ("paper", "random"):
        count = sum(result.misses(other) for result in results)
        lines.append(
            f"default at least as good as {other}: {100 * share(results, other):.1f} percent; "
            f"finds none where {other} finds a grasp: {count}"
        )
        worst = sorted(results, key=lambda result: result.ratio(other))[:WORST]
        lines += [
            f"  {result.ratio(other):7.3f}  {result.name}, {result.faces} faces: "
            f"{result.default:.5f}, {other} {getattr(result, other):.5f}"
            for result in worst
            if result.ratio(other) < math.inf
        ]
    seconds = np.array([result.seconds for result in results])
    lines.append(
        f"default: {np.median(seconds):.3f} s in the median, {seconds.max():.2f} s at most, "
        f"{seconds.sum():.1f} s in all"
    )
    return "\n".join(lines)


def holds(results: list[Comparison]) -> bool:
    """Whether the default misses nothing, and is as good as it promises."""
    missed = any(result.misses(other) for result in results for other in ("paper", "random"))
    return (
        not missed
        and share(results, "paper") == 1.0
        and share(results, "random") >= SHARE_OF_RANDOM
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.coverage",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("names", nargs="*", metavar="FAMILY", help="only these families (default: all)")
    add("--seeds", type=int, default=SEEDS, help=f"objects of each family (default: {SEEDS})")
    add("--first-seed", type=int, default=0, help="other objects of the same kinds (default: 0)")
    add("--json", type=Path, metavar="FILE", help="write every object's numbers to FILE")
    arguments = parser.parse_args()
    subjects = list(hard_objects(arguments.first_seed, arguments.seeds))
    known = dict.fromkeys(subject.family for subject in subjects)
    if unknown := set(arguments.names) - set(known):
        parser.error(f"no family {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    results = []
    for subject in subjects:
        if not arguments.names or subject.family in arguments.names:
            results.append(compare(subject))
            r = results[-1]
            print(
                f"{r.name:<26}{r.faces:>5} faces  default {r.default:.5f}  paper {r.paper:.5f}  "
                f"random {r.random:.5f}  {r.not_evaluated:>8} not evaluated  {r.seconds:.2f} s",
                flush=True,
            )
    print("", summary(results), sep="\n")
    if arguments.json:
        document = [asdict(result) for result in results]
        arguments.json.write_text(json.dumps(document, indent=1) + "\n")
    return 0 if holds(results) else 1


if __name__ == "__main__":
    sys.exit(main())
