"""A mesh file that Drake could not safely read is refused by a sentence that names it."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.mesh_file import MAX_TRIANGLES, check_mesh_file
from tests.support.convex_polyhedra import ellipsoid_hull, write_obj
from tests.support.grasp_files import TETRAHEDRON_VTK

VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
FACES = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

GOOD_OBJ = {
    "plain": VERTICES + FACES,
    "relative indices": VERTICES + "f -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n",
    "relative indices to vertices so far": VERTICES.replace("v 0 0 1\n", "")
    + "f -3 -1 -2\nv 0 0 1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    "textures and normals": VERTICES + "vt 0 0\nvn 0 0 1\n" + FACES.replace(" 4", " 4/1/1"),
    "normals only": VERTICES + "vn 0 0 1\n" + FACES.replace(" 4", " 4//1"),
    "comments and names": "# f 9 9 9\no thing\n" + VERTICES + "usemtl x # f 9 9 9\n" + FACES,
    "windows lines": (VERTICES + FACES).replace("\n", "\r\n"),
    "colours": VERTICES.replace("v 0 0 1", "v 0 0 1 0.5 0.5 0.5") + FACES,
    "exponents": VERTICES.replace("v 0 0 1", "v 0 -0.0 1.0e-2") + FACES,
    "tabs and indents": (VERTICES + FACES).replace("v ", " v\t"),
    "lines for faces": VERTICES + FACES + "f 1 2\nf 1\nf \nl 1 2\np 1\n",
    "lines of old Macs": (VERTICES + FACES).replace("\n", "\r"),
    "a byte order mark": "\ufeff" + VERTICES + FACES,
    "a fourth coordinate": VERTICES.replace("v 0 0 1", "v 0 0 1 1.0") + FACES,
    "groups and spaces": "o a\ng b c\ns off\n" + (VERTICES + FACES).replace("\n", " \t \n"),
    "a corner twice": VERTICES + FACES + "f 1 3 2 2\nf 1 1 2\n",
    "a backslash in a comment": VERTICES + "# C:\\things\\\n" + FACES,
    "a pyramid with a square": VERTICES + "v 1 1 0\nf 1 3 5 2\nf 1 2 4\nf 2 5 4\n",
}

BAD_OBJ = {
    "empty": ("", "at least 4 vertices, it has 0"),
    "too few vertices": (VERTICES.replace("v 0 0 1\n", "") + "f 1 2 3\n" * 4, "at least 4 vert"),
    "no faces": (VERTICES, "at least 4 triangles, it has 0"),
    "too few faces": (VERTICES + "f 1 2 3\nf 1 2 4\n", "at least 4 triangles, it has 2"),
    "a flat coordinate": (VERTICES + "v 0 0\n" + FACES, "fewer than three coordinates"),
    "an index too high": (VERTICES + FACES + "f 1 2 5\n", "vertex 5, but there are 4"),
    "an index far too high": (
        VERTICES + FACES + "f 1 2 999999999\n",
        "vertex 999999999, but",
    ),
    "an index beyond integers": (VERTICES + FACES + f"f 1 2 {10**30}\n", "is not a number"),
    "index zero": (VERTICES + FACES + "f 0 1 2\n", "vertex 0, but there are 4"),
    "an index too low": (VERTICES + FACES + "f -5 1 2\n", "vertex -5, but there are 4"),
    "relative before its vertex": ("v 0 0 0\nf -2 -1 -1\n" + VERTICES + FACES, "vertex -2, but"),
    "not a number": (VERTICES + "v nan 0 0\n" + FACES, "vertex 5 is not finite"),
    "infinite": (VERTICES + "v 0 inf 0\n" + FACES, "vertex 5 is not finite"),
    "overflow": (VERTICES + "v 0 1e999 0\n" + FACES, "vertex 5 is not finite"),
    "beyond measure": (VERTICES + "v 0 -2e9 0\n" + FACES, "vertex 5 lies beyond 1e\\+09"),
    "too many triangles": (VERTICES + (MAX_TRIANGLES // 4 + 1) * FACES, "simplify it"),
    "too many in one polygon": (VERTICES + "f" + (MAX_TRIANGLES + 3) * " 1", "simplify it"),
    "a continued line": (
        VERTICES + FACES + "f 1 2 \\\n3\n",
        "line 9 is continued on the next .* Rhino .* export triangles",
    ),
    "words": (VERTICES + "v a b c\n" + FACES, "'a' is not a number"),
    "broken index": (VERTICES + FACES + "f 1 2 3.5\n", "'3.5' is not a number"),
    "binary": ("\x00\x01\x02" * 100, "at least 4 vertices"),
}

BAD_VTK = {
    "no points": (TETRAHEDRON_VTK.replace("POINTS", "POINT"), "no POINTS"),
    "no cells": (TETRAHEDRON_VTK.replace("CELLS", "CELL"), "no CELLS"),
    "an index too high": (TETRAHEDRON_VTK.replace("0 1 2 3", "0 1 2 4"), "outside 0 to 3"),
    "a negative index": (TETRAHEDRON_VTK.replace("0 1 2 3", "0 1 2 -1"), "outside 0 to 3"),
    "not finite": (TETRAHEDRON_VTK.replace("0 0 1\n", "0 0 nan\n"), "vertex 4 is not finite"),
    "points missing": (TETRAHEDRON_VTK.replace("POINTS 4", "POINTS 40"), "is not a number"),
    "no tetrahedron": (
        TETRAHEDRON_VTK.replace("1 5\n4 0 1 2 3", "1 4\n3 0 1 2"),
        "not all tetrahedra",
    ),
    "too many points": (TETRAHEDRON_VTK.replace("POINTS 4", f"POINTS {10**18}"), "simplify it"),
    "too many cells": (TETRAHEDRON_VTK.replace("CELLS 1 5", f"CELLS {10**18} 5"), "simplify it"),
    "zero cells": (TETRAHEDRON_VTK.replace("1 5\n4 0 1 2 3", "0 0"), "no cells"),
    "broken sizes": (TETRAHEDRON_VTK.replace("1 5", "-1 5"), "missing or negative"),
}


@pytest.mark.parametrize("name", GOOD_OBJ)
def test_what_drake_can_read_passes(name: str, tmp_path: Path) -> None:
    path = tmp_path / "thing.OBJ"
    path.write_bytes(GOOD_OBJ[name].encode())
    check_mesh_file(path)


@pytest.mark.parametrize("name", BAD_OBJ)
def test_a_bad_obj_is_named_with_its_fault(name: str, tmp_path: Path) -> None:
    content, fault = BAD_OBJ[name]
    path = tmp_path / "thing.obj"
    path.write_text(content)
    with pytest.raises(ModelError, match=fault) as error:
        check_mesh_file(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize("name", BAD_VTK)
def test_a_bad_vtk_is_named_with_its_fault(name: str, tmp_path: Path) -> None:
    content, fault = BAD_VTK[name]
    path = tmp_path / "thing.vtk"
    path.write_text(TETRAHEDRON_VTK)
    check_mesh_file(path)
    path.write_text(content)
    with pytest.raises(ModelError, match=fault):
        check_mesh_file(path)


def test_a_missing_or_foreign_mesh_is_named(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"gone\.obj: there is no such mesh file"):
        check_mesh_file(tmp_path / "gone.obj")
    with pytest.raises(ModelError, match=r"thing\.stl: .* convert it to \.obj or \.vtk"):
        check_mesh_file(tmp_path / "thing.stl")


def test_sixteen_thousand_triangles_are_checked_in_a_moment(tmp_path: Path) -> None:
    triangles = ellipsoid_hull(1000, seed=0)
    small = tmp_path / "small.obj"
    write_obj(small, triangles)
    path = tmp_path / "large.obj"
    lines = small.read_text().splitlines()
    vertices = [line for line in lines if line.startswith("v")]
    faces = [line for line in lines if line.startswith("f")]
    path.write_text("\n".join(vertices * 16 + faces * 16))
    start = time.process_time()  # Other processes do not count; each pair of faces would take 60 s.
    check_mesh_file(path)
    assert time.process_time() - start < 10.0
