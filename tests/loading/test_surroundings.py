"""In the user's scene, a fingertip that penetrates a neighbour is a fault that names it."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydrake.geometry import Box, Cylinder, HalfSpace, Mesh
from pydrake.math import RigidTransform

from drake_polygrasp import (
    ModelError,
    PlantReport,
    Surroundings,
    UsageError,
    certify_in_plant,
    load_object,
    load_surroundings,
    obstacles_from_plant,
    rank_in_plant,
    surroundings_from_plant,
    verify_file,
)
from drake_polygrasp.cli.main import main
from drake_polygrasp.grasp import Verdict
from drake_polygrasp.loading.surroundings import obstacles_of
from tests.loading.test_plant_objects import CUBE, X_WB, Furnish, anchored, welded, world
from tests.support.planned import exact_plan
from tests.support.plant_scenes import MODELS, cube_grasp, model

TIP = 0.002
HOLDS, FAILS = Verdict.HOLDS, Verdict.FAILS
NOTCHED = MODELS / "u_channel" / "u_channel.obj"


def around(*furnish: Furnish, **options: Any) -> Surroundings:
    return surroundings_from_plant(*world(CUBE, *furnish).asked, **options)


def report(surroundings: Surroundings | None) -> PlantReport:
    return certify_in_plant(model("cube"), cube_grasp(), tip_radius=TIP, surroundings=surroundings)


def wall(gap: float, name: str = "wall") -> Furnish:
    """A body whose face is parallel to the cube's x = 0.03, at a gap [m] from it."""
    X_BG = RigidTransform([0.03 + gap + 0.1, 0.0, 0.0])
    return welded(name, Box(0.2, 0.2, 0.2), X_WB @ X_BG)


def test_a_tip_penetrates_a_wall_by_what_is_left_of_its_diameter() -> None:
    """Fingertip 1 is a sphere of 4 mm across at x = 0.03; the wall leaves it 3 mm."""
    refused = report(around(wall(1.5 * TIP)))
    geometry = refused.verdicts[2]
    assert geometry.verdict is FAILS
    assert geometry.reason == "fingertip 1 penetrates 'wall::wall' by 0.001 m"
    assert geometry.margin == pytest.approx(-0.5 * TIP, abs=1e-5)
    assert refused.settings["surroundings"] == ("wall::wall",)
    assert refused.settings["surroundings_used_in"] == "geometry"


def test_what_is_said_is_the_deepest_penetration() -> None:
    """Two walls that leave fingertip 1 3 and 2 mm of its 4, the worse one last."""
    geometry = report(around(wall(1.5 * TIP), wall(1.0 * TIP, "nearer"))).verdicts[2]
    assert geometry.reason == "fingertip 1 penetrates 'nearer::nearer' by 0.002 m"
    assert geometry.margin == pytest.approx(-1.0 * TIP, abs=1e-5)


def test_a_wall_that_leaves_room_changes_no_verdict() -> None:
    alone, beside = report(None), report(around(wall(2.5 * TIP)))
    assert beside.verdicts == alone.verdicts
    assert beside.holds
    assert "surroundings" not in alone.settings


def test_a_table_beneath_is_in_nobodys_way_and_bears_no_load() -> None:
    """The cube stands on it; its grasp is level with the centre and is simulated in the air."""
    on_table = report(around(anchored("table", HalfSpace(), RigidTransform())))
    assert on_table.verdicts == report(None).verdicts
    assert on_table.settings["surroundings"] == ("table",)


def test_a_mesh_is_its_true_surface_and_not_its_hull() -> None:
    """The cube stands in a U of 7 cm inside, all of it within the hull of the U."""

    def U(x: float) -> Furnish:
        X_BG = RigidTransform([x, 0.0, -0.05])
        return welded("U", Mesh(str(NOTCHED), 1e-3), X_WB @ X_BG)

    assert report(around(U(0.0))).verdicts[2].verdict is HOLDS
    # 2 mm to the left, it leaves 3 mm for a fingertip of 4.
    refused = report(around(U(-0.002))).verdicts[2]
    assert refused.reason == "fingertip 1 penetrates 'U::U' by 0.001 m"


def test_what_is_ignored_is_not_there() -> None:
    scenery = world(CUBE, wall(1.5 * TIP))
    instance = scenery.plant.GetModelInstanceByName("wall")
    assert surroundings_from_plant(*scenery.asked, ignore=[instance]).parts == ()


def test_what_is_planned_around_a_scene_passes_in_it() -> None:
    table = anchored("table", HalfSpace(), RigidTransform())
    scenery = world(CUBE, table, wall(0.001))
    surroundings = surroundings_from_plant(*scenery.asked)

    def verdicts(top: int, **options: Any) -> set[Verdict]:
        plan = exact_plan(model("cube"), top=top, **options)
        ranked = rank_in_plant(model("cube"), plan, surroundings=surroundings)
        return {grasp.plant.verdicts[2].verdict for grasp in ranked.grasps if grasp.plant}

    assert verdicts(2, obstacles=obstacles_from_plant(*scenery.asked)) == {HOLDS}
    # Of the three pairs of opposite faces, as good as one another, two have no room.
    assert FAILS in verdicts(6)


SCENE = """\
directives:
- add_model: {{name: my_cube, file: package://scene/cube.sdf, default_free_body_pose: {{cube: {{
    base_frame: world, translation: [0.4, 0.3, 0.03]}}}}}}
- add_model: {{name: wall, file: package://scene/wall.urdf}}
- add_weld: {{parent: world, child: "wall::wall", X_PC: {{translation: [{x}, 0.3, 0.1]}}}}
"""
WALL = """\
<robot name="wall"><link name="wall">
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.2 0.4 0.4"/></geometry></collision>
</link></robot>
"""


def scene(folder: Path, x: float) -> Path:
    """The cube, under another name, and a wall whose middle is at x [m]."""
    shutil.copy(CUBE, folder)
    (folder / "package.xml").write_text("<package><name>scene</name></package>")
    (folder / "wall.urdf").write_text(WALL)
    (folder / "scene.dmd.yaml").write_text(SCENE.format(x=x))
    return folder / "scene.dmd.yaml"


def test_a_scene_of_directives_is_found_by_the_name_of_its_body(tmp_path: Path) -> None:
    surroundings = load_surroundings(scene(tmp_path, 0.6), model("cube"))
    ((name, _, X_BG),) = surroundings.parts
    assert name == "wall::wall"
    np.testing.assert_allclose(X_BG.translation(), [0.2, 0.0, 0.07], atol=1e-12)


def test_verify_asks_in_the_users_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    scene(tmp_path, 0.6)
    assert main(["plan", "cube.sdf", "--top", "1"]) == 0
    command = ["verify", "cube.grasp.yaml", "--plant", "--scene", "scene.dmd.yaml"]
    assert main([*command, "-o", "new.yaml"]) == 0
    assert "the scene has wall::wall: regarded in geometry" in capsys.readouterr().out
    block = yaml.safe_load(Path("new.yaml").read_text())["grasps"][0]["plant"]
    assert block["settings"]["surroundings"] == ["wall::wall"]
    # The wall is pushed into the cube, and fingertips with it.
    scene(tmp_path, 0.46)
    capsys.readouterr()
    assert main(command) == 1
    assert "penetrates 'wall::wall' by" in capsys.readouterr().out


def test_a_scene_without_the_object_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no body 'brick'"):
        load_surroundings(scene(tmp_path, 0.6), model("brick"))


def test_a_scene_with_another_solid_of_that_name_is_refused(tmp_path: Path) -> None:
    directives = scene(tmp_path, 0.6)
    text = CUBE.read_text().replace("0.06 0.06 0.06", "0.06 0.06 0.08")
    (tmp_path / "cube.sdf").write_text(text)
    with pytest.raises(ModelError, match=r"scene\S+ holds another object: .* geometry differs"):
        load_surroundings(directives, model("cube"))


def test_a_scene_is_for_a_plant(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", "x.grasp.yaml", "--scene", "s.dmd.yaml"]) == 2
    assert "--plant" in capsys.readouterr().err
    with pytest.raises(UsageError, match="plant=True"):
        verify_file(tmp_path / "x", scene=tmp_path)


TWINS = """\
directives:
- add_model: {{name: one, file: package://scene/cube.sdf}}
- add_model: {{name: {other}, file: package://scene/cube.sdf,
    default_free_body_pose: {{cube: {{base_frame: world, translation: [0.2, 0, 0]}}}}}}
"""


def test_of_twins_the_one_of_the_models_name_is_grasped(tmp_path: Path) -> None:
    directives = scene(tmp_path, 0.6)
    directives.write_text(TWINS.format(other="another"))
    with pytest.raises(ModelError, match=r"several bodies 'cube'; give the model .* name 'cube'"):
        load_surroundings(directives, model("cube"))
    directives.write_text(TWINS.format(other="cube"))
    ((name, _, X_BG),) = load_surroundings(directives, model("cube")).parts
    assert name == "one::cube"
    np.testing.assert_allclose(X_BG.translation(), [-0.2, 0.0, 0.0], atol=1e-12)


LID = """\
<robot name="cube"><link name="cube">
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.06 0.06 0.06"/></geometry></collision></link>
<link name="lid">
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.06 0.06 0.002"/></geometry></collision></link>
<joint name="hinge" type="revolute"><parent link="cube"/><child link="lid"/><axis xyz="0 1 0"/>
  <origin xyz="0 0 0.032"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>
"""


@pytest.mark.parametrize("joints_free", [False, True])
def test_a_lid_on_a_joint_is_the_objects_own_and_no_neighbour(
    tmp_path: Path, joints_free: bool
) -> None:
    directives = scene(tmp_path, 0.6)
    directives.write_text(directives.read_text().replace("cube.sdf", "lid.urdf"))
    (tmp_path / "lid.urdf").write_text(LID)
    lidded = load_object(tmp_path / "lid.urdf", body_name="cube", mu=0.3, joints_free=joints_free)
    assert load_surroundings(directives, lidded, mu=0.3).names == ("wall::wall",)


def test_surroundings_are_the_obstacles_of_the_same_scene() -> None:
    ground = anchored("ground", HalfSpace(), X_WB @ RigidTransform([0.0, 0.0, -0.03]))
    pole = anchored("pole", Cylinder(0.01, 0.2), X_WB @ RigidTransform([0.08, 0.0, 0.0]))
    far = anchored("far", Box(0.1, 0.1, 0.1), X_WB @ RigidTransform([3.0, 0.0, 0.0]))
    scene = (ground, wall(0.01), pole, far)
    expected = obstacles_from_plant(*world(CUBE, *scene).asked, reach=0.2)
    found = obstacles_of(around(*scene), model("cube"), 0.2)
    assert found.names == expected.names == ("ground", "wall::wall", "pole")
    p_B = np.random.default_rng(0).uniform(-0.12, 0.12, (500, 3))
    # Poses differ by the rounding of the cube's pose in the world, so the last bits do.
    for reach in (0.0, 0.01):
        assert (found.block(p_B, reach) == expected.block(p_B, reach)).all()
    assert 0 < found.block(p_B, 0.0).sum() < 500
