"""The table of all grasps says what the grasp files say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import BatchError, load_grasps, plan_batch
from drake_polygrasp.batch.parquet import export_parquet
from tests.support.batches import QUICK, prism_file, rows_of

parquet = pytest.importorskip(
    "pyarrow.parquet", reason="pyarrow writes Parquet: pip install '.[query]'"
)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("planned")
    for sides in (4, 6):
        prism_file(folder / "parts", sides)
    (folder / "parts" / "broken.obj").write_text("f 1 2 3\n")
    plan_batch(
        folder / "parts", folder / "out", **QUICK | {"top": 3, "placement_error": 1e-3, "mu": 0.5}
    )
    return folder / "out"


def test_there_is_a_row_for_each_grasp_with_all_that_its_file_states(
    out: Path, tmp_path: Path
) -> None:
    count = export_parquet(out, tmp_path / "grasps.parquet")
    table = parquet.read_table(tmp_path / "grasps.parquet").to_pylist()
    assert len(table) == count == 6
    keys = {row.key: row.source for row in rows_of(out).values() if row.status == "ok"}
    for values in table:
        assert values["source"] == keys[values["key"]]
        file = load_grasps(out / "grasps" / f"{values['key']}.grasp.yaml")
        stated = file.grasps[values["rank"] - 1]
        for name in ("p_BC", "nhat_TB_B", "mu"):
            np.testing.assert_array_equal(np.array(values[name]), getattr(stated.grasp, name))
        np.testing.assert_array_equal(np.array(values["f_Bc_B"]), stated.f_Bc_B)
        np.testing.assert_array_equal(values["internal_force"], stated.certificate.internal_force)
        assert values["epsilon_lower"] == stated.certificate.epsilon_lower
        assert values["faces"] == list(stated.grasp.faces)
        assert values["num_faces"] == file.object_.num_faces
        assert values["mass"] is file.object_.mass is None
        assert stated.region is not None
        assert values["region_placement_error"] == stated.region.placement_error.tolist()
        assert values["region_epsilon_lower"] == stated.region.epsilon_lower


def test_the_same_grasps_are_the_same_bytes(out: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        export_parquet(out, tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_a_file_that_cannot_be_written_is_one_line_and_leaves_nothing(
    out: Path, tmp_path: Path
) -> None:
    with pytest.raises(BatchError, match=r"nowhere/x: cannot be written: No such file"):
        export_parquet(out, tmp_path / "nowhere" / "x")
    assert not list(tmp_path.iterdir())
