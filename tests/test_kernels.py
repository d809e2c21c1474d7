"""The same grasps to the last byte whichever processor plans, as far as that can be tried on one.

OpenBLAS, NumPy and the C library compute with what the processor has, and round differently.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import drake_polygrasp
from benchmarks.kernels import compare, supported
from benchmarks.objects import MU, Subject, models
from drake_polygrasp.vectors import circle, dot, product, times, transformed
from tests.support.convex_polyhedra import ellipsoid_hull, write_obj

PACKAGE = Path(drake_polygrasp.__file__).parent
DECIDING = sorted(
    {
        *(
            module
            for room in ("geometry", "wrenches", "paper", "search", "pipeline", "region_bounds")
            for module in PACKAGE.glob(f"{room}/*.py")
        ),
        *(PACKAGE / "certification" / f"{name}.py" for name in ("certify", "convex", "robustness")),
        PACKAGE / "digits.py",
    }
    # Figures, and what is only held against a tolerance.
    - {PACKAGE / "paper" / "trace.py", PACKAGE / "geometry" / "body_identity.py"}
)
BLAS = {"dot", "inner", "matmul", "tensordot", "vdot", "multi_dot"}
LAPACK = {"solve", "inv", "pinv", "det", "eig", "eigh", "svd", "qr", "cholesky", "lstsq", "cond"}
ROUNDED = {("triples.py", "eigh")}
"""LAPACK where what comes of it is rounded at once."""
UNORDERED = {"partition", "argpartition"}


def kernel_dependent(module: Path) -> Iterator[str]:
    """What in a module leaves its last bits, or the order of ties, to the processor."""
    for node in ast.walk(ast.parse(module.read_text())):
        where = f"{module.name}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.BinOp | ast.AugAssign) and isinstance(node.op, ast.MatMult):
            yield f"{where}: @"
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        name, given = node.func.attr, {keyword.arg for keyword in node.keywords}
        owner = ast.unparse(node.func.value)
        if owner == "np.linalg" and name == "norm" and "axis" not in given:
            yield f"{where}: norm of one vector"
        if owner == "np.linalg" and name in LAPACK and (module.name, name) not in ROUNDED:
            yield f"{where}: {name}"
        if owner in ("np", "np.linalg") and name in BLAS | UNORDERED | {"hypot"}:
            yield f"{where}: {name}"
        if name in ("dot", "argpartition") and owner != "np":
            yield f"{where}: .{name}"
        if name == "einsum" and "optimize" in given:
            yield f"{where}: einsum with optimize"
        if name == "argsort" and "kind" not in given and module.name != "surface.py":
            yield f"{where}: argsort that may part ties"


@pytest.mark.parametrize("module", DECIDING, ids=lambda path: path.name)
def test_nothing_that_decides_leaves_its_last_bits_to_the_processor(module: Path) -> None:
    assert not list(kernel_dependent(module))


def test_grasp_files_are_the_same_bytes_on_other_processors(tmp_path: Path) -> None:
    processors = supported()
    if len(processors) < 2:
        pytest.skip("this processor stands for no other")
    # The least and the most capable, which differ most.
    processors = [processors[-1], processors[0]]
    mesh = tmp_path / "hull.obj"
    write_obj(mesh, ellipsoid_hull(30, 3))
    subjects = [model for model in models() if model.name in ("l_bracket", "octagonal_prism")]
    subjects.append(Subject("ellipsoid", "hull", mesh, MU))
    (comparison,) = compare(subjects, processors, tmp_path, ["enriched", "paper", "quick"])
    assert not comparison.differing
    assert comparison.num_equal == {"enriched": 3, "paper": 3, "quick": 3}
    if not comparison.tried:
        pytest.skip("NumPy multiplies matrices alike on both: nothing was tried")


def test_sums_in_one_order_are_what_matrix_products_are() -> None:
    random = np.random.default_rng(0)
    points, matrix = random.normal(size=(40, 2, 3)), random.normal(size=(3, 5))
    several, others = random.normal(size=(40, 2, 3)), random.normal(size=(40, 3, 4))
    # Both are right to a few units in the last place.
    close = {"rtol": 1e-13, "atol": 1e-13}
    np.testing.assert_allclose(times(points, matrix), points @ matrix, **close)
    np.testing.assert_allclose(times(points, matrix[:, 0]), points @ matrix[:, 0], **close)
    np.testing.assert_allclose(times(points[:0], matrix), np.empty((0, 2, 5)))
    np.testing.assert_allclose(product(several, others), several @ others, **close)
    expected = (several @ points[:, 0, :, None])[..., 0]
    np.testing.assert_allclose(transformed(several, points[:, 0]), expected, **close)
    expected = several[0] @ matrix[:, 1]
    np.testing.assert_allclose(transformed(several[0], matrix[:, 1]), expected, **close)


def test_points_of_a_circle_have_fourteen_decimals() -> None:
    points = circle(np.arange(12) * np.pi / 6)
    assert (points == np.round(points, 14)).all()
    assert (points[[0, 3, 6, 9]] == [[1, 0], [0, 1], [-1, 0], [0, -1]]).all()
    np.testing.assert_allclose(dot(points, points), 1.0, atol=2e-14)
