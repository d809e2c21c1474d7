"""The rules of the house: what each room may know, and that a file is where its name says."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import drake_polygrasp

PACKAGE = Path(drake_polygrasp.__file__).parent
ROOT = PACKAGE.parent
MODULES = sorted(PACKAGE.rglob("*.py"))
ROOMS = sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py"))

BASE = {
    *("_version", "arguments", "arrays", "digits", "errors", "input_file", "vectors"),
}
"""Files at the top that every room may import, and that import nothing but each other."""
MAY_IMPORT: dict[str, set[str]] = {
    "wrenches": set(),
    "geometry": set(),
    "grasp": {"geometry"},
    "hand_grasp": {"grasp"},
    "settings": {"geometry"},
    "paper": {"geometry", "grasp", "settings"},
    "search": {"geometry", "wrenches"},
    "certification": {"grasp", "wrenches"},
    "region_bounds": {"certification", "grasp", "wrenches"},
    "loading": {"geometry", "grasp"},
    "plant": {"certification", "geometry", "grasp", "hand_grasp", "hands", "loading"},
    "files": {"geometry", "grasp", "hand_grasp", "settings", "wrenches"},
    "exporters": {"files", "grasp", "hand_grasp", "wrenches"},
    "hands": {
        *("certification", "files", "geometry", "grasp", "hand_grasp", "loading"),
        *("search", "wrenches"),
    },
    "verification": {
        *("certification", "files", "geometry", "grasp", "hand_grasp", "hands", "loading"),
        *("plant", "region_bounds", "wrenches"),
    },
    "pipeline": {
        *("certification", "geometry", "grasp", "hand_grasp", "hands", "loading", "paper", "plant"),
        *("region_bounds", "search", "settings", "wrenches"),
    },
    "optimality": {
        *("certification", "geometry", "grasp", "pipeline", "search", "wrenches"),
    },
    "visualization": {
        *("certification", "files", "geometry", "grasp", "hand_grasp", "hands", "paper"),
        *("pipeline", "wrenches"),
    },
    "batch": {
        *("files", "geometry", "grasp", "hand_grasp", "hands", "loading", "pipeline", "settings"),
        "verification",
    },
    "cli": {
        *("batch", "exporters", "files", "grasp", "hand_grasp", "hands", "loading", "optimality"),
        *("paper", "pipeline", "settings", "verification", "visualization"),
    },
}
"""Which rooms a room may import. The paper and the search do not know each other, what certifies
knows neither them nor files nor Drake's plants, and the command alone may know all."""
PURE = ("geometry", "wrenches", "paper", "search")
"""Rooms without plants and scenes."""
MOST_LINES = 350
LONG_FILES = {
    "certification/exact.py": "runs alone, and is read whole by who trusts nothing else",
    "certification/exact_cycle.py": "runs alone, like exact.py",
    "grasp.py": "the nouns of every page: most of it is what help() says of them",
}


RUN_ALONE = {"certification.exact", "certification.exact_cycle"}
"""Files that share nothing with others, so that they may define again what others have."""
ALSO_THERE = {"FLATNESS", "MIN_AREA_RATIO", "UNIT_TOLERANCE", "main"}
"""The public names that they define again."""


def name_of(module: Path) -> str:
    """Its dotted name within the package."""
    return ".".join(module.relative_to(PACKAGE).with_suffix("").parts)


NAMES = {name_of(module): module for module in MODULES}


def short(module: Path) -> str:
    return str(module.relative_to(ROOT))


def room_of(name: str) -> str:
    return name.partition(".")[0]


def imports_in(text: str) -> Iterator[str]:
    """Every module that is named in an import, also inside functions and under TYPE_CHECKING."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            assert node.module is not None
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def imports(module: Path) -> Iterator[str]:
    yield from imports_in(module.read_text())


@cache
def own_imports(module: Path) -> frozenset[str]:
    """The files of the package that a file imports, by their names within it."""
    within = (name.removeprefix("drake_polygrasp.") for name in imports(module))
    return frozenset(name for name in within if name in NAMES) - {name_of(module)}


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


def test_the_top_has_few_loose_files() -> None:
    loose = {name for name in NAMES if "." not in name} - {"__init__", "__main__"}
    assert loose == BASE | {"grasp", "hand_grasp", "settings"}
    assert len(loose - {"_version"}) <= 9


def test_rooms_stand_on_floors() -> None:
    assert {*MAY_IMPORT} - {"grasp", "hand_grasp", "settings"} == {*ROOMS}
    order = list(TopologicalSorter(MAY_IMPORT).static_order())  # CycleError if they do not
    assert order[-1] == "cli" or "cli" not in {
        room for rooms in MAY_IMPORT.values() for room in rooms
    }


@pytest.mark.parametrize("room", [*MAY_IMPORT, *sorted(BASE)])
def test_a_room_imports_what_it_may_and_no_more_is_allowed(room: str) -> None:
    files = [module for name, module in NAMES.items() if room_of(name) == room]
    within = {name.removeprefix("drake_polygrasp.") for file in files for name in imports(file)}
    found = {room_of(name) for name in within} & {*MAY_IMPORT, *BASE} - {room}
    if room in BASE:
        assert found <= BASE
    else:
        assert found - BASE == MAY_IMPORT[room]


def public_definitions(module: Path) -> Iterator[str]:
    """The public classes, functions, aliases and constants that a file defines."""
    for node in ast.parse(module.read_text()).body:
        names: list[str] = []
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = [node.name]
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [target.id for target in targets if isinstance(target, ast.Name)]
        yield from (name for name in names if not name.startswith("_"))


def test_a_public_name_is_of_one_thing() -> None:
    homes: dict[str, list[str]] = {}
    for file, module in NAMES.items():
        for name in public_definitions(module):
            homes.setdefault(name, []).append(file)
    twice = {name: {*files} for name, files in homes.items() if len(files) > 1}
    assert {*twice} == ALSO_THERE, {name: twice[name] for name in {*twice} - ALSO_THERE}
    assert all(len(files - RUN_ALONE) <= 1 for files in twice.values())


def test_no_files_import_each_other_in_a_circle() -> None:
    # The package itself names all that it offers and imports it when asked.
    graph = {name: own_imports(module) for name, module in NAMES.items() if name != "__init__"}
    assert len(list(TopologicalSorter(graph).static_order())) >= len(graph)


@pytest.mark.parametrize("module", MODULES, ids=short)
def test_no_module_imports_pydrake_all(module: Path) -> None:
    assert not [name for name in imports(module) if name.startswith("pydrake.all")]


@pytest.mark.parametrize(
    "module",
    [
        m
        for name, m in NAMES.items()
        if room_of(name) in {*PURE, *BASE, "grasp", "hand_grasp", "settings", "files"}
    ],
    ids=short,
)
def test_pure_rooms_import_of_drake_its_mathematics_at_most(module: Path) -> None:
    drake = [name for name in imports(module) if name.startswith("pydrake")]
    assert not [name for name in drake if not name.startswith("pydrake.math")]


@pytest.mark.parametrize("name", ["pipeline.plan", "pipeline.plant_ranking"])
def test_planning_loads_no_plant_until_one_is_asked(name: str) -> None:
    loaded, result = loaded_by("-c", f"import drake_polygrasp.{name}")
    assert f"drake_polygrasp.{name}" in loaded, result.stderr[-1000:]
    assert not {module for module in loaded if module.startswith("pydrake.multibody")}


def test_exact_needs_the_standard_library_only() -> None:
    roots = {name.partition(".")[0] for name in imports(PACKAGE / "certification" / "exact.py")}
    assert roots <= set(sys.stdlib_module_names)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_says_what_each_of_its_files_is_for(room: str) -> None:
    text = import_module(f"drake_polygrasp.{room}").__doc__ or ""
    rows = [cell for line in text.splitlines() for cell in line.split(" | ")]
    named = {cell.removeprefix("| ") for cell in rows if re.fullmatch(r"(\| )?\w+\.py", cell)}
    assert named == {file.name for file in (PACKAGE / room).glob("[!_]*.py")}


def test_the_table_of_the_paper_names_functions_and_tests_that_are_there() -> None:
    text = import_module("drake_polygrasp.paper").__doc__ or ""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()[4:]]
    rows = [row for row in rows if row]
    assert {row[0] for row in rows} >= {"4.1", "4.1, 4.2", "5", "6", "7"}
    for _, _, file, entries, test in rows:
        module = import_module(f"drake_polygrasp.paper.{file.removesuffix('.py')}")
        assert all(hasattr(module, entry) for entry in entries.split(", ")), file
        assert (ROOT / "tests" / "paper" / test).is_file(), test


@pytest.mark.parametrize("module", MODULES, ids=short)
def test_a_long_file_has_its_reason(module: Path) -> None:
    is_long = len(module.read_text().splitlines()) > MOST_LINES
    assert is_long == (str(module.relative_to(PACKAGE)) in LONG_FILES)


def test_each_folder_of_tests_is_of_a_room() -> None:
    folders = {path.parent.name for path in (ROOT / "tests").glob("*/*.py")}
    assert folders == {*ROOMS, "support"}
    assert not list((ROOT / "tests" / "support").glob("test_*.py"))
    assert [path.name for path in (ROOT / "tests").glob("*.py") if path.name[:5] != "test_"] == [
        "conftest.py"
    ]


def shown_code() -> Iterator[tuple[str, str]]:
    """What users are shown: the code of the README, of notebooks and of examples."""
    readme = (ROOT / "README.md").read_text()
    for block in re.findall(r"^```python\n(.*?)^```", readme, re.MULTILINE | re.DOTALL):
        yield "README.md", block
    for notebook in sorted((ROOT / "notebooks").glob("*.ipynb")):
        for cell in json.loads(notebook.read_text())["cells"]:
            if cell["cell_type"] == "code":
                yield notebook.name, re.sub(r"^%.*$", "", "".join(cell["source"]), flags=re.M)
    for example in sorted((ROOT / "examples").glob("*.py")):
        yield example.name, example.read_text()


def test_users_are_shown_names_of_the_package_and_its_rooms() -> None:
    inside = {
        (source, name)
        for source, code in shown_code()
        for name in imports_in(code)
        if name.removeprefix("drake_polygrasp.") in NAMES
    }
    assert not inside


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_offers_what_it_names_and_no_file_of_its_own_hides_it(room: str) -> None:
    module = import_module(f"drake_polygrasp.{room}")
    files = {file.stem for file in (PACKAGE / room).glob("*.py")}
    for name in getattr(module, "__all__", ()):
        assert hasattr(module, name)
        assert name in dir(module)
        # Where the file of that name is imported, it would take the place of what it defines.
        assert name not in files or room == "cli"


def test_an_example_is_read_in_one_go() -> None:
    lengths = {p.name: len(p.read_text().splitlines()) for p in (ROOT / "examples").glob("*.py")}
    assert {name for name, length in lengths.items() if length >= 120} == set()


@pytest.mark.parametrize("room", ROOMS)
def test_importing_a_room_loads_nothing_slow(room: str) -> None:
    loaded, result = loaded_by("-c", f"import drake_polygrasp.{room}")
    assert f"drake_polygrasp.{room}" in loaded, result.stderr[-1000:]
    assert not {name.partition(".")[0] for name in loaded} & {"matplotlib", "pydrake", "shapely"}


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


VERIFY = """
import sys
from drake_polygrasp.cli.child_process import ChildLimits, call_in_child
from drake_polygrasp.cli.main import make_parser
from drake_polygrasp.cli.verify import run_verify

def loaded():
    run_verify(make_parser().parse_args(["verify", sys.argv[1]]))
    return [*sys.modules]

modules, _ = call_in_child("__main__:loaded", limits=ChildLimits("verifying"))
print(*modules, *sys.modules)
"""
"""Prints what the command's child and its parent have imported."""


def test_verify_loads_no_planner(tmp_path: Path) -> None:
    from tests.support.grasp_files import EXAMPLE

    file = tmp_path / "box.grasp.yaml"
    file.write_text(EXAMPLE)
    _, result = loaded_by("-c", VERIFY, str(file))
    rooms = {room_of(name.removeprefix("drake_polygrasp.")) for name in result.stdout.split()}
    assert "verification" in rooms, result.stderr[-1000:]
    assert not rooms & {"paper", "search", "pipeline"}


def test_a_command_forks_before_it_imports_anything_slow(tmp_path: Path) -> None:
    command = ("plan", "models/cube/cube.sdf", "-o", str(tmp_path / "cube.grasp.yaml"))
    loaded, result = loaded_by("-m", "drake_polygrasp", *command)
    assert result.returncode == 0, result.stderr[-1000:]
    # Importing in the child is not told; what the parent imports would be imported twice.
    assert "drake_polygrasp.cli.plan" in loaded, result.stderr[-1000:]
    assert not {name.partition(".")[0] for name in loaded} & {"numpy", "pydrake", "shapely", "yaml"}
