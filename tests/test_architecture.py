"""The rules that keep the planner, the judge and Drake apart."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import drake_polygrasp

PACKAGE = Path(drake_polygrasp.__file__).parent
ROOT = PACKAGE.parent
MODULES = sorted(PACKAGE.rglob("*.py"))
PURE = [
    *(
        PACKAGE / f"{name}.py"
        for name in (
            "errors",
            "arguments",
            "vectors",
            "digits",
            "grasp",
            "plant_verdicts",
            "wrench",
            "facet_lines",
            "epsilon_bound",
        )
    ),
    *PACKAGE.glob("geometry/*.py"),
    *PACKAGE.glob("planning/*.py"),
]
ALLOWED_IN_PURE = ("pydrake.math",)
LAYERS = (
    ("errors", "arrays", "arguments", "progress", "vectors", "digits"),
    ("geometry", "wrench", "facet_lines", "epsilon_bound"),
    ("plant_verdicts", "grasp", "stated_grasp"),
    ("input_file", "plain_yaml", "loading"),
    ("planning", "certification", "grasp_file", "plan_settings", "plant_block"),
    (
        "claims",
        "verification",
        "task",
        "contenders",
        "proposals",
        "longer_search",
        "judging",
        "pipeline",
        "gap",
        "plant_results",
        "plant_ranking",
        "export",
        "systems",
    ),
    (
        "visualization",
        "progress_line",
        "child_process",
        "tables",
        "plant_table",
        "command_values",
        "command_line",
        "cli",
        "__main__",
    ),
)
"""From the bottom up: nothing imports what stands in a later row."""


def imports(module: Path) -> Iterator[str]:
    """Every module that is named in an import, also inside functions and under TYPE_CHECKING."""
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            assert node.module is not None
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def short(module: Path) -> str:
    return str(module.relative_to(ROOT))


def loaded_by(*arguments: str) -> tuple[set[str], subprocess.CompletedProcess[str]]:
    """The modules of a Python process, child processes included, and how it ended."""
    result = subprocess.run(
        [sys.executable, "-X", "importtime", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    lines = [line for line in result.stderr.splitlines() if line.startswith("import time:")]
    return {line.rpartition("|")[2].strip() for line in lines}, result


@pytest.mark.parametrize("module", MODULES, ids=short)
def test_no_module_imports_pydrake_all(module: Path) -> None:
    assert not [name for name in imports(module) if name.startswith("pydrake.all")]


@pytest.mark.parametrize("module", PURE, ids=short)
def test_the_core_imports_no_plant_and_no_geometry_of_drake(module: Path) -> None:
    drake = [name for name in imports(module) if name.startswith("pydrake")]
    assert not [name for name in drake if not name.startswith(ALLOWED_IN_PURE)]


@pytest.mark.parametrize(
    ("one", "other"), [("planning", "certification"), ("certification", "planning")]
)
def test_planner_and_judge_never_import_each_other(one: str, other: str) -> None:
    for module in PACKAGE.glob(f"{one}/*.py"):
        assert not [name for name in imports(module) if f"drake_polygrasp.{other}" in name]


@pytest.mark.parametrize("module", MODULES, ids=short)
def test_imports_point_downward(module: Path) -> None:
    def layer(name: str) -> int | None:
        return next((i for i, row in enumerate(LAYERS) if name in row), None)

    own = layer(module.relative_to(PACKAGE).parts[0].removesuffix(".py"))
    if own is None:
        assert module.name == "__init__.py", f"{short(module)} stands in no layer"
        return
    for name in imports(module):
        package, _, rest = name.partition(".")
        its = layer(rest.partition(".")[0])
        assert package != "drake_polygrasp" or its is None or its <= own, name


@pytest.mark.parametrize("name", ["pipeline", "plant_ranking"])
def test_planning_loads_no_plant_until_one_is_asked(name: str) -> None:
    loaded, result = loaded_by("-c", f"import drake_polygrasp.{name}")
    assert f"drake_polygrasp.{name}" in loaded, result.stderr[-1000:]
    assert not {module for module in loaded if module.startswith("pydrake.multibody")}


def test_exact_needs_the_standard_library_only() -> None:
    roots = {name.partition(".")[0] for name in imports(PACKAGE / "certification" / "exact.py")}
    assert roots <= set(sys.stdlib_module_names)


def test_importing_the_package_loads_neither_drake_nor_numpy() -> None:
    loaded, _ = loaded_by("-c", "import drake_polygrasp")
    assert "drake_polygrasp" in loaded
    assert not loaded & {"pydrake", "numpy", "shapely"}


def test_everything_the_package_offers_is_there_and_imports_in_under_a_second() -> None:
    # User time, for the tests may share the machine with others.
    code = (
        "import os, drake_polygrasp as d\n"
        "for name in d.__all__: getattr(d, name)\n"
        "assert set(d.__all__) <= set(dir(d))\n"
        "print(os.times().user)"
    )
    _, result = loaded_by("-c", code)
    assert result.returncode == 0, result.stderr
    assert float(result.stdout) < 2.0


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        drake_polygrasp.nothing  # noqa: B018


def test_verify_loads_no_planner(tmp_path: Path) -> None:
    from tests.grasp_files import EXAMPLE

    file = tmp_path / "box.grasp.yaml"
    file.write_text(EXAMPLE)
    # What the command's child process imports while it works is seen in this process only.
    code = f"from drake_polygrasp.verification import verify_file as v; v({str(file)!r})"
    for arguments in (("-m", "drake_polygrasp", "verify", str(file)), ("-c", code)):
        loaded, result = loaded_by(*arguments)
        assert "drake_polygrasp.verification" in loaded, result.stderr[-1000:]
        assert not {name for name in loaded if ".planning" in name or ".pipeline" in name}
