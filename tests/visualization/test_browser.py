"""The page in a real browser, headless and offline: what it says it draws is seen."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import rgb_to_hsv
from matplotlib.image import imread
from pydrake.geometry import Meshcat

from drake_polygrasp.arrays import Array
from drake_polygrasp.visualization import draw_grasps, look_at, save_html
from drake_polygrasp.visualization.palette import CONTACTS, PLANE, rgb
from tests.support.planned import planned

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no network
    "--enable-logging=stderr",
    "--virtual-time-budget=4000",
)
PANEL = 310  # [px]

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium here: `apt-get install chromium` to run these"
)


def look(page: Path, fragment: str = "", size: str = "900,600") -> tuple[Array, list[str]]:
    """A screenshot, shape (H, W, 3), and what the page said on its console."""
    picture = page.with_suffix(".png")
    assert CHROMIUM is not None
    result = subprocess.run(
        [
            *(CHROMIUM, *FLAGS, f"--window-size={size}", f"--screenshot={picture}"),
            f"{page.as_uri()}{fragment}",
        ],
        cwd=page.parent,
        capture_output=True,
        text=True,
        timeout=1200,
        check=True,
    )
    console = [line for line in result.stderr.splitlines() if "CONSOLE" in line]
    return np.asarray(imread(picture)[..., :3], dtype=float), console


def share_of_hue(picture: Array, colour: str, saturation: float = 0.25) -> float:
    """The part of the scene's pixels with about this hue; light and what is behind change the rest.

    The panel's legend is left out.
    """
    return float(of_hue(picture[:, PANEL:], colour, saturation).mean())


def of_hue(picture: Array, colour: str, saturation: float) -> Array:
    """Which pixels have about this hue, shape (H, W)."""
    hue, strength, _ = np.moveaxis(rgb_to_hsv(picture), -1, 0)
    wanted = rgb_to_hsv(np.array(rgb(colour)))[0]
    apart = np.abs((hue - wanted + 0.5) % 1 - 0.5)
    return np.asarray((apart < 0.04) & (strength > saturation))


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    object_, grasps = planned("l_bracket")
    meshcat = Meshcat()
    draw_grasps(meshcat, object_, grasps)
    look_at(meshcat, object_, grasps[0])
    path = tmp_path_factory.mktemp("page") / "l_bracket.html"
    save_html(path, meshcat, grasps, title="l_bracket")
    yield path


def test_object_contacts_and_plane_are_seen_and_nothing_complains(page: Path) -> None:
    picture, console = look(page)
    assert console == []
    for colour in CONTACTS:
        assert share_of_hue(picture, colour) > 5e-4, colour
    assert share_of_hue(picture, PLANE, saturation=0.03) > 0.01
    blank = (picture[:, PANEL:] > 0.99).all(axis=-1).mean()
    assert 0.3 < blank < 0.9


@pytest.mark.parametrize(("size", "left", "bottom"), [("412,915", 0, 122), ("800,600", PANEL, 0)])
def test_on_small_screens_the_object_is_seen_and_no_plane_is_cropped(
    page: Path, size: str, left: int, bottom: int
) -> None:
    picture, console = look(page, size=size)
    assert console == []
    # The panel is folded below the scene where it has no room beside it.
    scene = picture[: len(picture) - bottom, left + 2 :]
    for colour in CONTACTS:
        assert of_hue(scene, colour, 0.25).mean() > 2e-4, colour
    plane = of_hue(scene, PLANE, 0.03)
    assert plane.mean() > 0.01
    assert not plane[[0, -1]].any() and not plane[:, [0, -1]].any()


def test_on_a_narrow_screen_the_object_is_seen_beside_the_open_panel_too(page: Path) -> None:
    opened = page.with_name("opened.html")
    unfold = "<script>document.querySelector('#polygrasp details').open = true</script>"
    opened.write_text(page.read_text().replace("</body>", f"{unfold}</body>"))
    picture, _ = look(opened, size="412,915")
    above = picture[: int(0.45 * len(picture))]
    for colour in CONTACTS:
        assert of_hue(above, colour, 0.25).mean() > 2e-4, colour


def test_without_its_grasps_none_of_their_colours_are_seen(tmp_path: Path) -> None:
    object_, _ = planned("l_bracket")
    meshcat = Meshcat()
    draw_grasps(meshcat, object_, ())
    look_at(meshcat, object_)
    save_html(tmp_path / "bare.html", meshcat)
    picture, _ = look(tmp_path / "bare.html")
    for colour in (*CONTACTS, PLANE):
        assert share_of_hue(picture, colour) < 1e-4, colour
    assert (picture[:, PANEL:] < 0.95).any(axis=-1).mean() > 0.05


def test_the_button_shows_the_next_grasp(page: Path) -> None:
    first, _ = look(page)
    second, _ = look(page, "#2")
    assert np.abs(first - second)[:, PANEL:].max() > 0.2
    clicked = page.with_name("clicked.html")
    click = "<script>document.querySelectorAll('#polygrasp button')[1].click()</script>"
    clicked.write_text(page.read_text().replace("</body>", f"{click}</body>"))
    third, _ = look(clicked)
    # The button that was clicked has the focus, and its border shows it.
    assert np.abs(second - third)[:, PANEL:].max() < 0.02
