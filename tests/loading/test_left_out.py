"""What Drake leaves out of a model without a word, a warning names."""

from __future__ import annotations

from pathlib import Path

import pytest

from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.object_model import load_object
from tests.support.object_files import write_all

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))
CUBE += "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def area(path: Path) -> float:
    return sum(face.polygon_F.area for face in load_object(path).polyhedron.faces)


def test_repeated_geoms_of_mjcf_are_missing_and_named(tmp_path: Path) -> None:
    geom = '<geom type="box" size=".5 .5 .5"/>'
    row = f'<replicate count="3" offset="2 0 0">{geom}</replicate>'
    text = '<mujoco model="m"><worldbody><body name="b"><freejoint/>{}</body></worldbody></mujoco>'
    write_all(tmp_path, {"row.xml": text.format(geom + row), "one.xml": text.format(geom)})
    assert area(tmp_path / "row.xml") == pytest.approx(6.0)  # Drake has one cube of the four.
    told = [w for w in load_object(tmp_path / "row.xml").warnings if "<replicate>" in w]
    assert len(told) == 1
    assert "row.xml" in told[0]
    assert "write the copies out" in told[0]
    assert not any("replicate" in w for w in load_object(tmp_path / "one.xml").warnings)
    write_all(tmp_path, {"none.xml": text.format(row)})
    with pytest.raises(ModelError, match=r"no collision geometry on 'b'.*reads no <replicate>"):
        load_object(tmp_path / "none.xml")


def test_a_part_of_a_mesh_is_all_of_it_and_named(tmp_path: Path) -> None:
    mesh = "<mesh><uri>cube.obj</uri>{}</mesh>"
    text = (
        '<sdf version="1.7"><model name="m"><link name="b"><collision name="c"><geometry>{}'
        "</geometry></collision></link></model></sdf>"
    )
    part = text.format(mesh.format("<submesh><name>lid</name></submesh>"))
    whole = text.format(mesh.format(""))
    write_all(tmp_path, {"cube.obj": CUBE, "part.sdf": part, "whole.sdf": whole})
    assert area(tmp_path / "part.sdf") == pytest.approx(6.0)
    told = [w for w in load_object(tmp_path / "part.sdf").warnings if "<submesh>" in w]
    assert len(told) == 1
    assert "takes all of cube.obj" in told[0]
    assert not any("submesh" in w for w in load_object(tmp_path / "whole.sdf").warnings)
