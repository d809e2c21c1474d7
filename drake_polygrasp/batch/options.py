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
    check_flag,
    check_number,
    check_packages,
    check_paths,
    check_text,
)
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.patches import check_tolerances
from drake_polygrasp.loading.model_checks import MAX_FRICTION, MAX_SCALE
from drake_polygrasp.settings import PlanOptions


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


@dataclass(frozen=True)
class BatchOptions:
    """What is asked for each object of a batch.

    Attributes:
        load: how its model is read.
        plan: what is planned.
        plant: whether grasps are also checked in a plant, and those that fail come last.
    """

    load: LoadOptions = field(default_factory=LoadOptions)
    plan: PlanOptions = field(default_factory=PlanOptions)
    plant: bool = False

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
        }

    @cached_property
    def identity(self) -> str:
        """What decides the result beside the model's files, as text.

        Where packages are is left out: what they hold belongs to the model's files.
        """
        asked = self.request
        for place in ("package_paths", "packages"):
            del asked["load"][place]
        versions = {"drake_polygrasp": __version__, "drake": drake_version()}
        return json.dumps({**asked, "versions": versions}, sort_keys=True)


def make_batch_options(asked: Mapping[str, Any]) -> BatchOptions:
    """Sorts the keyword arguments of a batch into those of loading and of planning.

    Args:
        asked: options by the names that `load_object` and `plan_grasps` have for them, and `plant`.

    Returns:
        The options, valid for some object.

    Raises:
        UsageError: when there is no option of a name, or its value is wrong for every object.
    """
    of_load = {f.name for f in fields(LoadOptions)}
    of_plan = {f.name for f in fields(PlanOptions)} - {"obstacles"}
    for name in asked:
        if name not in of_load | of_plan | {"plant"}:
            raise UsageError(
                f"a batch has no option {name!r}; it has {', '.join(sorted(of_load | of_plan))}"
            )
    return BatchOptions(
        LoadOptions(**{name: value for name, value in asked.items() if name in of_load}),
        PlanOptions(**{name: value for name, value in asked.items() if name in of_plan}),
        check_flag("plant", asked.get("plant", False)),
    )
