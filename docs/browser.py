"""Takes pictures of Meshcat pages in headless Chromium, in one run for all frames of a page."""

from __future__ import annotations

import base64
import io
import re
import shutil
import subprocess
from pathlib import Path

from PIL import Image

_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--virtual-time-budget=100000", "--dump-dom"),
)
_PATIENCE = 600.0
"""Our choice: the longest run of the browser [s]."""
_CAMERA = """
<script>
  window.addEventListener("load", () => setTimeout(() => {
    const frames = document.createElement("div");
    FRAMES.forEach((frame) => {
      prepare(frame);
      const picture = document.createElement("i");
      picture.textContent = viewer.capture_image(WIDTH, HEIGHT);
      frames.append(picture);
    });
    document.body.replaceChildren(frames);
  }, 2000));
</script>
"""


def photograph(
    html: str, folder: Path, size: tuple[int, int], prepare: str = "", frames: str = "[0]"
) -> list[Image.Image]:
    """Returns pictures of a page that `save_html` wrote, one for each frame.

    Args:
        html: the page.
        folder: folder for a copy of it.
        size: width and height of the pictures in pixels.
        prepare: JavaScript that sets Meshcat's `viewer` for the value `frame`.
        frames: JavaScript array of the frames' values.

    Raises:
        FileNotFoundError: when there is no Chromium.
        RuntimeError: when the page shows nothing.
    """
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise FileNotFoundError("no Chromium here: apt-get install chromium")
    camera = _CAMERA.replace("FRAMES", frames)
    for name, pixels in zip(("WIDTH", "HEIGHT"), size, strict=True):
        camera = camera.replace(name, str(pixels))
    camera = f"<script>function prepare(frame) {{ {prepare} }}</script>{camera}"
    page = folder / "photographed.html"
    head, body_end, tail = html.rpartition("</body>")
    page.write_text(head + camera + body_end + tail, encoding="utf-8")
    command = [browser, *_FLAGS, f"--window-size={size[0]},{size[1]}", page.as_uri()]
    run = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE, check=True)
    found = re.findall(r"data:image/png;base64,([^<\"]+)</i>", run.stdout)
    if not found:
        raise RuntimeError(f"Chromium took no picture: {run.stderr[-500:]}")
    return [Image.open(io.BytesIO(base64.b64decode(each))).convert("RGB") for each in found]
