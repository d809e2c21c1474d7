"""Builds the faces of the exposed surface from collision triangles (for Section 2 of the paper).

A body is a union of closed shells. Coplanar triangles are merged into polygons, and whatever lies
inside or against another shell, or in a sealed cavity, is cut away. On curved or noisy surfaces,
facets are combined into patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, distinct_values, frozen
from drake_polygrasp.errors import ModelError
from drake_polygrasp.geometry.cavities import Cavities, enclose_nothing, find_cavities
from drake_polygrasp.geometry.patches import Patch, check_tolerances, curved_triangles, grow_patches
from drake_polygrasp.geometry.polygons import (
    Polygons,
    areas_of,
    merged,
    restore,
    tidy_polygons,
)
from drake_polygrasp.geometry.polyhedron import Face, Polyhedron
from drake_polygrasp.geometry.primitives import Primitive, sagitta, tessellation
from drake_polygrasp.geometry.sections import Mesh, Plane, covered
from drake_polygrasp.geometry.shells import oriented_shells, weld, without_doubles
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import diameter, face_frame, unit_normals
from drake_polygrasp.vectors import dot, times

_JUST_OUTSIDE = 1e-5
"""Times L, our choice: height over a facet of the points that are tested for being covered."""


@dataclass(frozen=True, eq=False)
class Part:
    """One collision geometry of a body.

    Attributes:
        triangles_B: triangles of either orientation [m], shape (T, 3, 3).
        mu: friction coefficient.
        primitive: the curved solid that the triangles are inscribed in; None if there is none.
        warnings: changes to the geometry of the file, one sentence each.
        own: False for the geometry of another body, which covers faces and is in the way of
            fingertips.
    """

    triangles_B: Array
    mu: float
    primitive: Primitive | None = None
    warnings: tuple[str, ...] = ()
    own: bool = True


def curved_part(primitive: Primitive, mu: float) -> Part:
    """Returns a curved solid as a part.

    Args:
        primitive: the solid.
        mu: its friction coefficient.
    """
    return Part(tessellation(primitive), mu, primitive)


def build_polyhedron(
    parts: Sequence[Part], patch_angle: float | None = None, patch_depth: float | None = None
) -> Polyhedron:
    """Returns the exposed surface of a union of parts, as planar faces and near-planar patches.

    A triangle belongs to a face if its vertices lie within `FLATNESS` L of the plane of the face's
    largest triangle and the two normals are not opposed. Faces of different friction are not
    merged; where they coincide the lower friction holds. On bodies of more than 1000 planes, the
    facets outside broad planes form patches.

    Args:
        parts: the geometries of the body, and of other bodies, which cover its faces and have none.
        patch_angle: greatest angle between normals in a patch and that of its seed [rad]; None for
            12 degrees.
        patch_depth: about the greatest distance of a patch's vertices from its plane [m]; None for
            0.005 L.

    Raises:
        ModelError: when the body has no faces: no triangles, no volume, or all of it covered.
        UsageError: when the angle or the depth is out of range.
    """
    check_tolerances(patch_angle, patch_depth)
    if not sum(len(part.triangles_B) for part in parts if part.own):
        raise ModelError("the collision geometry has no triangles")
    L = diameter(np.concatenate([part.triangles_B.reshape(-1, 3) for part in parts if part.own]))
    mesh = _mesh(parts, LENGTH_TOLERANCE * L)
    triangles = mesh.vertices[mesh.corners]
    if not mesh.own.any():
        raise ModelError(
            f"all its triangles are thinner than a rounding error of its length of {L:g} m; look "
            "for a vertex far away from the others"
        )
    primitives, covering = (
        tuple(part.primitive for part in parts if part.primitive is not None and part.own is own)
        for own in (True, False)
    )
    cavities = None
    shells = mesh.vertices, mesh.corners, mesh.shell, mesh.closed
    if not (_is_one_solid(mesh) or enclose_nothing(*shells, L)):
        closed = mesh.closed[mesh.shell]
        cavities = find_cavities(triangles, closed, (*primitives, *covering), L, mesh.own)
    faces: list[Face] = []
    triangle_face = np.full(len(triangles), -1, dtype=np.int64)
    is_curved = np.zeros(len(triangles), dtype=bool)
    is_curved[mesh.own] = curved_triangles(mesh.vertices, mesh.corners[mesh.own], L, FLATNESS * L)
    is_curved &= mesh.curve < 0
    for plane in _planes(triangles, mesh.curve, mesh.own & ~is_curved, L):
        curve = mesh.curve[plane.triangles[0]]
        solid = parts[curve].primitive if curve >= 0 else None
        reach = 0.0 if solid is None else sagitta(solid, triangles[plane.triangles])
        new = [
            replace(face, reach=reach, primitive=solid)
            for face in _exposed_faces(mesh, plane, L)
            if cavities is None or not _is_sealed(face, cavities)
        ]
        triangle_face[plane.triangles] = _largest_overlap(mesh, plane, new, len(faces))
        faces.extend(new)
    facets = _exposed_facets(mesh, triangles, is_curved, cavities, L)
    for patch in grow_patches(
        mesh.vertices, mesh.corners[facets], mesh.mu[facets], L, patch_angle, patch_depth
    ):
        members = facets[patch.triangles]
        triangle_face[members[triangle_face[members] < 0]] = len(faces)
        faces.append(_patch_face(patch))
    if not faces:
        by = "encloses no volume" if mesh.own.all() else "is wholly covered by links on its joints"
        raise ModelError(f"the collision geometry {by}")
    rank = _order(faces, L)
    position = np.append(np.argsort(rank), -1)
    return Polyhedron(
        faces=tuple(faces[k] for k in rank),
        diameter=L,
        triangles_B=frozen(triangles),
        triangle_face=frozen(position[triangle_face], np.int64),
        closed=frozen(mesh.closed[mesh.shell], bool),
        primitives=primitives,
        cavities=cavities,
        own=None if mesh.own.all() else frozen(mesh.own, bool),
        covering=covering,
    )


def _patch_face(patch: Patch) -> Face:
    """Returns a patch of facets as a face."""
    p_BF = patch.offset * patch.R_BF[:, 2]
    return Face(frozen(patch.R_BF), frozen(p_BF), patch.polygon_F, patch.mu, patch.reach)


def _is_one_solid(mesh: Mesh) -> bool:
    """Returns whether there is a single manifold shell, which covers nothing of itself."""
    return len(mesh.closed) == 1 and bool(mesh.simple.all())


def _is_sealed(face: Face, cavities: Cavities) -> bool:
    """Returns whether a face is wholly in a cavity; if in part, no contact is projected there."""
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(face.polygon_F))
    xy = shapely.get_coordinates(shapely.centroid(pieces))
    p_BC = face.p_BF + times(xy, face.R_BF[:, :2].T)
    return bool(cavities.sealed_at(p_BC, np.tile(face.nhat_TB_B, (len(p_BC), 1))).all())


def _exposed_facets(
    mesh: Mesh, triangles: Array, among: Bools, cavities: Cavities | None, L: float
) -> Ints:
    """Returns the facets of patches that are exposed.

    Facets are small, so it suffices that four samples are outside all shells and that the centroid
    is in no cavity.
    """
    facets = np.flatnonzero(among)
    if _is_one_solid(mesh):
        return facets
    nhat, _ = unit_normals(triangles[facets])
    if cavities is not None:
        free = ~cavities.sealed_at(triangles[facets].mean(axis=1), -nhat)
        facets, nhat = facets[free], nhat[free]
    middle = triangles[facets].mean(axis=1)[:, None]
    samples = np.concatenate([middle, 0.9 * triangles[facets] + 0.1 * middle], axis=1)
    samples = samples + _JUST_OUTSIDE * L * nhat[:, None]
    closed = TriangleSoup(triangles[mesh.closed[mesh.shell]])
    winding = closed.winding_numbers(samples.reshape(-1, 3))
    return facets[(winding.reshape(-1, 4) <= 0).all(axis=1)]


def _mesh(parts: Sequence[Part], tolerance: float) -> Mesh:
    """Returns the parts as shells of welded triangles, oriented outward."""
    vertices, corners = weld(np.concatenate([part.triangles_B for part in parts]), tolerance)
    count = 0
    rows: list[tuple[Ints, Ints, Array, Ints, Bools]] = []
    kinds: list[tuple[Bools, Bools]] = []
    for k, part in enumerate(parts):
        own, corners = np.split(corners, [len(part.triangles_B)])
        shells = oriented_shells(vertices, without_doubles(own))
        curve = np.full(len(shells.corners), -1)
        if part.primitive is not None:
            nhat, _ = unit_normals(vertices[shells.corners])
            curve[part.primitive.is_curved(nhat)] = k
        mu = np.full(len(shells.corners), part.mu)
        is_own = np.full(len(shells.corners), part.own)
        rows.append((shells.corners, shells.shell + count, mu, curve, is_own))
        kinds.append((shells.closed, shells.simple))
        count += len(shells.closed)
    corners, shell, mu, curve, is_own = (np.concatenate(x) for x in zip(*rows, strict=True))
    closed, simple = (np.concatenate(x) for x in zip(*kinds, strict=True))
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, shell, vertices[corners].min(axis=1))
    np.maximum.at(high, shell, vertices[corners].max(axis=1))
    return Mesh(vertices, corners, shell, mu, curve, is_own, low, high, closed, simple)


def _planes(triangles: Array, curve: Ints, among: Bools, L: float) -> list[Plane]:
    """Returns the planes of triangles by descending area of their largest triangle.

    Args:
        triangles: [m], shape (T, 3, 3).
        curve: the curved solid that each triangle is a facet of, -1 for none, shape (T,); facets of
            different solids are in different planes.
        among: which triangles to take, shape (T,); degenerate ones are skipped.
        L: diameter of the body [m].
    """
    nhat, area = unit_normals(triangles)
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    alive = among & (area > LENGTH_TOLERANCE * L * longest)
    planes: list[Plane] = []
    corner = np.ascontiguousarray(triangles[:, 0])
    for seed in np.argsort(-area, kind="stable"):
        if not alive[seed]:
            continue
        level = dot(corner[seed], nhat[seed])
        near = alive & (curve == curve[seed])
        near = np.flatnonzero(near & (np.abs(times(corner, nhat[seed]) - level) <= FLATNESS * L))
        flat = np.abs(times(triangles[near], nhat[seed]) - level).max(axis=1) <= FLATNESS * L
        joined = near[(flat & (dot(nhat[near], nhat[seed]) > 0)) | (near == seed)]
        alive[joined] = False
        weight = area[joined] / area[joined].sum()
        R_BF = face_frame(times(nhat[joined].T, weight))
        offset = float(dot(times(triangles[joined].mean(axis=1).T, weight), R_BF[:, 2]))
        planes.append(Plane(R_BF, offset, joined))
    return planes


def _exposed_faces(mesh: Mesh, plane: Plane, L: float) -> list[Face]:
    """Returns the exposed faces on one plane, by ascending friction."""
    corners, mu = mesh.corners[plane.triangles], mesh.mu[plane.triangles]
    xy = times(mesh.vertices, plane.R_BF[:, :2])
    pieces = shapely.polygons(xy[corners])
    near = _shells_near(mesh, mesh.vertices[corners].reshape(-1, 3), FLATNESS * L)
    alone = len(near) == 1 and mesh.simple[near[0]]
    if alone and len(pieces) == 1:
        return [_face(plane, pieces[0], mu[0])]
    grid = LENGTH_TOLERANCE * L
    if alone and (mu == mu[0]).all():
        whole = areas_of([merged(pieces, grid)])
        return [_face(plane, polygon, mu[0]) for polygon in tidy_polygons(whole, L)]
    cover = _NOTHING if alone else covered(mesh, plane, near, L)
    vertices = np.concatenate([xy[corners].reshape(-1, 2), shapely.get_coordinates(cover)])
    taken = shapely.union_all(cover, grid_size=grid)
    faces: list[Face] = []
    for value in distinct_values(mu):
        own = merged(pieces[mu == value], grid)
        free = shapely.difference(own, taken, grid_size=grid)
        taken = shapely.union_all(areas_of([taken, own]), grid_size=grid)
        free = restore(areas_of([free]), vertices, grid)
        faces += [_face(plane, polygon, value) for polygon in tidy_polygons(free, L)]
    return faces


_NOTHING: Polygons = np.empty(0, dtype=object)


def _shells_near(mesh: Mesh, points: Array, reach: float) -> Ints:
    """Returns the shells whose bounding box is within `reach` [m] of that of the points."""
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    return np.flatnonzero(((mesh.low <= high) & (mesh.high >= low)).all(axis=1))


def _face(plane: Plane, polygon: shapely.Polygon, mu: float) -> Face:
    """Returns a polygon on a plane as a face, with Fo at the point of the plane nearest to Bo."""
    p_BF = plane.offset * plane.R_BF[:, 2]
    return Face(frozen(plane.R_BF), frozen(p_BF), polygon, float(mu))


def _largest_overlap(mesh: Mesh, plane: Plane, faces: list[Face], first: int) -> Ints:
    """Returns the face, numbered from `first`, that shares most area with each triangle."""
    if not faces or len(plane.triangles) == 1:
        return np.full(len(plane.triangles), first if faces else -1, dtype=np.int64)
    xy = times(mesh.vertices, plane.R_BF[:, :2])
    triangles = shapely.polygons(xy[mesh.corners[plane.triangles]])
    polygons = np.array([face.polygon_F for face in faces], dtype=object)
    shared = np.zeros((len(triangles), len(polygons)))
    for k, polygon in enumerate(polygons):
        meet = shapely.STRtree(triangles).query(polygon)
        shared[meet, k] = shapely.area(shapely.intersection(triangles[meet], polygon))
    negligible = shared.max(axis=1) <= LENGTH_TOLERANCE * shapely.area(triangles)
    return np.where(negligible, -1, first + np.argmax(shared, axis=1))


def _order(faces: list[Face], L: float) -> Ints:
    """Returns the faces in an order that does not depend on the order in the model file.

    They are sorted by outward normal, offset and centroid.
    """
    R_BF = np.array([face.R_BF for face in faces])
    centroid = shapely.centroid(np.array([face.polygon_F for face in faces], dtype=object))
    p_BF = np.array([face.p_BF for face in faces])
    centroid_B = p_BF + np.einsum("nij,nj->ni", R_BF[:, :, :2], shapely.get_coordinates(centroid))
    nhat = R_BF[:, :, 2]
    offset = np.einsum("ni,ni->n", nhat, p_BF)[:, None]
    keys = np.column_stack([nhat, offset / L, centroid_B / L])
    return np.lexsort(np.round(keys / LENGTH_TOLERANCE).T[::-1])
