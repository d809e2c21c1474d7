"""Finds a body in the user's plant, and checks that plant and context can answer queries."""

from __future__ import annotations

from typing import Any

from pydrake.geometry import QueryObject
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context

from drake_polygrasp.arguments import check_instance, refuse
from drake_polygrasp.errors import UsageError


def find_body(plant: MultibodyPlant, body: RigidBody | BodyIndex | str) -> RigidBody:
    """Returns a body of the plant.

    Args:
        plant: the user's plant.
        body: the body itself, its index, or its name, alone or as "model::body".

    Raises:
        UsageError: when the plant has no such body, or several of that name.
    """
    check_instance("plant", plant, MultibodyPlant)
    if isinstance(body, RigidBody):
        return body
    bodies = [plant.get_body(BodyIndex(k)) for k in range(plant.num_bodies())]
    if isinstance(body, BodyIndex):
        if int(body) < len(bodies):
            return bodies[int(body)]
        raise UsageError(f"body index {int(body)} is not one of the plant's {len(bodies)} bodies")
    if not isinstance(body, str):
        raise refuse("body", body, "a body of the plant, its BodyIndex or its name")
    named = [b for b in bodies if body in (b.name(), str(b.scoped_name()))]
    if len(named) == 1:
        return named[0]
    others = ", ".join(f"'{b.scoped_name()}'" for b in named or bodies[1:])
    if named:
        raise UsageError(f"several bodies of the plant are called '{body}': {others}")
    raise UsageError(f"no body of the plant is called '{body}'; it has {others or 'none'}")


def query_of(plant: MultibodyPlant, body: RigidBody, context: Context) -> QueryObject[Any]:
    """Returns the query object of the plant's SceneGraph in a context.

    Args:
        plant: the user's plant, finalized.
        body: the body that will be asked about; not the world.
        context: the plant's context, taken from the diagram's.

    Raises:
        UsageError: when plant, body and context do not belong together, or the plant is not
            connected to a SceneGraph.
    """
    check_instance("context", context, Context, "plant.GetMyContextFromRoot(diagram_context)")
    if not plant.is_finalized():
        raise UsageError("the plant is not finalized: call plant.Finalize() first")
    if body.GetParentPlant() is not plant:
        raise UsageError(f"body '{body.name()}' belongs to another plant")
    if body.index() == plant.world_body().index():
        raise UsageError("the world body cannot be grasped; name another body")
    try:
        plant.ValidateContext(context)
    except (RuntimeError, TypeError) as error:
        raise UsageError(
            "the context is not the plant's; give plant.GetMyContextFromRoot(diagram_context)"
        ) from error
    port = plant.get_geometry_query_input_port()
    if not port.HasValue(context):
        raise UsageError(
            "the plant is not connected to a SceneGraph: make both by AddMultibodyPlantSceneGraph, "
            "and take the plant's context from the diagram's"
        )
    query: QueryObject[Any] = port.Eval(context)
    return query


def describe(body: RigidBody) -> str:
    """Returns what messages call a body of the user's plant.

    Args:
        body: the body.
    """
    return f"the plant's body '{body.scoped_name()}'"
