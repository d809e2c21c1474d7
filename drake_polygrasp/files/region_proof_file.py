"""Writes the proof file: what `exact_cycle` checks of the grasps of a plan."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from drake_polygrasp.files.whole_file import write_whole


def save_region_proofs(path: Path, proofs: Sequence[Mapping[str, Any]]) -> None:
    """Writes proofs of bounds over regions as JSON, one in a line.

    Args:
        path: the file.
        proofs: as `stated_proof` returns them.

    Raises:
        GraspFileError: when the file cannot be written.
    """
    lines = ",\n".join(json.dumps(proof, allow_nan=False) for proof in proofs)
    write_whole(path, f'{{"region_proofs": [\n{lines}\n]}}\n')
