"""`polygrasp batch` as users run it: in a process of its own, stopped and started again."""

from __future__ import annotations

import json
import os
import pty
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.chaos_moments import Progress
from drake_polygrasp import iter_batch
from drake_polygrasp.cli.main import main
from tests.support.batches import QUICK, QUICK_OPTIONS, files_of, prism_file, rows_of, two_bodies
from tests.support.held_batch import held_command, held_environment

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
HAND = "hands/three_finger/three_finger.hand.yaml"


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "drake_polygrasp", "batch", *arguments]


def run(
    *arguments: str,
    folder: Path,
    prepare: Callable[[], None] | None = None,
    env: dict[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments),
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | (env or {}),
        preexec_fn=prepare,
    )


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `parts` and their results in `out`."""
    folder = tmp_path_factory.mktemp("planned")
    for sides in (4, 6, 8):
        prism_file(folder / "parts", sides)
    (folder / "parts" / "broken.obj").write_text("f 1 2 3\n")
    done = run("parts", "--out", "out", *QUICK_OPTIONS, folder=folder)
    assert (done.returncode, done.stderr) == (0, "")  # Failures are results; and no bar, no byte.
    first, *counts = done.stdout.splitlines()
    assert first.startswith("out: 4 objects of 4 models, 4 planned in ")
    assert counts == [
        "  ok         3  a grasp file",
        "  bad_model  1  the model, or an option for it, is refused",
    ]
    return folder


def test_the_same_command_again_plans_nothing(planned: Path) -> None:
    done = run("parts", "--out", "out", *QUICK_OPTIONS, "--json", folder=planned)
    assert done.returncode == 0
    report = json.loads(done.stdout)
    assert report["num_planned"] == 0
    assert report["counts"] == {"ok": 3, "bad_model": 1}


def test_options_of_plan_pass_through(planned: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = "--mu 0.5 --tip-radius 0.001 --placement-error 0.001 --avoid-direction 0 0 -1 --plant"
    done = run(
        *("parts/prism_6.obj", "--out", "asked", "--top", "2", *asked.split()), folder=planned
    )
    assert done.returncode == 0, done.stderr
    (text,) = files_of(planned / "asked").values()
    alone = "parts/prism_6.obj --top 2 -o asked/grasps/alone.yaml " + asked
    monkeypatch.chdir(planned)
    assert main(["plan", *alone.split()]) == 1  # Of a mesh the mass is unknown, so none "holds".
    assert (planned / "asked" / "grasps" / "alone.yaml").read_bytes() == text
    assert b"tip_radius: 0.001" in text
    assert b"simulation" in text


def test_a_hand_s_grasps_are_those_of_plan(planned: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(planned)
    asked = f"{MODELS}/cube/cube.sdf --top 1 --up 0 0 1 --hand {MODELS}/{HAND} --budget 3600"
    assert main(["batch", *asked.split(), "--out", "held", "--timeout", "3600"]) == 0
    (text,) = files_of(planned / "held").values()
    assert main(["plan", *asked.split(), "-o", "held/grasps/alone.yaml"]) == 0
    assert (planned / "held" / "grasps" / "alone.yaml").read_bytes() == text


def test_status_says_what_there_is(planned: Path) -> None:
    done = run("status", "out", folder=planned)
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert lines[0] == ("out: 4 of 4 objects that were met have a result; sources name 4 models")
    slowest = max(rows_of(planned / "out").values(), key=lambda row: row.seconds)
    assert any(line.startswith(f"slowest: {slowest.source} ") for line in lines)
    assert any(line.startswith("worst: parts/prism_") for line in lines)
    status = json.loads(run("status", "out", "--json", folder=planned).stdout)
    counts = {"ok": 3, "bad_model": 1, "no_grasp": 0, "crash": 0, "timeout": 0, "out_of_memory": 0}
    assert status["counts"] == counts
    assert status["worst"][0]["epsilon"] == min(
        row.epsilon for row in rows_of(planned / "out").values() if row.epsilon
    )


def test_fail_on_is_the_exit_code(planned: Path) -> None:
    asked = ("parts", "--out", "out", *QUICK_OPTIONS, "--fail-on")
    assert run(*asked, "timeout,crash", folder=planned).returncode == 0
    done = run(*asked, "bad_model", folder=planned)
    assert done.returncode == 1
    assert done.stderr == "polygrasp: out: 1 bad_model\n"


def test_each_body_of_a_model_is_an_object(tmp_path: Path) -> None:
    two_bodies(tmp_path)
    asked = ("two.sdf", "--out", "out", *QUICK_OPTIONS)
    assert run(*asked, folder=tmp_path).stdout.startswith("out: 2 objects of 1 model, 2 planned")
    assert run(*asked, folder=tmp_path).stdout.startswith("out: 2 objects of 1 model, 0 planned")
    assert run(*asked, "--body", "low", folder=tmp_path).stdout.startswith("out: 1 object of 1")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("nowhere --out out", "nowhere: there is no such file or folder; mend the path"),
        ("parts --out parts/broken.obj", "parts/broken.obj: results cannot be written: Not a d"),
        ("status parts", "parts: has no results of a batch; name the --out of one"),
        pytest.param(
            *("export parts --parquet x", "parts: has no results of a batch"),
            marks=pytest.mark.skipif(find_spec("pyarrow") is None, reason="pyarrow is asked first"),
        ),
        ("parts --out new --hand nowhere.yaml", "nowhere.yaml: there is no such hand file"),
        ("parts --out new --hand x --plant", "--plant does not go with --hand"),
        ("parts --out new --mass 3", "--mass is for grasps of a hand; name one with --hand"),
        ("parts --out new --scheduler tcp://127.0.0.1:1", ": "),
    ],
)
def test_what_is_wrong_is_one_line_and_exit_2(planned: Path, arguments: str, said: str) -> None:
    done = run(*arguments.split(), folder=planned)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert said in done.stderr
    assert done.stdout == ""
    assert not (planned / "new").exists()


@pytest.mark.parametrize(
    "arguments", ["", "--shard 3/2", "--shard 1", "--memory 4", "--timeout 0", "--retry ok", "-j 0"]
)
def test_wrong_options_are_usage_errors(arguments: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["batch", "parts", *(f"--out out {arguments}" if arguments else "").split()])
    assert caught.value.code == 2
    assert "error: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("package", "extra", "arguments"),
    [
        ("distributed", "dask", ["parts", "--out", "out", "--scheduler", "tcp://127.0.0.1:8786"]),
        ("pyarrow", "query", ["export", "out", "--parquet", "grasps.parquet"]),
        ("s3fs", "s3", ["parts", "--out", "s3://bucket/out"]),
        ("gcsfs", "gcs", ["parts", "--out", "gs://bucket/out"]),
    ],
)
def test_an_extra_that_is_missing_is_named(
    planned: Path, tmp_path: Path, package: str, extra: str, arguments: Sequence[str]
) -> None:
    (tmp_path / f"{package}.py").write_text("raise ImportError\n")  # As if it were not installed.
    env = {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    done = run(*arguments, folder=planned, env=env)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"pip install 'drake_polygrasp[{extra}]'" in done.stderr


def test_a_second_driver_is_refused_by_the_name_of_the_first(planned: Path, tmp_path: Path) -> None:
    first = iter_batch(planned / "parts", tmp_path / "out", **QUICK)
    next(first)  # It goes on when it is asked for more.
    second = run(str(planned / "parts"), "--out", "out", folder=tmp_path)
    assert second.returncode == 2
    assert f"process {os.getpid()})" in second.stderr
    assert len([*first]) == 3


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_run_and_the_same_command_completes_it(
    tmp_path: Path, number: signal.Signals
) -> None:
    num_objects = 6
    for sides in range(4, 4 + num_objects):
        prism_file(tmp_path / "parts", sides)
    asked = ("parts", "--out", "out", *QUICK_OPTIONS, "-j", "1")
    progress, said = Progress(tmp_path), tmp_path / "said"
    progress.allow(2)
    with said.open("w") as stderr:
        driver = subprocess.Popen(
            held_command(*asked), cwd=tmp_path, env=held_environment(tmp_path), stderr=stderr
        )
    wait_for(progress.is_held, driver)  # Two objects are planned, and the third is in flight.
    driver.send_signal(number)
    wait_for(lambda: "stopping" in said.read_text(), driver)
    progress.allow(None)
    assert driver.wait() == 130
    assert said.read_text().splitlines() == [
        "polygrasp: stopping: objects in flight have 5 s; once more kills them",
        "polygrasp: out: stopped; the same command goes on from here",
    ]
    done = len(rows_of(tmp_path / "out"))
    assert done == len(files_of(tmp_path / "out"))
    assert done in (2, 3), "the third, if its time was enough"
    report = json.loads(run(*asked, "--json", folder=tmp_path).stdout)
    assert report["num_planned"] == num_objects - done
    assert report["counts"] == {"ok": num_objects}


def test_a_disk_that_is_full_is_one_line_and_leaves_nothing_half_written(tmp_path: Path) -> None:
    def no_room() -> None:
        # As on a full disk, no file grows; rows, which are written first, do fit.
        resource.setrlimit(resource.RLIMIT_FSIZE, (80_000, 80_000))

    prism_file(tmp_path / "parts", 4)
    options = ("--out", "out", *QUICK_OPTIONS, "--top=150")
    assert run("parts", *options, folder=tmp_path).returncode == 0
    whole = files_of(tmp_path / "out")
    prism_file(tmp_path / "parts", 16)
    done = run("parts", *options, folder=tmp_path, prepare=no_room)
    assert done.returncode == 2, done
    assert done.stderr.count("\n") == 1
    assert "a grasp file cannot be written: " in done.stderr
    assert "the same command again, which goes on from here" in done.stderr
    assert files_of(tmp_path / "out") == whole
    assert run("parts", *options, folder=tmp_path).returncode == 0
    (new,) = files_of(tmp_path / "out").keys() - whole.keys()
    assert (tmp_path / "out" / "grasps" / new).stat().st_size > 80_000


def test_a_terminal_shows_progress_and_nothing_else_does(planned: Path, tmp_path: Path) -> None:
    shutil.copytree(planned / "parts", tmp_path / "parts")
    progress, (terminal, stderr) = Progress(tmp_path), pty.openpty()
    progress.allow(0)
    asked = ("parts", "--out", "out", "-j", "1", "--plant", "--top", "3")
    driver = subprocess.Popen(
        held_command(*asked),
        cwd=tmp_path,
        env=held_environment(tmp_path),
        stderr=stderr,
        stdout=subprocess.DEVNULL,
    )
    os.close(stderr)
    shown = b""
    try:
        while part := os.read(terminal, 1000):
            shown += part
            if b" without grasps" in shown:
                progress.allow(None)
    except OSError:
        pass  # Linux says so when the other end is closed.
    assert driver.wait() == 0
    assert b"of 4 objects: " in shown
    assert b" without grasps" in shown
    assert shown.endswith(b"\x1b[K"), "it is erased"


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + 600
    while not condition():
        assert process.poll() is None, "it has ended"
        assert time.monotonic() < deadline
        time.sleep(0.02)
