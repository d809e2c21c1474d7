"""Writes and reads the grasp file: one YAML document per object (docs/grasp-file.md).

Drake's typed YAML can read it too, but does not write it, because it would leave out `mass: null`.
Unknown keys are allowed on reading, so that the format can be extended.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import yaml

from drake_polygrasp._version import __version__, drake_version
from drake_polygrasp.arguments import check_instance, check_items, check_path, refuse
from drake_polygrasp.arrays import frozen
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.hand_block import (
    hand_document,
    placement_document,
    read_hand,
    read_placement,
)
from drake_polygrasp.files.object_block import object_document, read_object
from drake_polygrasp.files.plain_yaml import Block, read_mapping
from drake_polygrasp.files.plan_block import read_plan
from drake_polygrasp.files.plant_block import plant_document, read_plant
from drake_polygrasp.files.region_block import read_region, region_document
from drake_polygrasp.files.stated_grasp import (
    GraspFile,
    StatedCertificate,
    StatedGrasp,
    StatedPlan,
)
from drake_polygrasp.files.whole_file import followed, write_whole
from drake_polygrasp.grasp import (
    CertifiedGrasp,
    Grasp,
    GraspObject,
    GraspPlane,
    Kind,
    Quality,
)
from drake_polygrasp.hand_grasp import HandGrasp, HandPlacement, HandSource
from drake_polygrasp.settings import PlanSettings
from drake_polygrasp.wrenches.contacts import edge_forces

FORMAT = "drake_polygrasp/grasps"
"""Value of a grasp file's key `format`."""
_VERSION = 1
"""Value of its key `version`."""


def save_grasps(
    path: Path | str,
    object_: GraspObject,
    grasps: Iterable[CertifiedGrasp | StatedGrasp | HandGrasp],
    plan_settings: PlanSettings | StatedPlan,
) -> None:
    """Writes a grasp file, whole or not at all; the same arguments give the same bytes.

        save_grasps("box.grasp.yaml", box, plan.grasps, plan.settings)

    Args:
        path: the grasp file.
        object_: the object that is grasped, loaded from a model file.
        grasps: its grasps, best first, with verdicts of checks in a plant if they have any; those
            read from a grasp file are written as they were stated. Of grasps that a hand holds, how
            it does is written too; the hand must be the same for all.
        plan_settings: the settings of the plan: `GraspPlan.settings`, or `GraspFile.plan`.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `object_` came from no file, a number is not finite, the grasps are of
            several hands, or `path` cannot be written.
    """
    path = Path(check_path("path", path))
    folder = followed(path).parent
    write_whole(path, grasp_file_text(folder, object_, grasps, plan_settings, path))


def grasp_file_text(
    folder: Path,
    object_: GraspObject,
    grasps: Iterable[CertifiedGrasp | StatedGrasp | HandGrasp],
    plan_settings: PlanSettings | StatedPlan,
    path: Path | None = None,
) -> str:
    """Returns the text of a grasp file; the same arguments give the same text.

    Args:
        folder: the folder that it will be in, to which the model's path is made relative.
        object_: the object that is grasped, loaded from a model file.
        grasps: its grasps, best first.
        plan_settings: the settings of the plan.
        path: what messages call the file (default: the folder).

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `object_` came from no file, a number is not finite, or the grasps are
            of several hands.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    if not isinstance(plan_settings, PlanSettings | StatedPlan):
        raise refuse("plan_settings", plan_settings, "a PlanSettings, such as plan.settings")
    kinds = (CertifiedGrasp, StatedGrasp, HandGrasp)
    grasps = check_items("grasps", grasps)
    for i, grasp in enumerate(grasps):
        if not isinstance(grasp, kinds):
            raise refuse(f"grasps[{i}]", grasp, "a CertifiedGrasp, as plan.grasps holds them")
    if object_.source is None:
        raise GraspFileError(
            f"{path or folder}: a grasp file names its model, and this object came from no file; "
            "give object_from_plant the body's model_file"
        )
    placements = [held for grasp in grasps if (held := _placement(grasp)) is not None]
    document = {
        "format": FORMAT,
        "version": _VERSION,
        "generator": {"drake_polygrasp": __version__, "drake": drake_version()},
        "object": _plain(object_document(object_, object_.source, folder)),
        "plan": _plain(plan_settings.stated),
        **({"hand": _plain(hand_document(placements, folder))} if placements else {}),
        "grasps": [grasp_document(grasp) for grasp in grasps],
    }
    return _document_text(document)


def write_document(path: Path, document: Mapping[str, Any]) -> None:
    """Writes a grasp file's document, whole or not at all; equal documents give the same bytes.

    Args:
        path: the grasp file.
        document: its keys and values, in order; GraspFileError for a number that is not finite, or
            when `path` cannot be written.
    """
    write_whole(path, _document_text(_plain(document)))


def _document_text(plain: dict[str, Any]) -> str:
    """Returns the text of a document of plain dictionaries, lists, numbers and text."""
    text: str = yaml.dump(
        plain,
        Dumper=_dumper(plain),
        sort_keys=False,
        default_flow_style=None,
        allow_unicode=True,
        width=10**6,
    )
    return text


def _dumper(document: Mapping[str, Any]) -> Any:
    """Returns libyaml's dumper, which is five times as fast, where it writes the same bytes."""
    same_bytes = yaml.__with_libyaml__ and json.dumps(document, ensure_ascii=False).isascii()
    return yaml.CSafeDumper if same_bytes else yaml.SafeDumper


def _placement(grasp: CertifiedGrasp | StatedGrasp | HandGrasp) -> HandPlacement | None:
    """Returns how a hand holds a grasp, if one does."""
    if isinstance(grasp, StatedGrasp):
        return grasp.hand
    return grasp if isinstance(grasp, HandGrasp) else None


def grasp_document(certified: CertifiedGrasp | StatedGrasp | HandGrasp) -> dict[str, Any]:
    """Returns a grasp as it stands in the file.

    Args:
        certified: a planned grasp, one read from a file, or one with the posture of a hand.

    Returns:
        Plain dictionaries, lists, numbers and text.
    """
    placement = _placement(certified)
    if isinstance(certified, HandGrasp):
        certified = certified.certified
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
    if certified.region is not None:
        document["region"] = region_document(certified.region, grasp.nhat_TB_B)
    if certified.plant is not None:
        document["plant"] = plant_document(certified.plant)
    if placement is not None:
        document["hand"] = placement_document(placement)
    plain: dict[str, Any] = _plain(document)
    return plain


def load_grasps(path: Path | str) -> GraspFile:
    """Reads a grasp file and checks its format: keys, lengths, types, finite numbers, signs.

    Whether what it states is true is checked by `verify_file`.

        best = load_grasps("box.grasp.yaml").grasps[0].grasp

    Args:
        path: the grasp file.

    Returns:
        What the file states.

    Raises:
        UsageError: when `path` is not a path.
        GraspFileError: when the file cannot be read or breaks the format, naming the place.
    """
    path = followed(Path(check_path("path", path)))
    root = read_mapping(path)
    if (format_ := root.text("format")) != FORMAT:
        raise GraspFileError(f"{path}: format is {format_!r}, not {FORMAT!r}; not a grasp file")
    if (version := root.integer("version")) != _VERSION:
        raise GraspFileError(
            f"{path}: version is {version}; this drake_polygrasp reads version {_VERSION}"
        )
    object_ = read_object(root.block("object"))
    has_plan = "plan" in root.data
    plan = read_plan(root.block("plan"), object_.num_faces) if has_plan else StatedPlan()
    hand = read_hand(root.block("hand"), path.parent) if "hand" in root.data else None
    return GraspFile(
        path=path,
        object_=object_,
        grasps=tuple(_read_grasp(block, plan.tip_radius, hand) for block in root.blocks("grasps")),
        plan=plan,
        generator=root.block("generator").data,
        hand=hand,
    )


_CERTIFICATE_KEYS = tuple(StatedCertificate.__dataclass_fields__)


def _plain(value: Any) -> Any:
    """Returns a value with NumPy's types and tuples replaced by Python's floats and lists.

    Raises GraspFileError for a number that is not finite, and for types that the format lacks.
    """
    if isinstance(value, float):  # first, for most values are
        if not math.isfinite(value):
            raise GraspFileError(f"a grasp file holds finite numbers, not {value}")
        return float(value)
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if value is not None and not isinstance(value, str | bool | int | float):
        raise GraspFileError(f"a grasp file holds numbers, text, lists and mappings, not {value!r}")
    return value


def _read_grasp(block: Block, tip_radius: float | None, hand: HandSource | None) -> StatedGrasp:
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
        read_region(block.block("region"), grasp.nhat_TB_B) if "region" in block.data else None,
        _read_placement(block, hand),
    )


def _read_placement(block: Block, hand: HandSource | None) -> HandPlacement | None:
    if "hand" not in block.data:
        return None
    if hand is None:
        raise block.error(f"{block.where}hand says how a hand holds the grasp; the file names none")
    return read_placement(block.block("hand"), hand)


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
