"""Loads what `polygrasp show` displays, from a grasp file or a model, and serves it in Meshcat."""

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
from drake_polygrasp.visualization.scene import ShownGrasp, draw_grasps, look_at, show_rank

_SLIDER = "grasp"
_POLL_SECONDS = 0.05
"""Time between two readings of the slider [s]. Our choice."""


@dataclass(frozen=True, eq=False)
class ShownScene:
    """An object and its ranked grasps, to be drawn.

    Attributes:
        object_: the object grasped.
        grasps: its grasps, best first.
        tip_radius: radius of the fingertips drawn [m]; None where the grasp file states none.
    """

    object_: GraspObject
    grasps: tuple[ShownGrasp, ...]
    tip_radius: float | None


def is_model(name: str) -> bool:
    """Returns whether a name is a model's, by its suffix or scheme, rather than a grasp file's.

    Args:
        name: a path or URI.
    """
    return is_uri(name) or name.lower().endswith(SUFFIXES)


def load_model_scene(
    model_file: str,
    *,
    body_name: str | None = None,
    mu: float | None = None,
    package_paths: Sequence[Path | str] = (),
    packages: Mapping[str, str | Path] | None = None,
    joints_free: bool = False,
    scale: float | None = None,
) -> ShownScene:
    """Loads an object and plans grasps of it with default options.

    Args:
        model_file: path or URI of the model.
        body_name: the link to grasp, where the model has several rigid bodies.
        mu: friction coefficient of all contacts; by default the model's.
        package_paths: folders to search for packages.
        packages: folders of packages by name.
        joints_free: whether links on the body's joints are ignored.
        scale: factor of an OBJ model's lengths.

    Returns:
        The scene; without grasps where planning finds none.

    Raises:
        ModelError: when the model cannot be loaded.
        UsageError: when an argument does not fit the model.
    """
    # Imported here because showing a grasp file needs no planner.
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


def load_file_scene(
    path: Path | str,
    package_paths: Sequence[Path | str] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> ShownScene:
    """Reads a grasp file and loads its object, without verifying anything that the file states.

    Args:
        path: the grasp file.
        package_paths: folders to search for packages.
        packages: folders of packages by name.

    Returns:
        The scene; the object's warnings say so if the model has changed since.

    Raises:
        GraspFileError: when the file cannot be read.
        ModelError: when its model is missing or cannot be loaded.
    """
    file = load_grasps(path)
    model_file = find_stated_model(file, find_packages(file.path, package_paths, packages))
    object_ = load_stated_object(file, model_file, package_paths, packages)
    if object_.source is not None and object_.source.sha256 != file.object_.sha256:
        changed = f"{model_file} has changed since {path} was written: contacts may be off it"
        object_ = replace(object_, warnings=(*object_.warnings, changed))
    return ShownScene(object_, file.grasps, file.plan.tip_radius)


def write_page(scene: ShownScene, file: Path, title: str) -> None:
    """Writes the scene as one HTML page that opens offline.

    Args:
        scene: the object and its grasps.
        file: the page to write.
        title: the page's title.

    Raises:
        UsageError: when the file cannot be written.
    """
    save_html(file, _draw(scene), scene.grasps, title=title)


def serve(scene: ShownScene) -> Iterator[str]:
    """Yields lines that say how to view the scene in a browser, then follows the slider forever.

    The caller stops it with KeyboardInterrupt.

    Args:
        scene: the object and its grasps.
    """
    meshcat, count = _draw(scene), len(scene.grasps)
    if count > 1:
        meshcat.AddSlider(_SLIDER, 1, count, 1, 1, "ArrowLeft", "ArrowRight")
        yield f"{count} grasps, best first: choose with the slider in the controls or arrow keys"
    yield "contacts 1, 2, 3 and their faces are blue, orange, green; the grasp plane is purple"
    yield f"open {meshcat.web_url()} in a browser; Ctrl-C ends"
    rank = 1
    while True:
        sleep(_POLL_SECONDS)
        if count > 1 and (wanted := round(meshcat.GetSliderValue(_SLIDER))) != rank:
            rank = wanted
            show_rank(meshcat, rank, count)


def _draw(scene: ShownScene) -> Meshcat:
    """Draws the scene in a new Meshcat, seen from where its best grasp is visible."""
    object_, grasps = scene.object_, scene.grasps
    meshcat = Meshcat()
    draw_grasps(meshcat, object_, grasps, tip_radius=scene.tip_radius)
    look_at(meshcat, object_, grasps[0] if grasps else None)
    return meshcat
