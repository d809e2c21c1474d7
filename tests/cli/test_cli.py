"""The command line: what it prints, writes and returns, whatever it is given."""

from __future__ import annotations

import faulthandler
import json
import math
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import drake_polygrasp
from drake_polygrasp import verify_file
from drake_polygrasp.cli import verify
from drake_polygrasp.cli.child_process import call_in_child
from drake_polygrasp.cli.main import main
from drake_polygrasp.errors import ModelError
from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.paper.reasons import MEANING, REASONS
from drake_polygrasp.visualization.precision import FINE
from tests.support.grasp_files import BOX_SDF, write_box

ROOT = Path(drake_polygrasp.__file__).parents[1]
MODELS = ROOT / "models"
CUBE, TETRAHEDRON = MODELS / "cube" / "cube.sdf", MODELS / "tetrahedron" / "tetrahedron.urdf"
EXACT = "--placement-error 0 --tilt-error 0 --friction-error 0 --com-error 0"
JSON_KEYS = [
    "model",
    "num_faces",
    "excluded_faces",
    "num_sets",
    "num_certified",
    "seconds",
    "reasons",
    "outcome",
    "output",
    "grasps",
]


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Run:
    """What a command returned and printed."""

    def __init__(self, capsys: pytest.CaptureFixture[str], command: str) -> None:
        try:
            self.code = main(shlex.split(command))
        except SystemExit as leaving:  # argparse
            self.code = int(leaving.code or 0)
        self.out, self.err = capsys.readouterr()

    def json(self) -> Any:
        return json.loads(self.out)


def polygrasp(command: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "drake_polygrasp", *shlex.split(command)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        **options,
    )


def test_plan_writes_what_verify_bears_out(capsys: pytest.CaptureFixture[str]) -> None:
    exact = Run(capsys, f"plan {CUBE} {EXACT} --top 15")
    counts = "15 certified, all evaluated"
    assert exact.out.splitlines()[0] == f"{CUBE}: 6 faces, 35 sets of faces, {counts}"
    plan = Run(capsys, f"plan {CUBE} --top 3")
    assert (plan.code, plan.err) == (0, "")
    assert plan.out.splitlines()[-1] == "wrote cube.grasp.yaml"
    verify = Run(capsys, "verify cube.grasp.yaml")
    assert (verify.code, verify.err) == (0, ""), verify.out
    assert verify.out.splitlines()[-1] == "all that was checked holds"
    assert verify.out.splitlines()[1].split() == [
        *("rank", "FORCES", "SURFACE", "NUMBERS", "bears", "[mm]")
    ]
    assert {line.split()[-1] for line in verify.out.splitlines()[2:-1]} == {"2.08"}
    assert {grasp.bears for grasp in verify_file("cube.grasp.yaml").grasps} == {0.00207846}


@pytest.mark.parametrize(
    ("asked", "kept"),
    [
        ("edge-clearance", "edge clearance"),
        ("placement-error", "edge clearance and placement error"),
    ],
)
def test_faces_that_are_too_small_are_named_by_what_they_are_too_small_for(
    asked: str, kept: str, capsys: pytest.CaptureFixture[str]
) -> None:
    # The cube's faces have an inradius of 30 mm.
    plan = Run(capsys, f"plan {CUBE} --{asked} 0.031")
    assert plan.code == 1
    assert f": no two faces have room within the {kept};" in plan.err


def test_the_table_has_a_row_a_grasp_and_a_unit_where_there_is_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines = Run(capsys, f"plan {CUBE} --top 3").out.splitlines()
    for column in ("rank", "faces", "kind", "Q", "margin", "epsilon", "mu_min", "placement"):
        assert column in lines[1]
    assert lines[2].split() == ["[mm]", "[N]", "[mm]", "epsilon", "[N]"]
    assert [line.split()[0] for line in lines[3:6]] == ["1", "2", "3"]
    exact = Run(capsys, f"plan {CUBE} --top 3 {EXACT}").out.splitlines()
    assert "bears" in lines[1] and "bears" not in exact[1]
    assert exact[2].split() == ["[mm]", "[N]"]
    # L is 60 mm times the square root of 3, and all three grasps bear 2 percent of it.
    assert {line.split()[-3] for line in lines[3:6]} == {"2.08"}
    least = [float(line.split()[-2]) for line in lines[3:6]]
    assert least == sorted(least, reverse=True) and least[-1] > 0
    assert lines[6].startswith("bears: proved to hold with each contact off by this much")
    assert lines[7].startswith("epsilon and squeeze are of exact contacts, then: of the worst ")
    assert "ranked" in lines[7]
    assert len(lines) == 9


def test_the_table_says_which_grasps_bear_less(capsys: pytest.CaptureFixture[str]) -> None:
    lines = Run(capsys, f"plan {MODELS / 'wedge' / 'wedge.urdf'}").out.splitlines()
    less = [line for line in lines if line.startswith("grasp") and " degrees, friction" in line]
    assert {line.split(" degrees")[0].split()[-1] for line in less} == {"2.5", "1.25"}
    full = next(line for line in lines if line.startswith("bears: "))
    assert "normals by 5 degrees, friction less by 20 percent" in full
    assert (
        "less than was asked is stated where more is not proved" in lines[lines.index(less[-1]) + 1]
    )


def test_the_table_says_what_a_placement_under_a_millimetre_means(
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = Run(capsys, f"plan {MODELS / 'rod' / 'rod.urdf'} --top 1 {EXACT}").out
    assert f"grasp 1: {FINE}" in out.splitlines()
    assert FINE not in Run(capsys, f"plan {CUBE} --top 1 {EXACT}").out


def test_the_table_says_why_placement_on_patches_is_narrow(
    capsys: pytest.CaptureFixture[str],
) -> None:
    can = "<cylinder><radius>0.03</radius><length>0.1</length></cylinder>"
    Path("can.sdf").write_text(BOX_SDF.replace("<box><size>0.1 0.1 0.2</size></box>", can))
    for file, says in (("can.sdf", True), (CUBE, False)):
        plan = Run(capsys, f"plan {file} --top 1 {EXACT}")
        assert (plan.code, "placement holds only" in plan.out) == (0, says)


def test_plan_in_json_is_one_object_that_says_what_the_file_says(
    capsys: pytest.CaptureFixture[str],
) -> None:
    plan = Run(capsys, f"plan {CUBE} --json -o out.yaml")
    document = plan.json()
    assert plan.code == 0
    assert list(document) == JSON_KEYS
    assert document["model"] == str(CUBE)
    assert document["num_faces"] == 6
    assert document["num_sets"] == math.comb(6, 3) + math.comb(6, 2)
    assert sum(document["reasons"].values()) == document["num_sets"]
    assert document["num_certified"] == document["reasons"]["certified"]
    assert list(document["seconds"]) == ["load", "plan", "certify"]
    assert document["output"] == "out.yaml"
    stated = load_grasps("out.yaml").grasps
    assert [grasp["faces"] for grasp in document["grasps"]] == [[*g.grasp.faces] for g in stated]


def test_the_same_command_writes_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert polygrasp(f"plan {CUBE} --top 2 -o {tmp_path}/{name}").returncode == 0
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_without_a_certified_grasp_an_older_file_is_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    older = tmp_path / "tetrahedron.grasp.yaml"
    older.write_text("older")
    plan = Run(capsys, f"plan {TETRAHEDRON} --json")
    assert plan.code == 1
    assert "no certified grasp; all 10 sets of faces were evaluated" in plan.err
    assert older.read_text() == "older"
    assert "left as it was" in plan.err
    assert "10 orientation" in plan.err
    assert "0.3536" in plan.err  # 1 / sqrt(8): what its faces need to oppose each other
    document = plan.json()
    assert document["output"] is None
    assert document["outcome"] == "no_certified_grasp"
    assert document["grasps"] == []
    assert document["num_certified"] == 0


def test_without_a_certified_grasp_no_file_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = Run(capsys, f"plan {TETRAHEDRON}")
    assert (plan.code, plan.out) == (1, "")
    assert "no file is written" in plan.err
    assert list(tmp_path.iterdir()) == []


def test_mu_overrides_the_model_and_verify_knows(capsys: pytest.CaptureFixture[str]) -> None:
    assert Run(capsys, f"plan {TETRAHEDRON} --mu 0.5").code == 0
    assert load_grasps("tetrahedron.grasp.yaml").plan.mu == 0.5
    verify = Run(capsys, "verify tetrahedron.grasp.yaml")
    assert verify.code == 0, verify.out
    assert "0.5" in verify.err


def test_the_paper_s_method_ranks_by_q(capsys: pytest.CaptureFixture[str]) -> None:
    document = Run(capsys, f"plan {CUBE} --method paper --json").json()
    qualities = [grasp["quality"]["Q"] for grasp in document["grasps"]]
    assert qualities == sorted(qualities, reverse=True)
    assert load_grasps("cube.grasp.yaml").plan.stated["method"] == "paper"


def test_explain_accounts_for_every_set(capsys: pytest.CaptureFixture[str]) -> None:
    explain = Run(capsys, f"explain {CUBE} --json")
    document = explain.json()
    assert explain.code == 0
    assert len(document["sets"]) == sum(document["reasons"].values()) == document["num_sets"] == 35
    assert {item["reason"] for item in document["sets"]} == set(document["reasons"])
    assert "not_evaluated" not in document["reasons"]
    text = Run(capsys, f"explain {CUBE}").out
    assert all(MEANING[reason][1] in text for reason in document["reasons"])


def test_explain_tells_the_story_of_one_set(capsys: pytest.CaptureFixture[str]) -> None:
    (item,) = Run(capsys, f"explain {CUBE} --set 5,0 --json").json()["sets"]
    assert item == {"faces": [0, 5], "reason": "certified"}
    assert Run(capsys, f"explain {CUBE} --set 5,0,0 --json").json()["sets"] == [item]
    assert MEANING["certified"][1] in Run(capsys, f"explain {CUBE} --set 0,5").out


def test_explain_says_what_friction_it_would_take(capsys: pytest.CaptureFixture[str]) -> None:
    explain = Run(capsys, f"explain {TETRAHEDRON}")
    assert explain.code == 0
    assert "0.3536" in explain.out


def test_every_reason_has_a_meaning() -> None:
    assert list(MEANING) == list(REASONS)


def test_verify_in_json_says_what_was_done_about_each_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_box(tmp_path)
    verify = Run(capsys, "verify box.grasp.yaml --json")
    assert verify.code == 0
    assert verify.json()["holds"] is True
    assert verify.json()["grasps"] == [
        {
            "FORCES": {"status": "proved", "reason": ""},
            "SURFACE": {"status": "recomputed", "reason": ""},
            "NUMBERS": {"status": "recomputed", "reason": ""},
        }
    ]


def test_a_spoilt_file_is_exit_1_and_says_where(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_box(tmp_path)
    file.write_text(file.read_text().replace("margin: 0.75", "margin: 1.5"))
    verify = Run(capsys, "verify box.grasp.yaml")
    assert verify.code == 1
    assert "grasp 1, NUMBERS: margin is 1.5, more than the 0.75 recomputed" in verify.out
    assert verify.out.splitlines()[-1] == "something does not hold"


def test_a_missing_model_is_a_warning_unless_it_is_required(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_box(tmp_path)
    (tmp_path / "box.sdf").unlink()
    verify = Run(capsys, "verify box.grasp.yaml")
    assert verify.code == 0
    assert verify.err.startswith("warning: SURFACE is not checked")
    assert verify.out.endswith("all that was checked holds; SURFACE was not checked\n")
    assert Run(capsys, "verify box.grasp.yaml --json").json()["holds"] is None
    required = Run(capsys, "verify box.grasp.yaml --require-model --json")
    assert required.code == 1
    assert required.json()["holds"] is False


def test_a_model_is_found_by_its_package(capsys: pytest.CaptureFixture[str]) -> None:
    uri = "package://drake_polygrasp_models/cube/cube.sdf"
    assert Run(capsys, f"plan {uri} --top 1 --package-path {MODELS}").code == 0
    assert load_grasps("cube.grasp.yaml").object_.model_file == uri
    found = Run(capsys, f"verify cube.grasp.yaml --package-path {MODELS} --require-model")
    assert found.code == 0, found.out
    assert "not checked" in Run(capsys, "verify cube.grasp.yaml").out


TWO_BODIES = """<sdf version="1.9"><model name="jar">
<link name="jar"><collision name="a"><geometry><box><size>1 1 1</size></box></geometry></collision>
</link>
<link name="lid"><collision name="a"><geometry><box><size>1 1 1</size></box></geometry></collision>
</link></model></sdf>"""
NO_COLLISION = '<sdf version="1.9"><model name="m"><link name="l"/></model></sdf>'
BAD_INDEX = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 99999999\n"
FILES = {
    "empty.sdf": "",
    "malformed.sdf": "<sdf",
    "binary.sdf": "\x00\x01",
    "bodies.sdf": TWO_BODIES,
    "bare.sdf": NO_COLLISION,
    "index.obj": BAD_INDEX,
    "nothing.obj": "",
    "thing.stl": "solid",
    "bad.dmd.yaml": "directives: 3",
    "empty.grasp.yaml": "",
    "list.grasp.yaml": "- 1",
}


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("plan missing.sdf", "missing.sdf"),
        ("plan .", "polygrasp: "),
        ("plan ''", "polygrasp: "),
        ("plan empty.sdf", "empty.sdf"),
        ("plan malformed.sdf", "malformed.sdf"),
        ("plan binary.sdf", "binary.sdf"),
        ("plan bare.sdf", "no collision geometry"),
        ("plan bodies.sdf", "'jar', 'lid'"),
        ("plan bodies.sdf --body lamp", "no body 'lamp'"),
        ("plan index.obj", "index.obj"),
        ("plan nothing.obj", "nothing.obj"),
        ("plan thing.stl", "thing.stl"),
        ("plan bad.dmd.yaml", "bad.dmd.yaml"),
        ("plan package://unknown/x.sdf", "unknown"),
        ("plan {CUBE} --package-path nowhere", "nowhere"),
        ("plan {CUBE} -o no/such/folder/x.yaml", "cannot be written"),
        ("plan {CUBE} -o .", "not a regular file"),
        ("plan {CUBE} -o {CUBE}", "is the model"),
        ("explain missing.sdf", "missing.sdf"),
        ("explain {CUBE} --set 0,17", "0 to 5"),
        ("verify missing.grasp.yaml", "missing.grasp.yaml"),
        ("verify .", "is a folder"),
        ("verify empty.grasp.yaml", "not a mapping"),
        ("verify list.grasp.yaml", "not a mapping"),
        ("verify {CUBE}", "cube.sdf"),
    ],
)
def test_bad_input_is_one_message_exit_2_and_no_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], command: str, message: str
) -> None:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    run = Run(capfd, command.format(CUBE=CUBE))
    assert run.code == 2
    assert run.out == ""
    assert message in run.err
    assert run.err.startswith("polygrasp: ")
    assert run.err.count("\n") == 1, run.err
    assert "internal error" not in run.err
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FILES)


@pytest.mark.parametrize(
    "command",
    [
        "",
        "fly",
        "plan",
        "plan a b",
        "plan a --mu 0",
        "plan a --mu nan",
        "plan a --mu inf",
        "plan a --mu high",
        "plan a --mu 1e9",
        "plan a --top 0",
        "plan a --top 1.5",
        "plan a --rank best",
        "plan a --method guess",
        "plan a --edge-clearance -1",
        "plan a --tip-radius nan",
        "plan a --placement-error -1",
        "plan a --tilt-error 1.6",
        "plan a --friction-error 1",
        "plan a --com-error nan",
        "explain a --set 1",
        "explain a --set 1,2,3,4",
        "explain a --set 1,x",
        "verify",
    ],
)
def test_wrong_usage_is_exit_2(capsys: pytest.CaptureFixture[str], command: str) -> None:
    run = Run(capsys, command)
    assert (run.code, run.out) == (2, "")
    assert "usage: polygrasp" in run.err


@pytest.mark.parametrize(
    ("command", "options"),
    [
        (
            "plan",
            "--body --mu --top --method --rank --edge-clearance --tip-radius --output --json "
            "--package-path --placement-error --tilt-error --friction-error --com-error",
        ),
        ("verify", "--require-model --json --package-path"),
        (
            "explain",
            "--set --body --mu --method --edge-clearance --tip-radius --json --package-path",
        ),
    ],
)
def test_help_names_every_option(
    capsys: pytest.CaptureFixture[str], command: str, options: str
) -> None:
    run = Run(capsys, f"{command} --help")
    assert run.code == 0
    for option in options.split():
        assert option in run.out
    assert run.out.count("default") >= len(options.split()) // 2


def test_an_unexpected_error_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr(verify, "call_in_child", broken)
    run = Run(capsys, "verify x")
    assert run.code == 2
    assert run.err == (
        "polygrasp: internal error (ZeroDivisionError: two lines); please report it\n"
    )


def test_an_interrupt_is_exit_130(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(verify, "call_in_child", interrupted)
    assert Run(capsys, "verify x").code == 130


def test_a_native_crash_is_a_message() -> None:
    with pytest.raises(ModelError, match=r"thing: Drake crashed \(SIGABRT\)"):
        call_in_child("tests.cli.test_cli:abort", "thing")
    with pytest.raises(ModelError, match="the process ended"):
        call_in_child("tests.cli.test_cli:leave", "thing")


def abort(_: str) -> None:
    faulthandler.disable()
    os.abort()


def leave(_: str) -> None:
    os._exit(0)


def test_what_a_child_raises_is_raised() -> None:
    with pytest.raises(ValueError, match="no such"):
        call_in_child("tests.cli.test_cli:refuse", "thing")


def refuse(_: str) -> None:
    raise ValueError("no such")


def test_a_reader_that_closes_the_pipe_is_no_error() -> None:
    command = f"{shlex.quote(sys.executable)} -m drake_polygrasp explain {CUBE} --json | head -c 1"
    result = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "{", "")


def test_a_full_disk_behind_standard_output_is_one_message(tmp_path: Path) -> None:
    write_box(tmp_path)
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [sys.executable, "-m", "drake_polygrasp", "verify", "box.grasp.yaml"],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert result.returncode == 2
    assert result.stderr == "polygrasp: standard output: No space left on device\n"


def test_a_name_in_another_encoding_is_printed_somehow(tmp_path: Path) -> None:
    name = os.fsdecode(b"cube\xff.sdf")
    (tmp_path / name).write_bytes(CUBE.read_bytes())
    result = subprocess.run(
        [sys.executable, "-m", "drake_polygrasp", "plan", name],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / os.fsdecode(b"cube\xff.grasp.yaml")).is_file()
