"""How long commands take beside the least that Drake lets them take.

    python -m benchmarks.shell [MODEL ...] [--runs 10]

A bare script loads the same model with Drake's Parser, as every user of Drake does. Whole processes
are timed, one of each in turn, and a command's time is divided by that of the script in the same
round: the processor's time, which other work on the machine changes least, and that of the clock.
The median of all rounds counts. Python's bytecode is kept, as pip keeps it for what it installs.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.objects import ROOT

MODELS = ("cube/cube.sdf", "l_bracket/l_bracket.sdf", "octagonal_prism/octagonal_prism.sdf")
BARE = """
import sys
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), time_step=0.0)
Parser(plant).AddModels(sys.argv[1])
plant.Finalize()
"""
POLYGRASP = "import sys; from drake_polygrasp.cli import main; sys.exit(main())"
"""What the installed command runs."""
NO_ERRORS = [
    part for name in ("placement", "tilt", "friction", "com") for part in (f"--{name}-error", "0")
]


class Seconds(NamedTuple):
    """What a process took."""

    processor: float
    clock: float

    def over(self, other: Seconds) -> Seconds:
        """The quotients."""
        return Seconds(self.processor / other.processor, self.clock / other.clock)


def main() -> None:
    arguments = _arguments()
    models = arguments.models or [ROOT / "models" / name for name in MODELS]
    print(
        "| model | command | processor [s] | ratio | by the clock |",
        "|---|---|---|---|---|",
        sep="\n",
    )
    with tempfile.TemporaryDirectory() as scratch:
        for model in models:
            for name, seconds, ratio in measure(model, arguments.runs, Path(scratch)):
                print(
                    f"| {model.stem} | {name} | {seconds:.2f} | {ratio.processor:.2f} | "
                    f"{ratio.clock:.2f} |",
                    flush=True,
                )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.shell", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument(
        "models", nargs="*", metavar="MODEL", type=Path, help="default: three of ours"
    )
    parser.add_argument("--runs", type=int, default=10, help="rounds of all commands (default: 10)")
    return parser.parse_args()


def commands(model: Path, folder: Path) -> dict[str, list[str]]:
    """What is timed, by name; the first is what the others are compared with."""
    python, written = sys.executable, folder / "written.grasp.yaml"
    polygrasp = [python, "-c", POLYGRASP]
    plan = [*polygrasp, "plan", str(model), "-o"]
    return {
        "Drake's Parser": [python, "-c", BARE, str(model)],
        "plan": [*plan, str(written)],
        "plan, no errors": [*plan, str(folder / "exact.grasp.yaml"), *NO_ERRORS],
        "plan --effort quick": [*plan, str(folder / "quick.grasp.yaml"), "--effort", "quick"],
        "verify": [*polygrasp, "verify", str(written)],
        "explain": [*polygrasp, "explain", str(model)],
        "--help": [*polygrasp, "--help"],
        "import drake_polygrasp": [python, "-c", "import drake_polygrasp"],
    }


def measure(model: Path, runs: int, folder: Path) -> list[tuple[str, float, Seconds]]:
    """Each command's name, median processor time [s], and median quotients."""
    environment = {
        **{key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"},
        "PYTHONPYCACHEPREFIX": str(folder / "bytecode"),
        "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
    }
    timed = commands(model, folder)
    for command in timed.values():  # Bytecode and files are read once before anything counts.
        run(command, environment)
    rounds = [[run(command, environment) for command in timed.values()] for _ in range(runs)]
    found = []
    for k, name in enumerate(timed):
        ratios = [row[k].over(row[0]) for row in rounds]
        median = Seconds(*(statistics.median(values) for values in zip(*ratios, strict=True)))
        found.append((name, statistics.median(row[k].processor for row in rounds), median))
    return found


def run(command: Sequence[str], environment: Mapping[str, str]) -> Seconds:
    """Runs a process that must succeed, and returns what it and its children took."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, env=dict(environment), capture_output=True, check=True)
    clock, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return Seconds(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, clock)


if __name__ == "__main__":
    main()
