"""A plant in its user's diagram: what its context says of the scene, or what is missing to ask."""

from __future__ import annotations

from typing import Any

from pydrake.geometry import QueryObject
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from drake_polygrasp.errors import UsageError


def query_of(plant: MultibodyPlant, body: RigidBody, context: Context) -> QueryObject[Any]:
    """The plant's SceneGraph as it stands in the context, for questions about a body.

    Raises UsageError when plant, body and context do not belong together, or to no scene.
    """
    if not plant.is_finalized():
        raise UsageError("the plant is not finalized: call plant.Finalize() first")
    if body.GetParentPlant() is not plant:
        raise UsageError(f"body '{body.name()}' belongs to another plant")
    if body.index() == plant.world_body().index():
        raise UsageError("the world itself cannot be grasped; name another body")
    try:
        plant.ValidateContext(context)
    except (RuntimeError, TypeError) as error:
        raise UsageError(
            "the context is not the plant's own: it is plant.GetMyContextFromRoot(diagram_context)"
        ) from error
    port = plant.get_geometry_query_input_port()
    if not port.HasValue(context):
        raise UsageError(
            "the plant sees no SceneGraph: make both by AddMultibodyPlantSceneGraph, and take the "
            "plant's context from the diagram's"
        )
    query: QueryObject[Any] = port.Eval(context)
    return query


def describe(body: RigidBody) -> str:
    """What messages call it."""
    return f"the plant's body '{body.scoped_name()}'"
