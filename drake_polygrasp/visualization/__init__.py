"""Draws objects and grasps: in 3-D with Meshcat, on the paper's planes with matplotlib.

| file | what it draws |
|---|---|
| scene.py | an object and its grasps in a Meshcat |
| plan_scene.py | a plan in a Meshcat |
| camera.py | from where they are seen |
| shown_grasp.py | the grasp plane around an object, and the scale of arrows |
| hand.py | a hand in postures in a Meshcat |
| hand_on_grasps.py | a hand that holds ranked grasps, and its way there, in a Meshcat |
| page.py | a Meshcat as one web page that needs no server, with a panel of grasps |
| precision.py | what a placement tolerance of less than a millimetre means, in words |
| figures.py | the planes on which the paper plans for one set of faces (needs matplotlib) |
| explanation.py | why a set of faces has a grasp or none (needs matplotlib) |
| directions.py | friction cones on the sphere of directions (needs matplotlib) |
| plane_axes.py | shapes, lines and marks of those figures (needs matplotlib) |
| sketch.py | a still 3-D picture of a grasp (needs matplotlib) |
| palette.py | the colours that scenes and figures share |
| marks.py | single meshes, shapes, cones, arrows and pieces of a surface in a Meshcat |
| labels.py | face numbers as flat shapes |
| meshes.py | triangles, edges and outlines to be drawn |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drake_polygrasp import lazy_names

if TYPE_CHECKING:
    from drake_polygrasp.visualization.camera import look_at
    from drake_polygrasp.visualization.explanation import draw_explanation
    from drake_polygrasp.visualization.figures import draw_reasons, draw_trace
    from drake_polygrasp.visualization.hand import draw_hand, draw_hand_postures
    from drake_polygrasp.visualization.hand_on_grasps import draw_hands, move_hand
    from drake_polygrasp.visualization.page import save_html
    from drake_polygrasp.visualization.palette import CONTACTS, rgb
    from drake_polygrasp.visualization.plan_scene import show_plan
    from drake_polygrasp.visualization.scene import (
        draw_grasp,
        draw_grasps,
        draw_object,
        show_rank,
    )
    from drake_polygrasp.visualization.sketch import draw_sketch

__all__ = [
    "CONTACTS",
    "draw_explanation",
    "draw_grasp",
    "draw_grasps",
    "draw_hand",
    "draw_hand_postures",
    "draw_hands",
    "draw_object",
    "draw_reasons",
    "draw_sketch",
    "draw_trace",
    "look_at",
    "move_hand",
    "rgb",
    "save_html",
    "show_plan",
    "show_rank",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "camera": ("look_at",),
        "explanation": ("draw_explanation",),
        "figures": ("draw_reasons", "draw_trace"),
        "hand": ("draw_hand", "draw_hand_postures"),
        "hand_on_grasps": ("draw_hands", "move_hand"),
        "page": ("save_html",),
        "palette": ("CONTACTS", "rgb"),
        "plan_scene": ("show_plan",),
        "scene": ("draw_grasp", "draw_grasps", "draw_object", "show_rank"),
        "sketch": ("draw_sketch",),
    },
)
