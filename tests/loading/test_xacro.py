"""A URDF document that xacro has still to expand is refused, not read without the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.object_model import load_object

BOX = '<collision><geometry><box size="1 1 1"/></geometry></collision>'


def urdf(link: str, rest: str = "") -> str:
    """A robot of one link; Drake does not ask for the declaration of xacro's prefix."""
    return f'<robot name="r"><link name="a">{link}</link>{rest}</robot>'


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (urdf(BOX, '<xacro:handle length="1"/>'), "<xacro:handle>"),
        (urdf(BOX + '<xacro:mass_of_box m="1"/>'), "<xacro:mass_of_box>"),
        (urdf(BOX, '<xacro:if value="$(arg lid)"><link name="b"/></xacro:if>'), "<xacro:if>"),
        (urdf(BOX.replace("1 1 1", "${w} 1 1")), "size='${w} 1 1' of <box>"),
        (urdf(f'<inertial><mass value="$(arg m)"/></inertial>{BOX}'), "value='$(arg m)' of <mass>"),
    ],
    ids=["a call", "a call in a link", "a condition", "a size", "a mass"],
)
def test_what_xacro_would_replace_is_named(text: str, named: str, tmp_path: Path) -> None:
    path = tmp_path / "part.urdf"
    path.write_text(text)
    with pytest.raises(ModelError) as error:
        load_object(path)
    assert f"{named} is xacro" in str(error.value)
    assert "'xacro part.urdf -o NEW.urdf'" in str(error.value)


def test_definitions_that_add_nothing_to_the_model_are_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "part.urdf"
    defined = (
        '<xacro:property name="w" value="2"/><xacro:arg name="lid" default="0"/>'
        '<xacro:macro name="handle"><link name="${name}"/><xacro:handle/></xacro:macro>'
    )
    path.write_text(urdf(BOX, defined))
    area = sum(face.polygon_F.area for face in load_object(path).polyhedron.faces)
    assert area == pytest.approx(6.0)
    path.write_text(urdf(BOX.replace("<collision>", '<collision name="${n}">'), defined))
    assert len(load_object(path).polyhedron.faces) == 6
