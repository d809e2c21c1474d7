"""A hand clears a table: it picks up three objects, one after another.

    python -m examples.clear_table [--hand HAND.yaml] [--meshcat]

Each is planned where it stands, clear of the table and of those that are still there, and lifted in
simulation by the whole hand, alone.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import Box, Meshcat
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, DiagramBuilder

from drake_polygrasp import (
    Hand,
    PolygraspError,
    lift_with_hand,
    load_hand,
    object_from_plant,
    plan_hand_grasps,
    surroundings_from_plant,
)
from drake_polygrasp.loading import add_model
from drake_polygrasp.plant import contact_material

MODELS = Path(__file__).resolve().parents[1] / "models"
OWN_HAND = MODELS / "hands" / "three_finger" / "three_finger.hand.yaml"
OBJECTS = [
    *(MODELS / "cube" / "cube.sdf", MODELS / "t_block" / "t_block.urdf"),
    MODELS / "hexagonal_prism" / "hexagonal_prism.urdf",
]
APART = 0.16
"""Distance between objects on the table [m]."""
AWAY = RigidTransform([0.0, 0.0, -2.0])
"""Where objects are put that have been picked up."""


def set_table(files: Sequence[Path]) -> tuple[MultibodyPlant, list[RigidBody], Context]:
    """A table whose top is at z = 0, with objects on it: the plant, its bodies, its context."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    material, X_WG = contact_material(0.5), RigidTransform([0.0, 0.0, -0.02])
    world, top = plant.world_body(), Box(1.0, 1.0, 0.04)
    plant.RegisterCollisionGeometry(world, X_WG, top, "table", material)
    bodies = [
        body
        for k, file in enumerate(files)
        for body in add_model(plant, file, name_prefix=f"object_{k}")
    ]
    plant.Finalize()
    context = plant.GetMyMutableContextFromRoot(builder.Build().CreateDefaultContext())
    for k, body in enumerate(bodies):
        object_ = object_from_plant(plant, body, context)
        height = -float(object_.polyhedron.triangles_B[..., 2].min())
        x = APART * (k - (len(bodies) - 1) / 2)
        plant.SetFreeBodyPose(context, body, RigidTransform([x, 0.0, height]))
    return plant, bodies, context


Scene = tuple[MultibodyPlant, RigidBody, Context]
"""A plant, the body to pick up, and the plant's context."""


def pick(scene: Scene, file: Path, hand: Hand, meshcat: Meshcat | None = None) -> str:
    """Plans a grasp where an object stands, lifts it, and says what became of it."""
    plant, body, context = scene
    object_ = object_from_plant(*scene, model_file=file)
    X_WB = plant.EvalBodyPoseInWorld(context, body)
    up_B = X_WB.rotation().inverse() @ np.array([0.0, 0.0, 1.0])
    plan = plan_hand_grasps(
        object_,
        hand,
        top=1,
        surroundings=surroundings_from_plant(*scene),
        up_B=up_B,
        avoid_directions=[-up_B],
        load_mass=0.15,
        budget=600.0,  # [s]: enough on a slow machine too
    )
    if not plan.grasps:
        return "left alone: " + "; ".join(plan.sentences.values())
    best = plan.grasps[0]
    p_WPalm = (X_WB @ best.X_BPalm).translation()
    held = lift_with_hand(object_, best.certified, hand, best, meshcat=meshcat).held
    plant.SetFreeBodyPose(context, body, AWAY)
    verb = "picked up" if held else "dropped"
    return f"{verb} by {', '.join(best.fingers)}; palm at {np.round(p_WPalm, 2).tolist()}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Clears the table; 1 if something is dropped or left alone."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hand", type=Path, default=OWN_HAND, help="default: our own")
    parser.add_argument("--meshcat", action="store_true", help="show the last lift")
    asked = parser.parse_args(arguments)
    hand, meshcat = load_hand(asked.hand), Meshcat() if asked.meshcat else None
    plant, bodies, context = set_table(OBJECTS)
    said = [
        pick((plant, body, context), file, hand, meshcat)
        for body, file in zip(bodies, OBJECTS, strict=True)
    ]
    print(*(f"{file.stem}: {words}" for file, words in zip(OBJECTS, said, strict=True)), sep="\n")
    return int(not all(words.startswith("picked up") for words in said))


if __name__ == "__main__":
    try:
        sys.exit(main())
    except PolygraspError as error:
        sys.exit(f"error: {error}")
