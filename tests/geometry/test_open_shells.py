"""Pieces of a surface that share no edges face the way that all of them together tell.

The lids of these solids have more vertices on their rims than the walls, as many CAD programs write
them: no edge of a lid is an edge of a wall, and each piece is an open shell.
"""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Polyhedron, volume_centroid
from drake_polygrasp.geometry.surface import Part, build_polyhedron

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
HEIGHT = 0.06


def wall(half: float) -> Array:
    """The sides of a square prism, facing away from its axis, shape (8, 3, 3)."""
    triangles = []
    for p, q in zip(SQUARE * half, np.roll(SQUARE, -1, axis=0) * half, strict=True):
        a, b, c, d = ([*p, 0.0], [*q, 0.0], [*q, HEIGHT], [*p, HEIGHT])
        triangles += [[a, b, c], [a, c, d]]
    return np.array(triangles)


def rim(half: float, pieces: int) -> Array:
    """A square with each side in equal pieces, shape (4 pieces, 2)."""
    share = np.linspace(0, 1, pieces, endpoint=False)[:, None]
    sides = zip(SQUARE * half, np.roll(SQUARE, -1, axis=0) * half, strict=True)
    return np.concatenate([p + share * (q - p) for p, q in sides])


def lids(half: float, bore: float, pieces: int) -> Array:
    """Bottom and top, with a square hole unless `bore` is 0, both facing out."""
    out, into = rim(half, pieces), rim(bore, pieces)
    quads = zip(out, np.roll(out, -1, axis=0), np.roll(into, -1, axis=0), into, strict=True)
    flat = [t for p, q, r, s in quads for t in ([p, q, r], [p, r, s])]
    top = np.array(flat if bore else flat[::2])  # Without a hole r and s coincide.
    top = np.concatenate([top, np.full((*top.shape[:2], 1), HEIGHT)], axis=2)
    return np.concatenate([top, top[:, ::-1] * [1.0, 1.0, 0.0]])


def solid(triangles: Array) -> Polyhedron:
    return build_polyhedron([Part(triangles, 0.3)])


def outward(polyhedron: Polyhedron) -> Array:
    return np.array([face.R_BF[:, 2] for face in polyhedron.faces])


@pytest.mark.parametrize("pieces", [1, 2, 3, 7])
@pytest.mark.parametrize("step", [1, -1], ids=["outward", "inside out"])
def test_a_prism_keeps_its_lids(pieces: int, step: int) -> None:
    prism = solid(np.concatenate([wall(0.03), lids(0.03, 0.0, pieces)])[:, ::step])
    axes = np.vstack([np.eye(3), -np.eye(3)])
    assert {tuple(n) for n in outward(prism).round(12) + 0.0} == {tuple(n + 0.0) for n in axes}
    assert sum(face.polygon_F.area for face in prism.faces) == pytest.approx(6 * 0.06**2)
    np.testing.assert_allclose(volume_centroid(prism), [0, 0, HEIGHT / 2], atol=1e-12)


@pytest.mark.parametrize("pieces", [2, 3])
@pytest.mark.parametrize("step", [1, -1], ids=["outward", "inside out"])
def test_the_wall_of_a_bore_faces_its_axis(pieces: int, step: int) -> None:
    """By its own shape it would face the other way: fingers would push from inside the solid."""
    pipe = [wall(0.03), wall(0.015)[:, ::-1], lids(0.03, 0.015, pieces)]
    tube = solid(np.concatenate(pipe)[:, ::step])
    # 4 sides, 4 of the bore and 2 lids; 24 + 12 cm long walls, lids of 36 - 9 cm2.
    assert len(tube.faces) == 10
    area = sum(face.polygon_F.area for face in tube.faces)
    assert area == pytest.approx(0.36 * HEIGHT + 2 * 27e-4)
    for face in tube.faces:
        nhat, middle = face.R_BF[:, 2], face.p_BF + face.R_BF[:, :2] @ _middle(face.polygon_F)
        if abs(nhat[2]) < 0.5:
            away = float(nhat @ middle)
            assert away == pytest.approx(0.03) or away == pytest.approx(-0.015)


def test_an_open_box_that_is_inside_out_beside_one_that_is_not_is_turned() -> None:
    box = np.concatenate([wall(0.03), lids(0.03, 0.0, 1)[:2]])
    both = solid(np.concatenate([box, box[:, ::-1] + [0.2, 0.0, 0.0]]))
    for face in both.faces:
        middle = face.p_BF + face.R_BF[:, :2] @ _middle(face.polygon_F)
        centre = np.array([0.2 * (middle[0] > 0.1), 0.0, HEIGHT / 2])
        assert (middle - centre) @ face.R_BF[:, 2] == pytest.approx(0.03)


def _middle(polygon: shapely.Polygon) -> Array:
    centroid = polygon.centroid
    return np.array([centroid.x, centroid.y])


def test_triangles_that_share_no_vertices_face_outward() -> None:
    """Every triangle is a shell by itself, without a volume of its own."""
    cube = np.concatenate([wall(0.03), lids(0.03, 0.0, 1)])
    rng = np.random.default_rng(3)
    apart = (cube + rng.uniform(-1e-7, 1e-7, cube.shape))[rng.permutation(len(cube))]
    for triangles in (apart, apart[:, ::-1]):
        found = solid(triangles)
        for face in found.faces:
            middle = face.p_BF + face.R_BF[:, :2] @ _middle(face.polygon_F)
            out = middle - [0.0, 0.0, HEIGHT / 2]
            assert out @ face.R_BF[:, 2] == pytest.approx(0.03, abs=1e-6)
        area = sum(face.polygon_F.area for face in found.faces)
        assert area == pytest.approx(6 * 0.06**2, rel=1e-4)
