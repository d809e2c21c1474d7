"""Writes and reads the object block of a grasp file: the model, and what was loaded from it."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path
from typing import Any

from drake_polygrasp.files.plain_yaml import Block
from drake_polygrasp.files.stated_grasp import StatedObject
from drake_polygrasp.grasp import GraspObject, ModelSource


def object_document(object_: GraspObject, source: ModelSource, folder: Path) -> dict[str, Any]:
    """Returns the object block as it stands in the file.

    Args:
        object_: the object.
        source: the model that it was loaded from.
        folder: the grasp file's folder, to which the model's path is made relative.
    """
    document: dict[str, Any] = {
        "model_file": relative_to(source.model_file, folder),
        "sha256": source.sha256,
        "model_name": source.model_name,
        "body_name": source.body_name,
        "mass": object_.mass,
        "p_BBcm": object_.p_BBcm,
        "rho": object_.rho,
        "num_faces": len(object_.polyhedron.faces),
    }
    asked = {
        "scale": source.scale,
        "patch_angle": source.patch_angle,
        "patch_depth": source.patch_depth,
    }
    document |= {key: float(value) for key, value in asked.items() if value is not None}
    document |= {"links": list(source.links)} if source.links else {}
    return document | ({"joints_free": True} if source.joints_free else {})


def relative_to(file: Path | str, folder: Path) -> str:
    """Returns a path as grasp files state it: relative to their folder, or a package:// URI.

    Args:
        file: a path or URI.
        folder: the grasp file's folder.
    """
    if str(file).startswith("package://"):
        return str(file)
    # Resolves links in folders only: a file that is a link keeps its name.
    absolute = Path(file).parent.resolve() / Path(file).name
    return Path(os.path.relpath(absolute, folder.resolve())).as_posix()


def read_object(block: Block) -> StatedObject:
    """Reads the object block.

    Args:
        block: the object block.

    Returns:
        What the file states of the object.

    Raises:
        GraspFileError: when it breaks the format.
    """
    sha256 = block.text("sha256")
    if not re.fullmatch("[0-9a-f]{64}", sha256):
        raise block.refuse("sha256", "64 hexadecimal digits")
    return StatedObject(
        model_file=block.text("model_file"),
        sha256=sha256,
        model_name=block.text("model_name"),
        body_name=block.text("body_name"),
        mass=None if block.get("mass") is None else block.number("mass", "positive"),
        p_BBcm=block.vector("p_BBcm"),
        rho=block.number("rho", "positive"),
        num_faces=block.integer("num_faces"),
        patch_angle=_read_patch_tolerance(block, "patch_angle", below=math.pi / 2),
        patch_depth=_read_patch_tolerance(block, "patch_depth", below=math.inf),
        links=_read_links(block),
        joints_free=_read_joints_free(block),
        scale=_read_scale(block),
    )


def _read_scale(block: Block) -> float | None:
    if "scale" not in block.data:
        return None
    scale = block.number("scale", "positive")
    if not block.text("model_file").lower().endswith(".obj"):
        raise block.refuse("scale", "left out: only .obj models have one")
    return scale


def _read_links(block: Block) -> tuple[str, ...] | None:
    if "links" not in block.data:
        return None
    links = block.items("links")
    if len(links) < 2 or not all(isinstance(name, str) and name for name in links):
        raise block.refuse("links", "a list of the names of two links or more")
    return tuple(links)


def _read_joints_free(block: Block) -> bool:
    value = block.data.get("joints_free", False)
    if not isinstance(value, bool):
        raise block.refuse("joints_free", "true or false")
    return value


def _read_patch_tolerance(block: Block, key: str, below: float) -> float | None:
    if key not in block.data:
        return None
    tolerance = block.number(key, "positive")
    if tolerance >= below:
        raise block.refuse(key, f"a number below {below:.3g}")
    return tolerance
