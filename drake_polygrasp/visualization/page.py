"""Writes a Meshcat as one web page that opens offline, with buttons for the ranked grasps.

Meshcat's own sliders need its server and are lost in a static page. The page gets a panel instead,
which also explains the colours.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib import resources
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat

from drake_polygrasp.errors import UsageError
from drake_polygrasp.grasp import RegionCertificate
from drake_polygrasp.visualization.palette import CONTACTS, INK, PLANE
from drake_polygrasp.visualization.precision import placement_words
from drake_polygrasp.visualization.scene import PATH
from drake_polygrasp.visualization.shown_grasp import ShownGrasp
from drake_polygrasp.wrenches.contacts import edge_forces

_VIEWPORT = '<meta name="viewport" content="width=device-width, initial-scale=1">'
"""Without it, a phone draws a page 980 pixels wide and shrinks it."""
_NOTE = (
    "Drag to turn, scroll to zoom. Spheres are fingertips, cones friction, arrows the forces that "
    "squeeze the object; in the dark discs each contact may be misplaced, in the outlines under "
    "all errors at once."
)


def save_html(
    file: Path | str,
    meshcat: Meshcat,
    grasps: Sequence[ShownGrasp] = (),
    *,
    title: str = "drake_polygrasp",
    path: str = PATH,
) -> None:
    """Writes all that a Meshcat shows, with its recording, as one page that needs no network.

        draw_grasps(meshcat, box, plan.grasps)
        look_at(meshcat, box)
        save_html("box.html", meshcat, plan.grasps)

    Args:
        file: page to write.
        meshcat: Meshcat in which `draw_grasps` has drawn.
        grasps: the grasps that it has drawn, for the panel; empty for no panel.
        title: title of the panel and of the browser's tab.
        path: path below which they were drawn.

    Raises:
        UsageError: when `file` cannot be written.
    """
    html = meshcat.StaticHtml().replace("<head>", f"<head>\n  {_VIEWPORT}", 1)
    if grasps:
        scene = {
            "title": title,
            "note": _NOTE,
            # Drake puts relative paths below /drake.
            "path": PurePosixPath("/drake", path, "grasps").parts[1:],
            "grasps": [
                [("grasp", f"{rank} of {len(grasps)}"), *_rows(grasp)]
                for rank, grasp in enumerate(grasps, start=1)
            ],
        }
        # "</script>" in a name must not end the script.
        text = json.dumps(scene).replace("</", "<\\/")
        panel = resources.files(__package__).joinpath("panel.html").read_text("utf-8")
        head, body_end, tail = html.rpartition("</body>")
        html = head + panel.replace("/*SCENE*/", text) + body_end + tail
    try:
        Path(file).write_text(html, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{file}: cannot be written: {error.strerror}") from error


def _rows(grasp: ShownGrasp) -> list[tuple[Any, ...]]:
    """Returns the panel's rows on a grasp: name, value, and a colour, "head" or "remark"."""
    contacts, certificate = grasp.grasp, grasp.certificate
    squeeze = certificate.squeeze_force
    f_Bc_B = edge_forces(contacts.p_BC[None], certificate.internal_force[None])[0]
    sizes = np.linalg.norm(f_Bc_B, axis=1)
    rows: list[tuple[Any, ...]] = [("kind", contacts.kind.replace("_", " "))]
    for i, colour in enumerate(CONTACTS):
        force = f"{sizes[i]:.2f}" if squeeze is None else f"{sizes[i] * squeeze:.1f} N"
        rows.append((f"contact {i + 1}", f"face {contacts.faces[i]}: {force}", colour))
    rows += [("grasp plane and triangle", "", PLANE), ("centre of mass", "", INK)]
    if grasp.region is not None:
        rows += _error_rows(grasp.region)
    rows.append(("with exact contacts", "", "head"))
    if contacts.quality is not None:
        rows.append(("quality Q", f"{contacts.quality.Q:.3f}"))
    for name, value, unit, scale in (
        ("margin", certificate.margin, "", 1.0),
        ("epsilon", certificate.epsilon_lower, "", 1.0),
        ("least friction", certificate.mu_min, "", 1.0),
        ("squeeze, all fingers", squeeze, " N", 1.0),
        ("placement alone off by", certificate.placement_tolerance, " mm", 1e3),
    ):
        if value is not None:
            rows.append((name, f"{value * scale:.3g}{unit}"))
    if words := placement_words(grasp):
        rows.append((words, "", "remark"))
    if grasp.plant is not None:
        rows.append(("in a plant", str(grasp.plant.verdict)))
    return rows


def _error_rows(region: RegionCertificate) -> list[tuple[Any, ...]]:
    """Returns the panel's rows on the errors that a grasp bears at once, and what is left then."""
    rows: list[tuple[Any, ...]] = [
        ("bears, all at once", "", "head"),
        ("contacts off by", f"{1e3 * region.least_placement_error:.3g} mm"),
        ("normals off by", f"{np.degrees(region.tilt_error):.3g} degrees"),
        ("friction less by", f"{100 * region.friction_error:.3g} percent"),
        ("centre of mass off by", f"{1e3 * region.com_error:.3g} mm"),
    ]
    if region.epsilon_lower is not None:
        rows.append(("epsilon then", f"{region.epsilon_lower:.3g}"))
    if region.squeeze_force is not None:
        rows.append(("squeeze then, all fingers", f"{region.squeeze_force:.3g} N"))
    return rows
