"""Seconds to load, plan and certify: our models, and generated convex polyhedra.

    python benchmarks/timing.py [--method paper] [--repeat 5] [NAME ...]

The least of some repetitions counts: on a shared machine the rest is others' time.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from convex_polyhedra import ellipsoid_hull, tangent_polyhedron, write_obj  # noqa: E402

from drake_polygrasp import load_object, plan_grasps  # noqa: E402

NUM_FACES = (10, 30, 100)
SEED = 0
MU = 0.3
COLUMNS = "{:<24}{:>6}{:>9}{:>10}{:>8}{:>8}{:>8}"


class Timing(NamedTuple):
    """Of one run [s]."""

    load: float
    plan: float
    certify: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these (default: all)")
    parser.add_argument("--method", choices=["enriched", "paper"], default="enriched")
    parser.add_argument("--repeat", type=int, default=3, help="least time of so many runs")
    arguments = parser.parse_args()
    print(COLUMNS.format("object", "faces", "sets", "certified", "load", "plan", "certify"))
    with tempfile.TemporaryDirectory() as folder:
        files = model_files() | generated_files(Path(folder))
        unknown = set(arguments.names) - set(files)
        if unknown:
            parser.error(f"no object {', '.join(sorted(unknown))}; there are {', '.join(files)}")
        measure(files["cube"], arguments.method)  # imports and first calls are not timed
        for name in arguments.names or files:
            print(row(name, files[name], arguments.method, arguments.repeat), flush=True)


def model_files() -> dict[str, Path]:
    folders = sorted(path for path in (ROOT / "models").iterdir() if path.is_dir())
    return {
        folder.name: next(path for path in folder.iterdir() if path.suffix in {".sdf", ".urdf"})
        for folder in folders
    }


def generated_files(folder: Path) -> dict[str, Path]:
    """Polygons tangent to a sphere, and triangles inscribed in an ellipsoid."""
    files = {}
    for kind, solid in {"tangent": tangent_polyhedron, "ellipsoid": ellipsoid_hull}.items():
        for num_faces in NUM_FACES:
            name = f"{kind}_{num_faces}"
            files[name] = folder / f"{name}.obj"
            write_obj(files[name], solid(num_faces, SEED))
    return files


def row(name: str, file: Path, method: str, repeat: int) -> str:
    runs = [measure(file, method) for _ in range(repeat)]
    least = [min(times) for times in zip(*(timing for timing, _ in runs), strict=True)]
    return COLUMNS.format(name, *runs[0][1], *(f"{seconds:.3f}" for seconds in least))


def measure(file: Path, method: str) -> tuple[Timing, tuple[int, int, int]]:
    """Times; numbers of faces, of sets and of certified sets."""
    start = perf_counter()
    # Models state their friction, generated meshes cannot.
    thing = load_object(file, mu=MU if file.suffix == ".obj" else None)
    load = perf_counter() - start
    plan = plan_grasps(thing, method=method, top=10)
    counts = (len(thing.polyhedron.faces), plan.num_sets, plan.num_certified)
    return Timing(load, plan.seconds["plan"], plan.seconds["certify"]), counts


if __name__ == "__main__":
    main()
