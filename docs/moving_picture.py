"""Makes docs/pick_up.png, the README's moving picture: `python -m docs.moving_picture`.

It is the simulation of `examples.pick_up`, with the planned grasp drawn on the object, rendered by
Meshcat in headless Chromium. It takes a minute. Pillow comes with Drake's matplotlib.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from pydrake.geometry import Meshcat

from docs.browser import photograph
from drake_polygrasp.visualization import draw_grasp, draw_object, look_at
from examples.choose_grasp import Target, choose_grasp
from examples.motion import Task, Z, plan_motion
from examples.pick_up import MODEL, pick_up
from examples.table_top import settle

PICTURE = Path(__file__).with_name("pick_up.png")
TASK = Task(lift=0.05, shake=5.0, rounds=1, hold=0.35)
SIZE = (720, 440)
"""Width and height [pixels]."""
STEP = 0.05
"""Time from frame to frame [s]."""
PAUSE = 1.2
"""How long the last frame stays before the picture starts again [s]."""
COLOURS, VIVID = 255, 70
"""Size of the palette, and by how much red, green and blue of a vivid colour differ, of 255."""
EYE = np.array([-0.5, -0.8, 0.38])
"""Direction from the object to the eye, in W."""
LIGHTS = {
    "SpotLight": 1.8,
    "AmbientLight": 1.0,
    "FillLight": 0.4,
    "PointLightPositiveX": 0.6,
    "PointLightNegativeX": 0.0,
}
"""Intensities of Meshcat's lights: most from the one that casts shadows."""


def make_scene(target: Target, meshcat: Meshcat) -> str:
    """Simulates the task and draws the grasp on the object; returns the grasp's path."""
    pick_up(MODEL, target, task=TASK, meshcat=meshcat)
    body = f"visualizer/object/{MODEL.stem}/{MODEL.stem}"
    draw_object(meshcat, target.object_, path=body)  # in place of what the model shows there
    meshcat.Delete(f"{body}/object/numbers")
    meshcat.SetProperty(f"{body}/object/faces", "modulated_opacity", 0.55)
    grasp = f"{body}/grasp"
    draw_grasp(meshcat, target.object_, target.found, path=grasp)
    for i in (1, 2, 3):
        for drawn in ("fingertip", "placement", "region"):
            meshcat.Delete(f"{grasp}/contact_{i}/{drawn}")
    meshcat.Delete(f"{grasp}/plane")
    return grasp


def look(target: Target, meshcat: Meshcat) -> None:
    """Sets a camera that has the object near through the whole task, and a light with shadows."""
    object_ = target.object_
    look_at(meshcat, object_)
    centre = target.X_WB.multiply(object_.p_BBcm) + (TASK.lift / 2 + 0.02) * Z
    meshcat.SetCameraPose(centre + 2.2 * object_.polyhedron.diameter * EYE, centre)
    meshcat.SetProperty("/Lights/SpotLight", "visible", True)
    meshcat.SetProperty("/Lights/SpotLight/<object>", "castShadow", True)
    meshcat.SetProperty("/Lights/SpotLight/<object>", "position", [0.2, -0.3, 1.2])
    meshcat.SetProperty("visualizer/table", "color", [0.9, 0.88, 0.85, 1.0])
    for light, intensity in LIGHTS.items():
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", intensity)


def save(frames: list[Image.Image], file: Path) -> None:
    """Writes frames as a looping picture that stays at its last frame for a while."""
    pixels = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in frames[::6]])
    strong = pixels[np.ptp(pixels.astype(int), axis=1) > VIVID]
    # Half of the palette is for the contacts, few as their pixels are.
    sample = np.concatenate([pixels, np.resize(strong, pixels.shape)])[None]
    palette = Image.fromarray(sample).quantize(COLOURS, dither=Image.Dither.NONE)
    flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    lasting = [round(1000 * STEP)] * (len(flat) - 1) + [round(1000 * PAUSE)]
    flat[0].save(file, save_all=True, append_images=flat[1:], duration=lasting, loop=0)


def main() -> None:
    """Makes the picture."""
    plant, body, context = settle(MODEL)
    target = choose_grasp(plant, body, context, TASK)
    motion = plan_motion(TASK)
    meshcat = Meshcat()
    path = make_scene(target, meshcat)
    look(target, meshcat)
    parts = ", ".join(f'"{part}"' for part in ("drake", *path.split("/")))
    closed = motion.time[motion.phase.index("squeeze")]
    prepare = (
        "viewer.animator.pause(); viewer.animator.actions.forEach((action) => action.play());"
        f"viewer.animator.seek(frame); viewer.set_property([{parts}], 'visible', frame > {closed});"
    )
    times = np.arange(0.0, motion.time[-1], STEP)
    with tempfile.TemporaryDirectory() as folder:
        frames = photograph(
            meshcat.StaticHtml(), Path(folder), SIZE, prepare, str(times.round(3).tolist())
        )
    save(frames, PICTURE)
    print(f"wrote {PICTURE}: {len(frames)} frames, {PICTURE.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
