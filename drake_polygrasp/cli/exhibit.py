"""What `polygrasp show` shows: a grasp file, or a model that is planned first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import sleep

from pydrake.geometry import Meshcat

from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.model_source import SUFFIXES
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.loading.packages import find_packages, is_uri
from drake_polygrasp.verification.stated_model import find_stated_model, load_stated_object
from drake_polygrasp.visualization.page import save_html
from drake_polygrasp.visualization.scene import AnyGrasp, draw_grasps, look_at, show_rank

SLIDER = "grasp"
_POLL = 0.05
"""[s] between looks at the slider, ours."""


@dataclass(frozen=True, eq=False)
class ShownScene:
    """An object, its ranked grasps, and fingertips to draw on it.

    Attributes:
        object_: what is grasped.
        grasps: best first.
        tip_radius: [m]; None where no plan states it.
    """

    object_: GraspObject
    grasps: tuple[AnyGrasp, ...]
    tip_radius: float | None


def is_model(name: str) -> bool:
    """Whether a name is that of a model, as opposed to a grasp file."""
    return is_uri(name) or name.lower().endswith(SUFFIXES)


def exhibit_model(
    model_file: str,
    *,
    body_name: str | None = None,
    mu: float | None = None,
    package_paths: Sequence[Path | str] = (),
    packages: Mapping[str, str | Path] | None = None,
    joints_free: bool = False,
    scale: float | None = None,
) -> ShownScene:
    """Loads an object and plans grasps of it; arguments and errors as of `load_object`."""
    # Showing a grasp file needs no planner.
    from drake_polygrasp.pipeline.plan import plan_grasps

    object_ = load_object(
        model_file,
        body_name=body_name,
        mu=mu,
        package_paths=package_paths,
        packages=packages,
        joints_free=joints_free,
        scale=scale,
    )
    plan = plan_grasps(object_)
    return ShownScene(object_, plan.grasps, plan.settings.tip_radius)


def exhibit_file(
    path: Path | str,
    package_paths: Sequence[Path | str] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> ShownScene:
    """Reads a grasp file and loads its object; nothing that the file claims is checked.

    Raises:
        GraspFileError: when the file cannot be read.
        ModelError: when its model is missing or cannot be loaded.
    """
    file = load_grasps(path)
    model_file = find_stated_model(file, find_packages(file.path, package_paths, packages))
    object_ = load_stated_object(file, model_file, package_paths, packages)
    if object_.source is not None and object_.source.sha256 != file.object_.sha256:
        changed = f"{model_file} has changed since {path} was written: its grasps may be off"
        object_ = replace(object_, warnings=(*object_.warnings, changed))
    return ShownScene(object_, file.grasps, file.plan.tip_radius)


def write_page(exhibit: ShownScene, file: Path, title: str) -> None:
    """Writes one page that opens offline; UsageError when it cannot be written."""
    save_html(file, _drawn(exhibit), exhibit.grasps, title=title)


def serve(exhibit: ShownScene) -> Iterator[str]:
    """Serves a Meshcat and says where, then follows its slider until KeyboardInterrupt."""
    meshcat, count = _drawn(exhibit), len(exhibit.grasps)
    if count > 1:
        meshcat.AddSlider(SLIDER, 1, count, 1, 1, "ArrowLeft", "ArrowRight")
        yield f"{count} grasps, best first: the slider in the controls or the arrow keys step on"
    yield "contacts 1, 2, 3 and their faces are blue, orange, green; the grasp plane is purple"
    yield f"open {meshcat.web_url()} in a browser; Ctrl-C ends"
    rank = 1
    while True:
        sleep(_POLL)
        if count > 1 and (wanted := round(meshcat.GetSliderValue(SLIDER))) != rank:
            rank = wanted
            show_rank(meshcat, rank, count)


def _drawn(exhibit: ShownScene) -> Meshcat:
    object_, grasps = exhibit.object_, exhibit.grasps
    meshcat = Meshcat()
    draw_grasps(meshcat, object_, grasps, tip_radius=exhibit.tip_radius)
    look_at(meshcat, object_, grasps[0] if grasps else None)
    return meshcat
