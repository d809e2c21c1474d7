"""Whether grasp files are the same bytes on other processors.

python -m benchmarks.kernels [--most N]

Plans objects in processes that compute as other processors do, and compares what they write. By
the processor, OpenBLAS chooses the kernels of NumPy's linear algebra, NumPy its own loops and the C
library its functions; all three are told what the processor lacks. A product of two large matrices
is compared too: where it does not differ, nothing was tried.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

from benchmarks.objects import Subject, generated, models
from drake_polygrasp import NO_ERRORS, UsageError, load_object, plan_grasps, save_grasps

WAYS: dict[str, dict[str, Any]] = {
    "default": {"top": 2},
    "enriched": NO_ERRORS,
    "paper": {"method": "paper"},
    "quick": NO_ERRORS | {"effort": "quick"},
}
"""Options of `plan_grasps`, by the name under which files are compared."""
CONTROL = "product_of_matrices"


class Processor(NamedTuple):
    """A processor as libraries see it."""

    core_type: str
    """OpenBLAS's name of it."""
    needs: str
    """What this processor must have to stand for it, by NumPy's name: OpenBLAS does not ask, and
    the process would end at the first instruction that is not there."""
    lacks: tuple[str, ...]
    """What it does not have: beginnings of NumPy's names."""
    lacks_in_c: tuple[str, ...]
    """The same by the C library's names."""


_AVX512 = ("AVX512", "X86_V4")
_AVX512_IN_C = ("AVX512F", "AVX512VL", "AVX512DQ", "AVX512CD", "AVX512BW")
_FMA = ("X86_V3", "AVX2", "FMA3")
_FMA_IN_C = ("AVX2", "FMA", "FMA4")
PROCESSORS = (
    Processor("SkylakeX", "AVX512F", (), ()),
    Processor("Haswell", "AVX2", _AVX512, _AVX512_IN_C),
    Processor("Sandybridge", "AVX", (*_AVX512, *_FMA), (*_AVX512_IN_C, *_FMA_IN_C)),
    Processor(
        "Nehalem", "SSE42", (*_AVX512, *_FMA, "AVX", "F16C"), (*_AVX512_IN_C, *_FMA_IN_C, "AVX")
    ),
)


class Comparison(NamedTuple):
    """Files of one processor held against those of another."""

    processors: tuple[str, str]
    """By their core types."""
    num_equal: dict[str, int]
    """By way."""
    differing: list[str]
    tried: bool
    """Whether the two compute a product of matrices differently."""


def supported(core_types: Iterable[str] | None = None) -> list[Processor]:
    """The processors that this one can stand for, the most capable first."""
    named = [p for p in PROCESSORS if core_types is None or p.core_type in core_types]
    return [processor for processor in named if __cpu_features__.get(processor.needs)]


def environment(processor: Processor) -> dict[str, str]:
    """The environment in which libraries take this processor for another one."""
    lacks = [name for name in __cpu_dispatch__ if name.startswith(processor.lacks)]
    variables = os.environ | {
        "OPENBLAS_CORETYPE": processor.core_type,
        "OPENBLAS_NUM_THREADS": "1",
        "NPY_DISABLE_CPU_FEATURES": " ".join(lacks),
    }
    if processor.lacks_in_c:
        hidden = ",".join(f"-{name}" for name in processor.lacks_in_c)
        variables["GLIBC_TUNABLES"] = f"glibc.cpu.hwcaps={hidden}"
    return variables


def write_plans(subjects: Iterable[Subject], folder: Path, ways: Iterable[str]) -> None:
    """Plans objects in this process and writes, for each way, a file or why there is no grasp."""
    random = np.random.default_rng(0)
    product = random.random((99, 99)) @ random.random((99, 99))
    (folder / CONTROL).write_bytes(product.tobytes())
    for subject in subjects:
        object_ = load_object(subject.file, mu=subject.mu)
        for way in ways:
            path = folder / f"{subject.name}.{way}"
            try:
                plan = plan_grasps(object_, **WAYS[way])
            except UsageError as error:  # Too many sets of faces for the paper.
                path.write_text(f"# {error}\n")
                continue
            if plan.grasps:
                save_grasps(path, object_, plan.grasps, plan.settings)
            with path.open("a") as file:
                file.write(f"# {plan.reasons}\n")


def compare(
    subjects: list[Subject], processors: list[Processor], folder: Path, ways: list[str]
) -> list[Comparison]:
    """Holds the files of all processors against those of the first; files are left in `folder`."""
    asked = json.dumps([[s.kind, s.name, str(s.file), s.mu] for s in subjects])
    children = []
    for processor in processors:
        own = folder / processor.core_type
        own.mkdir()
        command = [sys.executable, "-m", "benchmarks.kernels", "--write", str(own), *ways]
        child = subprocess.Popen(
            command, stdin=subprocess.PIPE, env=environment(processor), text=True
        )
        assert child.stdin is not None
        child.stdin.write(asked)
        child.stdin.close()
        children.append(child)
    for child, processor in zip(children, processors, strict=True):
        if child.wait() != 0:
            raise SystemExit(f"as {processor.core_type}, planning ended with {child.returncode}")
    first, *others = ((p.core_type, _contents(folder / p.core_type)) for p in processors)
    return [_comparison(first, other, subjects, ways) for other in others]


def _contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def _comparison(
    one: tuple[str, dict[str, bytes]],
    other: tuple[str, dict[str, bytes]],
    subjects: list[Subject],
    ways: list[str],
) -> Comparison:
    equal = {name for name in one[1] if one[1][name] == other[1][name]}
    names = [f"{subject.name}.{way}" for subject in subjects for way in ways]
    return Comparison(
        (one[0], other[0]),
        {way: sum(f"{subject.name}.{way}" in equal for subject in subjects) for way in ways},
        [name for name in names if name not in equal],
        CONTROL not in equal,
    )


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kernels")
    parser.add_argument("--most", type=int, default=0, help="generated objects of each size")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--core-types", nargs="+", choices=[p.core_type for p in PROCESSORS])
    parser.add_argument("--supported", action="store_true", help="print the core types and end")
    parser.add_argument("--write", nargs="+", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.write:
        subjects = [
            Subject(kind, name, Path(file), mu) for kind, name, file, mu in json.load(sys.stdin)
        ]
        write_plans(subjects, Path(options.write[0]), options.write[1:])
        return 0
    processors = supported(options.core_types)
    if options.supported:
        print(*(processor.core_type for processor in processors))
        return 0
    if len(processors) < 2:
        print("nothing is compared: this processor stands for fewer than two of those asked for")
        return 0
    with TemporaryDirectory() as folder:
        subjects = models()
        if options.most:
            meshes = Path(folder) / "meshes"
            meshes.mkdir()
            subjects += generated(meshes, options.most)
        comparisons = compare(subjects, processors, Path(folder), options.ways)
    for comparison in comparisons:
        one, other = comparison.processors
        for way, num_equal in comparison.num_equal.items():
            print(f"{num_equal} of {len(subjects)} files are equal on {one} and {other}: {way}")
        if not comparison.tried:
            print(f"nothing was tried: a product of matrices is the same on {one} and {other}")
        for name in comparison.differing:
            print(f"  differs: {name}")
    return 1 if any(comparison.differing for comparison in comparisons) else 0


if __name__ == "__main__":
    sys.exit(main())
