"""`polygrasp hand check` and `polygrasp plan --hand`, as users call them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from drake_polygrasp.cli.hand_plan import HAND_OPTIONS, OTHER_OPTIONS, SHARED_OPTIONS
from drake_polygrasp.cli.main import main, make_parser
from tests.support.hands import CUBE, OWN_HAND


def called(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    code = main([str(word) for word in words])
    out, err = capsys.readouterr()
    return code, out, err


def test_a_hand_is_checked_and_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    page = tmp_path / "hand.html"
    code, out, err = called(capsys, "hand", "check", OWN_HAND, "--html", page)
    assert (code, err) == (0, "")
    assert out.startswith("three_finger: 9 joints, 9 independent; its root 'palm' floats\n")
    assert "tip first: moves in 3 of 3 directions" in out
    assert "it can grasp\n" in out
    assert page.stat().st_size > 100_000
    code, out, _ = called(capsys, "hand", "check", OWN_HAND, "--json")
    document = json.loads(out)
    assert code == 0
    assert document["effort"]["second_curl"] == 1.0
    assert document["errors"] == document["warnings"] == []


def test_a_bad_hand_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    bad = tmp_path / "bad.hand.yaml"
    text = OWN_HAND.read_text()
    model = OWN_HAND.with_name("three_finger.sdf")
    bad.write_text(text.replace("three_finger.sdf", str(model)).replace("palm_face", "hand"))
    for words in (("hand", "check", bad), ("plan", CUBE, "--hand", bad, "-o", tmp_path / "x.yaml")):
        code, out, err = called(capsys, *words)
        assert (code, out) == (2, "")
        assert err.count("\n") == 1
        assert "bad.hand.yaml: palm.frame is 'hand', which the model lacks" in err
    assert not (tmp_path / "x.yaml").exists()


def test_grasps_of_a_hand_are_planned_written_and_verified(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "cube.grasp.yaml"
    words = ("plan", CUBE, "--hand", OWN_HAND, "-o", file, "--budget", "3600", "--seed", "0")
    code, out, _ = called(capsys, *words, "--up", "0", "0", "1", "--top", "2")
    assert code == 0
    assert "2 grasps that 'three_finger' can make" in out
    assert "bears: proved to hold with each contact off by this much" in out
    assert f"wrote {file}" in out
    code, out, _ = called(capsys, "verify", file)
    assert code == 0
    assert "HAND" in out
    before = file.read_bytes()
    code, out, _ = called(capsys, *words, "--up", "0", "0", "1", "--top", "2", "--json")
    document = json.loads(out)
    assert code == 0
    assert [grasp["hand"]["torque"]["loads"] for grasp in document["grasps"]] == ["up", "up"]
    assert file.read_bytes() == before


def test_a_hand_that_makes_no_grasp_says_why(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    crate, file = tmp_path / "crate.sdf", tmp_path / "crate.grasp.yaml"
    crate.write_text(CUBE.read_text().replace("0.06", "0.6"))
    code, out, err = called(capsys, "plan", crate, "--hand", OWN_HAND, "-o", file)
    assert (code, out) == (1, "")
    assert "no grasp that 'three_finger' can make; 0 of 0 candidates within reach tried" in err
    assert "600 x 600 x 600 mm" in err
    assert not file.exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mass", "1"), "--mass is for grasps of a hand; name one with --hand"),
        (("--seed", "0"), "--seed is for grasps of a hand"),
        (("--hand", OWN_HAND, "--plant"), "--plant does not go with --hand"),
        (("--hand", OWN_HAND, "--tip-radius", "0"), "--tip-radius does not go with --hand"),
        (("--hand", OWN_HAND, "--region-proof", "x.json"), "--region-proof does not go with"),
        (("--hand", OWN_HAND, "--method", "paper"), "--method does not go with --hand"),
    ],
)
def test_options_that_do_not_go_together(
    capsys: pytest.CaptureFixture[str], options: tuple[str, ...], message: str
) -> None:
    code, out, err = called(capsys, "plan", CUBE, *options)
    assert (code, out) == (2, "")
    assert message in err


def test_every_option_of_plan_is_used_with_a_hand_or_refused() -> None:
    arguments = vars(make_parser().parse_args(["plan", "model.sdf"]))
    of_the_call = {"command", "model", "hand", "top", "output", "json", "package_path", "packages"}
    of_the_call |= {"version"}
    of_the_object = {"body", "joints_free", "scale", "mu", "patch_angle", "patch_depth"}
    assert {*arguments} == of_the_call | of_the_object | {
        *HAND_OPTIONS,
        *OTHER_OPTIONS,
        *SHARED_OPTIONS,
    }
