"""How good, how fast, how large: the planner beside its peers on many objects.

    python -m benchmarks.compare [NAME ...] [--folder DIR] [--most 1] [--json OUT.json]

Each object is loaded, planned and certified in a process of its own; another process searches it
in other ways. epsilon is compared, a bound within half a percent. Peers:

    quick          the planner with effort "quick", for one grasp
    random         best of 5,000 triples drawn by area on the same eroded faces
    random_x4      best of 20,000 of them
    random_inside  best of 5,000 that keep the default placement error from edges
    antipodal      best of 5,000 antipodal pairs with a third contact drawn by area
    paper          the paper's planner, its grasp of best Q
    best           best known: 50,000 random triples, then all winners improved by moving contacts

The planner is asked for no errors, as these searches know none; `default` is the plan for its
default errors, whose contacts are compared by their epsilon without errors.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.long_search import NUM_TRIPLES
from benchmarks.objects import ROOT, Subject, generated, in_folder, models
from benchmarks.tables import HEADER, growth_table, kinds_table, row, stages_table
from drake_polygrasp.settings import NO_ERRORS

LARGEST_FOR_PAPER = 110
"""Faces; "100 faces" and the few more that tangent polyhedra of rounded coordinates have."""


def main() -> None:
    arguments = _arguments()
    with tempfile.TemporaryDirectory() as scratch:
        subjects = _subjects(arguments, Path(scratch))
        print(HEADER)
        results = []
        for subject in subjects:
            results.append(measure(subject, arguments))
            print(row(results[-1]), flush=True)
    print("", stages_table(results), kinds_table(results), growth_table(results), sep="\n")
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1) + "\n")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.compare",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="only these objects or kinds (default: all)")
    add("--folder", type=Path, help="measure the models in this folder and below instead of ours")
    add("--most", type=int, help="at most so many generated objects of each size")
    add("--first-seed", type=int, default=0, help="of generated objects (default: 0)")
    add("--repeat", type=int, default=3, help="the least time of so many runs counts (default: 3)")
    add("--timeout", type=float, default=600.0, help="seconds for each process (default: 600)")
    add("--long", type=int, default=NUM_TRIPLES, help="triples of the long search; 0: none")
    add("--alone", action="store_true", help="no peers")
    add("--json", type=Path, metavar="FILE", help="write everything measured to FILE")
    return parser.parse_args()


def _subjects(arguments: argparse.Namespace, scratch: Path) -> list[Subject]:
    if arguments.folder:
        subjects = in_folder(arguments.folder)
    else:
        subjects = models() + generated(scratch, arguments.most, arguments.first_seed)
    names = set(arguments.names)
    known = {s.kind for s in subjects} | {s.name for s in subjects}
    if names - known:
        sys.exit(
            f"no object {', '.join(sorted(names - known))}; there are {', '.join(sorted(known))}"
        )
    return [s for s in subjects if not names or {s.kind, s.name} & names]


def measure(subject: Subject, arguments: argparse.Namespace) -> dict[str, Any]:
    """What there is to say of one object; a method that fails or takes too long has an error."""
    thing = {"file": str(subject.file), "mu": subject.mu}

    def run(task: str, **options: Any) -> dict[str, Any]:
        return _in_child({"task": task, **thing, **options}, arguments.timeout)

    result: dict[str, Any] = {"kind": subject.kind, "name": subject.name}
    result["ours"] = ours = run("ours", repeat=arguments.repeat, **NO_ERRORS)
    result["quick"] = run("ours", repeat=arguments.repeat, effort="quick", top=1, **NO_ERRORS)
    result["default"] = run("ours", repeat=arguments.repeat)
    if arguments.alone:
        return result
    found = run("peers", repeat=arguments.repeat)
    result |= {"peers": found} if "error" in found else found
    starts = [grasp for grasp in (ours, *found.values()) if _is_grasp(grasp)]
    if arguments.long and starts:
        result["best"] = run("long", num=arguments.long, starts=starts)
    if ours.get("faces", math.inf) <= LARGEST_FOR_PAPER:
        result["paper"] = run("ours", method="paper", repeat=1)
    return result


def _is_grasp(found: Any) -> bool:
    return isinstance(found, dict) and found.get("p_BC") is not None


def _in_child(request: dict[str, Any], timeout: float) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.measure"]
    try:
        done = subprocess.run(
            command,
            input=json.dumps(request),
            capture_output=True,
            text=True,
            cwd=ROOT,
            timeout=timeout,
            check=True,
        )
    except subprocess.TimeoutExpired:
        return {"error": f"more than {timeout:g} s"}
    except subprocess.CalledProcessError as failure:
        return {"error": failure.stderr.strip().splitlines()[-1]}
    result: dict[str, Any] = json.loads(done.stdout)
    return result


if __name__ == "__main__":
    main()
