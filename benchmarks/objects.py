"""What is measured: our models, generated solids of many kinds, and folders of anyone's models."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

from drake_polygrasp.arrays import Array
from tests.support.common import round_body
from tests.support.convex_polyhedra import (
    boxes,
    ellipsoid_hull,
    holed_prism,
    shells,
    tangent_polyhedron,
    write_obj,
)

ROOT = Path(__file__).resolve().parents[1]
SUFFIXES = {".sdf", ".urdf", ".xml", ".obj"}
MU = 0.3
FLAT, LONG = (0.07, 0.06, 0.02), (0.1, 0.03, 0.03)


class Subject(NamedTuple):
    """An object to measure."""

    kind: str
    name: str
    file: Path
    mu: float | None
    """Friction where the file states none, as generated meshes cannot."""


class _Family(NamedTuple):
    kind: str
    name: str
    solid: Callable[[int], Array]
    """Triangles of a seed."""
    num_seeds: int


def _families() -> Iterator[_Family]:
    """90 objects in all; few of the large ones, whose planning takes longest."""
    for faces, seeds in {10: 4, 30: 4, 100: 3, 300: 2, 1000: 1}.items():
        yield _Family("ellipsoid", f"ellipsoid_{faces}", partial(ellipsoid_hull, faces), seeds)
    for shape, axes in {"flat": FLAT, "long": LONG}.items():
        for faces in (10, 30):
            solid = partial(ellipsoid_hull, faces, semi_axes=axes)
            yield _Family(shape, f"{shape}_{faces}", solid, 3)
    for faces, seeds in {10: 4, 30: 4, 100: 2}.items():
        yield _Family("tangent", f"tangent_{faces}", partial(tangent_polyhedron, faces), seeds)
    for sides, holes in ((5, 0), (6, 1), (8, 2), (9, 0), (12, 3)):
        yield _Family("prism", f"prism_{sides}_{holes}", partial(holed_prism, sides, holes), 4)
    for number in (2, 3, 4):
        yield _Family("boxes_skew", f"boxes_skew_{number}", partial(boxes, number), 4)
        solid = partial(boxes, number, aligned=True)
        yield _Family("boxes_aligned", f"boxes_aligned_{number}", solid, 4)
    for number, faces in ((3, 40), (6, 80)):
        yield _Family("shells", f"shells_{number * faces}", partial(shells, number, faces), 3)
    yield _Family("scan", "scan_16000", _scan, 3)
    yield _Family("sphere", "sphere_20000", lambda _: round_body(20_000), 1)


def _scan(seed: int) -> Array:
    """An egg of a scan's size, with noise of a seventh of its facets' size."""
    return round_body(16_000, (0.03, 0.04, 0.05 + 0.01 * seed), noise=1e-4, seed=seed)


def models() -> list[Subject]:
    """Our own objects."""
    folders = sorted(
        path for path in (ROOT / "models").iterdir() if path.is_dir() and path.name != "hands"
    )
    files = (
        next(p for p in folder.iterdir() if p.suffix in SUFFIXES - {".obj"}) for folder in folders
    )
    return [Subject("models", file.parent.name, file, None) for file in files]


def generated(folder: Path, most: int | None = None, first_seed: int = 0) -> list[Subject]:
    """Generated solids, written to `folder` as meshes; at most `most` of each size."""
    subjects = []
    for family in _families():
        num_seeds = min(family.num_seeds, most or family.num_seeds)
        for seed in range(first_seed, first_seed + num_seeds):
            name = f"{family.name}_s{seed}"
            file = folder / f"{name}.obj"
            write_obj(file, family.solid(seed))
            subjects.append(Subject(family.kind, name, file, MU))
    return subjects


def in_folder(folder: Path) -> list[Subject]:
    """Every model file in a folder and below; meshes only where no model beside them uses them."""
    files = sorted(
        path
        for path in folder.resolve().rglob("*")
        if path.suffix in SUFFIXES and path.name != "package.xml"
    )
    described = {path.parent for path in files if path.suffix != ".obj"}
    return [
        Subject(folder.name, str(file.relative_to(folder.resolve())), file, None)
        for file in files
        if file.suffix != ".obj" or file.parent not in described
    ]
