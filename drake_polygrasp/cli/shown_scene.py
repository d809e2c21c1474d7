"""Loads what `polygrasp show` displays, from a grasp file or a model, and serves it in Meshcat."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import sleep

from pydrake.geometry import Meshcat

from drake_polygrasp.errors import HandError
from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.files.stated_grasp import GraspFile, StatedGrasp
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.hand_grasp import HandPlacement
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.loading.model_source import SUFFIXES
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.loading.packages import find_packages, is_uri
from drake_polygrasp.verification.stated_model import find_stated_model, load_stated_object
from drake_polygrasp.visualization.camera import look_at
from drake_polygrasp.visualization.hand_on_grasps import draw_hands, move_hand, reach_of_hands
from drake_polygrasp.visualization.page import save_html
from drake_polygrasp.visualization.scene import draw_grasps, show_rank
from drake_polygrasp.visualization.shown_grasp import ShownGrasp

_SLIDER, _WAY = "grasp", "open to closed"
_POLL_SECONDS = 0.05
"""Time between two readings of the slider [s]. Our choice."""


@dataclass(frozen=True, eq=False)
class ShownScene:
    """An object and its ranked grasps, to be drawn.

    Attributes:
        object_: the object grasped.
        grasps: its grasps, best first.
        tip_radius: radius of the fingertips drawn [m]; None where the grasp file states none.
        hand: description of the hand that holds the grasps; None where there is none to draw.
        package_paths: folders to search for packages, for the hand.
        packages: folders of packages by name, for the hand.
    """

    object_: GraspObject
    grasps: tuple[ShownGrasp, ...]
    tip_radius: float | None
    hand: Path | None = None
    package_paths: Sequence[Path | str] = ()
    packages: Mapping[str, str | Path] | None = None


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
    hand, said = _stated_hand(file, package_paths, packages)
    object_ = replace(object_, warnings=(*object_.warnings, *said))
    return ShownScene(
        object_, file.grasps, file.plan.tip_radius, hand, tuple(package_paths), packages
    )


def _stated_hand(
    file: GraspFile,
    package_paths: Sequence[Path | str],
    packages: Mapping[str, str | Path] | None,
) -> tuple[Path | None, tuple[str, ...]]:
    """Returns the description of a file's hand, if it can be drawn, and warnings."""
    if file.hand is None or file.hand.description_file is None:
        return None, ()
    # Loaded here too, in the child process that bears what goes wrong.
    from drake_polygrasp.hands.model import load_hand

    description = file.hand.description_file
    try:
        hand = load_hand(description, package_paths=package_paths, packages=packages)
        for stated in file.grasps:
            if stated.hand is not None:
                hand.joint_array(stated.hand.q)
                hand.joint_array(stated.hand.pregrasp.q)
    except HandError as error:
        return None, (f"the hand is not shown: {error}",)
    if hand.sha256 != file.hand.sha256:
        return description, (f"{description} has changed since {file.path} was written",)
    return description, ()


def write_page(scene: ShownScene, file: Path, title: str) -> None:
    """Writes the scene as one HTML page that opens offline.

    Args:
        scene: the object and its grasps.
        file: the page to write.
        title: the page's title.

    Raises:
        UsageError: when the file cannot be written.
    """
    meshcat, _ = _draw(scene)
    save_html(file, meshcat, scene.grasps, title=title)


def serve(scene: ShownScene) -> Iterator[str]:
    """Yields lines that say how to view the scene in a browser, then follows the slider forever.

    The caller stops it with KeyboardInterrupt.

    Args:
        scene: the object and its grasps.
    """
    meshcat, hand = _draw(scene)
    count, share = len(scene.grasps), 1.0
    placements = [_placement(grasp) for grasp in scene.grasps]
    if count > 1:
        meshcat.AddSlider(_SLIDER, 1, count, 1, 1, "ArrowLeft", "ArrowRight")
        yield f"{count} grasps, best first: choose with the slider in the controls or arrow keys"
    yield "contacts 1, 2, 3 and their faces are blue, orange, green; the grasp plane is purple"
    if hand is not None:
        meshcat.AddSlider(_WAY, 0.0, 1.0, 0.01, 1.0)
        yield "the hand is drawn at the grasp and, faint, before it closes; a slider moves it"
    yield f"open {meshcat.web_url()} in a browser; Ctrl-C ends"
    rank = 1
    while True:
        sleep(_POLL_SECONDS)
        if count > 1 and (wanted := round(meshcat.GetSliderValue(_SLIDER))) != rank:
            rank = wanted
            show_rank(meshcat, rank, count)
            share = -1.0
        if hand is None or (moved := meshcat.GetSliderValue(_WAY)) == share:
            continue
        share, placement = moved, placements[rank - 1]
        if placement is not None:
            move_hand(meshcat, hand, placement, rank, share)


def _placement(grasp: ShownGrasp) -> HandPlacement | None:
    """Returns how a hand holds a grasp of a file, if one does."""
    return grasp.hand if isinstance(grasp, StatedGrasp) else None


def _draw(scene: ShownScene) -> tuple[Meshcat, Hand | None]:
    """Draws the scene in a new Meshcat, seen from where its best grasp is visible."""
    object_, grasps = scene.object_, scene.grasps
    meshcat = Meshcat()
    draw_grasps(meshcat, object_, grasps, tip_radius=scene.tip_radius)
    best, others = (grasps[0], grasps[1:]) if grasps else (None, ())
    look_at(meshcat, object_, best, others=others)
    if scene.hand is None:
        return meshcat, None
    from drake_polygrasp.hands.model import load_hand

    hand = load_hand(scene.hand, package_paths=scene.package_paths, packages=scene.packages)
    placements = [_placement(grasp) for grasp in grasps]
    draw_hands(meshcat, hand, placements)
    look_at(meshcat, object_, best, others=others, radius=reach_of_hands(placements))
    return meshcat, hand
