"""XML that people write is read where Drake reads it, and refused with a reason where not."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.loading.xml_reader import MAX_DEPTH, elements_at, parse_xml
from tests.support.fuzz import CUBE_OBJ

MASS = 0.3
MODELS = {
    "urdf": '<robot name="r"><link name="l"><inertial><mass value="0.3"/><inertia ixx="0.001" '
    'iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>'
    '<box size="0.06 0.08 0.1"/></geometry></collision></link></robot>',
    "sdf": '<sdf version="1.7"><model name="r"><link name="l"><inertial><mass>0.3</mass>'
    '</inertial><collision name="c"><geometry><box><size>0.06 0.08 0.1</size></box></geometry>'
    "</collision></link></model></sdf>",
    "xml": '<mujoco model="r"><worldbody><body name="l"><freejoint/>'
    '<geom type="box" size="0.03 0.04 0.05" mass="0.3"/></body></worldbody></mujoco>',
}
DECLARATION = '<?xml version="1.0"?>\n'
LINK = 'name="l">'


def inside(what: str) -> Callable[[str], str]:
    """Puts text after the tag of the link."""
    return lambda model: DECLARATION + model.replace(LINK, LINK + what, 1)


def attribute(what: str) -> Callable[[str], str]:
    """Puts text among the attributes of the link."""
    return lambda model: DECLARATION + model.replace(LINK, f"{LINK[:-1]} {what}>", 1)


def around(before: str, after: str = "") -> Callable[[str], str]:
    return lambda model: before + model + after


def in_root(what: str) -> Callable[[str], str]:
    return lambda model: DECLARATION + model.replace(">", f" {what}>", 1)


QUIRKS: dict[str, Callable[[str], str]] = {
    "nothing": around(""),
    "a declaration": around(DECLARATION),
    "-- in a comment": inside("<!-- a -- b --->"),
    "a short comment": inside("<!-->x-->"),
    "a blank line first": around("\n" + DECLARATION),
    "a byte order mark": around("\ufeff" + DECLARATION),
    "a byte order mark after a blank line": around("\n\ufeff" + DECLARATION),
    "two declarations": around(DECLARATION + "<?model 1?>"),
    "a declaration after a comment": around("<!-- a -->" + DECLARATION),
    "& in an attribute": attribute('x="nuts & bolts"'),
    "an unknown reference": attribute('x="&foo;"'),
    "a reference beyond characters": attribute('x="&#xFFFFFFFF;&#0;&#X41;"'),
    "< in an attribute": attribute('x="a < b"'),
    "& in text": inside("nuts & bolts"),
    "CDATA": inside("<![CDATA[ a < b ]]>"),
    "Latin-1 in a comment": inside("<!-- caf\udce9 -->"),
    "Latin-1 that is declared": around(
        '<?xml version="1.0" encoding="ISO-8859-1"?><!-- caf\udce9 -->'
    ),
    "an encoding that is none": around('<?xml version="1.0" encoding="klingon"?>'),
    "UTF-16 that is none": around('<?xml version="1.0" encoding="UTF-16"?>'),
    "version 1.1": around('<?xml version="1.1"?>'),
    "a prefix without declaration": inside('<foo:bar foo:baz="1"/>'),
    "an attribute's prefix without declaration": attribute('drake:x="1"'),
    "a default namespace": in_root('xmlns="https://drake.mit.edu"'),
    "line ends of old": lambda model: DECLARATION.replace("\n", "\r") + model.replace("><", ">\r<"),
    "line ends of Windows": lambda model: DECLARATION + model.replace("><", ">\r\n<"),
    "an attribute twice": attribute('x="1" x="2"'),
    "attributes in a row": attribute('x="1"y="2"'),
    "an attribute without quotes": attribute("x=1"),
    "an attribute without value": attribute("x"),
    "spaces about =": attribute("x = '1'"),
    "a line end in an attribute": attribute('x="1\n2"'),
    "text after the root": around("", "hello"),
    "text before a comment after the root": around("", "hello<!-- -->"),
    "text before the root": around("hello"),
    "another root after": around("", "<foo/>"),
    "another root before": around("<foo/>"),
    "an end too many": around("", "</foo>"),
    "an end before the root": around("</foo>"),
    "no end": lambda model: model[: model.rindex("<")],
    "a document type": around("<!DOCTYPE robot>"),
    "a document type of its own": around('<!DOCTYPE r SYSTEM "x.dtd" [<!ELEMENT a (b)>]>'),
    "an instruction inside": inside("<?foo bar?>"),
    "an instruction after": around("", "<?foo bar?>"),
    "a null character after": around("", "\0garbage<"),
    "a control character": inside("<!-- \x01 -->"),
    "spaces in tags": lambda model: model.replace("<geom", "< geom").replace("</link>", "</link >"),
    "a space after /": lambda model: model.replace("</link>", "</ link>").replace(
        "</body>", "</ body>"
    ),
    "an end with attributes": lambda model: model.replace("</link>", "</link a='1'>"),
    "an end that is empty": inside("<b><a></a/></a></b>"),
    "names that begin with a digit": inside("<1a/>"),
    "names of other letters": inside("<été été='1'/>"),
    "an unended comment": around("", "<!-- x"),
    "what is no tag": inside("<<a/>"),
    "deep elements": inside(400 * "<a>" + 400 * "</a>"),
    "deeper elements": inside(600 * "<a>" + 600 * "</a>"),
    "vertical white space": attribute('\vx="1"\f'),
    "space of no break": attribute('\xa0x="1"'),
}
REFUSED_BY_DRAKE = {
    "a declaration after a comment",
    "an attribute twice",
    "an attribute without quotes",
    "an attribute without value",
    "text after the root",
    "an end before the root",
    "no end",
    "an instruction inside",
    "an instruction after",
    "a space after /",
    "names that begin with a digit",
    "an unended comment",
    "what is no tag",
    "deeper elements",
}
"""Of URDF; SDF has a schema besides."""


def drake_reads(model_file: Path) -> bool:
    plant = MultibodyPlant(0.0)
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        Parser(plant).AddModels(str(model_file))
    except (Exception, SystemExit):
        return False
    finally:
        logger.setLevel(level)
    return plant.num_bodies() == 2 and plant.get_body(BodyIndex(1)).default_mass() == MASS


@pytest.mark.parametrize("kind", MODELS)
@pytest.mark.parametrize("quirk", QUIRKS)
def test_what_drake_reads_is_read_alike(quirk: str, kind: str, tmp_path: Path) -> None:
    model_file = tmp_path / f"model.{kind}"
    text = QUIRKS[quirk](MODELS[kind])
    model_file.write_bytes(text.encode(errors="surrogateescape"))
    reads = drake_reads(model_file)
    if kind == "urdf":
        assert reads == (quirk not in REFUSED_BY_DRAKE)
    if reads:
        object_ = load_object(model_file)
        assert object_.mass == MASS
        assert not [warning for warning in object_.warnings if "states no mass" in warning]


def test_random_marks_are_read_alike(tmp_path: Path) -> None:
    pieces = [
        *("<", ">", "/>", "</", "&", "&amp;", "&#65;", '"', "'", "=", "-", "--", "<!--", "-->"),
        *("<?", "?>", "<!", "<![CDATA[", "]]>", " ", "\r", "\n", "a", "b:c", ":", "1", "\ufeff"),
        *('<a x="1">', "</a>", "<a/>", "caf\udce9", "\x01"),
    ]
    rng = np.random.default_rng(0)
    read = refused = 0
    model = DECLARATION + MODELS["urdf"]
    for _ in range(600):
        marks = "".join(rng.choice(pieces, rng.integers(1, 5)))
        where = int(rng.integers(len(model) + 1))
        content = (model[:where] + marks + model[where:]).encode(errors="surrogateescape")
        model_file = tmp_path / "model.urdf"
        model_file.write_bytes(content)
        if drake_reads(model_file):
            read += 1
            masses = [
                mass.get("value")
                for robot in parse_xml(content)
                for mass in elements_at(robot, ("link", "inertial", "mass"))
            ]
            assert "0.3" in masses, content
        else:
            refused += 1
    # The marks are of both kinds, or the test says little.
    assert read > 50
    assert refused > 50


def test_names_and_values_are_those_of_the_file() -> None:
    (root,) = parse_xml(
        b"<a x='1 &lt; 2 &#65;&#x42; & c' drake:y='\r\n'><b:c> text\r<d/>tail</b:c>caf\xe9</a>"
    )
    assert root.attrib == {"x": "1 < 2 AB & c", "drake:y": "\n"}
    (child,) = elements_at(root, ["b:c"])
    assert child.text == " text\n"
    assert [element.tag for element in root.iter()] == ["a", "b:c", "d"]
    assert parse_xml(b"  \n") == []


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"<a>\n<b>\n</a>", "line 3: </a> ends <b>"),
        (b"<a>\n", "line 2: <a> is not ended"),
        (b"<" + 1_000_000 * b"a", "line 1: an attribute of <aaa"),
        (b"<a\nx=1/>", "line 1: an attribute of <a> or its end is malformed"),
        (b"<a x='1'\nx='2'/>", "line 1: attribute 'x' is stated twice"),
        (b"\n<a/>b", "line 2: text stands after the last tag"),
        (b"<a><!-- </a>", "line 1: what begins here is not ended by '-->'"),
        (b"<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "line 1: it declares entities"),
        ((MAX_DEPTH + 1) * b"<a>", f"nested over {MAX_DEPTH} deep"),
    ],
)
def test_what_is_not_read_is_refused_with_its_line(content: bytes, reason: str) -> None:
    with pytest.raises(ValueError) as error:
        parse_xml(content)
    assert reason in str(error.value)
    assert len(str(error.value)) < 200


def test_entities_in_a_comment_harm_nobody() -> None:
    (root,) = parse_xml(b"<!-- <!ENTITY a 'b'> --><a/>")
    assert root.tag == "a"


@pytest.mark.parametrize("name", ["r", "l"])
def test_a_name_that_python_cannot_ask_for_is_refused(name: str, tmp_path: Path) -> None:
    """Drake reads it, but its Python bindings cannot return it."""
    model_file = tmp_path / "model.urdf"
    text = MODELS["urdf"].replace(f'name="{name}"', 'name="caf\udce9"')
    model_file.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(ModelError, match=r"the name 'caf.udce9' of a .* is not UTF-8 text"):
        load_object(model_file)
    model_file.write_bytes(text.encode(errors="surrogateescape").decode("latin-1").encode())
    assert load_object(model_file).mass == MASS


def test_a_mesh_may_have_a_name_of_any_bytes(tmp_path: Path) -> None:
    mesh = '<mesh filename="caf\udce9.obj"/>'
    text = MODELS["urdf"].replace('<box size="0.06 0.08 0.1"/>', mesh)
    (tmp_path / "caf\udce9.obj").write_text(CUBE_OBJ)
    model_file = tmp_path / "model.urdf"
    model_file.write_bytes(text.encode(errors="surrogateescape"))
    assert load_object(model_file).mass == MASS
