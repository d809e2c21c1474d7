"""Contacts read back from JSON Lines and from comma-separated values are those of the file."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drake_polygrasp import load_grasps
from drake_polygrasp.exporters import export_contacts_csv, export_contacts_jsonl
from tests.support.held_files import write_held_box


@pytest.fixture
def box(tmp_path: Path) -> Path:
    return write_held_box(tmp_path)


def read_jsonl(box: Path) -> list[dict[str, Any]]:
    export_contacts_jsonl(load_grasps(box), box.parent / "out.jsonl")
    return [json.loads(line) for line in (box.parent / "out.jsonl").read_text().splitlines()]


def read_csv(box: Path) -> list[dict[str, Any]]:
    export_contacts_csv(load_grasps(box), box.parent / "out.csv")
    with (box.parent / "out.csv").open(newline="") as lines:
        rows = [*csv.DictReader(lines)]
    numbers = ("mu", "margin", "epsilon_lower", "squeeze_force")
    return [
        {
            **{name: row[name] for name in ("model_name", "body_name", "kind")},
            **{name: int(row[name]) for name in ("grasp", "contact", "face")},
            **{name: float(row[name]) if row[name] else None for name in numbers},
            **{
                name: [float(row[f"{name}_{axis}"]) for axis in "xyz"]
                for name in ("p_BC", "nhat_TB_B", "f_Bc_B")
            },
        }
        for row in rows
    ]


@pytest.mark.parametrize("read", [read_jsonl, read_csv])
def test_each_contact_is_a_row_with_the_numbers_of_the_file(box: Path, read: Any) -> None:
    file, rows = load_grasps(box), read(box)
    assert [(row["grasp"], row["contact"]) for row in rows] == [
        (rank, contact) for rank in (1, 2) for contact in (1, 2, 3)
    ]
    for row in rows:
        stated, i = file.grasps[row["grasp"] - 1], row["contact"] - 1
        assert (row["model_name"], row["body_name"], row["kind"]) == ("box", "box", "two_faces")
        assert row["face"] == stated.grasp.faces[i]
        for name in ("p_BC", "nhat_TB_B"):
            np.testing.assert_array_equal(row[name], getattr(stated.grasp, name)[i])
        np.testing.assert_array_equal(row["f_Bc_B"], stated.f_Bc_B[i])
        assert row["mu"] == stated.grasp.mu[i]
        for name in ("margin", "epsilon_lower", "squeeze_force"):
            assert row[name] == getattr(stated.certificate, name)
    assert [row["squeeze_force"] for row in rows] == [35.4] * 3 + [None] * 3


def test_names_may_hold_what_separates_values(box: Path) -> None:
    for export in (export_contacts_csv, export_contacts_jsonl):
        export(load_grasps(box), box.parent / "out", instance='a, "b"\n物')
        text = (box.parent / "out").read_text()
        if export is export_contacts_csv:
            names = {row["model_name"] for row in csv.DictReader(text.splitlines(keepends=True))}
        else:
            names = {json.loads(line)["model_name"] for line in text.splitlines()}
        assert names == {'a, "b"\n物'}
