"""Picks an object up from a table, shakes it and holds it, in a plant with honest contact.

    python -m examples.pick_up models/l_bracket/l_bracket.sdf --html pick_up.html
    python -m examples.pick_up models/l_bracket/l_bracket.sdf --mu 0.1   # drops it

The object settles on the table. A grasp is planned for it where it lies, the table being an
obstacle. Three fingertips approach along the normals of their contacts, squeeze, lift, shake and
hold. Each pushes with the normal part of the force that the planned friction cones ask for against
weight and inertia; friction has to bear the rest. The exit status is 0 when the object was held, 1
when not, and 2 when there was nothing to try.

The hand does not feel what happens and corrects nothing. A grasp with little friction to spare then
creeps, though forces exist that would hold it: models/frustum, whose weight alone takes nearly all
of its friction, shows it. A fingertip's contact is a small disc and not a point: it also resists
twisting, by about a tenth of what friction times its radius would.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat

from drake_polygrasp import PolygraspError
from drake_polygrasp.plant import GraspReport, GraspSimulation, report_grasp
from drake_polygrasp.visualization import look_at, save_html
from examples.choose_grasp import STANDOFF, Target, choose_grasp, describe
from examples.hand import add_hand, connect_hand, plan_forces
from examples.motion import Task, Z, plan_motion
from examples.table_top import make_table_top, settle

MODEL = Path(__file__).parents[1] / "models" / "l_bracket" / "l_bracket.sdf"
TASK = Task()


def pick_up(
    model_file: Path,
    target: Target,
    mu: float | None = None,
    *,
    task: Task = TASK,
    meshcat: Meshcat | None = None,
) -> GraspReport:
    """Approaches, squeezes, lifts, shakes and holds an object where it lies.

    Args:
        model_file: of the object.
        target: the object where it lies, and its grasp.
        mu: friction that the fingertips find where more was planned with.
        task: what to do, that of `choose_grasp`.
        meshcat: where a recording is published.
    """
    motion = plan_motion(task)
    forces = plan_forces(target, motion)
    table_top = make_table_top(model_file)
    tips = add_hand(table_top.plant, table_top.body, target, mu)
    table_top.finalize()
    connect_hand(table_top.builder, tips, motion, forces)
    visualizer = table_top.visualizer(meshcat)  # before the diagram is built
    simulation = GraspSimulation(table_top.builder.Build(), tips, visualizer)
    tips.plant.SetFreeBodyPose(simulation.context, tips.body, target.X_WB)
    tips.plant.SetPositions(simulation.context, tips.instance, np.full(3, -STANDOFF))
    object_, grasp = target.object_, target.found.grasp
    with simulation.recording():
        for t, force in zip(motion.time, forces, strict=True):
            X_HB = simulation.advance_to(t, force).X_HB
            strayed = X_HB.translation() - simulation.samples[0].X_HB.translation()
            if np.linalg.norm(strayed) > object_.polyhedron.diameter / 2:
                break
    return report_grasp(
        simulation.record,
        motion.phase,
        motion.lift_off,
        grasp.p_BC,
        tips.nhat_H,
        object_.p_BBcm,
        object_.polyhedron.diameter,
    )


def film(target: Target) -> Meshcat:
    """A Meshcat that looks at the object."""
    meshcat, object_ = Meshcat(), target.object_
    look_at(meshcat, object_)
    centre = target.X_WB.multiply(object_.p_BBcm) + TASK.lift / 2 * Z
    eye = 4.0 * object_.polyhedron.diameter * np.array([0.6, -0.7, 0.4])
    meshcat.SetCameraPose(centre + eye, centre)
    return meshcat


def main(arguments: Sequence[str] | None = None) -> int:
    """Reports on one model."""
    parser = argparse.ArgumentParser(prog="python -m examples.pick_up", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("model", type=Path, nargs="?", default=MODEL, help="default: L bracket")
    parser.add_argument("--mu", type=float, help="friction that the fingertips find, if it is less")
    parser.add_argument("--html", type=Path, help="page to write, with the recording")
    options = parser.parse_args(arguments)
    try:
        plant, body, context = settle(options.model)
        target = choose_grasp(plant, body, context, TASK)
        meshcat = film(target) if options.html else None
        report = pick_up(options.model, target, options.mu, meshcat=meshcat)
        print(describe(target, options.mu), report, sep="\n")
        if meshcat is not None:
            save_html(options.html, meshcat, title=f"Picking up {options.model.stem}")
    except PolygraspError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0 if report.held else 1


if __name__ == "__main__":
    sys.exit(main())
