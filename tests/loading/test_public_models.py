"""The comparison of public models with Drake's plant, on models that are made here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.public_models import Outcome, compare_body, compare_model, main, write_copy
from tests.loading.test_model_statements import FILES, MASSES, MU
from tests.support.object_files import write_all


def look_alikes(folder: Path) -> Path:
    """Models as people write them, each in a folder of its own."""
    for k, files in enumerate(FILES.values()):
        here = folder / f"model_{k}"
        texts = {
            name: text.replace(MU, "1").replace("(HERE)", f"package://p{k}")
            for name, text in files.items()
        }
        texts["package.xml"] = f"<package><name>p{k}</name></package>"
        write_all(here, texts)
    for k, (name, text, _, _) in enumerate(MASSES.values()):
        write_all(folder / f"mass_{k}", {name: text})
    write_all(folder, {"no_model.xml": "<html/>", "broken.urdf": "<robot", "bare.sdf": "<sdf/>"})
    return folder


def test_all_look_alikes_agree_with_drake(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(look_alikes(tmp_path))]) == 0
    said = capsys.readouterr().out
    assert "DISAGREES: 0" in said
    assert "refused: 0" in said
    assert "3 files are not Drake's" in said
    assert int(said.partition("agrees: ")[2].split()[0]) >= len(FILES) + len(MASSES)


@pytest.mark.parametrize(
    "false",
    [{"mass": 2.1}, {"mass": None}, {"p_BBcm": (1e-6, 0.0, 0.0)}, {"friction": (0.3,)}],
)
def test_what_differs_from_drake_is_found(false: dict[str, object], tmp_path: Path) -> None:
    files = {name: text.replace(MU, "1") for name, text in FILES["ode"].items()}
    write_all(tmp_path / "models", files)
    write_copy(tmp_path / "models", tmp_path / "copy")
    model_file = tmp_path / "models/m.sdf"
    (found,) = compare_model(model_file, tmp_path / "copy/m.sdf", 1)
    assert found.outcome is Outcome.AGREES
    from benchmarks.public_models import drake_bodies

    (body,) = drake_bodies(model_file, tmp_path / "copy/m.sdf")
    assert (body.mass, body.friction) == (2.0, (1.0,))
    other = replace(body, **false)  # type: ignore[arg-type]
    assert compare_body(model_file, other).outcome is Outcome.DISAGREES
