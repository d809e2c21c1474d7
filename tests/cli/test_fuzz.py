"""A taste of the fuzz: `python tests/support/fuzz.py` runs thousands more."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.support.fuzz import COMMANDS, FILES, TIME_LIMIT, Ending, fuzz, run, spoil, write_files


@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_spoilt_was_good(name: str, tmp_path: Path) -> None:
    folder = write_files(tmp_path / "files")
    command = COMMANDS[name].replace("plan", "plan --method paper --top 1 -o out.yaml")
    ending = run(command, folder)
    assert (ending.code, ending.fault) == (0, ""), ending.said


def test_no_spoilt_file_breaks_the_command_line() -> None:
    endings, faults = fuzz(range(45), seed=1)
    assert not faults, "\n".join(faults)
    assert endings.total() == 45
    assert {ending.split(":")[0] for ending in endings} == set(COMMANDS)
    assert any("exit 0" in ending for ending in endings)
    assert any("exit 2" in ending for ending in endings)


def test_the_same_seed_spoils_the_same_way() -> None:
    for name, text in FILES.items():
        once, again = (
            [spoil(text.encode(), random.Random(f"0 {k}")) for k in range(20)] for _ in range(2)
        )
        assert once == again, name
        assert len(set(once)) > 10, name


@pytest.mark.parametrize(
    "ending",
    [
        Ending(-11, "polygrasp: x", 0, []),
        Ending(3, "polygrasp: x", 0, []),
        Ending(1, "", 0, []),
        Ending(2, "something", 0, []),
        Ending(2, "polygrasp: x\nTraceback", 0, []),
        Ending(2, "polygrasp: internal error", 0, []),
        Ending(0, "", 0, [".out.yaml.1.tmp"]),
    ],
)
def test_a_bad_ending_is_known_for_one(ending: Ending) -> None:
    assert ending.fault


def test_a_good_ending_has_no_fault() -> None:
    assert not Ending(0, "", 0, []).fault
    assert not Ending(2, "polygrasp: x.sdf: is no model; mend it\n", TIME_LIMIT, []).fault
