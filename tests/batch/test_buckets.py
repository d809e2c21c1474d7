"""Grasp files in a bucket: created once, adopted on resume, exported; rows stay on this machine."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from drake_polygrasp import BatchError, iter_batch, plan_batch
from drake_polygrasp.batch.outputs import open_output
from drake_polygrasp.batch.parquet import export_parquet
from tests.support.batches import QUICK, files_of, prism_file, rows_of

server = pytest.importorskip(
    "moto.server", reason="moto stands in for S3: pip install '.[buckets]'"
)
s3fs = pytest.importorskip("s3fs", reason="s3fs reaches S3: pip install '.[buckets]'")


@pytest.fixture
def bucket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """An empty bucket "grasps", and the current folder with three objects in `parts`."""
    moto = server.ThreadedMotoServer(port=0)
    moto.start()
    host, port = moto.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "key",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_DEFAULT_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    for sides in (4, 6, 8):
        prism_file(tmp_path / "parts", sides)
    s3fs.S3FileSystem.clear_instance_cache()
    files = s3fs.S3FileSystem()
    if files.exists("grasps"):  # moto keeps buckets as long as its process lives.
        files.rm("grasps", recursive=True)
    files.mkdir("grasps")
    yield files
    s3fs.S3FileSystem.clear_instance_cache()
    moto.stop()


def test_a_bucket_holds_the_files_that_a_folder_would(bucket: Any, tmp_path: Path) -> None:
    assert plan_batch("parts", "s3://grasps/run", **QUICK).counts == {"ok": 3}
    assert plan_batch("parts", "here", **QUICK).counts == {"ok": 3}
    in_bucket = {Path(name).name: bucket.cat_file(name) for name in bucket.ls("grasps/run/grasps")}
    assert in_bucket == files_of(tmp_path / "here")
    assert {*rows_of(tmp_path / "run")} == {*rows_of(tmp_path / "here")}
    assert plan_batch("parts", "s3://grasps/run", **QUICK).num_planned == 0


def test_files_in_a_bucket_without_rows_are_adopted(bucket: Any, tmp_path: Path) -> None:
    plan_batch("parts", "s3://grasps/run", **QUICK)
    assert len(bucket.ls("grasps/run/grasps")) == 3
    rows = rows_of(tmp_path / "run")
    with sqlite3.connect(tmp_path / "run" / "results.sqlite") as connection:
        connection.execute("DELETE FROM results")
    connection.close()
    adopted = list(iter_batch("parts", "s3://grasps/run", **QUICK))
    assert [row.plan_seconds for row in adopted] == [None] * 3
    assert {row.key: row.epsilon for row in adopted} == {
        row.key: pytest.approx(row.epsilon) for row in rows.values()
    }


def test_a_file_that_is_there_is_not_replaced(bucket: Any) -> None:
    output = open_output("s3://grasps/run")
    output.write("key", "first")
    output.write("key", "second")
    assert bucket.cat_file("grasps/run/grasps/key.grasp.yaml") == b"first"


def test_grasps_in_a_bucket_are_exported(bucket: Any, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="pyarrow writes Parquet: pip install '.[query]'")
    del bucket
    plan_batch("parts", "s3://grasps/run", **QUICK)
    assert export_parquet("s3://grasps/run", tmp_path / "grasps.parquet") == 6


def test_a_bucket_that_is_not_there_is_one_line(bucket: Any) -> None:
    del bucket
    with pytest.raises(BatchError, match=r"s3://nowhere/run/grasps: cannot be used: ") as caught:
        plan_batch("parts", "s3://nowhere/run", **QUICK)
    assert "\n" not in str(caught.value)
