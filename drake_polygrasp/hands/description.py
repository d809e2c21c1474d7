"""Reads and writes the YAML file that describes a hand beside its model.

The model file is never edited: what it lacks, where the fingertips and the palm are, is said here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import yaml

from drake_polygrasp.arguments import check_instance, check_path
from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import HandError
from drake_polygrasp.files.plain_yaml import Block, read_mapping

HAND_FORMAT = "drake_polygrasp/hand"
_VERSION = 1
_MAX_TIP_RADIUS = 1.0
"""Greatest radius of a fingertip [m]. Our choice: beyond it, it is not in metres."""
_ROUNDING = 1e-12
_MOST_TIPS = 20
"""Our choice: more tips have more triples than a plan can try."""


@dataclass(frozen=True, eq=False)
class TipDescription:
    """The sphere that stands for a fingertip, in a frame F of the hand's model.

    Attributes:
        name: what the tip is called: "thumb".
        frame: name of frame F.
        p_FT: the sphere's centre [m], shape (3,).
        radius: its radius [m].
        axis_F: unit vector in which the pad of the finger looks, shape (3,).
        geometries: names of the collision geometries that it stands for, all on the body of F.
    """

    name: str
    frame: str
    p_FT: Array
    radius: float
    axis_F: Array
    geometries: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class HandDescription:
    """A hand as its YAML file describes it.

    Attributes:
        name: name of the hand.
        model: its model: a path relative to the description's folder, or a package:// URI.
        palm_frame: name of the palm's frame P in the model.
        approach_P: unit vector from the palm to the object, shape (3,).
        tips: the fingertips, three or more.
        friction: friction coefficient of the tips; None for the model's.
        effort: greatest effort of each joint, by name [N m, or N of a prismatic joint], or one
            number for all; None for the model's.
        limit_margin: distance kept from joint limits in the library [rad].
        max_angle: greatest angle between a tip's axis and the inward normal that it touches [rad].
        kp: proportional gain of each joint [N m/rad].
        kd: derivative gain of each joint [N m s/rad].
        ignore_collisions: pairs of names of bodies that may overlap.
        fingers: the triples of names of tips that may grasp; empty for all.
        path: the file; None if it came from none.
    """

    name: str
    model: str
    palm_frame: str
    approach_P: Array
    tips: tuple[TipDescription, ...]
    friction: float | None = None
    effort: float | Mapping[str, float] | None = None
    limit_margin: float = 0.03
    max_angle: float = math.radians(80.0)
    kp: float = 4.0
    kd: float = 0.05
    ignore_collisions: tuple[tuple[str, str], ...] = ()
    fingers: tuple[tuple[str, str, str], ...] = ()
    path: Path | None = None

    @property
    def where(self) -> str:
        """What messages call the hand: its file, or its name."""
        return f"hand '{self.name}'" if self.path is None else str(self.path)


_KEYS = (
    *("format", "version", "name", "model", "palm", "tips", "friction", "effort", "limit_margin"),
    *("max_angle", "gains", "ignore_collisions", "fingers"),
)
_TIP_KEYS = ("name", "frame", "p", "radius", "axis", "geometries")


def read_description(path: str | Path) -> HandDescription:
    """Reads a hand's description, and checks all that can be checked without the model.

    Args:
        path: the file, NAME.hand.yaml.

    Returns:
        The description.

    Raises:
        UsageError: when `path` is not a path.
        HandError: when the file cannot be read or breaks the format, naming the place.
    """
    path = Path(check_path("path", path))
    root = read_mapping(path, "hand", HandError)
    if (format_ := root.text("format")) != HAND_FORMAT:
        raise HandError(f"{path}: format is {format_!r}, not {HAND_FORMAT!r}; not a hand file")
    if (version := root.integer("version")) != _VERSION:
        raise HandError(
            f"{path}: version is {version}; this drake_polygrasp reads version {_VERSION}"
        )
    root.check_keys(_KEYS)
    palm = root.block("palm")
    palm.check_keys(("frame", "approach"))
    tips = tuple(_read_tip(block) for block in root.blocks("tips"))
    if not 3 <= len(tips) <= _MOST_TIPS:
        raise HandError(
            f"{root.where}tips has {len(tips)} fingertips; three hold an object, so list 3 to "
            f"{_MOST_TIPS}"
        )
    _check_distinct(root, tips)
    stated: dict[str, Any] = {}
    for key in ("friction", "limit_margin"):
        if key in root.data:
            stated[key] = root.number(key, "positive" if key == "friction" else "zero or positive")
    if "max_angle" in root.data:
        stated["max_angle"] = math.radians(root.number("max_angle", "positive"))
        if stated["max_angle"] > math.pi:
            raise root.refuse("max_angle", "an angle of at most 180 degrees")
    if "effort" in root.data:
        stated["effort"] = _read_effort(root)
    if "gains" in root.data:
        gains = root.block("gains")
        gains.check_keys(("p", "d"))
        stated["kp"], stated["kd"] = gains.number("p", "positive"), gains.number("d", "positive")
    if "ignore_collisions" in root.data:
        stated["ignore_collisions"] = _read_names(root, "ignore_collisions", 2, "bodies")
    if "fingers" in root.data:
        stated["fingers"] = _read_fingers(root, [tip.name for tip in tips])
    return HandDescription(
        name=root.text("name"),
        model=root.text("model"),
        palm_frame=palm.text("frame"),
        approach_P=_unit(palm, "approach"),
        tips=tips,
        path=path,
        **stated,
    )


def description_text(description: HandDescription) -> str:
    """Returns the YAML text of a description, which `read_description` reads again.

    Args:
        description: the description; its `path` is not written.

    Raises:
        UsageError: when it is no description.
    """
    check_instance("description", description, HandDescription, "as read_description returns it")
    root: dict[str, Any] = {
        "format": HAND_FORMAT,
        "version": _VERSION,
        "name": description.name,
        "model": description.model,
        "palm": {"frame": description.palm_frame, "approach": description.approach_P.tolist()},
        "tips": [
            {
                "name": tip.name,
                "frame": tip.frame,
                "p": tip.p_FT.tolist(),
                "radius": tip.radius,
                "axis": tip.axis_F.tolist(),
                "geometries": list(tip.geometries),
            }
            for tip in description.tips
        ],
    }
    default = {field.name: field.default for field in fields(HandDescription)}
    if description.friction is not None:
        root["friction"] = description.friction
    if isinstance(description.effort, Mapping):
        root["effort"] = dict(description.effort)
    elif description.effort is not None:
        root["effort"] = description.effort
    if description.limit_margin != default["limit_margin"]:
        root["limit_margin"] = description.limit_margin
    if description.max_angle != default["max_angle"]:
        root["max_angle"] = round(math.degrees(description.max_angle), 9)
    if (description.kp, description.kd) != (default["kp"], default["kd"]):
        root["gains"] = {"p": description.kp, "d": description.kd}
    if description.ignore_collisions:
        root["ignore_collisions"] = [list(pair) for pair in description.ignore_collisions]
    if description.fingers:
        root["fingers"] = [list(triple) for triple in description.fingers]
    text: str = yaml.safe_dump(root, sort_keys=False, default_flow_style=None, allow_unicode=True)
    return text


def _read_tip(block: Block) -> TipDescription:
    block.check_keys(_TIP_KEYS)
    radius = block.number("radius", "positive")
    if radius > _MAX_TIP_RADIUS:
        raise block.refuse("radius", f"a length of at most {_MAX_TIP_RADIUS:g} m")
    names = block.items("geometries")
    if not names or not all(isinstance(name, str) and name for name in names):
        raise block.refuse("geometries", "a list of names of collision geometries")
    return TipDescription(
        name=block.text("name"),
        frame=block.text("frame"),
        p_FT=block.vector("p"),
        radius=radius,
        axis_F=_unit(block, "axis"),
        geometries=tuple(names),
    )


def _unit(block: Block, key: str) -> Array:
    """Returns a direction as a unit vector, shape (3,)."""
    vector = block.vector(key)
    length = math.hypot(*vector.tolist())
    if not 0 < length < math.inf:
        raise block.refuse(key, "a direction; give a vector that is not zero")
    # A unit vector is kept to its last digit, so that what is written reads the same.
    return vector if abs(length - 1) < _ROUNDING else frozen(vector / length)


def _check_distinct(root: Block, tips: tuple[TipDescription, ...]) -> None:
    names = [tip.name for tip in tips]
    for name in names:
        if names.count(name) > 1:
            raise HandError(f"{root.where}tips has two tips '{name}'; give each its own name")
    owners: dict[str, str] = {}
    for tip in tips:
        for geometry in tip.geometries:
            if geometry in owners and tip.frame == owners[geometry]:
                raise HandError(
                    f"{root.where}tips names geometry '{geometry}' of frame '{tip.frame}' twice; "
                    "each stands for one tip"
                )
            owners[geometry] = tip.frame


def _read_effort(root: Block) -> float | dict[str, float]:
    if not isinstance(root.get("effort"), dict):
        return root.number("effort", "positive")
    efforts = root.block("effort")
    if not efforts.data:
        raise root.refuse("effort", "a number, or a mapping of joints to numbers")
    return {joint: efforts.number(joint, "positive") for joint in efforts.data}


def _read_names(root: Block, key: str, count: int, kind: str) -> tuple[tuple[str, ...], ...]:
    """Returns a list of lists of `count` different names."""
    for item in root.items(key):
        is_names = isinstance(item, list) and all(isinstance(n, str) and n for n in item)
        if not is_names or len(item) != count or len(set(item)) != count:
            raise root.refuse(key, f"a list of lists of {count} different names of {kind}")
    return tuple(tuple(item) for item in root.items(key))


def _read_fingers(root: Block, tips: list[str]) -> tuple[tuple[str, ...], ...]:
    fingers = _read_names(root, "fingers", 3, "tips")
    for name in (name for triple in fingers for name in triple):
        if name not in tips:
            raise HandError(
                f"{root.where}fingers names '{name}', which is no tip; the tips are "
                f"{', '.join(tips)}"
            )
    return fingers
