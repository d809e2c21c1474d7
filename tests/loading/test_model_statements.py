"""Whether a model states friction and mass, of which link: as Drake itself reads it.

Drake is the judge: a coefficient that the file states is another one in Drake's plant when it is
another one in the file. Written as 1, Drake's own default, it must still be known as stated.
"""

from __future__ import annotations

from itertools import count
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.body_object import DEFAULT_MU
from drake_polygrasp.loading.object_model import load_object
from tests.support.fuzz import CUBE_OBJ

MU = "(MU)"
"""Stands for the coefficient in the models below."""
FRICTION_PROPERTY = ("material", "coulomb_friction")
JUDGED = "1.7"
"""The coefficient for Drake to see."""
BOX = "<box><size>0.1 0.1 0.1</size></box>"
ODE = f"<surface><friction><ode><mu>{MU}</mu><mu2>{MU}</mu2></ode></friction></surface>"
BULLET = f"<surface><friction><bullet><friction>{MU}</friction></bullet></friction></surface>"
PROPERTIES = (
    f"<drake:proximity_properties><drake:mu_static>{MU}</drake:mu_static>"
    f"<drake:mu_dynamic>{MU}</drake:mu_dynamic></drake:proximity_properties>"
)


def sdf(*models: str) -> str:
    return f'<sdf version="1.9">{"".join(models)}</sdf>'


def world(*models: str) -> str:
    return sdf(f'<world name="w">{"".join(models)}</world>')


def model(name: str, *parts: str) -> str:
    return f'<model name="{name}">{"".join(parts)}</model>'


def link(*collisions: str, name: str = "link", mass: str = "<mass>2</mass>") -> str:
    return f'<link name="{name}"><inertial>{mass}</inertial>{"".join(collisions)}</link>'


def collision(x: float, extra: str = "", *, name: str = "c", shape: str = BOX) -> str:
    return (
        f'<collision name="{name}"><pose>{x} 0 0 0 0 0</pose><geometry>{shape}</geometry>{extra}'
        "</collision>"
    )


STATED, BARE = link(collision(0, ODE)), link(collision(0))


def include(file: str, name: str = "", merge: str = "") -> str:
    name = f"<name>{name}</name>" if name else ""
    return f"<include {merge}><uri>{file}</uri>{name}</include>"


def urdf(collisions: str, extra: str = "", link_attributes: str = "") -> str:
    return (
        f'<robot name="r" xmlns:drake="x"><link name="link" {link_attributes}><inertial>'
        '<mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"{collisions}</link>{extra}</robot>"
    )


def urdf_box(x: float, extra: str = "", attributes: str = "") -> str:
    return (
        f'<collision {attributes}><origin xyz="{x} 0 0"/><geometry><box size="0.1 0.1 0.1"/>'
        f"</geometry>{extra}</collision>"
    )


URDF_MU = (
    f'<drake:proximity_properties><drake:mu_static value="{MU}"/><drake:mu_dynamic value="{MU}"/>'
    "</drake:proximity_properties>"
)
COMPLIANCE = (
    f"<drake_compliance><static_friction>{MU}</static_friction>"
    f"<dynamic_friction>{MU}</dynamic_friction></drake_compliance>"
)


def mjcf(body: str, before: str = "") -> str:
    return f'<mujoco model="m">{before}<worldbody>{body}</worldbody></mujoco>'


def body(*parts: str, attributes: str = "") -> str:
    return f"<body {attributes}><freejoint/>{''.join(parts)}</body>"


def geom(x: float, attributes: str = "") -> str:
    return f'<geom type="box" size="0.05 0.05 0.05" pos="{x} 0 0" {attributes}/>'


FRICTION = f'friction="{MU} 0 0"'
HIDDEN = 'contype="0" conaffinity="0"'
DROPPED = (
    '<geom type="hfield"/>',
    '<geom type="mesh" mesh="none"/>',
    '<geom type="box" size="1 1 1" fromto="0 0 0 0 0 1"/>',
)


def default(attributes: str, name: str = "", inner: str = "") -> str:
    name = f'class="{name}"' if name else ""
    return f"<default {name}><geom {attributes}/>{inner}</default>"


HINGES = 2 * '<joint type="hinge" axis="1 0 0"/>'

FILES: dict[str, dict[str, str]] = {
    "ode": {"m.sdf": sdf(model("m", STATED))},
    "mu alone": {"m.sdf": sdf(model("m", STATED.replace(f"<mu2>{MU}</mu2>", "")))},
    "proximity properties": {"m.sdf": sdf(model("m", link(collision(0, PROPERTIES))))},
    "bullet": {"m.sdf": sdf(model("m", link(collision(0, BULLET))))},
    "properties of another place": {"m.urdf": urdf(URDF_MU + urdf_box(0))},
    "two collisions": {
        "m.sdf": sdf(model("m", link(collision(0, name="a"), collision(1, ODE, name="b"))))
    },
    "what Drake drops": {
        "m.sdf": sdf(
            model(
                "m",
                link(
                    collision(2, name="a", shape="<cone><radius>1</radius></cone>"),
                    collision(0, ODE, name="b"),
                    collision(2, name="c", shape="<heightmap><uri>h</uri></heightmap>"),
                    collision(1, name="d"),
                ),
            )
        )
    },
    "one name in two models": {"m.sdf": world(model("one", STATED), model("two", BARE))},
    "one name in nested models": {"m.sdf": sdf(model("m", BARE, model("inner", STATED)))},
    "an included model": {
        "m.sdf": world(include("(HERE)/part.sdf", "other"), model("part", BARE)),
        "part.sdf": sdf(model("part", STATED)),
    },
    "a file included twice": {
        "m.sdf": sdf(
            model("m", include("(HERE)/part.sdf", "a"), include("(HERE)/part.sdf", "b"), BARE)
        ),
        "part.sdf": sdf(model("part", STATED)),
    },
    "a merged model": {
        "m.sdf": sdf(
            model("m", include("(HERE)/part.sdf", merge='merge="true"'), model("other", BARE))
        ),
        "part.sdf": sdf(model("part", STATED, model("inner", BARE))),
    },
    "a URDF included": {
        "m.sdf": sdf(model("m", include("(HERE)/part.urdf", "other"), BARE)),
        "part.urdf": urdf(urdf_box(0, URDF_MU)),
    },
    "a folder included": {
        "m.sdf": sdf(model("m", include("(HERE)/thing"), BARE)),
        "thing/model.config": '<model><sdf version="1.9">part.sdf</sdf></model>',
        "thing/part.sdf": sdf(model("part", STATED)),
    },
    "directives": {
        "m.dmd.yaml": "directives:\n"
        "- add_model: {name: one, file: (HERE)/stated.sdf}\n"
        "- add_model: {name: two, file: (HERE)/bare.sdf}\n"
        "- add_model: {name: three, file: (HERE)/stated.sdf}\n"
        "- add_directives: {file: (HERE)/more.dmd.yaml}\n"
        "- add_model_instance: {name: four}\n"
        "- add_directives: {file: (HERE)/more.dmd.yaml, model_namespace: four}\n",
        "more.dmd.yaml": "directives:\n- add_model: {name: part, file: (HERE)/part.urdf}\n",
        "stated.sdf": sdf(model("m", STATED, model("inner", BARE))),
        "bare.sdf": sdf(model("m", BARE)),
        "part.urdf": urdf(urdf_box(0, URDF_MU)),
    },
    "an include by directives": {
        "m.dmd.yaml": "directives:\n- add_model: {name: one, file: (HERE)/world.sdf}\n"
        "- add_model: {name: two, file: (HERE)/world.sdf}\n",
        "world.sdf": world(include("(HERE)/part.sdf", "its_own")),
        "part.sdf": sdf(model("part", STATED, model("inner", BARE))),
    },
    "a world by directives": {
        "m.dmd.yaml": "directives:\n- add_model: {name: one, file: (HERE)/world.sdf}\n",
        "world.sdf": world(model("part", STATED, model("inner", BARE))),
    },
    "an include at the top": {
        "m.sdf": sdf(include("(HERE)/part.sdf", "other")),
        "part.sdf": sdf(model("part", STATED)),
    },
    "names with spaces in MJCF": {
        "m.xml": mjcf(body(geom(0, FRICTION + ' name=" g "'), geom(1), attributes='name=" b "'))
    },
    "names with spaces in URDF": {
        "m.urdf": urdf(urdf_box(0, URDF_MU) + urdf_box(1))
        .replace('"link"', '" l k "')
        .replace('"r"', '" r "')
    },
    "names with spaces": {
        "m.sdf": world(model(" a b ", STATED.replace('"link"', '" l k "')), model("a", BARE)),
    },
    "a merged URDF": {
        "m.sdf": sdf(model("m", include("(HERE)/part.urdf", merge='merge="true"'))),
        "part.urdf": urdf(urdf_box(0, URDF_MU) + urdf_box(1)),
    },
    "an MJCF included": {
        "m.sdf": sdf(model("m", include("(HERE)/part.xml", "other"), BARE)),
        "part.xml": mjcf(body(geom(0, FRICTION), geom(1)) + body(geom(2))),
    },
    "a merged MJCF": {
        "m.sdf": sdf(model("m", include("(HERE)/part.xml", merge='merge="1"'), link(name="other"))),
        "part.xml": mjcf(body(geom(0, FRICTION), geom(1), attributes='name="a"')),
    },
    "an OBJ by directives": {
        "m.dmd.yaml": "directives:\n- add_model: {name: link, file: (HERE)/link.obj}\n"
        "- add_model: {name: one, file: (HERE)/stated.sdf}\n",
        "stated.sdf": sdf(model("m", STATED)),
        "link.obj": CUBE_OBJ,
    },
    "MJCF by directives": {
        "m.dmd.yaml": "directives:\n- add_model: {name: one, file: (HERE)/bare.sdf}\n"
        "- add_model: {name: two, file: (HERE)/part.xml}\n",
        "bare.sdf": sdf(model("m", BARE)),
        "part.xml": mjcf(body(geom(0, FRICTION)) + body(geom(1))),
    },
    "a URDF": {"m.urdf": urdf(urdf_box(0) + urdf_box(1, URDF_MU) + urdf_box(2))},
    "a URDF of compliance": {"m.urdf": urdf(urdf_box(0, COMPLIANCE) + urdf_box(1))},
    "a URDF with names that repeat": {
        "m.urdf": urdf(
            urdf_box(0, attributes='name="a"') + urdf_box(1, URDF_MU, attributes='name="a"')
        )
    },
    "a URDF with a default namespace": {
        "m.urdf": urdf(urdf_box(0, URDF_MU)).replace("<robot", '<robot xmlns="x"')
    },
    "a URDF with other elements": {
        "m.urdf": "<notes/>" + urdf(urdf_box(0), f"<gazebo><link>{urdf_box(1)}</link></gazebo>")
    },
    "Gazebo's friction": {
        "m.urdf": urdf(urdf_box(0), f'<gazebo reference="link"><mu1>{MU}</mu1></gazebo>')
    },
    "PyBullet's friction": {
        "m.urdf": urdf(f'<contact><lateral_friction value="{MU}"/></contact>' + urdf_box(0))
    },
    "MJCF": {"m.xml": mjcf(body(geom(0, FRICTION), geom(1), attributes='name="a"'))},
    "an MJCF body without name": {"m.xml": mjcf(body(geom(0, FRICTION)) + body(geom(1)))},
    "MJCF bodies on several joints": {
        "m.xml": mjcf(
            f"<body>{HINGES}{geom(0)}<body>{HINGES}{geom(1, FRICTION)}</body></body>"
            + body(geom(2))
            + body(geom(3, FRICTION), "<body/>")
        )
    },
    "an MJCF geom for show": {
        "m.xml": mjcf(body(geom(2, HIDDEN), geom(0, FRICTION), geom(3, HIDDEN), geom(1)))
    },
    "MJCF geoms that Drake drops": {
        "m.xml": mjcf(body(*DROPPED, geom(0, FRICTION), *DROPPED, geom(1)))
    },
    "named and unnamed MJCF geoms": {
        "m.xml": mjcf(
            body(geom(0, FRICTION + ' name="x"'), geom(1), geom(2, FRICTION + ' name="y"'))
        )
    },
    "more than numbers in MJCF": {
        "m.xml": mjcf(body(geom(0, FRICTION.replace("0 0", "torsion")), geom(1, 'friction="x"')))
    },
    "MJCF defaults": {"m.xml": mjcf(body(geom(0), geom(1, 'class="other"')), default(FRICTION))},
    "a class of MJCF defaults": {
        "m.xml": mjcf(
            body(geom(0, 'class="grip"'), geom(1)),
            default("", inner=default(FRICTION, "grip") + default("", "slip")),
        )
    },
    "inherited MJCF defaults": {
        "m.xml": mjcf(
            body(geom(0, 'class="in"'), geom(1, 'class="bare"')),
            default(
                FRICTION,
                inner='<default class="bare"><joint/></default>' + default('group="3"', "in"),
            ),
        )
    },
    "the class of an MJCF body": {
        "m.xml": mjcf(
            body(
                geom(0),
                geom(1, 'class="slip"'),
                f'<body><joint type="hinge"/>{geom(2)}</body>',
                attributes='childclass="grip"',
            )
            + body(geom(3)),
            default("", inner=default(FRICTION, "grip") + default("", "slip")),
        )
    },
    "an MJCF default that hides": {
        "m.xml": mjcf(
            body(geom(0, FRICTION), geom(1, 'class="visual"')),
            default("", inner=default(HIDDEN + ' friction="0.2"', "visual")),
        )
    },
    "the friction of MJCF pairs": {
        "m.xml": mjcf(body(geom(0, 'name="g"')) + body(geom(1, 'name="h"'))).replace(
            "</mujoco>", f'<contact><pair geom1="g" geom2="h" {FRICTION}/></contact></mujoco>'
        )
    },
    "an MJCF include": {
        "m.xml": mjcf(body(geom(0)), '<include file="part.xml"/>'),
        "part.xml": f"<mujoco>{default(FRICTION)}</mujoco>",
    },
}


def write(folder: Path, files: dict[str, str], mu: str) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_text(text.replace(MU, mu).replace("(HERE)", folder.as_uri()))
    return folder / next(iter(files))


def friction_of_drake(model_file: Path) -> dict[str, list[float]]:
    """The coefficients of each body's collision geometries."""
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    Parser(plant, scene_graph).AddModels(str(model_file))
    inspector = scene_graph.model_inspector()
    found = {}
    for index in range(1, plant.num_bodies()):
        body = plant.get_body(BodyIndex(index))
        properties = [
            inspector.GetProximityProperties(geometry)
            for geometry in plant.GetCollisionGeometriesForBody(body)
        ]
        if properties:
            found[str(body.scoped_name())] = [
                p.GetProperty(*FRICTION_PROPERTY).static_friction()
                if p.HasProperty(*FRICTION_PROPERTY)
                else 1.0  # Drake gives an OBJ file none.
                for p in properties
            ]
    return found


@pytest.mark.parametrize("name", FILES)
def test_friction_is_stated_where_drake_reads_it(name: str, tmp_path: Path) -> None:
    for folder in ("judge", "ours"):
        (tmp_path / folder).mkdir()
    judged = friction_of_drake(write(tmp_path / "judge", FILES[name], JUDGED))
    model_file = write(tmp_path / "ours", FILES[name], "1")
    assert judged
    for body_name, coefficients in judged.items():
        thing = load_object(model_file, body_name=body_name)
        # The boxes stand apart, and each has six faces.
        expected = [
            {float(JUDGED): 1.0, 1.0: DEFAULT_MU}[mu] for mu in coefficients for _ in range(6)
        ]
        assert sorted(face.mu for face in thing.polyhedron.faces) == sorted(expected)
        assumed = any("states no friction" in warning for warning in thing.warnings)
        assert assumed == (DEFAULT_MU in expected)


def test_the_judge_has_seen_both_answers(tmp_path: Path) -> None:
    folders = (tmp_path / str(k) for k in count())
    seen = []
    for files in FILES.values():
        folder = next(folders)
        folder.mkdir()
        judged = friction_of_drake(write(folder, files, JUDGED))
        seen += [mu for coefficients in judged.values() for mu in coefficients]
    assert seen.count(float(JUDGED)) > 20
    assert seen.count(1.0) > 20


UNREAD = {
    "Gazebo's friction": "<gazebo><mu1>",
    "PyBullet's friction": "<contact><lateral_friction>",
    "bullet": "<surface><friction><bullet><friction>",
    "properties of another place": "<drake:proximity_properties><drake:mu_static>",
    "the friction of MJCF pairs": '<contact><pair friction="...">',
}


@pytest.mark.parametrize("name", UNREAD)
def test_friction_that_drake_does_not_read_is_named(name: str, tmp_path: Path) -> None:
    model_file = write(tmp_path, FILES[name], "0.9")
    body_name = next(iter(friction_of_drake(model_file)))
    warnings = load_object(model_file, body_name=body_name).warnings
    (said,) = [warning for warning in warnings if "states no friction" in warning]
    assert f"0.3 is assumed, because Drake reads no friction from {UNREAD[name]}" in said


MASSES: dict[str, tuple[str, str, float | None, list[float]]] = {
    "in a default namespace": (
        "m.urdf",
        urdf(urdf_box(0))
        .replace("<robot", '<robot xmlns="https://drake.mit.edu"')
        .replace("<inertial>", '<inertial><origin xyz="0.01 0 0"/>'),
        2.0,
        [0.01, 0, 0],
    ),
    "of an unnamed MJCF body": (
        "m.xml",
        mjcf(body(geom(0.1, 'mass="0.2"'), geom(0.5, 'mass="2"'))),
        2.2,
        [(0.1 * 0.2 + 0.5 * 2) / 2.2, 0, 0],
    ),
    "of MJCF's default density": ("m.xml", mjcf(body(geom(0.1))), 1.0, [0.1, 0, 0]),
    "with a unit": (
        "m.sdf",
        sdf(model("m", link(collision(1), mass="<mass><!-- kg -->0.4 kg</mass>"))),
        0.4,
        [0] * 3,
    ),
    "of 1 kg": ("m.sdf", sdf(model("m", link(collision(1), mass="<mass>1</mass>"))), 1.0, [0] * 3),
    "of none": ("m.sdf", sdf(model("m", link(collision(1), mass=""))), None, [1, 0, 0]),
    "of none in URDF": (
        "m.urdf",
        urdf(urdf_box(1)).replace('<mass value="2"/>', "").replace("inertial", "other"),
        None,
        [1, 0, 0],
    ),
    "of its geometry": (
        "m.sdf",
        sdf(model("m", link(collision(1), mass=""))).replace(
            "<inertial>", '<inertial auto="true">'
        ),
        1.0,
        [1, 0, 0],
    ),
}


@pytest.mark.parametrize("name", MASSES)
def test_a_mass_is_drake_s_or_none(name: str, tmp_path: Path) -> None:
    file, text, mass, p_BBcm = MASSES[name]
    thing = load_object(write(tmp_path, {file: text}, "1"))
    assert thing.mass == pytest.approx(mass)
    np.testing.assert_allclose(thing.p_BBcm, p_BBcm, atol=1e-12)
    assert any("states no mass" in warning for warning in thing.warnings) == (mass is None)


def test_a_mass_that_drake_does_not_read_is_refused(tmp_path: Path) -> None:
    text = urdf(urdf_box(0)).replace('<mass value="2"/>', "<mass>2</mass>")
    with pytest.raises(ModelError, match="link 'link' has a mass that is not above 0"):
        load_object(write(tmp_path, {"m.urdf": text}, "1"))


def test_links_of_one_name_keep_their_own_mass(tmp_path: Path) -> None:
    bare = link(collision(0), mass="")
    text = world(model("one", STATED), model("two", bare), model("three", STATED))
    model_file = write(tmp_path, {"m.sdf": text}, "1")
    masses = [load_object(model_file, body_name=f"{n}::link").mass for n in ("one", "two", "three")]
    assert masses == [2.0, None, 2.0]
