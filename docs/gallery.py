"""Makes docs/gallery.md and its pictures: `python -m docs.gallery`, in some minutes.

Each model of `example_models`, and a scan that is generated here, with its best grasp, rendered by
Meshcat in headless Chromium. Pillow comes with Drake's matplotlib.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from docs.browser import photograph
from drake_polygrasp import GraspPlan, example_models, load_object, plan_grasps
from drake_polygrasp.visualization import show_plan
from tests.support.convex_polyhedra import write_obj
from tests.support.scanned import bottle, scan

PAGE = Path(__file__).with_suffix(".md")
FOLDER = PAGE.with_suffix("")
COLUMNS = 3
SIZE = (480, 400)
"""Width and height of a picture [pixels]."""
COLOURS = 96
SCAN = "scan of a bottle"
HEAD = """# Gallery

The best grasp of each of our [models](../models/README.md), and of a generated scan of 8,000
triangles with noise of 0.1 mm, planned with default options: fingertips, friction cones and forces
in the colours of contacts 1, 2 and 3, and the grasp plane. Under each picture: how many faces, the
faces that are touched, and how far all three contacts may miss at once, with all other errors.
`python -m docs.gallery` makes this page.

"""


@dataclass(frozen=True)
class Exhibit:
    """What is shown of a model.

    Attributes:
        name: its name.
        plan: its plan.
    """

    name: str
    plan: GraspPlan

    @property
    def picture(self) -> Path:
        """The file of its picture."""
        return FOLDER / f"{self.name.replace(' ', '_')}.png"

    @property
    def caption(self) -> str:
        """Its name and what is planned for it, in Markdown."""
        name = self.name if self.name == SCAN else f"[{self.name}](../models/{self.name}/README.md)"
        num_faces = len(self.plan.object_.polyhedron.faces)
        kind = "patches" if self.plan.object_.polyhedron.is_patch.any() else "faces"
        return f"**{name}**<br>{num_faces} {kind}, {self._grasp()}"

    def _grasp(self) -> str:
        if not self.plan.grasps:
            return "no grasp at its friction"
        best = self.plan.grasps[0]
        touched = " ".join(map(str, best.grasp.faces))
        if best.region is None:
            return f"grasp on {touched}"
        return f"grasp on {touched}, bears {1e3 * best.region.least_placement_error:.1f} mm"


def exhibits() -> Iterator[Exhibit]:
    """Yields each model with its plan, and the scan."""
    for name, file in example_models().items():
        yield Exhibit(name, plan_grasps(load_object(file)))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bottle.obj"
        write_obj(file, scan(bottle(0.03, 0.045, 0.004), 8000, 1e-4, seed=1))
        yield Exhibit(SCAN, plan_grasps(load_object(file, mu=0.5)))


def take_picture(exhibit: Exhibit) -> None:
    """Writes the picture of an exhibit."""
    with tempfile.TemporaryDirectory() as folder:
        (picture,) = photograph(show_plan(exhibit.plan).StaticHtml(), Path(folder), SIZE)
    flat = picture.quantize(COLOURS, dither=Image.Dither.NONE)
    flat.save(exhibit.picture, optimize=True)


def write_page(shown: list[Exhibit]) -> None:
    """Writes the page: a table of pictures with their captions below."""
    lines = ["| " * COLUMNS + "|", "|---" * COLUMNS + "|"]
    for k in range(0, len(shown), COLUMNS):
        row = shown[k : k + COLUMNS]
        pictures = [f"![{each.name}](gallery/{each.picture.name})" for each in row]
        cells = [f"{p}<br>{each.caption}" for p, each in zip(pictures, row, strict=True)]
        lines.append(f"| {' | '.join(cells + [''] * (COLUMNS - len(row)))} |")
    PAGE.write_text(HEAD + "\n".join(lines) + "\n", "utf-8")


def main() -> None:
    """Makes all pictures and the page."""
    FOLDER.mkdir(exist_ok=True)
    shown = []
    for exhibit in exhibits():
        take_picture(exhibit)
        shown.append(exhibit)
        print(f"{exhibit.name}: {exhibit.picture.stat().st_size / 1e3:.0f} kB", flush=True)
    write_page(shown)


if __name__ == "__main__":
    main()
