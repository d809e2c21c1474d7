"""Looking at objects and grasps: Meshcat in 3-D, matplotlib for the paper's planes.

| file | what it draws |
|---|---|
| scene.py | an object and its grasps in a Meshcat, one's own or a new one |
| page.py | all of a Meshcat as one web page that needs no server, with buttons |
| figures.py | what each section of the paper computes for one set of faces (needs matplotlib) |
| explanation.py | what became of a set of faces, and why (needs matplotlib) |
| directions.py | friction cones on the sphere of directions (needs matplotlib) |
| plane_axes.py | what figures are drawn with (needs matplotlib) |
| sketch.py | a still 3-D picture of a grasp (needs matplotlib) |
| palette.py | the colours of all of them |
| labels.py | numbers of faces as shapes |
| meshes.py | triangles and edges of faces |
"""

from drake_polygrasp.visualization.page import save_html
from drake_polygrasp.visualization.scene import (
    draw_grasp,
    draw_grasps,
    draw_object,
    look_at,
    show_rank,
)

__all__ = ["draw_grasp", "draw_grasps", "draw_object", "look_at", "save_html", "show_rank"]
