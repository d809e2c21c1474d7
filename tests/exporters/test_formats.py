"""What holds for the exporter of every format."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from drake_polygrasp import GraspFileError, UsageError, exporters, load_grasps
from drake_polygrasp.cli.main import main
from tests.support.grasp_files import write_box

ROOM = Path(exporters.__file__).parent


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return write_box(tmp_path)


def test_each_file_of_the_room_is_a_format() -> None:
    assert {file.stem for file in ROOM.glob("[!_]*.py")} == {*exporters.FORMATS, "writing"}


@pytest.mark.parametrize("name", exporters.FORMATS)
class TestFormat:
    def test_the_command_writes_what_the_function_writes(self, box: Path, name: str) -> None:
        export = getattr(exporters, f"export_{name}")
        assert list(inspect.signature(export).parameters) == ["file", "output"]
        by_function, by_command = box.parent / "function", box.parent / "command"
        export(load_grasps(box), by_function)
        option = f"--{name.replace('_', '-')}"
        assert main(["export", str(box), option, str(by_command)]) == 0
        assert by_function.read_bytes() == by_command.read_bytes() != b""

    def test_the_grasp_file_is_never_replaced(self, box: Path, name: str) -> None:
        before = box.read_bytes()
        with pytest.raises(GraspFileError, match="is the grasp file"):
            getattr(exporters, f"export_{name}")(load_grasps(box), box)
        assert box.read_bytes() == before

    def test_what_cannot_be_written_is_an_error(self, box: Path, name: str) -> None:
        with pytest.raises(GraspFileError, match="cannot be written"):
            getattr(exporters, f"export_{name}")(load_grasps(box), box.parent / "no" / "such")

    def test_wrong_arguments_are_usage_errors(self, box: Path, name: str) -> None:
        export = getattr(exporters, f"export_{name}")
        with pytest.raises(UsageError, match="GraspFile"):
            export(box, box.parent / "output")
        with pytest.raises(UsageError, match="output"):
            export(load_grasps(box), None)


def test_the_command_asks_for_a_format(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["export", str(box)])
    error = capsys.readouterr().err
    assert all(f"--{name.replace('_', '-')}" in error for name in exporters.FORMATS)
