"""Each object has exactly one result, which is the same however often the run is broken off."""

from __future__ import annotations

import fcntl
import json
import os
import pickle
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import IO

import pytest

from drake_polygrasp import (
    BatchError,
    ModelError,
    UsageError,
    iter_batch,
    load_object,
    plan_batch,
    plan_grasps,
    save_grasps,
    verify_file,
)
from drake_polygrasp.batch.driver_lock import DriverLock
from drake_polygrasp.batch.outputs import LocalOutput, remove_scratch
from drake_polygrasp.batch.status import read_status
from drake_polygrasp.settings import NO_ERRORS
from tests.support.batches import QUICK, files_of, prism_file, rows_of, two_bodies

MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with objects of every result in `parts`, and the results in `out`."""
    folder = tmp_path_factory.mktemp("planned")
    parts = folder / "parts"
    for sides in (4, 6):
        prism_file(parts, sides)
    shutil.copy(parts / "prism_4.obj", parts / "prism_4_again.obj")
    (parts / "broken.obj").write_text("v 0 0 0\nf 1 2 3\n")
    two_bodies(folder / "others")
    for name in ("tetrahedron.urdf", "tetrahedron.obj"):
        shutil.copy(MODELS / "tetrahedron" / name, folder / "others")
    (folder / "others" / "lost_mesh.urdf").write_text(
        '<robot name="r"><link name="l"><collision><geometry><mesh filename="lost.obj"/></geometry>'
        "</collision></link></robot>"
    )
    report = plan_batch([parts, folder / "others"], folder / "out", **QUICK)
    assert report.complete
    assert report.num_planned == 7  # Two sources are the same object.
    assert report.num_objects == 8
    assert report.counts == {"ok": 5, "no_grasp": 1, "bad_model": 2}
    return folder


@pytest.fixture
def copy(planned: Path, tmp_path: Path) -> Iterator[Path]:
    """A copy of `planned` to spoil."""
    yield Path(shutil.copytree(planned, tmp_path / "copy"))


def again(folder: Path, **arguments: object) -> list[str]:
    """What the same batch plans when it is asked for again."""
    sources = [folder / "parts", folder / "others"]
    rows = iter_batch(sources, folder / "out", **QUICK | arguments)
    return sorted(f"{Path(row.source).name} {row.status}" for row in rows)


def test_every_result_is_a_file_that_verifies_or_a_row_that_says_why_not(planned: Path) -> None:
    rows = rows_of(planned / "out")
    assert {name: row.status for name, row in rows.items()} == {
        "broken.obj": "bad_model",
        "tetrahedron.urdf": "no_grasp",
        "prism_4.obj": "ok",
        "prism_6.obj": "ok",
        "lost_mesh.urdf": "bad_model",
        "two.sdf:low": "ok",
        "two.sdf:high": "ok",
    }
    files = files_of(planned / "out")
    assert {*files} == {f"{row.key}.grasp.yaml" for row in rows.values() if row.status == "ok"}
    for row in rows.values():
        assert (row.reason == "") == (row.status == "ok")
        assert "\n" not in row.reason
        if row.status == "ok":
            report = verify_file(planned / "out" / "grasps" / f"{row.key}.grasp.yaml")
            assert report.holds
            assert len(report.grasps) == row.num_grasps == 2
            assert row.epsilon is not None
            assert row.load_seconds is not None


def test_a_result_is_what_planning_alone_gives(planned: Path) -> None:
    row = rows_of(planned / "out")["prism_6.obj"]
    file = planned / "out" / "grasps" / f"{row.key}.grasp.yaml"
    alone = file.with_name("alone.yaml")
    object_ = load_object(row.source)
    plan = plan_grasps(object_, effort="quick", top=2, **NO_ERRORS)
    save_grasps(alone, object_, plan.grasps, plan.settings)
    assert alone.read_bytes() == file.read_bytes()
    alone.unlink()
    assert (row.num_faces, row.num_sets) == (8, plan.num_sets)
    assert row.epsilon == pytest.approx(plan.grasps[0].certificate.epsilon_lower, rel=1e-5)


def test_a_model_that_cannot_be_read_has_the_sentence_of_load_object(planned: Path) -> None:
    for name in ("broken.obj", "lost_mesh.urdf"):
        row = rows_of(planned / "out")[name]
        with pytest.raises(ModelError) as caught:
            load_object(row.source)
        assert row.reason == str(caught.value)


def test_what_has_a_result_is_not_planned_again(copy: Path) -> None:
    before = files_of(copy / "out")
    assert again(copy) == []
    assert files_of(copy / "out") == before


def test_a_changed_object_or_option_is_another_result(copy: Path) -> None:
    mesh = copy / "parts" / "prism_6.obj"
    mesh.write_text(mesh.read_text() + "# changed\n")
    assert again(copy) == ["prism_6.obj ok"]
    assert len(again(copy, edge_clearance=1e-3)) == 7
    status = read_status(copy / "out")
    assert status.num_objects == 8
    assert status.counts["ok"] == 5
    assert status.num_earlier == 1  # The first run's are those of the folder that was copied.
    # A file that a model names counts as much as the model.
    mesh = copy / "others" / "lost.obj"
    shutil.copy(copy / "parts" / "prism_4.obj", mesh)
    assert again(copy) == ["lost_mesh.urdf ok"]


def test_options_that_say_the_same_are_the_same(copy: Path) -> None:
    assert again(copy, rank="epsilon", mu=None, avoid_directions=[]) != []
    assert again(copy, rank="epsilon", scale=None, avoid_directions=()) == []
    assert again(copy, limit=1, avoid_directions=[(0, 0, -2)], exclude_faces=[1, 0]) != []
    asked = {"avoid_directions": ((0, 0, -1.0),), "exclude_faces": (0, 1, 1)}
    assert len(again(copy, **asked)) == 7 - 1


def test_a_file_without_its_row_is_adopted_if_it_holds(copy: Path) -> None:
    rows, before = rows_of(copy / "out"), files_of(copy / "out")
    spoiled = copy / "out" / "grasps" / f"{rows['prism_6.obj'].key}.grasp.yaml"
    spoiled.write_text(spoiled.read_text().replace("margin: 0", "margin: 9"))
    (copy / "out" / "grasps" / f".{rows['prism_4.obj'].key}.{os.uname()[1]}-999999.tmp").touch()
    with sqlite3.connect(copy / "out" / "results.sqlite") as connection:
        connection.execute("DELETE FROM results WHERE status = 'ok'")
    connection.close()
    assert again(copy) == ["prism_4.obj ok", "prism_6.obj ok", "two.sdf ok", "two.sdf ok"]
    after = rows_of(copy / "out")
    assert files_of(copy / "out") == before
    for name in ("prism_4.obj", "two.sdf:low", "two.sdf:high"):
        assert after[name].plan_seconds is None, "adopted"
        assert after[name].epsilon == pytest.approx(rows[name].epsilon)
    assert after["prism_6.obj"].plan_seconds is not None, "planned, as the file did not hold"


def test_what_a_worker_left_half_written_is_gone_at_the_end(planned: Path, tmp_path: Path) -> None:
    rows = iter_batch(planned / "parts", tmp_path, **QUICK)
    key = next(rows).key
    (tmp_path / "grasps" / f".{key}.{os.uname()[1]}-999999.tmp").touch()
    assert len(list(rows)) == 2
    assert len(files_of(tmp_path)) == 2, "broken.obj has none"


def test_a_file_is_written_though_another_driver_clears_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def clear_up_first(file: IO[str], operation: int) -> None:
        monkeypatch.undo()
        remove_scratch(tmp_path)
        fcntl.flock(file, operation)

    monkeypatch.setattr("fcntl.flock", clear_up_first)
    LocalOutput(tmp_path).write("key", "text")
    assert [path.name for path in tmp_path.iterdir()] == ["key.grasp.yaml"]
    assert LocalOutput(tmp_path).path("key").read_text() == "text"


def test_a_file_that_is_gone_is_planned_again(copy: Path) -> None:
    before = files_of(copy / "out")
    (copy / "out" / "grasps" / f"{rows_of(copy / 'out')['prism_6.obj'].key}.grasp.yaml").unlink()
    assert again(copy) == ["prism_6.obj ok"]
    assert files_of(copy / "out") == before


def test_failures_are_tried_again_when_asked(copy: Path) -> None:
    assert again(copy, retry=["bad_model"]) == ["broken.obj bad_model", "lost_mesh.urdf bad_model"]
    rows = rows_of(copy / "out")
    assert rows["broken.obj"].attempts == 2
    assert rows["tetrahedron.urdf"].attempts == 1


def test_shards_and_executors_give_the_same_files_as_one_run(planned: Path) -> None:
    for count in (1, 2, 3):
        whole = [row.key for row in rows_of(planned / "out").values()]
        shards = []
        for index in range(1, count + 1):
            # Beside the first output, for paths of models in files are relative.
            asked = {"shard": (index, count), **QUICK}
            with ThreadPoolExecutor(2) as threads:
                report = plan_batch(
                    [planned / "parts", planned / "others"],
                    planned / f"out_{count}",
                    executor=threads if count == 3 else None,
                    **asked,
                )
            assert report.complete
            shards.append(report.num_planned)
        assert sum(shards) == len(whole)
        assert files_of(planned / f"out_{count}") == files_of(planned / "out")
        assert sorted(r.key for r in rows_of(planned / f"out_{count}").values()) == sorted(whole)


class LosingExecutor(ThreadPoolExecutor):
    """Loses each call once, and like Dask remembers what became of it by function and arguments."""

    def __init__(self) -> None:
        super().__init__(1)
        self.futures: dict[bytes, Future[object]] = {}

    def submit(self, fn: Callable[..., object], /, *arguments: object) -> Future[object]:  # type: ignore[override]
        call = pickle.dumps((fn, arguments))
        if call not in self.futures:
            first = len(self.futures) % 2 == 0
            self.futures[call] = super().submit(lose) if first else super().submit(fn, *arguments)
        return self.futures[call]


def lose() -> None:
    raise RuntimeError("the worker was killed")


def test_a_chunk_that_is_lost_with_its_worker_is_another_call(
    planned: Path, tmp_path: Path
) -> None:
    with LosingExecutor() as executor:
        report = plan_batch(planned / "parts", tmp_path, executor=executor, **QUICK)
    assert report.counts == {"ok": 3, "bad_model": 1}
    assert len(executor.futures) == 2


def test_a_limit_is_of_objects_that_are_planned(planned: Path, tmp_path: Path) -> None:
    asked = {"limit": 2, **QUICK}
    report = plan_batch(planned / "parts", tmp_path, **asked)
    assert (report.num_planned, report.complete) == (2, False)
    report = plan_batch(planned / "parts", tmp_path, **asked)
    assert report.num_planned == 1
    assert report.complete


def test_leaving_the_loop_ends_the_run_and_frees_the_output(planned: Path, tmp_path: Path) -> None:
    rows = iter_batch(planned / "parts", tmp_path, **QUICK)
    next(rows)
    with pytest.raises(BatchError, match=f"another driver writes there .*process {os.getpid()}"):
        plan_batch(planned / "parts", tmp_path)
    rows.close()
    assert plan_batch(planned / "parts", tmp_path, **QUICK).complete


def test_one_driver_in_all_or_one_for_each_shard(tmp_path: Path) -> None:
    with DriverLock(tmp_path, "1-of-2"), DriverLock(tmp_path, "2-of-2"):
        for shard in ("", "2-of-2"):
            with pytest.raises(BatchError, match=r"shard [12]-of-2"), DriverLock(tmp_path, shard):
                pass
    with DriverLock(tmp_path), pytest.raises(BatchError), DriverLock(tmp_path, "1-of-2"):
        pass
    with DriverLock(tmp_path):
        assert json.loads((tmp_path / "driver.lock").read_text())["pid"] == os.getpid()


def test_a_look_at_who_drives_refuses_no_driver(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = []

    def looked_at_first(file: IO[str], operation: int) -> None:
        if not looks:
            looks.append(file)  # As if `running_drivers` had the lock.
            raise BlockingIOError
        flock(file, operation)

    flock = fcntl.flock
    monkeypatch.setattr("drake_polygrasp.batch.driver_lock.fcntl.flock", looked_at_first)
    with DriverLock(tmp_path):
        assert looks


def test_rows_of_a_driver_that_just_starts_hinder_no_other(copy: Path) -> None:
    for name in ("results-1-of-2.sqlite", "results-2-of-2.sqlite"):
        sqlite3.connect(copy / "out" / name).close()
        (copy / "out" / name).touch()
    assert again(copy) == []
    assert read_status(copy / "out").num_objects == 8


def test_a_place_that_cannot_be_written_is_one_line(planned: Path, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(BatchError, match=r"file: results cannot be written: .*; mend that"):
        plan_batch(planned / "parts", file)
    (tmp_path / "results.sqlite").write_text("no rows at all, but a letter to a friend")
    with pytest.raises(BatchError, match="results cannot be written: file is not a database"):
        plan_batch(planned / "parts", tmp_path)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"workers": 0}, "workers is 0; it must be at least 1"),
        ({"timeout": 0}, "timeout is 0; it must be a time above 0 s"),
        ({"memory": 1000}, "memory is 1000; it must be a number of bytes, 256 MiB or more"),
        ({"shard": (3, 2)}, r"shard is \(3, 2\); it must be \(i, n\) with i at most n"),
        ({"retry": ["ok"]}, r"retry is \['ok'\]; it must be a list of some of no_grasp"),
        ({"executor": 3}, "executor is 3; it must be a concurrent.futures.Executor"),
        ({"obstacles": None}, "a batch has no option 'obstacles'; it has avoid_directions"),
        ({"topp": 3}, "a batch has no option 'topp'"),
        ({"top": 0}, "top is 0; it must be at least 1"),
        ({"mu": -1}, "mu is -1; it must be above 0 and at most 100"),
        ({"scale": 0}, "scale is 0; it must be a factor from"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_planned(
    tmp_path: Path, asked: dict[str, object], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        iter_batch((), tmp_path / "out", **asked)
    assert not (tmp_path / "out").exists()
