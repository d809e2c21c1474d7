"""glTF meshes are planned on as Drake collides with them, and read only where that is safe."""

from __future__ import annotations

import base64
import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import ModelError
from drake_polygrasp.files.grasp_file import save_grasps
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.mesh_file import check_mesh_file
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.plant.certify_in_plant import certify_in_plant
from drake_polygrasp.verification.report import Status
from drake_polygrasp.verification.verify import verify_file
from tests.support.convex_polyhedra import prism
from tests.support.planned import exact_plan

L_PROFILE = shapely.Polygon(
    [(0.0, 0.0), (0.1, 0.0), (0.1, 0.02), (0.02, 0.02), (0.02, 0.1), (0.0, 0.1)]
)
URDF = """<robot name="r" xmlns:drake="x"><link name="part"><inertial><mass value="0.4"/>
<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><mesh filename="part.gltf">{}</mesh></geometry></collision></link></robot>"""


def gltf(triangles: Array) -> dict[str, Any]:
    vertices, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    positions = vertices.astype("<f4")
    data = positions.tobytes() + index.astype("<u2").tobytes()
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data), "uri": uri_of(data)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions.nbytes},
            {"buffer": 0, "byteOffset": positions.nbytes, "byteLength": 2 * index.size},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5123, "count": index.size, "type": "SCALAR"},
        ],
    }


def uri_of(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


PART = gltf(prism(L_PROFILE, 0.03))


def write(folder: Path, document: dict[str, Any], declaration: str = "") -> Path:
    (folder / "part.gltf").write_text(json.dumps(document))
    (folder / "part.urdf").write_text(URDF.format(declaration))
    return folder / "part.urdf"


def exposed_area(object_: GraspObject) -> float:
    return sum(face.polygon_F.area for face in object_.polyhedron.faces)


@pytest.mark.parametrize("declaration", ["", "<drake:declare_convex/>"])
def test_a_gltf_is_its_convex_hull_as_drake_collides_with_it(
    declaration: str, tmp_path: Path
) -> None:
    object_ = load_object(write(tmp_path, PART, declaration), mu=0.5)
    hull = L_PROFILE.convex_hull
    assert exposed_area(object_) == pytest.approx(2 * hull.area + 0.03 * hull.length, rel=1e-6)
    said = [warning for warning in object_.warnings if "convex hull" in warning]
    assert len(said) == (not declaration)
    assert all("part.gltf" in warning and "convert it to .obj" in warning for warning in said)
    grasp = exact_plan(object_, top=1).grasps[0].grasp
    verdicts = certify_in_plant(object_, grasp, tip_radius=0.002).verdicts
    assert {v.name: v.verdict for v in verdicts}["geometry"] == "holds"


def test_a_buffer_in_a_file_of_its_own_is_part_of_the_model(tmp_path: Path) -> None:
    document = copy.deepcopy(PART)
    data = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    document["buffers"][0]["uri"] = "part.bin"
    (tmp_path / "part.bin").write_bytes(data)
    object_ = load_object(write(tmp_path, document), mu=0.5)
    plan, file = exact_plan(object_, top=1), tmp_path / "part.grasp.yaml"
    save_grasps(file, object_, plan.grasps, replace(plan.settings, mu=0.5))
    assert verify_file(file).grasps[0].surface.status is Status.RECOMPUTED
    (tmp_path / "part.bin").write_bytes(data + b"\0")
    surface = verify_file(file).grasps[0].surface
    assert surface.status is Status.FAILED
    assert "sha256 differs" in surface.reason


def put(*path: str | int, value: object) -> Callable[[dict[str, Any]], None]:
    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return change


SPOILED = {
    "no nodes": (put("nodes", value=[]), "number 0 of 0 nodes"),
    "no meshes": (put("meshes", value=[]), "number 0 of 0 meshes"),
    "a node beyond": (put("scenes", 0, "nodes", value=[5]), "number 5 of 1 nodes"),
    "a circle": (put("nodes", 0, "children", value=[0]), "nodes contain themselves"),
    "two parents": (
        put("nodes", value=[{"children": [2]}, {"children": [2]}, {"mesh": 0}]),
        "node 2 has two parents",
    ),
    "too many positions": (put("accessors", 0, "count", value=10**9), "beyond its buffer"),
    "too many indices": (put("accessors", 1, "count", value=10**6), "beyond its buffer"),
    "an offset beyond": (put("accessors", 0, "byteOffset", value=10**6), "beyond its buffer"),
    "a view beyond": (put("bufferViews", 1, "byteLength", value=10**6), "beyond its buffer"),
    "a negative count": (put("accessors", 0, "count", value=-3), "count is -3, not a size"),
    "a short buffer": (put("buffers", 0, "uri", value=uri_of(b"abc")), "bytes has 3"),
    "a missing buffer": (put("buffers", 0, "uri", value="gone.bin"), "gone.bin: there is no such"),
    "positions missing": (put("meshes", 0, "primitives", 0, "attributes", value={}), "POSITION"),
    "positions beyond": (
        put("meshes", 0, "primitives", 0, "attributes", "POSITION", value=7),
        "number 7 of 2 accessors",
    ),
    "a strange number": (put("accessors", 0, "componentType", value=99), "not valid glTF"),
    "an old version": (put("asset", "version", value="1.0"), "not glTF of version 2"),
}


@pytest.mark.parametrize("name", SPOILED)
def test_a_gltf_that_leads_nowhere_is_refused_by_name(name: str, tmp_path: Path) -> None:
    change, fault = SPOILED[name]
    document = copy.deepcopy(PART)
    write(tmp_path, document)
    check_mesh_file(tmp_path / "part.gltf")
    change(document)
    write(tmp_path, document)
    with pytest.raises(ModelError, match=fault) as error:
        check_mesh_file(tmp_path / "part.gltf")
    assert str(tmp_path) in str(error.value)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"asset": 3}', "glTF\x02"])
def test_what_is_no_gltf_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "part.gltf").write_text(content)
    with pytest.raises(ModelError, match=r"part\.gltf: it is no"):
        check_mesh_file(tmp_path / "part.gltf")
