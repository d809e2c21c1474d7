"""Links fixed to one another are one rigid body, in whatever format and whichever is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import RotationalInertia

from drake_polygrasp import (
    GraspFileError,
    ModelError,
    load_grasps,
    load_object,
    save_grasps,
    verify_file,
)
from drake_polygrasp.geometry.surface_contact import locate_contacts
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.object_model import load_solid
from tests.support.planned import exact_plan

HANDLE, HEAD = (0.03, 0.03, 0.2), (0.12, 0.05, 0.05)
X_BH = RigidTransform(RollPitchYaw(0.2, -0.3, 0.4), [0.01, -0.02, 0.1])
"""Of the head on the handle."""

Write = Callable[[str, str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(name: str, content: str) -> Path:
        path = tmp_path / name
        path.write_text(content)
        return path

    return write


def words(numbers: object) -> str:
    return " ".join(map(repr, np.asarray(numbers, dtype=float).tolist()))


def principal(mass: float, size: tuple[float, float, float]) -> list[float]:
    """Moments of inertia of a box about its centre."""
    x, y, z = np.square(size)
    return [mass / 12 * s for s in (y + z, x + z, x + y)]


def urdf_inertial(mass: float, size: tuple[float, float, float]) -> str:
    ixx, iyy, izz = principal(mass, size)
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" '
        'ixz="0" iyz="0"/></inertial>'
    )


def urdf_link(
    name: str, size: tuple[float, float, float] | None, mass: float | None, mu: float | None = 0.4
) -> str:
    inertial = "" if mass is None else urdf_inertial(mass, size or (0.1, 0.1, 0.1))
    friction = (
        ""
        if mu is None
        else f'<drake:proximity_properties><drake:mu_static value="{mu}"/><drake:mu_dynamic '
        f'value="{mu}"/></drake:proximity_properties>'
    )
    shape = f'<geometry><box size="{words(size)}"/></geometry>' if size else ""
    return f'<link name="{name}">{inertial}' + (
        f"<collision>{shape}{friction}</collision></link>" if size else "</link>"
    )


def urdf_joint(parent: str, child: str, X_PC: RigidTransform | None = None) -> str:
    X = X_PC or RigidTransform()
    rpy = RollPitchYaw(X.rotation()).vector()
    return (
        f'<joint name="{parent}_{child}" type="fixed"><parent link="{parent}"/>'
        f'<child link="{child}"/>'
        f'<origin xyz="{words(X.translation())}" rpy="{words(rpy)}"/></joint>'
    )


def urdf(*elements: str) -> str:
    return f'<robot name="hammer" xmlns:drake="drake.mit.edu">{"".join(elements)}</robot>'


def hammer_urdf() -> str:
    return urdf(
        urdf_link("handle", HANDLE, 0.2),
        urdf_link("head", HEAD, 0.8, 0.6),
        urdf_joint("handle", "head", X_BH),
    )


def sdf_collision(size: tuple[float, float, float], mu: float, pose: str = "") -> str:
    return (
        f'<collision name="c{mu}">{pose}<geometry><box><size>{words(size)}</size></box></geometry>'
        f"<drake:proximity_properties><drake:mu_static>{mu}</drake:mu_static><drake:mu_dynamic>"
        f"{mu}</drake:mu_dynamic></drake:proximity_properties></collision>"
    )


def sdf_inertial(mass: float, size: tuple[float, float, float]) -> str:
    ixx, iyy, izz = principal(mass, size)
    return (
        f"<inertial><mass>{mass}</mass><inertia><ixx>{ixx}</ixx><iyy>{iyy}</iyy><izz>{izz}</izz>"
        "</inertia></inertial>"
    )


def sdf(content: str) -> str:
    return (
        '<sdf version="1.9" xmlns:drake="drake.mit.edu"><model name="hammer">'
        f"{content}</model></sdf>"
    )


def pose_of_head() -> str:
    return f"{words(X_BH.translation())} {words(RollPitchYaw(X_BH.rotation()).vector())}"


def hammer_sdf() -> str:
    return sdf(
        f'<link name="handle">{sdf_inertial(0.2, HANDLE)}{sdf_collision(HANDLE, 0.4)}</link>'
        f'<link name="head"><pose relative_to="handle">{pose_of_head()}</pose>'
        f"{sdf_inertial(0.8, HEAD)}{sdf_collision(HEAD, 0.6)}</link>"
        '<joint name="j" type="fixed"><parent>handle</parent><child>head</child></joint>'
    )


def hammer_mjcf() -> str:
    def inertial(mass: float, size: tuple[float, float, float]) -> str:
        return f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{words(principal(mass, size))}"/>'

    def geom(size: tuple[float, float, float], mu: float) -> str:
        return f'<geom type="box" size="{words(np.array(size) / 2)}" friction="{mu}"/>'

    quaternion = words(X_BH.rotation().ToQuaternion().wxyz())
    head = (
        f'<body name="head" pos="{words(X_BH.translation())}" quat="{quaternion}">'
        f"{inertial(0.8, HEAD)}{geom(HEAD, 0.6)}</body>"
    )
    return (
        '<mujoco model="hammer"><worldbody><body name="handle"><freejoint/>'
        f"{inertial(0.2, HANDLE)}{geom(HANDLE, 0.4)}{head}</body></worldbody></mujoco>"
    )


def single_link_sdf() -> str:
    """The same two boxes on one link."""
    pose = f"<pose>{pose_of_head()}</pose>"
    return sdf(
        f'<link name="handle"><inertial><mass>1</mass></inertial>{sdf_collision(HANDLE, 0.4)}'
        f"{sdf_collision(HEAD, 0.6, pose)}</link>"
    )


def same_surface(one: GraspObject, other: GraspObject) -> None:
    here, there = one.polyhedron, other.polyhedron
    assert here.triangles_B == pytest.approx(there.triangles_B, abs=1e-14)
    assert [face.mu for face in here.faces] == [face.mu for face in there.faces]
    area = [[face.polygon_F.area for face in p.faces] for p in (here, there)]
    assert area[0] == pytest.approx(area[1], rel=1e-9)


@pytest.mark.parametrize(
    ("name", "content"),
    [("h.urdf", hammer_urdf()), ("h.sdf", hammer_sdf()), ("h.xml", hammer_mjcf())],
)
def test_fixed_links_are_one_body_as_if_all_their_geometry_were_on_one_link(
    name: str, content: str, write: Write
) -> None:
    hammer = load_object(write(name, content))
    same_surface(hammer, load_object(write("one.sdf", single_link_sdf())))
    assert hammer.mass == pytest.approx(1.0)
    assert hammer.p_BBcm == pytest.approx(0.8 * X_BH.translation())
    assert hammer.source is not None
    assert (hammer.source.body_name, hammer.source.links) == ("handle", ("handle", "head"))
    assert "'handle', 'head' are fixed to one another" in hammer.warnings[0]


def test_the_inertia_is_that_of_all_links_by_the_parallel_axis_theorem(write: Write) -> None:
    hammer = load_object(write("h.urdf", hammer_urdf()))
    assert hammer.source is not None
    p, R = X_BH.translation(), X_BH.rotation().matrix()
    about_head = R @ np.diag(principal(0.8, HEAD)) @ R.T
    shifted = 0.8 * (p @ p * np.eye(3) - np.outer(p, p))
    expected = np.diag(principal(0.2, HANDLE)) + about_head + shifted
    M_BBo_B = load_solid(hammer.source).M_BBo_B
    rotational: RotationalInertia = M_BBo_B.CalcRotationalInertia()
    assert rotational.CopyToFullMatrix3() == pytest.approx(expected, rel=1e-12)
    assert M_BBo_B.get_mass() == pytest.approx(1.0)


def test_whichever_link_is_named_it_is_the_same_body_in_another_frame(write: Write) -> None:
    path = write("h.urdf", hammer_urdf())
    handle, head = (load_object(path, body_name=name) for name in ("handle", "head"))
    assert head.mass == handle.mass
    assert head.rho == pytest.approx(handle.rho)
    assert X_BH @ head.p_BBcm == pytest.approx(handle.p_BBcm, abs=1e-11)
    p_HV = head.polyhedron.triangles_B.reshape(-1, 3)
    p_BV = handle.polyhedron.triangles_B.reshape(-1, 3)
    assert (X_BH @ p_HV.T).T == pytest.approx(p_BV, abs=1e-15)
    best = [exact_plan(one, top=1).grasps[0].certificate for one in (handle, head)]
    assert best[0].epsilon_lower == pytest.approx(best[1].epsilon_lower, rel=0.02)


def test_no_contact_is_inside_another_link_and_file_and_plant_hold(tmp_path: Path) -> None:
    """A handle of 0.2 kg through a head of 0.8 kg at 0.1 m."""
    model = tmp_path / "hammer.urdf"
    model.write_text(
        urdf(
            urdf_link("handle", HANDLE, 0.2, None),
            urdf_link("head", HEAD, 0.8, None),
            urdf_joint("handle", "head", RigidTransform([0.0, 0.0, 0.1])),
        )
    )
    hammer = load_object(model)
    assert hammer.mass == pytest.approx(1.0)
    assert hammer.p_BBcm == pytest.approx([0.0, 0.0, 0.08])
    plan = exact_plan(hammer, top=2)
    for certified in plan.grasps:
        within = np.abs(certified.grasp.p_BC - [0.0, 0.0, 0.1]) < np.array(HEAD) / 2 - 1e-9
        assert not within.all(axis=1).any()
    inside = np.array([[0.015, 0.0, 0.08], [0.015, 0.0, 0.05]])
    on_handle = locate_contacts(hammer.polyhedron, inside, np.tile([-1.0, 0.0, 0.0], (2, 1)))
    assert (on_handle.face >= 0).tolist() == [False, True]
    file = tmp_path / "hammer.grasp.yaml"
    save_grasps(file, hammer, plan.grasps, plan.settings)
    assert load_grasps(file).object_.links == ("handle", "head")
    assert verify_file(file, plant=True).holds


def test_a_file_of_another_group_of_links_is_refused(write: Write, tmp_path: Path) -> None:
    hammer = load_object(write("h.urdf", hammer_urdf()))
    plan = exact_plan(hammer, top=1)
    file = tmp_path / "h.grasp.yaml"
    save_grasps(file, hammer, plan.grasps, plan.settings)
    text = file.read_text()
    assert "links: [handle, head]" in text
    file.write_text(text.replace("links: [handle, head]", "links: [handle, grip]"))
    report = verify_file(file)
    assert not report.holds
    assert "the model's are ['handle', 'head']" in report.grasps[0].surface.reason
    for spoilt in ("[handle]", "[]", "[handle, 3]"):
        file.write_text(text.replace("links: [handle, head]", f"links: {spoilt}"))
        with pytest.raises(GraspFileError, match="names of two links or more"):
            load_grasps(file)


def test_chains_of_frames_count_for_nothing_but_are_followed(write: Write) -> None:
    """Base and flange have neither geometry nor mass; a weight of 0.3 kg has no geometry."""
    X = RigidTransform([0.1, 0.0, 0.0])
    path = write(
        "chain.urdf",
        urdf(
            urdf_link("base", None, None),
            urdf_link("block", HEAD, 0.5),
            urdf_link("flange", None, None),
            urdf_link("weight", None, 0.3),
            urdf_joint("base", "block", X),
            urdf_joint("block", "flange", X),
            urdf_joint("flange", "weight", X),
        ),
    )
    chain = load_object(path)
    assert chain.source is not None
    assert chain.source.body_name == "base"
    assert chain.source.links == ("base", "block", "flange", "weight")
    assert chain.mass == pytest.approx(0.8)
    assert chain.p_BBcm == pytest.approx([(0.5 * 0.1 + 0.3 * 0.3) / 0.8, 0.0, 0.0])
    low, high = (f(chain.polyhedron.triangles_B.reshape(-1, 3), axis=0) for f in (np.min, np.max))
    assert low == pytest.approx([0.04, -0.025, -0.025])
    assert high == pytest.approx([0.16, 0.025, 0.025])


def test_a_link_that_states_no_mass_or_no_friction_is_named(write: Write) -> None:
    path = write(
        "h.urdf",
        urdf(
            urdf_link("handle", HANDLE, 0.2),
            urdf_link("head", HEAD, None, None),
            urdf_joint("handle", "head"),
        ),
    )
    hammer = load_object(path)
    assert hammer.mass is None
    assert any(
        "its mass is unknown, as the model states none of 'head'" in w for w in hammer.warnings
    )
    assert any("link 'head' states no friction" in w for w in hammer.warnings)
    assert not any("link 'handle' states no friction" in w for w in hammer.warnings)
    assert {face.mu for face in hammer.polyhedron.faces} == {0.3, 0.4}


def test_what_is_fixed_to_the_world_is_planned_as_if_free_and_apart(write: Write) -> None:
    world, block = '<link name="world"/>', urdf_link("block", HEAD, 0.5)
    alone = load_object(write("one.urdf", urdf(world, block, urdf_joint("world", "block"))))
    assert alone.mass == pytest.approx(0.5)
    assert alone.source is not None
    assert alone.source.links == ()
    assert any("joined to the world ('world_block')" in w for w in alone.warnings)
    two = urdf(
        world,
        block,
        urdf_link("handle", HANDLE, 0.2),
        urdf_joint("world", "block", RigidTransform([0.5, 0.0, 0.0])),
        urdf_joint("world", "handle"),
    )
    path = write("two.urdf", two)
    with pytest.raises(ModelError, match="several bodies to grasp: 'block', 'handle'"):
        load_object(path)
    assert load_object(path, body_name="handle").mass == pytest.approx(0.2)


def test_several_rigid_bodies_are_told_apart_by_their_base_links(write: Write) -> None:
    """SDF states the child first; the other body is free."""
    content = sdf(
        f'<link name="tip">{sdf_inertial(0.1, HEAD)}{sdf_collision(HEAD, 0.4)}</link>'
        f'<link name="stem">{sdf_inertial(0.2, HANDLE)}{sdf_collision(HANDLE, 0.4)}</link>'
        f'<link name="ball"><pose>1 0 0 0 0 0</pose>{sdf_collision(HANDLE, 0.4)}</link>'
        '<joint name="j" type="fixed"><parent>stem</parent><child>tip</child></joint>'
    )
    path = write("two.sdf", content)
    with pytest.raises(ModelError, match="several bodies to grasp: 'stem', 'ball'"):
        load_object(path)
    assert load_object(path, body_name="tip").mass == pytest.approx(0.3)
    no_ball = content[: content.index('<link name="ball">')] + content[content.index("<joint") :]
    whole = load_object(write("one.sdf", no_ball))
    assert whole.source is not None
    assert (whole.source.body_name, whole.source.links) == ("stem", ("tip", "stem"))


def test_a_mere_frame_may_state_a_mass_of_0_and_a_solid_may_not(write: Write) -> None:
    weightless = '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0"/></inertial>'
    frame = f'<link name="tool">{weightless}</link>'
    content = urdf(urdf_link("block", HEAD, 0.5), frame, urdf_joint("block", "tool"))
    tooled = load_object(write("tooled.urdf", content))
    assert tooled.mass == pytest.approx(0.5)
    box = f'<collision><geometry><box size="{words(HEAD)}"/></geometry></collision>'
    solid = content.replace(frame, f'<link name="tool">{weightless}{box}</link>')
    with pytest.raises(ModelError, match="link 'tool' has a mass that is not above 0"):
        load_object(write("solid.urdf", solid))


def test_links_of_one_name_in_nested_models_are_told_apart(write: Write, tmp_path: Path) -> None:
    inner = f'<model name="inner"><link name="a">{sdf_inertial(0.3, HEAD)}'
    inner += f"{sdf_collision(HEAD, 0.4)}</link></model>"
    path = write(
        "nested.sdf",
        sdf(
            f'<link name="a">{sdf_inertial(0.2, HANDLE)}{sdf_collision(HANDLE, 0.4)}</link>{inner}'
            '<joint name="j" type="fixed"><parent>a</parent><child>inner::a</child></joint>'
        ),
    )
    with pytest.raises(ModelError, match="'hammer::a', 'hammer::inner::a'"):
        load_object(path, body_name="a")
    for body, links in (
        ("hammer::a", {"a", "hammer::inner::a"}),
        ("hammer::inner::a", {"a", "hammer::a"}),
    ):
        nested = load_object(path, body_name=body)
        assert nested.mass == pytest.approx(0.5)
        assert nested.source is not None
        assert set(nested.source.links) == links
        plan, file = exact_plan(nested, top=1), tmp_path / "nested.grasp.yaml"
        save_grasps(file, nested, plan.grasps, plan.settings)
        assert verify_file(file).holds


def test_models_that_directives_weld_are_one_body(write: Write) -> None:
    write("package.xml", "<package><name>here</name></package>")
    block = f'<link name="block">{sdf_inertial(0.5, HEAD)}{sdf_collision(HEAD, 0.4)}</link>'
    write("block.sdf", sdf(block))
    path = write(
        "stack.dmd.yaml",
        "directives:\n"
        "- add_model: {name: low, file: package://here/block.sdf}\n"
        "- add_model: {name: high, file: package://here/block.sdf}\n"
        "- add_weld: {parent: low::block, child: high::block, X_PC: {translation: [0, 0, 0.05]}}\n",
    )
    stack = load_object(path)
    assert stack.mass == pytest.approx(1.0)
    assert stack.p_BBcm == pytest.approx([0.0, 0.0, 0.025])
    assert len(stack.polyhedron.faces) == 6
    assert stack.source is not None
    assert (stack.source.model_name, stack.source.links) == ("low", ("block", "high::block"))


def test_what_is_left_out_of_the_body_is_named(write: Write) -> None:
    """Links of a static model hang on the world one by one; constraints are no joints."""
    static = sdf(
        f'<static>true</static><link name="a">{sdf_collision(HEAD, 0.4)}</link>'
        f'<link name="b">{sdf_collision(HANDLE, 0.4)}</link>'
    )
    fixed = load_object(write("static.sdf", static), body_name="a")
    line = next(w for w in fixed.warnings if "joined to the world" in w)
    assert line.endswith("without the world's other bodies: 'b'")
    geom = '<geom type="box" size=".1 .1 .1"/>'
    connected = "".join(f'<body name="{name}"><freejoint/>{geom}</body>' for name in "ab")
    mjcf = (
        f'<mujoco model="m"><worldbody>{connected}</worldbody><equality>'
        '<connect body1="a" body2="b" anchor="0 0 .1"/></equality></mujoco>'
    )
    tied = load_object(write("tied.xml", mjcf), body_name="a")
    assert any("constraints of the model tie to it are left out" in w for w in tied.warnings)
