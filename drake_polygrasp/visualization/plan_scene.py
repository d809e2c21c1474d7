"""Shows a plan in a Meshcat."""

from __future__ import annotations

from pydrake.geometry import Meshcat

from drake_polygrasp.pipeline.plan import GraspPlan
from drake_polygrasp.visualization.camera import look_at
from drake_polygrasp.visualization.scene import draw_grasps


def show_plan(plan: GraspPlan, meshcat: Meshcat | None = None) -> Meshcat:
    """Draws the object of a plan and its grasps, of which the best is visible, and sets the camera.

        meshcat = show_plan(plan_grasps(box))
        print(meshcat.web_url())  # to be opened in a browser
        show_rank(meshcat, 2, len(plan.grasps))
        save_html("box.html", meshcat, plan.grasps)

    Args:
        plan: result of `plan_grasps`; without grasps, only the object is drawn.
        meshcat: Meshcat to draw in, whose other contents stay (default: a new one).

    Returns:
        The Meshcat.
    """
    meshcat = Meshcat() if meshcat is None else meshcat
    draw_grasps(meshcat, plan.object_, plan.grasps, tip_radius=plan.settings.tip_radius)
    first = plan.grasps[0] if plan.grasps else None
    look_at(meshcat, plan.object_, first, others=plan.grasps[1:])
    return meshcat
