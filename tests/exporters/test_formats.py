"""What holds for the exporter of every format."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from pathlib import Path
from threading import Thread

import pytest

from drake_polygrasp import GraspFileError, UsageError, exporters, load_grasps
from drake_polygrasp.cli.main import main
from tests.support.grasp_files import write_box
from tests.support.held_files import write_held_box

ROOM = Path(exporters.__file__).parent
ROOT = ROOM.parents[1]


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return write_held_box(tmp_path)


def test_each_file_of_the_room_is_a_format() -> None:
    shared = {"holding", "poses", "writing"}
    assert {file.stem for file in ROOM.glob("[!_]*.py")} == {*exporters.FORMATS, *shared}


@pytest.mark.parametrize("name", exporters.FORMATS)
class TestFormat:
    def test_the_command_writes_what_the_function_writes(self, box: Path, name: str) -> None:
        export = getattr(exporters, f"export_{name}")
        assert list(inspect.signature(export).parameters) == ["file", "output", "instance"]
        by_function, by_command = box.parent / "function", box.parent / "command"
        export(load_grasps(box), by_function)
        option = f"--{name.replace('_', '-')}"
        assert main(["export", str(box), option, str(by_command)]) == 0
        assert by_function.read_bytes() == by_command.read_bytes() != b""
        by_name = box.parent / "name"
        to = ["--to", name.replace("_", "-"), "-o", str(by_name), "--instance", "other"]
        assert main(["export", str(box), *to]) == 0
        assert "box" in by_command.read_text()
        export(load_grasps(box), by_function, instance="other")
        assert by_function.read_bytes() == by_name.read_bytes() != by_command.read_bytes()

    def test_the_file_has_the_format_s_ending_unless_it_is_named(
        self, box: Path, name: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (box.parent / "here").mkdir()
        monkeypatch.chdir(box.parent / "here")
        assert main(["export", str(box), "--to", name.replace("_", "-")]) == 0
        (written,) = Path().iterdir()
        assert written.name.startswith("box.")
        assert written.name.endswith(f".{exporters.FORMATS[name][0]}")

    def test_a_file_is_replaced_whole_and_a_pipe_is_written_to(
        self, box: Path, name: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        export, output = getattr(exporters, f"export_{name}"), box.parent / "output"
        output.write_text("older")
        with output.open() as reader:
            export(load_grasps(box), output)
            assert reader.read() == "older"
        expected = output.read_text()
        link = box.parent / "link"
        link.symlink_to(output)
        output.write_text("older")
        export(load_grasps(box), link)
        assert link.is_symlink()
        assert output.read_text() == expected
        pipe = box.parent / "pipe"
        os.mkfifo(pipe)
        read: list[str] = []
        reading = Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
        reading.start()
        export(load_grasps(box), pipe)
        reading.join()
        assert read == [expected]
        assert pipe.is_fifo()

        def full(*_: object, **__: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(Path, "replace", full)
        with pytest.raises(GraspFileError, match="No space left"):
            export(load_grasps(box), output, instance="other")
        assert output.read_text() == expected
        assert not [*box.parent.glob(".*")]

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
        with pytest.raises(UsageError, match="instance"):
            export(load_grasps(box), box.parent / "output", instance=3)


def test_the_command_asks_for_a_format(box: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["export", str(box)])
    error = capsys.readouterr().err
    assert all(f"--{name.replace('_', '-')}" in error for name in exporters.FORMATS)
    assert "--to" in error


def test_an_output_without_to_is_a_usage_error(
    box: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(box), "--directives", "a.yaml", "-o", "b.yaml"]) == 2
    assert "-o: it goes with --to" in capsys.readouterr().err
    assert not Path("a.yaml").exists()


@pytest.mark.parametrize("name", ["isaac-grasp", "moveit"])
def test_formats_of_hands_refuse_files_without_one(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    box = write_box(tmp_path)
    assert main(["export", str(box), "--to", name, "-o", str(tmp_path / "out")]) == 2
    assert "states no posture of a hand" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_goes_to_standard_output_is_the_export_alone(box: Path) -> None:
    command = [sys.executable, "-m", "drake_polygrasp", "export", str(box), "--to", "contacts-csv"]
    exporters.export_contacts_csv(load_grasps(box), box.parent / "expected")
    done = subprocess.run(
        [*command, "-o", "/dev/stdout"], cwd=ROOT, capture_output=True, check=True
    )
    assert done.stdout == (box.parent / "expected").read_bytes()
