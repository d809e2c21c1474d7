"""Objects and obstacles in a user's own plant, held against Drake's own distances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    GeometryInstance,
    HalfSpace,
    Mesh,
    ProximityProperties,
    QueryObject,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.fem import DeformableBodyConfig
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from drake_polygrasp import (
    GraspFileError,
    GraspPlan,
    ModelError,
    Obstacles,
    UsageError,
    explain_sets,
    load_grasps,
    load_object,
    object_from_plant,
    obstacles_from_plant,
    save_grasps,
    verify_file,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.geometry.primitives import Primitive, tessellation
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.search.fingertip_room import with_tip_room
from drake_polygrasp.settings import NO_ERRORS
from tests.support.convex_polyhedra import write_obj
from tests.support.planned import exact_plan

MODELS = Path(__file__).parents[2] / "models"
CUBE, BRACKET = MODELS / "cube" / "cube.sdf", MODELS / "l_bracket" / "l_bracket.sdf"
U_CHANNEL = MODELS / "u_channel" / "u_channel.obj"
MU = CoulombFriction(0.3, 0.3)
WOOD = SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1)
X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, 0.4), [0.3, -0.2, 0.03])
"""Of a cube of 6 cm that stands on z = 0."""


@dataclass(frozen=True)
class World:
    """A diagram with a body to grasp."""

    plant: MultibodyPlant
    body: RigidBody
    diagram: Diagram
    root: Context

    @property
    def context(self) -> Context:
        return self.plant.GetMyContextFromRoot(self.root)

    @property
    def asked(self) -> tuple[MultibodyPlant, RigidBody, Context]:
        """What the functions take first."""
        return self.plant, self.body, self.context

    @property
    def query(self) -> QueryObject[Any]:
        return self.plant.get_geometry_query_input_port().Eval(self.context)


Furnish = Callable[[MultibodyPlant], None]


def world(model: Path, *furnish: Furnish, X_WB: RigidTransform = X_WB) -> World:
    """The model's first body, free, at a pose among furniture."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.001)
    (instance,) = Parser(plant).AddModels(str(model))
    (index,) = plant.GetBodyIndices(instance)
    for add in furnish:
        add(plant)
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    body = plant.get_body(index)
    free = body.is_floating_base_body() if hasattr(body, "is_floating_base_body") else True
    if free:
        state = plant.GetMyMutableContextFromRoot(root)
        q = plant.GetPositions(state)
        start = body.floating_positions_start()
        quaternion = X_WB.rotation().ToQuaternion().wxyz()
        q[start : start + 7] = np.concatenate([quaternion, X_WB.translation()])
        plant.SetPositions(state, q)
    return World(plant, body, diagram, root)


def anchored(name: str, shape: Shape, X_WG: RigidTransform) -> Furnish:
    def add(plant: MultibodyPlant) -> None:
        plant.RegisterCollisionGeometry(plant.world_body(), X_WG, shape, name, MU)

    return add


def welded(name: str, shape: Shape, X_WG: RigidTransform) -> Furnish:
    """A body of its own, which stays where it is."""

    def add(plant: MultibodyPlant) -> None:
        body = plant.AddRigidBody(name, plant.AddModelInstance(name), WOOD)
        plant.WeldFrames(plant.world_frame(), body.body_frame(), X_WG)
        plant.RegisterCollisionGeometry(body, RigidTransform(), shape, name, MU)

    return add


def table(top: float = 0.0) -> Furnish:
    return welded("table", Box(1.0, 0.8, 0.05), RigidTransform([0.2, 0.0, top - 0.025]))


def beside(shape: Shape, x: float, y: float = 0.0, z: float = 0.0) -> Furnish:
    """At a place and attitude given in the object's frame."""
    X_BG = RigidTransform(RollPitchYaw(0.3, -0.2, 0.5), [x, y, z])
    return welded(type(shape).__name__, shape, X_WB @ X_BG)


SCENES: dict[str, tuple[Furnish, ...]] = {
    "table": (table(),),
    "ground": (anchored("ground", HalfSpace(), RigidTransform()),),
    "sunk": (anchored("ground", HalfSpace(), RigidTransform([0.0, 0.0, 0.01])),),
    "mesh": (table(), beside(Mesh(str(U_CHANNEL), 5e-4), -0.07)),
    "hull": (table(), beside(Convex(str(U_CHANNEL), 5e-4), -0.07)),
    "round": (
        anchored("ground", HalfSpace(), RigidTransform()),
        beside(Cylinder(0.02, 0.1), 0.055),
        beside(Capsule(0.015, 0.1), 0.0, 0.05),
        beside(Ellipsoid(0.02, 0.03, 0.01), -0.045),
        beside(Sphere(0.02), 0.0, -0.055, 0.01),
    ),
}


@cache
def scene(name: str) -> tuple[World, Obstacles]:
    scenery = world(CUBE, *SCENES[name])
    return scenery, obstacles_from_plant(*scenery.asked)


def drakes_distance(scenery: World, p_WQ: Array) -> float:
    """Least signed distance of a point to all but the object, as Drake has it."""
    own = set(scenery.plant.GetCollisionGeometriesForBody(scenery.body))
    found = scenery.query.ComputeSignedDistanceToPoint(p_WQ)
    return min(d.distance for d in found if d.id_G not in own)


def tips_W(obstacles: Obstacles, plan: GraspPlan) -> Array:
    """The centres of all grasps' fingertips in the world, shape (M, 3)."""
    r = plan.settings.tip_radius
    p_BT = np.concatenate([g.grasp.p_BC - r * g.grasp.nhat_TB_B for g in plan.grasps])
    return np.asarray((obstacles.X_WB @ p_BT.T).T)


@pytest.mark.parametrize("name", ["cube", "brick", "l_bracket", "two_materials", "plate_with_hole"])
def test_the_plants_body_is_the_object_of_its_file(name: str) -> None:
    (file,) = (path for path in (MODELS / name).iterdir() if path.suffix in {".sdf", ".urdf"})
    filed, live = load_object(file), object_from_plant(*world(file).asked)
    assert live.source is None
    assert live.mass == pytest.approx(filed.mass, rel=1e-12)
    assert live.p_BBcm == pytest.approx(filed.p_BBcm, abs=1e-12)
    assert live.rho == pytest.approx(filed.rho, rel=1e-12)
    assert np.array_equal(live.polyhedron.triangles_B, filed.polyhedron.triangles_B)
    mu = [[face.mu for face in o.polyhedron.faces] for o in (live, filed)]
    assert mu[0] == mu[1]


def test_the_context_states_mass_and_centre_of_mass() -> None:
    scenery = world(CUBE)
    state = scenery.plant.GetMyMutableContextFromRoot(scenery.root)
    M = SpatialInertia.SolidBoxWithMass(2.5, 0.06, 0.06, 0.06).Shift([0.0, 0.0, -0.01])
    scenery.body.SetSpatialInertiaInBodyFrame(state, M)
    object_ = object_from_plant(*scenery.asked)
    assert object_.mass == pytest.approx(2.5)
    assert object_.p_BBcm == pytest.approx([0.0, 0.0, 0.01])
    with pytest.raises(ModelError, match=r"its mass is 2\.5 kg, the file's 0\.1512 kg"):
        object_from_plant(*scenery.asked, model_file=CUBE)


def test_a_grasp_of_a_body_in_a_plant_is_saved_under_its_file(tmp_path: Path) -> None:
    scenery, obstacles = scene("table")
    path = tmp_path / "cube.grasp.yaml"
    object_ = object_from_plant(*scenery.asked, model_file=CUBE)
    plan = exact_plan(object_, obstacles=obstacles, top=2)
    save_grasps(path, object_, plan.grasps, plan.settings)
    assert verify_file(path).holds
    assert load_grasps(path).plan.obstacles == ("table::table",)


def test_without_a_file_saving_names_the_remedy(tmp_path: Path) -> None:
    object_ = object_from_plant(*world(CUBE).asked)
    with pytest.raises(GraspFileError, match="model_file"):
        save_grasps(tmp_path / "cube.grasp.yaml", object_, [], StatedPlan())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("old", "new", "difference"),
    [
        ("0.06 0.06 0.06", "0.06 0.06 0.0600001", "geometry differs"),
        ("<mass>0.1512", "<mass>0.1513", "its mass is"),
        ("<mu>0.3</mu><mu2>0.3</mu2>", "<mu>0.4</mu><mu2>0.4</mu2>", r"friction is 0\.3"),
        ('<link name="cube">', '<link name="die">', "no body 'cube'"),
    ],
)
def test_another_solids_file_is_refused(
    old: str, new: str, difference: str, tmp_path: Path
) -> None:
    other = tmp_path / "other.sdf"
    other.write_text(CUBE.read_text().replace(old, new))
    with pytest.raises(ModelError, match=difference):
        object_from_plant(*world(CUBE).asked, model_file=other)


def test_a_mesh_with_the_facets_that_stand_for_a_ball_is_not_the_ball(tmp_path: Path) -> None:
    ball = Primitive("ellipsoid", np.eye(3), np.zeros(3), np.full(3, 0.03))
    sphere, mesh = tmp_path / "sphere.sdf", tmp_path / "mesh.sdf"
    write_obj(tmp_path / "ball.obj", tessellation(ball))
    box = "<box><size>0.06 0.06 0.06</size></box>"
    for file, shape in (
        (sphere, "<sphere><radius>0.03</radius></sphere>"),
        (mesh, "<mesh><uri>ball.obj</uri></mesh>"),
    ):
        file.write_text(CUBE.read_text().replace(box, shape))
    for file, other in ((sphere, mesh), (mesh, sphere)):
        assert object_from_plant(*world(file).asked, model_file=file).source is not None
        with pytest.raises(ModelError, match="geometry differs"):
            object_from_plant(*world(file).asked, model_file=other)


def test_mu_replaces_the_friction_of_plant_and_file() -> None:
    for model_file in (None, CUBE):
        object_ = object_from_plant(*world(CUBE).asked, model_file=model_file, mu=0.7)
        assert {face.mu for face in object_.polyhedron.faces} == {0.7}
    with pytest.raises(UsageError, match="must be above 0"):
        object_from_plant(*world(CUBE).asked, mu=0.0)


def test_a_friction_of_1_may_be_drakes_own_and_is_warned_of(tmp_path: Path) -> None:
    silent = tmp_path / "cube.sdf"
    silent.write_text(CUBE.read_text().replace("<mu>0.3</mu><mu2>0.3</mu2>", ""))
    live = object_from_plant(*world(silent).asked)
    assert {face.mu for face in live.polyhedron.faces} == {1.0}
    assert "Drake's default where a model states none" in live.warnings[0]
    # The file's object is planned with the paper's coefficient, which the plant bears out.
    filed = object_from_plant(*world(silent).asked, model_file=silent)
    assert {face.mu for face in filed.polyhedron.faces} == {0.3}


def test_what_is_welded_to_the_body_is_part_of_it_and_no_obstacle() -> None:
    def handle(plant: MultibodyPlant) -> None:
        body = plant.AddRigidBody("handle", plant.AddModelInstance("handle"), WOOD)
        plant.WeldFrames(plant.GetFrameByName("cube"), body.body_frame(), X_BH)
        plant.RegisterCollisionGeometry(body, RigidTransform(), Sphere(0.02), "handle", MU)

    X_BH = RigidTransform([0.05, 0.0, 0.0])
    scenery = world(CUBE, handle)
    object_ = object_from_plant(*scenery.asked)
    assert object_.mass == pytest.approx(1.1512)
    assert object_.p_BBcm == pytest.approx([0.05 * 1.0 / 1.1512, 0.0, 0.0])
    assert len(object_.polyhedron.primitives) == 1
    assert "'cube', 'handle::handle' are fixed to one another" in object_.warnings[0]
    obstacles = obstacles_from_plant(*scenery.asked)
    assert obstacles.names == ()
    with pytest.raises(
        ModelError, match=r"geometry differs; in the plant it is 'cube', 'handle::handle'"
    ):
        object_from_plant(*scenery.asked, model_file=CUBE)


@pytest.mark.parametrize("function", [object_from_plant, obstacles_from_plant])
def test_plant_body_and_context_must_belong_together(function: Callable[..., Any]) -> None:
    one, other = world(CUBE), world(CUBE)
    refused = {
        "belongs to another plant": (one.plant, other.body, one.context),
        "GetMyContextFromRoot": (one.plant, one.body, one.root),
        "the context is not the plant's": (one.plant, one.body, other.context),
        "the world body": (one.plant, one.plant.world_body(), one.context),
        "not connected to a SceneGraph": (one.plant, one.body, one.plant.CreateDefaultContext()),
        "Finalize": (MultibodyPlant(0.0), one.body, one.context),
    }
    for complaint, asked in refused.items():
        with pytest.raises(UsageError, match=complaint):
            function(*asked)


def test_a_body_that_no_finger_can_hold_is_no_object() -> None:
    def without_surface(plant: MultibodyPlant) -> None:
        for name in ("ghost", "ground"):
            body = plant.AddRigidBody(name, plant.AddModelInstance(name), WOOD)
        plant.RegisterCollisionGeometry(body, RigidTransform(), HalfSpace(), "half", MU)

    scenery = world(CUBE, without_surface)
    for name, complaint in (("ghost", "no collision geometry"), ("ground", "fingers can.* hold")):
        body = scenery.plant.GetBodyByName(name)
        for function in (object_from_plant, obstacles_from_plant):
            with pytest.raises(ModelError, match=complaint):
                function(scenery.plant, body, scenery.context)


def test_a_deformable_obstacle_is_to_be_ignored() -> None:
    def sponge(plant: MultibodyPlant) -> None:
        instance = GeometryInstance(X_WB @ RigidTransform([0.06, 0.0, 0.0]), Sphere(0.02), "sponge")
        properties = ProximityProperties()
        AddContactMaterial(friction=MU, properties=properties)
        instance.set_proximity_properties(properties)
        plant.mutable_deformable_model().RegisterDeformableBody(
            instance, DeformableBodyConfig(), resolution_hint=0.02
        )

    scenery = world(CUBE, sponge)
    with pytest.raises(ModelError, match=r"'.*sponge' is deformable; .*ignore"):
        obstacles_from_plant(*scenery.asked)
    (soft,) = scenery.query.inspector().GetAllDeformableGeometryIds()
    assert not obstacles_from_plant(*scenery.asked, ignore=[soft]).names


@pytest.mark.parametrize("name", SCENES)
def test_obstacles_are_where_drake_has_them(name: str) -> None:
    scenery, obstacles = scene(name)
    p_BQ = np.random.default_rng(0).uniform(-0.08, 0.08, (400, 3))
    p_WQ = (obstacles.X_WB @ p_BQ.T).T
    distance = np.array([drakes_distance(scenery, p) for p in p_WQ])
    assert (obstacles.contain(p_BQ) == (distance < 0)).all()
    for reach in (0.002, 0.01):
        clear = np.abs(distance - reach) > 1e-9
        assert (obstacles.block(p_BQ, reach) == (distance < reach))[clear].all()
    assert 0.02 < (distance < 0.01).mean() < 0.98


@pytest.mark.parametrize("name", SCENES)
def test_no_planned_fingertip_penetrates_anything_that_drake_knows(name: str) -> None:
    scenery, obstacles = scene(name)
    object_ = object_from_plant(*scenery.asked)
    plan = exact_plan(object_, obstacles=obstacles, tip_radius=0.006)
    assert plan.grasps
    slack = 3e-5 * object_.polyhedron.diameter
    for p_WT in tips_W(obstacles, plan):
        assert drakes_distance(scenery, p_WT) >= 0.006 - slack


def test_without_obstacles_fingertips_would_penetrate_the_table() -> None:
    scenery, obstacles = scene("table")
    plan = exact_plan(object_from_plant(*scenery.asked), tip_radius=0.006)
    assert min(drakes_distance(scenery, p) for p in tips_W(obstacles, plan)) < 0


@pytest.mark.parametrize("method", ["paper", "enriched"])
def test_sets_whose_tips_obstacles_block_are_counted_so(method: Any) -> None:
    scenery, obstacles = scene("table")
    object_ = object_from_plant(*scenery.asked)
    plan = exact_plan(object_, method=method, obstacles=obstacles, top=100)
    explanation = explain_sets(object_, method=method, obstacles=obstacles, **NO_ERRORS)
    underside = [k for k, f in enumerate(object_.polyhedron.faces) if f.R_BF[2, 2] < -0.9]
    for reasons in (plan.reasons, explanation.counts):
        assert sum(reasons.values()) == 35
        assert reasons["obstructed"] > 0
    on_it = (explanation.faces == underside[0]).any(axis=1)
    assert "certified" not in np.array(explanation.reasons)[on_it]
    assert "certified" in np.array(explanation.reasons)[~on_it]


def test_on_a_table_grasps_are_nearly_as_good_as_in_the_air() -> None:
    for model in (CUBE, BRACKET):
        object_ = load_object(model)
        low = object_.polyhedron.triangles_B[..., 2].min()
        on_table = RigidTransform(X_WB.rotation(), [0.3, -0.2, -low])
        obstacles = obstacles_from_plant(*world(model, table(), X_WB=on_table).asked)
        best = exact_plan(object_, obstacles=obstacles).grasps[0].certificate
        free = exact_plan(object_).grasps[0].certificate
        assert best.epsilon_lower >= 0.9 * free.epsilon_lower


def test_in_a_tight_box_nothing_can_be_held() -> None:
    """A cube's five sides have gaps of 2 mm, its top is open."""
    gap, t = 0.002, 0.01
    walls = [
        anchored(f"wall_{k}", Box(*size), X_WB @ RigidTransform(p))
        for k, (size, p) in enumerate(
            [
                ([t, 0.1, 0.06], [0.03 + gap + t / 2, 0, 0]),
                ([t, 0.1, 0.06], [-0.03 - gap - t / 2, 0, 0]),
                ([0.1, t, 0.06], [0, 0.03 + gap + t / 2, 0]),
                ([0.1, t, 0.06], [0, -0.03 - gap - t / 2, 0]),
                ([0.1, 0.1, t], [0, 0, -0.03 - t / 2]),
            ]
        )
    ]
    scenery = world(CUBE, *walls)
    obstacles = obstacles_from_plant(*scenery.asked)
    assert obstacles.names == tuple(f"wall_{k}" for k in range(5))
    object_ = object_from_plant(*scenery.asked)
    blocked = exact_plan(object_, obstacles=obstacles, tip_radius=0.003)
    assert not blocked.grasps
    assert blocked.reasons["obstructed"] > 0
    assert exact_plan(object_, obstacles=obstacles, tip_radius=0.0009).grasps


def test_regions_lose_what_a_table_leaves_no_room_for() -> None:
    """Of a cube's sides a strip as high as the tip's radius and no more than 2 percent higher.

    Of the underside all, and of the top nothing.
    """
    scenery, obstacles = scene("table")
    polyhedron = object_from_plant(*scenery.asked).polyhedron
    regions = erode(polyhedron, edge_clearance=0.001)
    for r in (0.004, 0.01):
        clear = with_tip_room(regions, polyhedron, r, obstacles)
        for nhat, area in zip(-regions.nhat_TB_B, clear.area, strict=True):
            if abs(nhat[2]) > 0.5:
                assert area == pytest.approx(0.058**2 if nhat[2] > 0 else 0.0)
            else:
                assert 0.059 - 1.02 * r <= area / 0.058 <= 0.059 - r + 1e-9
        assert shapely.is_empty(clear.polygon_F).sum() == 1


def test_what_is_ignored_is_no_obstacle() -> None:
    scenery, obstacles = scene("table")
    plant = scenery.plant
    body = plant.GetBodyByName("table")
    (geometry,) = plant.GetCollisionGeometriesForBody(body)
    assert obstacles.names == ("table::table",)
    ignored: list[RigidBody | GeometryId | Any] = [body, body.model_instance(), geometry]
    for item in ignored:
        assert not obstacles_from_plant(*scenery.asked, ignore=[item]).names
    with pytest.raises(UsageError, match="'table' cannot be ignored"):
        obstacles_from_plant(*scenery.asked, ignore=["table"])  # type: ignore[list-item]


def test_what_is_far_away_costs_and_changes_nothing() -> None:
    far = beside(Mesh(str(U_CHANNEL), 1e-3), 0.4)
    plans = []
    for scenery in (world(CUBE, table()), world(CUBE, table(), far)):
        obstacles = obstacles_from_plant(*scenery.asked)
        assert obstacles.names == ("table::table",)
        assert np.array_equal(obstacles.surface_B, scene("table")[1].surface_B)
        plans.append(exact_plan(object_from_plant(*scenery.asked), obstacles=obstacles, top=3))
    for one, other in zip(plans[0].grasps, plans[1].grasps, strict=True):
        assert np.array_equal(one.grasp.p_BC, other.grasp.p_BC)
    assert "Mesh::Mesh" in obstacles_from_plant(*scenery.asked, reach=1.0).names


def test_fingertips_wider_than_the_known_surroundings_are_refused() -> None:
    scenery, _ = scene("table")
    obstacles = obstacles_from_plant(*scenery.asked, reach=0.01)
    with pytest.raises(UsageError, match="greater reach"):
        exact_plan(object_from_plant(*scenery.asked), obstacles=obstacles, tip_radius=0.006)
    for reach in (-1.0, np.nan, np.inf):
        with pytest.raises(UsageError, match="reach is"):
            obstacles_from_plant(*scenery.asked, reach=reach)


def test_the_pose_takes_contacts_to_the_world() -> None:
    scenery, obstacles = scene("table")
    p_BC = np.random.default_rng(0).normal(size=(3, 3))
    frame = scenery.body.body_frame()
    p_WC = scenery.plant.CalcPointsPositions(
        scenery.context, frame, p_BC.T, scenery.plant.world_frame()
    )
    assert (obstacles.X_WB @ p_BC.T).T == pytest.approx(p_WC.T)


def test_moving_the_whole_scene_leaves_obstacles_where_they_are_in_the_body() -> None:
    X_WV = RigidTransform(RollPitchYaw(0.7, -1.1, 2.0), [3.0, -2.0, 1.0])
    seen = []
    for X in (RigidTransform(), X_WV):
        top = anchored("table", Box(1.0, 0.8, 0.05), X @ RigidTransform([0.2, 0.0, -0.025]))
        ball = anchored(
            "ball", Ellipsoid(0.01, 0.02, 0.03), X @ X_WB @ RigidTransform([0.06, 0, 0])
        )
        scenery = world(CUBE, top, ball, X_WB=X @ X_WB)
        seen.append(obstacles_from_plant(*scenery.asked))
    here, there = seen
    assert there.surface_B == pytest.approx(here.surface_B, abs=1e-12)
    assert np.array_equal(there.closed, here.closed)
    assert there.X_WB.IsNearlyEqualTo(X_WV @ here.X_WB, 1e-12)
