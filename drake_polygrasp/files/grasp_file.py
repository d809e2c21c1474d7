"""The grasp file: one YAML document per object, written by the planner and read by anyone.

Drake's typed YAML reads it too, but is not what writes it: it would leave `mass: null` out. Unknown
keys are allowed, so that the format may grow.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, get_args

import numpy as np
import yaml

from drake_polygrasp._version import __version__
from drake_polygrasp.arguments import check_instance, check_items, check_path, refuse
from drake_polygrasp.arrays import frozen
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.plain_yaml import Block, read_mapping
from drake_polygrasp.files.plan_block import read_plan
from drake_polygrasp.files.plant_block import plant_document, read_plant
from drake_polygrasp.files.stated_grasp import (
    GraspFile,
    StatedCertificate,
    StatedGrasp,
    StatedObject,
    StatedPlan,
)
from drake_polygrasp.grasp import (
    CertifiedGrasp,
    Grasp,
    GraspObject,
    GraspPlane,
    Kind,
    ModelSource,
    Quality,
)
from drake_polygrasp.settings import PlanSettings
from drake_polygrasp.wrenches.contacts import edge_forces

FORMAT = "drake_polygrasp/grasps"
VERSION = 1


def save_grasps(
    path: Path | str,
    object_: GraspObject,
    grasps: Iterable[CertifiedGrasp | StatedGrasp],
    plan_settings: PlanSettings | StatedPlan,
) -> None:
    """Writes a grasp file, whole or not at all: the same arguments give the same bytes.

    Args:
        path: the grasp file.
        object_: what is grasped, loaded from a file.
        grasps: best first. What a plant said of them is written too; grasps of a file that was
            read are written as they were stated.
        plan_settings: what repeats the plan: `GraspPlan.settings`, or `GraspFile.plan`.

    Raises:
        UsageError: when an argument is not what it may be.
        GraspFileError: when `object_` came from no file, a number is not finite, or `path` cannot
            be written.
    """
    path = Path(check_path("path", path))
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    if not isinstance(plan_settings, PlanSettings | StatedPlan):
        raise refuse("plan_settings", plan_settings, "a PlanSettings, such as plan.settings")
    kinds = (CertifiedGrasp, StatedGrasp)
    grasps = check_items("grasps", grasps)
    for i, grasp in enumerate(grasps):
        if not isinstance(grasp, kinds):
            raise refuse(f"grasps[{i}]", grasp, "a CertifiedGrasp, as plan.grasps holds them")
    if object_.source is None:
        raise GraspFileError(
            f"{path}: a grasp file names its model, and this object came from none; give "
            "object_from_plant the body's model_file"
        )
    document = {
        "format": FORMAT,
        "version": VERSION,
        "generator": {"drake_polygrasp": __version__, "drake": metadata.version("drake")},
        "object": _object_document(object_, object_.source, path.parent),
        "plan": _plain(plan_settings.stated),
        "grasps": [grasp_document(grasp) for grasp in grasps],
    }
    write_document(path, document)


def write_document(path: Path, document: Mapping[str, Any]) -> None:
    """Writes a grasp file's document, whole or not at all: equal ones give the same bytes.

    Raises:
        GraspFileError: when a number is not finite, or `path` cannot be written.
    """
    text = yaml.safe_dump(
        _plain(document), sort_keys=False, default_flow_style=None, allow_unicode=True, width=10**6
    )
    _write_whole(path, text)


def grasp_document(certified: CertifiedGrasp | StatedGrasp) -> dict[str, Any]:
    """One grasp as it stands in the file: plain lists, numbers and strings."""
    grasp, certificate = certified.grasp, certified.certificate
    if isinstance(certified, StatedGrasp):
        f_Bc_B = certified.f_Bc_B
    else:
        x = certificate.internal_force
        f_Bc_B = to_decimals(edge_forces(grasp.p_BC[None], x[None])[0])
    document: dict[str, Any] = {
        "kind": grasp.kind,
        "faces": grasp.faces,
        "contacts": [
            {"p_BC": p_BC, "nhat_TB_B": nhat_TB_B, "mu": mu, "f_Bc_B": f_B}
            for p_BC, nhat_TB_B, mu, f_B in zip(
                grasp.p_BC, grasp.nhat_TB_B, grasp.mu, f_Bc_B, strict=True
            )
        ],
        "grasp_plane": {"nhat_B": grasp.grasp_plane.nhat_B, "p_BP": grasp.grasp_plane.p_BP},
    }
    if grasp.quality is not None:
        quality = grasp.quality
        document["quality"] = {"scale": quality.scale, "Q": quality.Q, "q": quality.q}
    stated = {name: getattr(certificate, name) for name in _CERTIFICATE_KEYS}
    document["certificate"] = {name: value for name, value in stated.items() if value is not None}
    if certified.plant is not None:
        document["plant"] = plant_document(certified.plant)
    plain: dict[str, Any] = _plain(document)
    return plain


def load_grasps(path: Path | str) -> GraspFile:
    """Reads a grasp file and checks its form: keys, lengths, types, finite numbers, signs.

    Whether what it claims is true is not asked here: see `drake_polygrasp.verification.verify`.

    Raises:
        UsageError: when the path is none.
        GraspFileError: naming the file, the place in it and what is wrong there.
    """
    path = Path(check_path("path", path))
    root = read_mapping(path)
    if (format_ := root.text("format")) != FORMAT:
        raise GraspFileError(f"{path}: format is {format_!r}, not {FORMAT!r}: no grasp file")
    if (version := root.integer("version")) != VERSION:
        raise GraspFileError(
            f"{path}: version is {version}; this drake_polygrasp reads version {VERSION}"
        )
    object_ = _read_object(root.block("object"))
    has_plan = "plan" in root.data
    plan = read_plan(root.block("plan"), object_.num_faces) if has_plan else StatedPlan()
    return GraspFile(
        path=path,
        object_=object_,
        grasps=tuple(_read_grasp(block, plan.tip_radius) for block in root.blocks("grasps")),
        plan=plan,
        generator=root.block("generator").data,
    )


_CERTIFICATE_KEYS = tuple(StatedCertificate.__dataclass_fields__)


def _object_document(object_: GraspObject, source: ModelSource, folder: Path) -> dict[str, Any]:
    model_file = str(source.model_file)
    if not model_file.startswith("package://"):
        # Only folders are resolved: a model that is a link keeps its name.
        model = Path(model_file)
        absolute = model.parent.resolve() / model.name
        model_file = Path(os.path.relpath(absolute, folder.resolve())).as_posix()
    document: dict[str, Any] = _plain(
        {
            "model_file": model_file,
            "sha256": source.sha256,
            "model_name": source.model_name,
            "body_name": source.body_name,
            "mass": object_.mass,
            "p_BBcm": object_.p_BBcm,
            "rho": object_.rho,
            "num_faces": len(object_.polyhedron.faces),
        }
    )
    asked = {
        "scale": source.scale,
        "patch_angle": source.patch_angle,
        "patch_depth": source.patch_depth,
    }
    document |= {key: float(value) for key, value in asked.items() if value is not None}
    document |= {"links": list(source.links)} if source.links else {}
    return document | ({"joints_free": True} if source.joints_free else {})


def _plain(value: Any) -> Any:
    """`value` with NumPy's types and tuples replaced by Python's floats and lists.

    Raises:
        GraspFileError: for a number that is not finite, and what else the format does not know.
    """
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise GraspFileError(f"a grasp file holds finite numbers, not {value}")
    if value is not None and not isinstance(value, str | bool | int | float):
        raise GraspFileError(f"a grasp file holds numbers, text, lists and mappings, not {value!r}")
    return value


def _write_whole(path: Path, text: str) -> None:
    if path.exists() and not path.is_file():
        raise GraspFileError(f"{path}: cannot be written: it is not a regular file")
    scratch = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        scratch.write_text(text, encoding="utf-8")
        scratch.replace(path)
    except OSError as error:
        raise GraspFileError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        scratch.unlink(missing_ok=True)


def _read_object(block: Block) -> StatedObject:
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


def _read_grasp(block: Block, tip_radius: float | None) -> StatedGrasp:
    contacts = block.blocks("contacts")
    if len(contacts) != 3:
        raise block.refuse("contacts", "a list of three contacts")
    plane = block.block("grasp_plane")
    grasp = Grasp(
        p_BC=frozen([contact.vector("p_BC") for contact in contacts]),
        nhat_TB_B=frozen([contact.vector("nhat_TB_B") for contact in contacts]),
        mu=frozen([contact.number("mu", "positive") for contact in contacts]),
        kind=block.text("kind", get_args(Kind)),
        faces=_read_faces(block),
        grasp_plane=GraspPlane(nhat_B=plane.vector("nhat_B"), p_BP=plane.vector("p_BP")),
        quality=_read_quality(block.block("quality")) if "quality" in block.data else None,
    )
    f_Bc_B = frozen([contact.vector("f_Bc_B") for contact in contacts])
    return StatedGrasp(
        grasp,
        f_Bc_B,
        _read_certificate(block.block("certificate")),
        tip_radius,
        read_plant(block.block("plant")) if "plant" in block.data else None,
    )


def _read_faces(block: Block) -> tuple[int, int, int]:
    value = block.get("faces")
    whole = isinstance(value, list) and all(type(item) is int and item >= 0 for item in value)
    if not whole or len(value) != 3:
        raise block.refuse("faces", "a list of three indices of faces")
    return (value[0], value[1], value[2])


def _read_quality(block: Block) -> Quality:
    q1, q2, q3, q4, q5 = block.vector("q", 5).tolist()
    return Quality(
        scale=block.text("scale", ("paper", "object")),
        Q=block.number("Q", "zero or positive"),
        q=(q1, q2, q3, q4, q5),
    )


def _read_certificate(block: Block) -> StatedCertificate:
    stated: dict[str, Any] = {"internal_force": block.vector("internal_force")}
    for key in _CERTIFICATE_KEYS:
        if key == "mu_min_internal_force" and key in block.data:
            stated[key] = block.vector(key)
        elif key != "internal_force" and key in block.data:
            stated[key] = block.number(key, "zero or positive")
    return StatedCertificate(**stated)
