"""Links on a body's joints cover its faces and leave fingertips no room, as they stand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from drake_polygrasp import (
    GraspFileError,
    ModelError,
    certify_in_plant,
    load_grasps,
    load_object,
    object_from_plant,
    obstacles_from_plant,
    save_grasps,
    verify_file,
)
from drake_polygrasp.cli.main import main
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface_contact import locate_contacts
from drake_polygrasp.visualization.scene import draw_object
from tests.support.planned import exact_plan

BASE = "0.1 0.08 0.05"
LID = '<box size="0.1 0.08 0.01"/>'
HINGE = "-0.05 0 0.025"
"""On the upper edge of the base at its left."""

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(content: str) -> Path:
        path = tmp_path / "box.urdf"
        path.write_text(content)
        return path

    return write


def link(name: str, *shapes: tuple[str, str], mass: float | None = 0.3) -> str:
    """A link with shapes at places."""
    inertial = (
        ""
        if mass is None
        else f'<inertial><mass value="{mass}"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" '
        'ixz="0" iyz="0"/></inertial>'
    )
    collisions = (
        f'<collision><origin xyz="{xyz}"/><geometry>{shape}</geometry></collision>'
        for shape, xyz in shapes
    )
    return f'<link name="{name}">{inertial}{"".join(collisions)}</link>'


def joint(kind: str, parent: str, child: str, xyz: str = "0 0 0", axis: str = "0 1 0") -> str:
    return (
        f'<joint name="{parent}_{child}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
    )


def urdf(*elements: str) -> str:
    return f'<robot name="r">{"".join(elements)}</robot>'


def base(mass: float | None = 0.3) -> str:
    return link("base", (f'<box size="{BASE}"/>', "0 0 0"), mass=mass)


def with_lid(lid: str = LID, xyz: str = "0.05 0 0.005", mass: float | None = 0.3) -> str:
    """The lid's geometry is at `xyz` from the hinge."""
    return urdf(
        base(mass),
        link("lid", (lid, xyz), mass=0.05),
        joint("revolute", "base", "lid", HINGE),
    )


def area(polyhedron: Polyhedron, nhat_B: tuple[float, float, float]) -> float:
    """Of the faces of an outward normal [m^2]."""
    return sum(
        face.polygon_F.area for face in polyhedron.faces if face.R_BF[:, 2] @ nhat_B > 1 - 1e-9
    )


def test_no_contact_is_beneath_a_lid_unless_it_is_ignored(write: Write) -> None:
    path = write(with_lid())
    shut, free = (load_object(path, body_name="base", joints_free=f) for f in (False, True))
    assert [area(o.polyhedron, (0, 0, 1)) for o in (shut, free)] == pytest.approx([0, 0.008])
    for side in ((0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)):
        assert area(shut.polyhedron, side) == pytest.approx(area(free.polyhedron, side))
    for one in (shut, free):
        assert one.mass == pytest.approx(0.3)
        assert one.rho == pytest.approx(np.linalg.norm([0.05, 0.04, 0.025]))
        assert one.polyhedron.diameter == pytest.approx(2 * np.linalg.norm([0.05, 0.04, 0.025]))
        assert one.polyhedron.watertight
    top = np.array([[0.01, 0.02, 0.025]]), np.array([[0.0, 0.0, -1.0]])
    assert (
        locate_contacts(shut.polyhedron, *top).face[0]
        < 0
        <= locate_contacts(free.polyhedron, *top).face[0]
    )
    assert "links on its joints, 'lid', stay where they are" in shut.warnings[0]
    assert "mass is not counted" in shut.warnings[0]
    assert shut.warnings[0].endswith("; --joints-free (joints_free=True) ignores them")
    assert "links on its joints, 'lid', are ignored, as asked for" in free.warnings[0]


@pytest.mark.parametrize(
    ("lid", "xyz", "top", "side"),
    [
        # Over half of the base, and a quarter of it.
        ('<box size="0.05 0.08 0.01"/>', "0.025 0 0.005", 0.004, 0.004),
        ('<box size="0.05 0.04 0.01"/>', "0.025 0 0.005", 0.006, 0.004),
        # 5 mm deep in the base, at its edge: it ends in the plane of the side, and hides it.
        ('<box size="0.02 0.02 0.02"/>', "0.01 0 0.005", 0.008 - 0.0004, 0.004 - 0.02 * 0.005),
        # A ball, halfway in; the hole is drawn around the facets that stand for it.
        ('<sphere radius="0.02"/>', "0.05 0 0", 0.008 - np.pi * 0.0004, 0.004),
        # Above the base: it covers nothing.
        ('<box size="0.1 0.08 0.01"/>', "0.05 0 0.015", 0.008, 0.004),
    ],
)
def test_faces_lose_what_links_on_joints_cover(
    lid: str, xyz: str, top: float, side: float, write: Write
) -> None:
    polyhedron = load_object(write(with_lid(lid, xyz)), body_name="base").polyhedron
    tolerance = 0.01 if "sphere" in lid else 1e-6
    assert area(polyhedron, (0, 0, 1)) == pytest.approx(top, rel=tolerance)
    assert area(polyhedron, (-1, 0, 0)) == pytest.approx(side, rel=1e-6)


def test_a_link_on_a_joint_leaves_no_room_for_wider_tips_than_its_gap(write: Write) -> None:
    """A wall stands 6 mm beside the base's right side, all along it."""
    wall = link("wall", ('<box size="0.01 0.2 0.2"/>', "0.061 0 0"), mass=1.0)
    path = write(urdf(base(), wall, joint("prismatic", "base", "wall", axis="1 0 0")))
    object_ = load_object(path, body_name="base")
    assert area(object_.polyhedron, (1, 0, 0)) == pytest.approx(0.004)
    for tip_radius, has_room in ((0.0029, True), (0.0031, False)):
        plan = exact_plan(object_, top=100, tip_radius=tip_radius)
        normals = np.concatenate([g.grasp.nhat_TB_B for g in plan.grasps])
        assert (normals[:, 0] < -0.9).any() == has_room


def test_a_hollow_box_that_a_lid_shuts_has_no_inside_to_touch(write: Write) -> None:
    walls = (
        ('<box size="0.1 0.08 0.005"/>', "0 0 -0.0225"),
        ('<box size="0.005 0.08 0.05"/>', "0.0475 0 0"),
        ('<box size="0.005 0.08 0.05"/>', "-0.0475 0 0"),
        ('<box size="0.1 0.005 0.05"/>', "0 0.0375 0"),
        ('<box size="0.1 0.005 0.05"/>', "0 -0.0375 0"),
    )
    lid = link("lid", (LID, "0.05 0 0.005"), mass=0.1)
    path = write(urdf(link("base", *walls), lid, joint("revolute", "base", "lid", HINGE)))
    shut, free = (
        load_object(path, body_name="base", joints_free=f).polyhedron for f in (False, True)
    )
    floor = np.array([[0.0, 0.0, -0.02]]), np.array([[0.0, 0.0, -1.0]])
    assert locate_contacts(shut, *floor).face[0] < 0 <= locate_contacts(free, *floor).face[0]
    assert area(shut, (1, 0, 0)) == pytest.approx(0.004)
    assert area(free, (1, 0, 0)) == pytest.approx(0.004 + 0.07 * 0.045)


def test_without_stated_mass_the_centre_is_that_of_the_body_alone(write: Write) -> None:
    lid = '<box size="0.05 0.08 0.01"/>'
    object_ = load_object(write(with_lid(lid, "0.025 0 0.005", mass=None)), body_name="base")
    assert object_.mass is None
    assert object_.p_BBcm == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_joints_are_followed_both_ways_but_neither_freely_nor_through_the_world(
    write: Write,
) -> None:
    """Lid and base hang on each other, a knob on the lid; a door hangs on the world."""
    path = write(
        urdf(
            '<link name="world"/>',
            base(),
            link("lid", (LID, "0.05 0 0.005")),
            link("knob", ('<sphere radius="0.01"/>', "0 0 0.02")),
            link("door", (LID, "0 0 -0.03")),
            link("ball", ('<sphere radius="0.01"/>', "0 0.045 0")),
            joint("revolute", "base", "lid", HINGE),
            joint("fixed", "lid", "knob", "0.05 0 0"),
            joint("revolute", "world", "door"),
        )
    )

    def named(body: str) -> str:
        return next(w for w in load_object(path, body_name=body).warnings if "on its joints" in w)

    assert "joints, 'lid', 'knob', stay" in named("base")
    assert "joints, 'base', stay" in named("knob")
    for body in ("door", "ball"):
        object_ = load_object(path, body_name=body)
        assert not any("on its joints" in warning for warning in object_.warnings)
        assert not object_.polyhedron.is_covered
    assert any("joined to the world" in w for w in load_object(path, body_name="door").warnings)


def test_a_large_link_far_away_changes_nothing(write: Write) -> None:
    far = link("far", ('<box size="50 50 50"/>', "0 0 30"))
    path = write(urdf(base(), far, joint("revolute", "base", "far")))
    one, other = (load_object(path, body_name="base", joints_free=f) for f in (False, True))
    assert one.rho == other.rho
    assert [f.polygon_F.area for f in one.polyhedron.faces] == pytest.approx(
        [f.polygon_F.area for f in other.polyhedron.faces]
    )


def test_files_say_how_links_on_joints_were_taken_and_verify_repeats_it(
    write: Write, tmp_path: Path
) -> None:
    path, file = write(with_lid()), tmp_path / "box.grasp.yaml"
    for joints_free in (False, True):
        object_ = load_object(path, body_name="base", joints_free=joints_free)
        plan = exact_plan(object_, top=1)
        save_grasps(file, object_, plan.grasps, plan.settings)
        assert load_grasps(file).object_.joints_free == joints_free
        assert ("joints_free: true" in file.read_text()) == joints_free
        assert verify_file(file, plant=True).holds
    text = file.read_text()
    file.write_text(text.replace("joints_free: true\n", ""))
    assert not verify_file(file).holds
    file.write_text(text.replace("joints_free: true", "joints_free: 1"))
    with pytest.raises(GraspFileError, match="joints_free is 1, not true or false"):
        load_grasps(file)


def test_the_command_says_once_what_became_of_links_on_joints(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, file = str(write(with_lid())), str(tmp_path / "box.grasp.yaml")
    common = ["plan", path, "--top", "1", "-o", file]
    assert main(common) == 2
    assert "several bodies to grasp: 'base', 'lid'" in capsys.readouterr().err
    for options, said in (([], "stay where they are"), (["--joints-free"], "are ignored")):
        assert main([*common, "--body", "base", *options]) == 0
        lines = [w for w in capsys.readouterr().err.splitlines() if "links on its joints" in w]
        assert len(lines) == 1
        assert said in lines[0]
        assert main(["verify", file]) == 0
        assert said in capsys.readouterr().err
    assert main(["show", file, "--joints-free", "--html", str(tmp_path / "a.html")]) == 2
    assert "and whether joints are free; leave them out" in capsys.readouterr().err


def test_links_on_joints_are_drawn(write: Write) -> None:
    meshcat, path = Meshcat(), write(with_lid())
    for joints_free in (False, True):
        draw_object(meshcat, load_object(path, body_name="base", joints_free=joints_free))
        assert meshcat.HasPath("polygrasp/object/links_on_joints") != joints_free


def test_a_plant_keeps_links_on_joints_locked(write: Write) -> None:
    path = write(with_lid(xyz="0.05 0 0.008"))  # 3 mm above the base
    shut, free = (load_object(path, body_name="base", joints_free=f) for f in (False, True))
    plan = exact_plan(free, top=100, tip_radius=0.002)
    best = next(g for g in plan.grasps if (g.grasp.nhat_TB_B[:, 2] < -0.9).any())
    for object_, verdict in ((free, "holds"), (shut, "does not hold")):
        report = certify_in_plant(
            object_, best.grasp, best.certificate.internal_force, tip_radius=0.002
        )
        geometry = next(v for v in report.verdicts if v.name == "geometry")
        assert geometry.verdict == verdict
    assert "penetrates 'lid' by 0.001 m" in geometry.reason


Scene = tuple[MultibodyPlant, Diagram, Context]


def in_plant(path: Path, angle: float) -> Scene:
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.001)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    state = plant.GetMyMutableContextFromRoot(root)
    plant.GetJointByName("base_lid").set_angle(state, angle)
    return plant, diagram, state


def test_in_a_plant_links_on_joints_stand_as_the_context_says(write: Write) -> None:
    path = write(with_lid())
    for angle, top in ((0.0, 0.0), (-np.pi / 2, 0.008)):
        plant, _diagram, context = in_plant(path, angle)
        body = plant.GetBodyByName("base")
        object_ = object_from_plant(plant, body, context)
        assert area(object_.polyhedron, (0, 0, 1)) == pytest.approx(top)
        assert "they cover faces" in object_.warnings[-1]
        # The lid is in the scene whether the object counts it or not.
        assert obstacles_from_plant(plant, body, context).names == ("r::lid",)
    with pytest.raises(ModelError, match=r"links on its joints differs in size .*joints_free"):
        object_from_plant(plant, body, context, model_file=path)
    filed = object_from_plant(plant, body, context, model_file=path, joints_free=True)
    assert filed.source is not None
    assert filed.source.joints_free
    plant, _diagram, context = in_plant(path, 0.0)
    same = object_from_plant(plant, plant.GetBodyByName("base"), context, model_file=path)
    assert same.polyhedron.is_covered


def test_the_lid_is_no_obstacle_to_itself(write: Write) -> None:
    plant, _diagram, context = in_plant(write(with_lid()), 0.0)
    lid = plant.GetBodyByName("lid")
    obstacles = obstacles_from_plant(plant, lid, context)
    assert obstacles.names == ("r::base",)
    X_BL = RigidTransform([-0.05, 0.0, 0.025])
    assert obstacles.X_WB.IsNearlyEqualTo(
        plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("base")) @ X_BL, 1e-12
    )
