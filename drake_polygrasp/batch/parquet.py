"""Exports the grasps of a batch as Parquet, one row a grasp (extra [query])."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

from drake_polygrasp.arguments import check_path
from drake_polygrasp.batch.outputs import GraspOutput, open_output, state_folder
from drake_polygrasp.batch.reading import read_rows
from drake_polygrasp.batch.rows import BatchRow
from drake_polygrasp.errors import BatchError
from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.files.stated_grasp import GraspFile, StatedGrasp

_GROUP = 5000
"""Rows that are written at once. Our choice."""
_BOUNDS = (
    *("margin", "mu_min", "epsilon_lower", "epsilon_upper", "placement_tolerance"),
    *("tilt_tolerance", "friction_tolerance", "squeeze_force"),
)
_REGION_NUMBERS = (
    *("tilt_error", "friction_error", "com_error"),
    *("epsilon_lower", "epsilon_upper", "squeeze_force"),
)
_KINDS: dict[str, str] = {
    **dict.fromkeys(("key", "source", "body", "sha256", "model_name"), "text"),
    **dict.fromkeys(("mass", "rho"), "number"),
    "p_BBcm": "vector",
    **dict.fromkeys(("num_faces", "rank"), "count"),
    "kind": "text",
    "faces": "counts",
    "p_BC": "matrix",
    "nhat_TB_B": "matrix",
    "mu": "vector",
    "f_Bc_B": "matrix",
    "grasp_plane_nhat_B": "vector",
    "grasp_plane_p_BP": "vector",
    "Q": "number",
    "internal_force": "vector",
    "mu_min_internal_force": "vector",
    **dict.fromkeys(_BOUNDS, "number"),
    "region_placement_error": "vector",
    "region_internal_force": "vector",
    **dict.fromkeys((f"region_{name}" for name in _REGION_NUMBERS), "number"),
    "plant": "text",
}
"""The columns and what each holds; names are those of the grasp file, values in its units."""


def export_parquet(out: str | Path, file: str | Path) -> int:
    """Writes all grasps of a batch to a Parquet file, one row a grasp, whole or not at all.

    Args:
        out: the output, as for `plan_batch`.
        file: the Parquet file.

    Returns:
        The number of grasps.

    Raises:
        BatchError: when pyarrow is not installed, `out` has no results, or `file` cannot be
            written.
        GraspFileError: when a grasp file is missing or breaks the format.
    """
    path = Path(check_path("file", file))
    try:
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError:
        raise BatchError("Parquet needs pyarrow: pip install 'drake_polygrasp[query]'") from None
    number, count = arrow.float64(), arrow.int64()
    types = {
        "text": arrow.string(),
        "number": number,
        "count": count,
        "counts": arrow.list_(count),
        "vector": arrow.list_(number),
        "matrix": arrow.list_(arrow.list_(number)),
    }
    schema = arrow.schema([(name, types[kind]) for name, kind in _KINDS.items()])
    grasps, total = _grasps(out), 0
    scratch = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with scratch.open("wb") as sink, parquet.ParquetWriter(sink, schema) as writer:
            while group := list(islice(grasps, _GROUP)):
                writer.write_table(arrow.Table.from_pylist(group, schema))
                total += len(group)
        scratch.replace(path)
    except OSError as error:
        raise BatchError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            scratch.unlink(missing_ok=True)
    return total


def _grasps(out: str | Path) -> Iterator[dict[str, Any]]:
    """Yields the values of each grasp's row."""
    output = None
    for row in read_rows(state_folder(out)):
        if row.status == "ok":
            output = output or open_output(out)
            file = _load(output, row.key)
            for rank, stated in enumerate(file.grasps, start=1):
                yield _values(row, file, rank, stated)


def _load(output: GraspOutput, key: str) -> GraspFile:
    """Reads a grasp file of the output, from a copy where it is in a bucket."""
    place = output.adoption(key)
    if "file" in place:
        return load_grasps(place["file"])
    with tempfile.NamedTemporaryFile("w", suffix=f".{key}.yaml", encoding="utf-8") as copy:
        copy.write(place["text"])
        copy.flush()
        return load_grasps(copy.name)


def _values(row: BatchRow, file: GraspFile, rank: int, stated: StatedGrasp) -> dict[str, Any]:
    object_, grasp, certificate = file.object_, stated.grasp, stated.certificate
    region, least = stated.region, certificate.mu_min_internal_force
    values: dict[str, Any] = {
        "key": row.key,
        "source": row.source,
        "body": object_.body_name,
        "sha256": object_.sha256,
        "model_name": object_.model_name,
        "mass": object_.mass,
        "rho": object_.rho,
        "p_BBcm": object_.p_BBcm.tolist(),
        "num_faces": object_.num_faces,
        "rank": rank,
        "kind": grasp.kind,
        "faces": list(grasp.faces),
        "p_BC": grasp.p_BC.tolist(),
        "nhat_TB_B": grasp.nhat_TB_B.tolist(),
        "mu": grasp.mu.tolist(),
        "f_Bc_B": stated.f_Bc_B.tolist(),
        "grasp_plane_nhat_B": grasp.grasp_plane.nhat_B.tolist(),
        "grasp_plane_p_BP": grasp.grasp_plane.p_BP.tolist(),
        "Q": None if grasp.quality is None else grasp.quality.Q,
        "internal_force": certificate.internal_force.tolist(),
        "mu_min_internal_force": None if least is None else least.tolist(),
        "plant": None if stated.plant is None else str(stated.plant.verdict),
    }
    values |= {name: getattr(certificate, name) for name in _BOUNDS}
    if region is not None:
        values |= {f"region_{name}": getattr(region, name) for name in _REGION_NUMBERS}
        values["region_placement_error"] = region.placement_error.tolist()
        values["region_internal_force"] = region.internal_force.tolist()
    return values
