"""What the README shows is what happens."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def block(name: str) -> str:
    found = re.search(rf"<!-- {name} -->\n```\w*\n(.*?)```", README, re.DOTALL)
    assert found
    return found[1]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "models").symlink_to(ROOT / "models")
    return tmp_path


def test_the_example_prints_what_it_says(folder: Path) -> None:
    assert len(block("example").strip().splitlines()) <= 12
    done = subprocess.run(
        [sys.executable, "-c", block("example")],
        cwd=folder,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == block("printed")


def test_the_main_command_plans_a_model_of_ours(folder: Path) -> None:
    command = block("main").strip().split(" && ")[-1].split()
    assert command[0] == ".venv/bin/polygrasp"
    done = subprocess.run(
        [sys.executable, "-m", "drake_polygrasp", *command[1:]],
        cwd=folder,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert (folder / "l_bracket.grasp.yaml").exists()


def test_ci_runs_the_readme_s_test_command() -> None:
    script = (ROOT / ".ci" / "run").read_text()
    assert "<!-- tests -->" in script
    assert "pytest" in block("tests")


def test_no_command_is_promised_that_is_not_there() -> None:
    promised = set(re.findall(r"`polygrasp (\w+)", README))
    done = subprocess.run(
        [sys.executable, "-m", "drake_polygrasp", "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in promised:
        assert re.search(rf"^\s+{name}\b", done.stdout, re.MULTILINE), name


def test_the_first_picture_moves_and_loops_and_is_small() -> None:
    first = ROOT / re.findall(r"!\[[^]]*\]\((.*?)\)", README)[0]
    with Image.open(first) as picture:
        assert 40 <= picture.n_frames <= 80  # type: ignore[attr-defined]
        assert picture.info["loop"] == 0
        assert min(picture.size) >= 400
    assert first.stat().st_size < 2e6


def test_every_extra_that_is_named_is_there_and_the_notebooks_open() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = extras["optional-dependencies"]
    assert set(re.findall(r"\.\[(\w+)\]", README)) <= set(extras)
    assert "jupyter lab" in README and any(
        line.startswith("jupyterlab") for line in extras["notebooks"]
    )
