"""`plan --region-proof`: proofs that a reader checks alone, and refuses once they are changed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from drake_polygrasp.certification import exact_cycle
from drake_polygrasp.cli.main import main
from drake_polygrasp.files.grasp_file import load_grasps
from tests.support.grasp_files import BOX_SDF


def write_box(folder) -> Path:
    box = folder / "box.sdf"
    box.write_text(BOX_SDF)
    return box


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A planned box: its grasp file and its proof file."""
    folder = tmp_path_factory.mktemp("proofs")
    box = write_box(folder)
    options = ["-o", str(folder / "box.yaml"), "--region-proof", str(folder / "proof.json")]
    assert main(["plan", str(box), "--top", "2", *options]) == 0
    return folder


@pytest.fixture
def proofs(folder):
    return json.loads((folder / "proof.json").read_text())


def judged(proofs, tmp_path) -> tuple[int, str]:
    """Exit code and output of the checker, as a file of its own."""
    lone, file = tmp_path / "lone.py", tmp_path / "changed.json"
    lone.write_text(Path(exact_cycle.__file__).read_text())
    file.write_text(json.dumps(proofs))
    command = [sys.executable, "-I", str(lone), str(file)]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.stderr == ""
    return result.returncode, result.stdout


def test_the_bounds_of_the_grasp_file_are_proved_for_its_regions(folder, proofs, tmp_path):
    code, out = judged(proofs, tmp_path)
    grasps = load_grasps(folder / "box.yaml").grasps
    assert code == 0 and len(grasps) == len(proofs["region_proofs"]) == 2
    assert [line.split(":")[1].strip() for line in out.splitlines()] == ["holds", "holds"]
    for rank, (grasp, proof) in enumerate(zip(grasps, proofs["region_proofs"], strict=True), 1):
        states, region = proof["states"], grasp.region
        assert (states["rank"], tuple(states["faces"])) == (rank, grasp.grasp.faces)
        assert states["epsilon_lower"] == region.epsilon_lower <= proof["epsilon"]["bound"]
        assert states["squeeze_force"] == region.squeeze_force
        # The weight's force, withstood per newton of total normal force.
        assert states["mass"] * 9.81 <= region.squeeze_force * proof["weight"]["bound"] * (1 + 1e-9)
        corners = [[piece.p_BV.tolist() for piece in pieces] for pieces in region.pieces]
        assert [[piece["p_BV"] for piece in pieces] for pieces in proof["regions"]] == corners
    assert {path.name for path in folder.iterdir()} == {"box.sdf", "box.yaml", "proof.json"}


def more_epsilon(proof):
    proof["states"]["epsilon_lower"] *= 1.001


def less_squeeze(proof):
    proof["states"]["squeeze_force"] *= 0.999


def a_heavier_body(proof):
    proof["states"]["mass"] *= 1.001


def more_epsilon_and_bound(proof):
    proof["epsilon"]["bound"] *= 1.001
    proof["states"]["epsilon_lower"] = proof["epsilon"]["bound"]


def no_proof_of_the_squeeze(proof):
    proof["weight"] = None


def missing_simplex(proof):
    del proof["epsilon"]["simplices"][0], proof["epsilon"]["twists"][0]


def moved_corner(proof):
    piece = proof["regions"][0][0]["p_BV"]
    middle = [sum(x) / len(piece) for x in zip(*piece, strict=True)]
    piece[0] = [a + 0.5 * (a - b) for a, b in zip(piece[0], middle, strict=True)]


def states_that_are_no_mapping(proof):
    proof["states"] = [1]


@pytest.mark.parametrize(
    "change",
    [
        *(more_epsilon, less_squeeze, a_heavier_body, more_epsilon_and_bound),
        *(no_proof_of_the_squeeze, missing_simplex, moved_corner, states_that_are_no_mapping),
    ],
    ids=lambda change: change.__name__,
)
def test_a_changed_proof_is_refused(proofs, change, tmp_path):
    change(proofs["region_proofs"][1])
    code, out = judged(proofs, tmp_path)
    first, second = out.splitlines()
    assert code == 1 and ": holds" in first and "does not hold" in second


def test_the_checker_runs_as_a_module_and_says_what_it_cannot_read(folder, tmp_path):
    command = [sys.executable, "-m", "drake_polygrasp.certification.exact_cycle"]
    for file, code in ((folder / "proof.json", 0), (folder / "box.yaml", 2), (tmp_path, 2)):
        result = subprocess.run([*command, str(file)], capture_output=True, text=True, check=False)
        assert (result.returncode, result.stderr) == (code, "")


def test_without_errors_there_is_nothing_to_prove(tmp_path, capsys):
    box, proof = write_box(tmp_path), tmp_path / "proof.json"
    errors = [f"--{kind}-error=0" for kind in ("placement", "tilt", "friction", "com")]
    output = ["-o", str(tmp_path / "box.yaml"), "--region-proof", str(proof)]
    assert main(["plan", str(box), "--top", "1", *errors, *output]) == 1
    assert capsys.readouterr().err.count(f"polygrasp: {proof}: not written: ") == 1
    assert (tmp_path / "box.yaml").exists() and not proof.exists()


def test_it_replaces_neither_the_model_nor_the_grasp_file(tmp_path, capsys):
    box = write_box(tmp_path)
    before = box.read_text()
    for name, kind in (("box.sdf", "the model"), ("new.yaml", "the grasp file")):
        options = ["-o", str(tmp_path / "new.yaml"), "--region-proof", str(tmp_path / name)]
        assert main(["plan", str(box), *options]) == 2
        assert f"{name}: is {kind}" in capsys.readouterr().err
    assert box.read_text() == before and not (tmp_path / "new.yaml").exists()
