"""The pages in docs/ say what is so: links lead somewhere, keys are the file's, examples hold."""

from __future__ import annotations

import ast
import copy
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydrake.math import RigidTransform

from drake_polygrasp import load_object, plan_grasps, save_grasps, verify_file
from drake_polygrasp.cli.main import main
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.geometry.surface_contact import edge_distance
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.paper.reasons import REASONS
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.pipeline.region_certificates import Errors, certify_errors
from drake_polygrasp.verification.report import Status
from tests.support.convex_polyhedra import prism, write_obj
from tests.support.hands import CUBE, own_hand_grasps
from tests.support.planned import exact_plan
from tests.support.solids import regular_polygon

ROOT = Path(__file__).parents[1]
MODELS = ROOT / "models"
DOCS = ROOT / "docs"
HIDDEN = (".", "build", "node_modules")
PAGES = [
    page
    for page in sorted(ROOT.rglob("*.md"))
    if not any(part.startswith(HIDDEN) for part in page.relative_to(ROOT).parts[:-1])
]
FORMAT = (DOCS / "grasp-file.md").read_text()


def short(page: Path) -> str:
    return str(page.relative_to(ROOT))


def links(page: Path) -> Iterator[tuple[str, str, str]]:
    """Text, path and fragment of every link that stays in the repository."""
    prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    for text, target in re.findall(r"\[([^\]]*)\]\(([^)\s]+)\)", prose):
        if "://" not in target and not target.startswith("mailto:"):
            path, _, fragment = target.partition("#")
            yield text, path, fragment


def anchors(page: Path) -> set[str]:
    """What GitHub makes of the headings: lower case, hyphens for blanks, no punctuation."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@cache
def names_in(module: Path) -> set[str]:
    """Functions, classes and constants at the top of a Python file."""
    names: set[str] = set()
    for node in ast.parse(module.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return names


@pytest.mark.parametrize("page", PAGES, ids=short)
def test_links_lead_to_files_headings_and_functions(page: Path) -> None:
    for text, path, fragment in links(page):
        target = page.parent / path if path else page
        assert target.exists(), path
        if fragment:
            assert fragment in anchors(target), f"{path}#{fragment}"
        name = re.fullmatch(r"`(\w+)`", text)
        if name and target.suffix == ".py":
            assert name[1] in names_in(target), f"{name[1]} in {path}"


def test_the_readme_leads_to_every_page() -> None:
    targets = {(ROOT / path).resolve() for _, path, _ in links(ROOT / "README.md") if path}
    assert targets >= {page.resolve() for page in DOCS.glob("*.md")}


def rows(page: str) -> list[list[str]]:
    """The cells of all rows of tables whose first cell is code, without its marks."""
    lines = re.findall(r"^\| (`.*) \|$", page, re.MULTILINE)
    return [[cell.strip().strip("`") for cell in line.split(" | ")] for line in lines]


@cache
def words_in_code() -> set[str]:
    """Every word in the Python files, of ours and of the libraries that they use."""
    folders = ("benchmarks", "docs", "drake_polygrasp", "examples", "notebooks", "tests")
    files = [file for folder in folders for file in (ROOT / folder).rglob("*.py")]
    return set(re.findall(r"\w+", "\n".join(file.read_text() for file in files)))


@pytest.mark.parametrize("page", [*PAGES, *sorted((ROOT / "notebooks").glob("*.ipynb"))], ids=short)
def test_names_that_pages_give_are_in_the_code(page: Path) -> None:
    text = page.read_text()
    if page.suffix == ".ipynb":
        cells = [c for c in json.loads(text)["cells"] if c["cell_type"] == "markdown"]
        text = "\n".join("".join(cell["source"]) for cell in cells)
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    given = " ".join(re.findall(r"`([^`\n]+)`", prose))
    # Snake and camel case; NAME stands for any name.
    names = {word for word in re.findall(r"\b\w*[A-Za-z0-9]\b", given) if "NAME" not in word}
    assert {n for n in names if re.search(r"_|[a-z][A-Z]", n)} <= words_in_code()


def test_every_reason_is_explained_once() -> None:
    page = (DOCS / "paper.md").read_text()
    assert sorted(row[0] for row in rows(page)) == sorted(REASONS)


def test_without_a_clearance_the_text_puts_contacts_on_edges() -> None:
    channel = load_object(MODELS / "u_channel" / "u_channel.sdf")
    polyhedron = channel.polyhedron
    size = channel.p_BBcm, polyhedron.diameter, channel.rho

    def on_edges(edge_clearance: float | None) -> int:
        regions = erode(polyhedron, edge_clearance)
        built = plan_sets(regions, *size, "paper").candidates
        built = built.take(np.isfinite(built.p_BC).all(axis=(1, 2)))
        faces = regions.face[built.region]
        room = edge_distance(polyhedron, built.p_BC.reshape(-1, 3), faces.ravel())
        return int((room.reshape(-1, 3).min(axis=1) < 1e-9 * polyhedron.diameter).sum())

    assert on_edges(0.0) >= 10
    assert on_edges(None) == 0


# The grasp file.


def block(language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```", FORMAT, re.DOTALL | re.MULTILINE)
    assert found
    return found[1]


def described() -> dict[str, str]:
    """Every key of the page, as a path, and whether it is required."""
    found = [(row[0], row[2]) for row in rows(FORMAT)]
    assert len(dict(found)) == len(found)
    return dict(found)


BY_NAMES = {
    "grasps[].plant.settings",
    *(f"grasps[].hand.{key}" for key in ("q", "pregrasp.q", "torque.torque")),
}
"""Mappings whose keys are names, of settings or joints."""


def paths(value: Any, path: str = "") -> Iterator[str]:
    """The paths of all keys but such names."""
    if isinstance(value, list):
        for item in value:
            yield from paths(item, f"{path}[]")
    elif isinstance(value, dict):
        for key, item in value.items():
            inner = f"{path}.{key}" if path else str(key)
            yield inner
            if inner not in BY_NAMES:
                yield from paths(item, inner)


def bearing_errors(
    object_: GraspObject, grasps: Sequence[CertifiedGrasp]
) -> Iterator[CertifiedGrasp]:
    """Grasps with a certificate of small errors, and bounds as they may be stated."""
    num_faces, L = len(object_.polyhedron.faces), object_.polyhedron.diameter
    errors = Errors(np.full(num_faces, 1e-3 * L), tilt=0.01, friction=0.1, com=1e-3 * L)
    for grasp in grasps:
        region = certify_errors(object_, grasp.grasp, errors)
        assert region is not None
        bounds = {"epsilon_lower": 0.01, "epsilon_upper": 0.02, "squeeze_force": 100.0}
        yield replace(grasp, region=replace(region, **bounds))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """Documents that between them hold every key we write."""
    folder = tmp_path_factory.mktemp("written")
    names = ("full", "around", "welded", "scaled", "curved", "held")
    full, around, welded, scaled, curved, held = (folder / f"{name}.yaml" for name in names)
    asked = "--mu 0.3 --avoid-direction 0 0 -1 --exclude-faces 0 --patch-angle 0.2"
    asked += " --patch-depth 0.001 --top 1 --plant"
    asked += " --placement-error 1e-3 --tilt-error 0.05 --friction-error 0.1 --com-error 1e-3"
    model = str(MODELS / "l_bracket" / "l_bracket.sdf")
    assert main(["plan", model, *asked.split(), "-o", str(full)]) == 0
    cube = load_object(MODELS / "cube" / "cube.sdf")
    table = np.array([[[-1.0, -1, -1], [1, -1, -1], [0, 1, -1]]])
    obstacles = Obstacles(RigidTransform(), ("table",), table, np.array([False]), (), reach=2.0)
    plan = exact_plan(cube, top=1, effort="quick", obstacles=obstacles)
    save_grasps(around, cube, bearing_errors(cube, plan.grasps), plan.settings)
    model_file = folder / "ball.urdf"
    model_file.write_text(
        '<robot name="ball"><link name="ball"><collision><geometry><sphere radius="0.05"/>'
        "</geometry></collision></link></robot>"
    )
    ball = load_object(model_file, mu=0.5)
    plan = exact_plan(ball, top=1, effort="quick")
    save_grasps(curved, ball, bearing_errors(ball, plan.grasps), plan.settings)
    stack = folder / "stack.urdf"
    block = '<link name="{}"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'
    few = ("--top", "1", "--effort", "quick")
    weld = '<joint name="j" type="fixed"><parent link="low"/><child link="high"/></joint>'
    stack.write_text(f'<robot name="r">{block.format("low")}{block.format("high")}{weld}</robot>')
    assert main(["plan", str(stack), "--joints-free", *few, "-o", str(welded)]) == 0
    write_obj(folder / "mm.obj", prism(regular_polygon(4, 40.0), 60.0))
    asked = ["--scale", "0.001", *few, "-o", str(scaled)]
    assert main(["plan", str(folder / "mm.obj"), *asked]) == 0
    save_grasps(held, cube, own_hand_grasps(CUBE, up=True)[:1], plan.settings)
    return [yaml.safe_load((folder / f"{name}.yaml").read_text()) for name in names]


def test_every_key_that_is_written_is_described_and_no_other(
    written: list[dict[str, Any]],
) -> None:
    found = {path for document in written for path in paths(document)}
    assert found == set(described())


@pytest.fixture
def example(tmp_path: Path) -> Path:
    (tmp_path / "box.sdf").write_text(block("xml"))
    file = tmp_path / "box.grasp.yaml"
    file.write_text(block("yaml"))
    return file


def test_the_example_verifies_against_its_model(example: Path) -> None:
    assert len(load_grasps(example).grasps) == 1
    report = verify_file(example)
    assert not report.warnings
    lines = report.grasps[0].lines
    assert {name: line.status for name, line in lines.items()} == {
        "FORCES": Status.PROVED,
        "SURFACE": Status.RECOMPUTED,
        "NUMBERS": Status.RECOMPUTED,
    }


def test_the_example_is_what_the_planner_finds(example: Path) -> None:
    box = load_object(example.parent / "box.sdf")
    plan = plan_grasps(box, method="paper", edge_clearance=0.01, top=15)
    stated = load_grasps(example).grasps[0]
    same = [g for g in plan.grasps if g.grasp.faces == stated.grasp.faces]
    np.testing.assert_allclose(same[0].grasp.p_BC, stated.grasp.p_BC, atol=1e-9)
    for name in ("internal_force", "margin", "epsilon_lower", "tilt_tolerance", "squeeze_force"):
        value = getattr(same[0].certificate, name)
        np.testing.assert_allclose(value, getattr(stated.certificate, name), rtol=0.02)


def test_the_reader_on_the_page_prints_the_contacts(example: Path) -> None:
    command = [sys.executable, "-c", block("python")]
    done = subprocess.run(command, cwd=example.parent, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[0] == "[0.0, 0.05, 0.0] [0.0, -1.0, 0.0]"


def without(document: Any, keys: list[str]) -> bool:
    """Takes a key out of a document, where it is; says whether it was there."""
    first, *rest = keys
    name, *lists = first.split("[]")
    if name not in document:
        return False
    if not rest:
        del document[name]
        return True
    inner = document[name]
    for _ in lists:
        inner = inner[0]
    return without(inner, rest)


@pytest.mark.parametrize(("path", "need"), described().items())
def test_a_file_is_refused_without_what_is_required_and_read_without_the_rest(
    example: Path, written: list[dict[str, Any]], path: str, need: str
) -> None:
    assert need in ("required", "optional")
    for document in (yaml.safe_load(example.read_text()), *copy.deepcopy(written)):
        if without(document, path.split(".")):
            break
    else:
        pytest.fail(f"{path} is nowhere")
    example.write_text(yaml.safe_dump(document))
    if need == "optional":
        load_grasps(example)
    else:
        with pytest.raises(GraspFileError, match=path.rpartition(".")[2]):
            load_grasps(example)


# How to cite.


def test_the_citation_names_the_software_and_the_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["title"] == "drake_polygrasp"
    (paper,) = citation["references"]
    readme = " ".join((ROOT / "README.md").read_text().split())
    assert f"*{paper['title']}*" in readme
    assert [author["family-names"] for author in paper["authors"]] == ["Prado", "Suárez"]
    assert f'license = "{citation["license"]}"' in (ROOT / "pyproject.toml").read_text()
