"""Obstacles and surroundings remember whose they are, and those of one body can be joined."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from pydrake.geometry import Box, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from drake_polygrasp import (
    UsageError,
    certify_in_plant,
    explain_sets,
    load_object,
    object_from_plant,
    obstacles_from_plant,
    plan_grasps,
)
from drake_polygrasp.geometry.body_identity import surface_lengths
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.loading.surroundings import surroundings_from_plant
from tests.support.convex_polyhedra import prism
from tests.support.planned import exact_plan

MODELS = Path(__file__).parents[2] / "models"
CUBE, BRICK = MODELS / "cube" / "cube.sdf", MODELS / "brick" / "brick.urdf"
X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, 0.4), [0.3, -0.2, 0.03])
"""Of a cube of 6 cm that stands on z = 0."""
MU = CoulombFriction(0.3, 0.3)
TABLE = "table", Box(1.0, 0.8, 0.05), RigidTransform([0.2, 0.0, -0.025])
WALL = "wall", Box(0.01, 0.2, 0.2), X_WB @ RigidTransform([0.037, 0.0, 0.0])
BALL = "ball", Sphere(0.02), X_WB @ RigidTransform([0.0, 0.055, 0.0])

Asked = tuple[MultibodyPlant, RigidBody, Context]


class World:
    """Cubes called one and two, and a brick, at given poses among fixed shapes."""

    def __init__(self, *fixed: tuple[str, Any, RigidTransform], X_WB: RigidTransform = X_WB):
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.001)
        parser = Parser(self.plant)
        parser.SetAutoRenaming(True)
        names = ("one", "two", "brick")
        self.bodies: dict[str, RigidBody] = {}
        for name, model in zip(names, (CUBE, CUBE, BRICK), strict=True):
            (instance,) = parser.AddModels(str(model))
            (index,) = self.plant.GetBodyIndices(instance)
            self.bodies[name] = self.plant.get_body(index)
        for name, shape, X_WG in fixed:
            world = self.plant.world_body()
            self.plant.RegisterCollisionGeometry(world, X_WG, shape, name, MU)
        self.plant.Finalize()
        self.diagram: Diagram = builder.Build()
        self.context = self.plant.GetMyMutableContextFromRoot(self.diagram.CreateDefaultContext())
        q = self.plant.GetPositions(self.context)
        poses = (X_WB, RigidTransform([5.0, 0, 0]), RigidTransform([9.0, 0, 0]))
        for body, X in zip(self.bodies.values(), poses, strict=True):
            start = body.floating_positions_start()
            quaternion = X.rotation().ToQuaternion().wxyz()
            q[start : start + 7] = np.concatenate([quaternion, X.translation()])
        self.plant.SetPositions(self.context, q)

    def asked(self, name: str = "one") -> Asked:
        return self.plant, self.bodies[name], self.context


def test_obstacles_of_another_body_are_refused_though_it_has_the_same_shape() -> None:
    world = World(TABLE)
    one, obstacles = object_from_plant(*world.asked("one")), {}
    for name in world.bodies:
        obstacles[name] = obstacles_from_plant(*world.asked(name), reach=1.0)
    assert exact_plan(one, top=1, obstacles=obstacles["one"]).grasps
    refusing: tuple[Callable[..., Any], ...] = (plan_grasps, explain_sets)
    for function in refusing:
        with pytest.raises(UsageError, match=r"around 'cube_1::cube', .* is 'cube::cube'"):
            function(one, obstacles=obstacles["two"])
        with pytest.raises(UsageError, match="take them for the body that is grasped"):
            function(one, obstacles=obstacles["brick"])


def test_an_object_of_a_file_is_any_body_of_its_shape_in_a_plant() -> None:
    world = World(TABLE)
    cube = load_object(CUBE)
    for name in ("one", "two"):
        obstacles = obstacles_from_plant(*world.asked(name))
        assert exact_plan(cube, top=1, obstacles=obstacles).grasps
    with pytest.raises(UsageError, match="the object is not that body"):
        exact_plan(cube, obstacles=obstacles_from_plant(*world.asked("brick")))
    filed = object_from_plant(*world.asked("two"), model_file=CUBE)
    with pytest.raises(UsageError, match=r"is 'cube_1::cube'"):
        exact_plan(filed, obstacles=obstacles_from_plant(*world.asked("one")))


def test_surroundings_of_another_body_are_refused() -> None:
    world = World(TABLE)
    one = object_from_plant(*world.asked("one"), model_file=CUBE)
    best = exact_plan(one, top=1, obstacles=obstacles_from_plant(*world.asked("one"))).grasps[0]
    around = {name: surroundings_from_plant(*world.asked(name)) for name in ("one", "two")}
    with pytest.raises(UsageError, match="the surroundings are those around 'cube_1::cube'"):
        certify_in_plant(one, best, tip_radius=0.002, surroundings=around["two"])
    assert certify_in_plant(one, best, tip_radius=0.002, surroundings=around["one"]).holds


def test_the_same_body_in_another_frame_is_another() -> None:
    world = World(TABLE)
    obstacles, cube = obstacles_from_plant(*world.asked()), load_object(CUBE)
    assert cube.body is not None
    shifted = cube.polyhedron.own_triangles_B + np.array([0.0, 0.0, 0.01])
    elsewhere = replace(cube, body=replace(cube.body, lengths=surface_lengths(shifted)))
    with pytest.raises(UsageError, match="is not that body"):
        exact_plan(elsewhere, obstacles=obstacles)


def test_obstacles_of_several_plants_are_joined_as_if_of_one() -> None:
    together = obstacles_from_plant(*World(TABLE, WALL, BALL).asked())
    first, second = (obstacles_from_plant(*World(*f).asked()) for f in ((TABLE,), (WALL, BALL)))
    third = obstacles_from_plant(*World(BALL).asked(), reach=0.02)
    joined = first | second
    assert joined.names == together.names == ("table", "wall", "ball")
    assert np.array_equal(joined.triangles_B, together.triangles_B)
    assert np.array_equal(joined.closed, together.closed)
    assert joined.body is not None
    assert joined.body.names == ("cube::cube",)
    p_BQ = np.random.default_rng(0).uniform(-0.08, 0.08, (400, 3))
    assert (joined.contain(p_BQ) == (first.contain(p_BQ) | second.contain(p_BQ))).all()
    assert (joined.block(p_BQ, 0.01) == together.block(p_BQ, 0.01)).all()
    every = first.joined(second, third)
    assert (every.reach, len(every.primitives)) == (0.02, 2)
    cube = load_object(CUBE)
    plans = [exact_plan(cube, obstacles=obstacles, top=3) for obstacles in (joined, together)]
    for one, other in zip(plans[0].grasps, plans[1].grasps, strict=True):
        assert np.array_equal(one.grasp.p_BC, other.grasp.p_BC)


def test_obstacles_of_other_bodies_or_poses_cannot_be_joined() -> None:
    here = obstacles_from_plant(*World(TABLE).asked())
    moved = X_WB @ RigidTransform([0.0, 0.0, 1e-6])
    with pytest.raises(UsageError, match="poses X_WB differ"):
        here.joined(obstacles_from_plant(*World(WALL, X_WB=moved).asked()))
    with pytest.raises(UsageError, match="of different bodies"):
        here.joined(obstacles_from_plant(*World(TABLE).asked("brick")))
    with pytest.raises(UsageError, match="what is joined is a str"):
        here.joined("table")  # type: ignore[arg-type]


def test_obstacles_made_by_hand_are_anyones() -> None:
    none = np.empty((0, 3, 3)), np.empty(0, dtype=bool)
    by_hand = Obstacles(X_WB, ("nothing",), *none, (), reach=1.0)
    assert exact_plan(load_object(CUBE), top=1, obstacles=by_hand).grasps
    joined = by_hand | obstacles_from_plant(*World(TABLE).asked())
    assert joined.body is not None


def test_lengths_of_a_box_are_those_of_its_closed_forms() -> None:
    """Of sides a, b, c: two faces of a c at b/2, and so on."""
    a, b, c = sides = np.array([0.3, 0.2, 0.1])
    area = 2 * (a * b + b * c + c * a)
    second = [
        (2 * s**2 / 4 * t * u + 2 * s**2 / 12 * s * (t + u)) / area
        for s, t, u in ((a, b, c), (b, c, a), (c, a, b))
    ]
    xx, yy, zz = np.array(second) / np.linalg.norm(sides)
    expected = [*(-sides / 2), *(sides / 2), 0, 0, 0, np.sqrt(area), xx, 0, 0, yy, 0, zz]
    upright = prism(shapely.box(-a / 2, -b / 2, a / 2, b / 2), c) - [0.0, 0.0, c / 2]
    lengths = surface_lengths(upright)
    assert lengths == pytest.approx(expected, abs=1e-15)
