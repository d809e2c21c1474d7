"""The options of a batch: those of loading and planning each object, as values that have a key."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from drake_polygrasp._version import __version__, drake_version
from drake_polygrasp.arguments import (
    check_array,
    check_flag,
    check_number,
    check_packages,
    check_path,
    check_paths,
    check_text,
)
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.patches import check_tolerances
from drake_polygrasp.loading.model_checks import MAX_FRICTION, MAX_SCALE
from drake_polygrasp.settings import PlanOptions

NOT_OF_HANDS = {"plant", "method", "effort", "rank", "tip_radius", "steps"}
"""Options that do not go with a hand."""


@dataclass(frozen=True, kw_only=True)
class LoadOptions:
    """What is asked of loading each model: arguments of `load_object`.

    Attributes:
        body_name: name of the body to grasp in each model; None for every body of a model.
        mu: friction coefficient of all faces; None for the model's.
        package_paths: folders searched for the packages of URIs.
        packages: folders of packages by name.
        patch_angle: greatest angle between a patch's normal and its facets' [rad]; None for the
            default.
        patch_depth: greatest distance of facets from the plane of their patch [m]; None for the
            default.
        joints_free: whether links on joints are ignored.
        scale: factor for the lengths of .obj models; None for 1.

    Raises:
        UsageError: when an option is not what it may be for any model.
    """

    body_name: str | None = None
    mu: float | None = None
    package_paths: Sequence[str | Path] = ()
    packages: Mapping[str, str | Path] | None = None
    patch_angle: float | None = None
    patch_depth: float | None = None
    joints_free: bool = False
    scale: float | None = None

    def __post_init__(self) -> None:
        if self.body_name is not None:
            check_text("body_name", self.body_name)
        if self.mu is not None:
            demand = f"above 0 and at most {MAX_FRICTION:g}"
            self._keep("mu", check_number("mu", self.mu, demand, above=0.0, most=MAX_FRICTION))
        if self.scale is not None:
            demand = f"a factor from {1 / MAX_SCALE:g} to {MAX_SCALE:g}"
            least, most = 1 / MAX_SCALE, MAX_SCALE
            self._keep("scale", check_number("scale", self.scale, demand, least=least, most=most))
        check_tolerances(self.patch_angle, self.patch_depth)
        self._keep("joints_free", check_flag("joints_free", self.joints_free))
        paths = check_paths("package_paths", self.package_paths)
        # Workers may have another current folder.
        self._keep("package_paths", tuple(str(Path(path).absolute()) for path in paths))
        packages = check_packages("packages", self.packages)
        self._keep("packages", {name: str(Path(p).absolute()) for name, p in packages.items()})

    def _keep(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)


@dataclass(frozen=True, kw_only=True)
class HandOptions:
    """What is asked of grasps that a hand makes: arguments of `plan_hand_grasps`.

    Attributes:
        description: path of the hand's description.
        up_B: direction against gravity, three numbers; None for every orientation.
        load_mass: mass that the torques must hold [kg]; None for the model's.
        budget: time after which no more postures are tried [s]; None for the default.
        seed: seed of random postures; None for the default.
        sha256: digest of the hand's files; empty until they are read.

    Raises:
        UsageError: when an option is not what it may be for any object.
    """

    description: str
    up_B: Sequence[float] | None = None
    load_mass: float | None = None
    budget: float | None = None
    seed: int | None = None
    sha256: str = ""

    def __post_init__(self) -> None:
        path = Path(check_path("hand", self.description)).absolute()
        object.__setattr__(self, "description", str(path))
        if self.up_B is not None:
            up_B = tuple(check_array("up_B", self.up_B, (3,)).tolist())
            object.__setattr__(self, "up_B", up_B)
        for name, demand in (("load_mass", "a mass above 0 kg"), ("budget", "a time above 0 s")):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, check_number(name, value, demand, above=0.0))
        if self.seed is not None:
            seed = check_number("seed", self.seed, "a whole number, 0 or more", least=0.0)
            object.__setattr__(self, "seed", int(seed))


@dataclass(frozen=True)
class BatchOptions:
    """What is asked for each object of a batch.

    Attributes:
        load: how its model is read.
        plan: what is planned.
        plant: whether grasps are also checked in a plant, and those that fail come last.
        hand: what is asked of a hand; None for grasps of three fingertips alone.
    """

    load: LoadOptions = field(default_factory=LoadOptions)
    plan: PlanOptions = field(default_factory=PlanOptions)
    plant: bool = False
    hand: HandOptions | None = None

    @property
    def request(self) -> dict[str, Any]:
        """The options as plain data: arguments of `load_object` and of `plan_grasps`."""
        return {
            "load": {f.name: getattr(self.load, f.name) for f in fields(self.load)},
            "plan": {
                f.name: asdict(value) if f.name == "steps" else value
                for f in fields(self.plan)
                if (value := getattr(self.plan, f.name)) != f.default
            },
            "plant": self.plant,
            "hand": None if self.hand is None else asdict(self.hand),
        }

    @cached_property
    def identity(self) -> str:
        """What decides the result beside the model's files, as text.

        Where packages and the hand are is left out: what they hold belongs to the files.
        """
        asked = self.request
        for place in ("package_paths", "packages"):
            del asked["load"][place]
        if self.hand is not None:
            del asked["hand"]["description"]
        versions = {"drake_polygrasp": __version__, "drake": drake_version()}
        return json.dumps({**asked, "versions": versions}, sort_keys=True)


def make_batch_options(asked: Mapping[str, Any]) -> BatchOptions:
    """Sorts the keyword arguments of a batch into those of loading and of planning.

    Args:
        asked: options by the names that `load_object`, `plan_grasps` and `plan_hand_grasps` have
            for them, `plant`, and `hand`, the path of a hand's description.

    Returns:
        The options, valid for some object.

    Raises:
        UsageError: when there is no option of a name, or its value is wrong for every object.
    """
    of_load = {f.name for f in fields(LoadOptions)}
    of_plan = {f.name for f in fields(PlanOptions)} - {"obstacles"}
    of_hand = {f.name for f in fields(HandOptions)} - {"description", "sha256"}
    known = of_load | of_plan | of_hand | {"hand", "plant"}
    for name in asked:
        if name not in known:
            raise UsageError(f"a batch has no option {name!r}; it has {', '.join(sorted(known))}")
    hand = asked.get("hand")
    given = {name for name, value in asked.items() if value is not None and value is not False}
    if hand is None and (lone := sorted(given & of_hand)):
        raise UsageError(f"{lone[0]} is for grasps of a hand; name one with hand")
    if hand is not None and (others := sorted(given & NOT_OF_HANDS)):
        raise UsageError(f"{others[0]} does not go with hand; leave one of them out")
    return BatchOptions(
        LoadOptions(**{name: value for name, value in asked.items() if name in of_load}),
        PlanOptions(**{name: value for name, value in asked.items() if name in of_plan}),
        check_flag("plant", asked.get("plant", False)),
        None
        if hand is None
        else HandOptions(
            description=hand, **{name: value for name, value in asked.items() if name in of_hand}
        ),
    )
