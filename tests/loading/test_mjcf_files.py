"""Files that an MJCF model is made of: those that Drake opens, wherever they are stated."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.model_source import model_digest, read_model_files
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.loading.packages import find_packages
from tests.support.convex_polyhedra import prism
from tests.support.solids import regular_polygon

ASSET = '<asset><mesh name="cube" file="cube.obj"/></asset>'
BODY = '<body name="b"><freejoint/><geom type="mesh" mesh="cube"/></body>'
WORLD = f"<worldbody>{BODY}</worldbody>"
INCLUDE = '<include file="sub/part.xml"/>'


def compiler(**attributes: str) -> str:
    return f"<compiler {' '.join(f'{key}={value!r}' for key, value in attributes.items())}/>"


A, B = compiler(meshdir="a"), compiler(meshdir="b")
MODELS = {
    "plain": (ASSET + WORLD, ""),
    "meshdir": (A + ASSET + WORLD, ""),
    "assetdir": (compiler(assetdir="a") + ASSET + WORLD, ""),
    "meshdir before assetdir": (compiler(assetdir="a", meshdir="b") + ASSET + WORLD, ""),
    "stated after the mesh": (ASSET + WORLD + A, ""),
    "the last of several": (A + B + ASSET + WORLD, ""),
    "the last that states one": (A + compiler(angle="degree") + ASSET + WORLD, ""),
    "assetdir after meshdir": (A + compiler(assetdir="b") + ASSET + WORLD, ""),
    "an empty one": (A + compiler(meshdir="") + ASSET + WORLD, ""),
    "included": (INCLUDE + ASSET + WORLD, A),
    "included with the mesh": (INCLUDE + WORLD, A + ASSET),
    "mesh included": (A + INCLUDE + WORLD, ASSET),
    "included after the model's": (B + INCLUDE + ASSET + WORLD, A),
    "included before the model's": (INCLUDE + B + ASSET + WORLD, A),
    "included among assets": (A + f"<asset>{INCLUDE}</asset>" + WORLD, ASSET[7:-8]),
    "included where none is read": (B + ASSET + f"<worldbody>{INCLUDE}</worldbody>", A + BODY),
    "included twice": (INCLUDE + B + INCLUDE + ASSET + WORLD, A),
    "included by an included file": (INCLUDE + WORLD, '<include file="more.xml"/>' + ASSET),
}
"""What the model holds and what the file sub/part.xml holds."""


def write_model(folder: Path, model: str, part: str) -> Path:
    corners = prism(regular_polygon(4), 0.1).reshape(-1, 3).tolist()
    cube = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    cube += "".join(f"f {k} {k + 1} {k + 2}\n" for k in range(1, len(corners), 3))
    for where in (".", "a", "b", "sub", "sub/a", "sub/b"):
        (folder / where).mkdir(exist_ok=True)
        (folder / where / "cube.obj").write_text(cube)
    (folder / "model.xml").write_text(f'<mujoco model="m">{model}</mujoco>')
    (folder / "sub/part.xml").write_text(f"<mujoco>{part}</mujoco>")
    (folder / "more.xml").write_text(f"<mujoco>{B}</mujoco>")
    (folder / "sub/more.xml").write_text(f"<mujoco>{A}</mujoco>")
    return folder / "model.xml"


def mesh_of_drake(model_file: Path) -> Path:
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    Parser(plant, scene_graph).AddModels(str(model_file))
    (geometry,) = plant.GetCollisionGeometriesForBody(plant.GetBodyByName("b"))
    return Path(scene_graph.model_inspector().GetShape(geometry).source().path())


@pytest.mark.parametrize("name", MODELS)
def test_the_mesh_of_the_digest_is_the_one_that_drake_opens(name: str, tmp_path: Path) -> None:
    model_file = write_model(tmp_path, *MODELS[name])
    files = read_model_files(model_file, find_packages(model_file))
    assert list(files.meshes) == [mesh_of_drake(model_file)]
    included = (
        {model_file, tmp_path / "sub/part.xml"} if INCLUDE in MODELS[name][0] else {model_file}
    )
    assert set(files.documents) == included | (
        {tmp_path / "more.xml"} if "by an" in name else set()
    )


def test_every_included_file_and_mesh_counts_for_the_digest(tmp_path: Path) -> None:
    model_file = write_model(tmp_path, *MODELS["included by an included file"])
    digest = model_digest(model_file)
    for name, counts in {
        "sub/part.xml": True,
        "more.xml": True,
        "b/cube.obj": True,
        "sub/more.xml": False,
        "a/cube.obj": False,
    }.items():
        content = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(content + b"\n")
        assert (model_digest(model_file) != digest) == counts
        (tmp_path / name).write_bytes(content)


def test_friction_of_an_included_default_is_stated(tmp_path: Path) -> None:
    default = '<default><geom friction="0.7"/></default>'
    for part, stated in ((default, True), ("", False)):
        (tmp_path / str(stated)).mkdir()
        model_file = write_model(tmp_path / str(stated), INCLUDE + ASSET + WORLD, part)
        warnings = " ".join(load_object(model_file).warnings)
        assert ("states no friction" not in warnings) == stated


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ('<include file="model.xml"/>', "break the circle"),
        ('<asset><include file="sub/part.xml"/></asset>', "break the circle"),
        ('<include file="none.xml"/>', "none.xml: there is no such model file"),
        ("<include/>", "part.xml: an include names no file"),
        ("<open>", "part.xml: cannot be read as XML"),
    ],
)
def test_an_include_that_leads_nowhere_is_named(part: str, message: str, tmp_path: Path) -> None:
    model_file = write_model(tmp_path, INCLUDE + ASSET + WORLD, part)
    with pytest.raises(ModelError, match=message):
        model_digest(model_file)
