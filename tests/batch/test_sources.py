"""Which model files sources name, in which order."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from drake_polygrasp.batch.sources import Sources, find_models
from drake_polygrasp.errors import UsageError
from tests.support.object_files import write_all

FILES = {
    "b/part.urdf": "<robot/>",
    "b/meshes/part.obj": "",
    "a/scene.xml": "<mujoco model='s'/>",
    "a/package.xml": "<package/>",
    "a/two.SDF": "<sdf/>",
    "c.dmd.yaml": "directives: []",
    "c.yaml": "x: 1",
    ".hidden/x.sdf": "<sdf/>",
    "notes.md": "",
}


def found(sources: Sources) -> list[str]:
    return list(find_models(sources, lambda _: None))


def test_a_folder_stands_for_its_models_sorted_folder_by_folder(tmp_path: Path) -> None:
    write_all(tmp_path, FILES)
    warnings: list[str] = []
    models = [str(Path(m).relative_to(tmp_path)) for m in find_models(tmp_path, warnings.append)]
    assert models == ["c.dmd.yaml", "a/scene.xml", "a/two.SDF", "b/part.urdf"]
    assert len(warnings) == 1
    assert "1 .obj files are taken for meshes" in warnings[0]


def test_a_folder_of_meshes_alone_is_a_folder_of_objects(tmp_path: Path) -> None:
    write_all(tmp_path, {"z.obj": "", "a/y.obj": "", "a/x.OBJ": "", "package.xml": "<package/>"})
    models = [str(Path(m).relative_to(tmp_path)) for m in found(tmp_path)]
    assert models == ["z.obj", "a/x.OBJ", "a/y.obj"]


def test_patterns_match_as_in_a_shell_and_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_all(tmp_path, FILES)
    monkeypatch.chdir(tmp_path)
    assert found("**/*.obj") == ["b/meshes/part.obj"]
    assert found("[ab]/*.*") == ["a/package.xml", "a/scene.xml", "a/two.SDF", "b/part.urdf"]
    assert found("*/?art.urdf") == ["b/part.urdf"]
    assert found(f"{tmp_path}/b/**/*.obj") == [f"{tmp_path}/b/meshes/part.obj"]
    write_all(tmp_path, {"[ab]/x.sdf": ""})  # What is there is no pattern.
    assert found("[ab]/x.sdf") == ["[ab]/x.sdf"]


def test_a_text_file_names_models_relative_to_itself(tmp_path: Path) -> None:
    lines = "# parts\na.sdf\n\n  b/c.urdf  # the lid\n/abs/d.xml\npackage://p/e#1.sdf\n"
    write_all(tmp_path, {"list.txt": lines})
    assert found(tmp_path / "list.txt") == [
        f"{tmp_path}/a.sdf",
        f"{tmp_path}/b/c.urdf",
        "/abs/d.xml",
        "package://p/e#1.sdf",
    ]


def test_several_sources_follow_one_another_and_uris_are_taken_as_they_are(tmp_path: Path) -> None:
    write_all(tmp_path, {"a.sdf": "", "x/b.sdf": ""})
    sources = ["package://p/m.sdf", tmp_path / "x", str(tmp_path / "a.sdf")]
    assert found(sources) == ["package://p/m.sdf", f"{tmp_path}/x/b.sdf", f"{tmp_path}/a.sdf"]


def test_a_pipe_is_found_and_not_waited_for(tmp_path: Path) -> None:
    for name in ("pipe.xml", "pipe.sdf"):
        os.mkfifo(tmp_path / name)
    assert found(tmp_path) == [f"{tmp_path}/pipe.sdf", f"{tmp_path}/pipe.xml"]


def test_finding_is_lazy(tmp_path: Path) -> None:
    write_all(tmp_path, {"x/a.sdf": ""})
    models = find_models([tmp_path / "x", tmp_path], lambda _: None)
    assert next(models) == f"{tmp_path}/x/a.sdf"
    (tmp_path / "b.sdf").touch()  # It is found, since nobody has looked there yet.
    assert list(models) == [f"{tmp_path}/b.sdf", f"{tmp_path}/x/a.sdf"]


@pytest.mark.parametrize(
    ("sources", "said"),
    [
        ("nowhere.sdf", "nowhere.sdf: there is no such file or folder"),
        ("nowhere/*.sdf", "nowhere/*.sdf: no model file is found there"),
        ("", "a source is ''"),
        (b"x", "sources is b'x'"),
        ([3], r"sources[0] is 3"),
        (None, "sources is None; it must be a list"),
    ],
)
def test_sources_that_name_nothing_are_refused(sources: Sources, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        found(sources)
    assert said in str(caught.value)


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no model file is found there; Drake reads .sdf, .urdf"):
        found(tmp_path)
