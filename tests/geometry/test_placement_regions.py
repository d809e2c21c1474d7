"""Pieces of surface around a contact hold all that a fingertip touches when it misses.

The judges here share nothing with the package: rays against triangles one by one, bisection on
implicit functions of curved solids, non-negative least squares for "in the hull of".
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import shapely
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.geometry.placement_regions import (
    MOST_PIECES,
    PlacementRegion,
    placement_region,
    regions_of_grasps,
)
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.regions import default_placement_errors, erode
from drake_polygrasp.geometry.surface import Part, build_polyhedron, curved_part
from drake_polygrasp.geometry.surface_contact import project_contacts
from drake_polygrasp.geometry.surface_pieces import SIDES, SurfacePiece, greatest_tangent
from tests.support.common import random_rotations, round_body
from tests.support.convex_polyhedra import boxes, ellipsoid_hull, holed_prism, prism, shells
from tests.support.solids import cube, object_of, random_contacts, solid

R = random_rotations(1, np.random.default_rng(3))[0]
P = np.array([0.1, -0.2, 0.3])


def test_angles_of_rounding_have_their_own_tangents():
    slight = np.array([[2.0, 3e-10, 4e-10], [5.0, 0.0, 1e-9]])
    np.testing.assert_allclose(greatest_tangent(slight, np.eye(3)[0]), 2.5e-10, rtol=1e-12)
    np.testing.assert_allclose(greatest_tangent(np.ones((1, 3)), np.eye(3)[0]), 2**0.5, rtol=1e-12)
    assert greatest_tangent(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.eye(3)[0]) == np.inf


def face_towards(polyhedron: Polyhedron, nhat: Array) -> int:
    """The face whose inward normal is nearest to one."""
    return int(np.argmax([face.nhat_TB_B @ nhat for face in polyhedron.faces]))


def face_at_height(polyhedron: Polyhedron, nhat: Array, height: float) -> int:
    """The face of an inward normal, and so high along it [m]."""
    for k, face in enumerate(polyhedron.faces):
        if face.nhat_TB_B @ nhat > 0.99 and abs(face.p_BF @ nhat - height) < 1e-9:
            return k
    raise LookupError(nhat)


def misses(count: int, radius: float, nhat: Array, seed: int = 0) -> Array:
    """Offsets across a normal, evenly over a disc, an eighth of them on its rim."""
    rng = np.random.default_rng(seed)
    _, _, axes = np.linalg.svd(nhat[None])
    turn, size = rng.uniform(0, 2 * np.pi, count), radius * np.sqrt(rng.uniform(size=count))
    size[::8] = radius
    return size[:, None] * (np.outer(np.cos(turn), axes[1]) + np.outer(np.sin(turn), axes[2]))


def first_met(start: Array, nhat: Array, triangles: Array) -> tuple[Array, Array] | None:
    """The point and inward normal that a ray meets first, Möller and Trumbore; None for a miss."""
    a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(nhat, f)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / np.einsum("ti,ti->t", e, p)
        u = np.einsum("ti,ti->t", start - a, p) * inverse
        q = np.cross(start - a, e)
        v, t = q @ nhat * inverse, np.einsum("ti,ti->t", f, q) * inverse
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    if not met.any():
        return None
    k = int(np.argmin(np.where(met, t, np.inf)))
    inward = -np.cross(e[k], f[k])
    return start + t[k] * nhat, inward / np.linalg.norm(inward)


def is_held(p: Array, inward: Array, pieces: tuple[SurfacePiece, ...], L: float) -> bool:
    """Whether a point of surface is in a piece that allows for its normal."""
    for piece in pieces:
        cosine = piece.nhat_TB_B @ inward
        tangent = np.linalg.norm(np.cross(piece.nhat_TB_B, inward)) / cosine
        if cosine <= 0 or tangent > piece.tan_spread + 1e-8:
            continue
        corners = piece.p_BV - p
        # Lengths in units of L beside the sum of the shares, which is to be 1.
        A = np.vstack([corners.T / L, np.ones(len(corners))])
        if nnls(A, np.array([0.0, 0, 0, 1]))[1] <= 1e-8:
            return True
    return False


def check_facets(
    polyhedron: Polyhedron, p: Array, nhat: Array, region: PlacementRegion, radius: float
) -> None:
    """Fingertips that come from outside land on pieces."""
    L = polyhedron.diameter
    for offset in misses(64, radius, nhat):
        met = first_met(p + offset - 2 * L * nhat, nhat, polyhedron.triangles_B)
        assert met is not None
        assert is_held(*met, region.pieces, L)


def contains_disc(corners: Array, centre: Array, nhat: Array, radius: float) -> bool:
    """In rational arithmetic: every side is at least so far from the centre, seen along nhat."""
    p, c, n = ([Fraction(x) for x in row] for row in (corners.ravel(), centre, nhat))
    points = [p[k : k + 3] for k in range(0, len(p), 3)]

    def cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
        return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]

    for tail, head in zip(points, points[1:] + points[:1], strict=True):
        side = [y - x for x, y in zip(tail, head, strict=True)]
        arm = [y - x for x, y in zip(tail, c, strict=True)]
        turn = sum(a * b for a, b in zip(cross(side, arm), n, strict=True))
        length = sum(s * s for s in side) * sum(x * x for x in n)
        if turn <= 0 or turn**2 < Fraction(radius) ** 2 * length:
            return False
    return True


def test_in_the_middle_of_a_face_there_is_a_regular_polygon_around_the_disc() -> None:
    box = cube(0.06).polyhedron
    nhat = np.array([0.0, 0.0, -1.0])
    face, r = face_towards(box, nhat), 0.004
    (piece,) = placement_region(box, np.array([0.03, 0.02, 0.06]), nhat, face, r).pieces
    assert len(piece.p_BV) == SIDES
    assert piece.tan_spread == 0
    np.testing.assert_allclose(piece.p_BV[:, 2], 0.06, atol=1e-15)
    away = np.linalg.norm(piece.p_BV - [0.03, 0.02, 0.06], axis=1)
    np.testing.assert_allclose(away, r / np.cos(np.pi / SIDES), rtol=1e-8)


@pytest.mark.parametrize(("x", "y"), [(0.004, 0.03), (0.004, 0.004), (0.00401, 0.004)])
def test_at_edges_and_in_corners_the_polygon_stays_on_the_face(x: float, y: float) -> None:
    box = cube(0.06).polyhedron
    nhat = np.array([0.0, 0.0, -1.0])
    p_BC, r = np.array([x, y, 0.06]), 0.004
    (piece,) = placement_region(box, p_BC, nhat, face_towards(box, nhat), r).pieces
    assert piece.p_BV.min() >= -1e-11
    assert len(piece.p_BV) <= SIDES + 2
    # Counter-clockwise from inside the body, as nhat says.
    assert contains_disc(piece.p_BV[::-1], p_BC, nhat, r)


@pytest.mark.parametrize("seed", range(8))
def test_polygons_hold_the_disc_exactly_and_lie_on_faces_with_holes_and_reflex_corners(
    seed: int,
) -> None:
    polyhedron = solid(holed_prism(6 + seed % 4, seed % 3, seed)).polyhedron
    r, rng = 0.003, np.random.default_rng(seed)
    regions = erode(polyhedron, r)
    assert len(regions.face) >= 4
    for k, polygon in enumerate(regions.polygon_F):
        # Corners of what erosion leaves are exactly r from edges.
        corners = shapely.get_coordinates(polygon)
        for xy in corners[rng.permutation(len(corners))[:4]]:
            on = polyhedron.faces[regions.face[k]]
            p_BC = np.round(on.p_BF + on.R_BF[:, :2] @ xy, 12)
            nhat = np.round(on.nhat_TB_B, 12)
            (piece,) = placement_region(polyhedron, p_BC, nhat, int(regions.face[k]), r).pieces
            assert contains_disc(piece.p_BV[::-1], p_BC, nhat, r)
            outline = shapely.Polygon((piece.p_BV - on.p_BF) @ on.R_BF[:, :2])
            assert shapely.covers(shapely.buffer(on.polygon_F, 2e-10), outline)


def test_a_turned_body_has_the_turned_region() -> None:
    here = solid(ellipsoid_hull(60, seed=2)).polyhedron
    there = build_polyhedron([Part(here.triangles_B @ R.T + P, 0.3)])
    p_BC, nhat, face = random_contacts(here, 5, seed=1)
    for p, n, k in zip(p_BC, nhat, face, strict=True):
        one = placement_region(here, p, n, int(k), 0.004)
        other = placement_region(there, R @ p + P, R @ n, face_towards(there, R @ n), 0.004)
        assert len(one.pieces) == len(other.pieces)
        assert one.reason == other.reason
        if one.pieces:
            normals = np.array([piece.nhat_TB_B for piece in other.pieces])
            for piece in one.pieces:
                assert (normals @ R @ piece.nhat_TB_B).max() == pytest.approx(1, abs=1e-9)


BODIES = {
    "hull": lambda: ellipsoid_hull(200, seed=1),
    "scan": lambda: round_body(4000, (0.03, 0.04, 0.05), noise=1e-4, seed=5),
    "shells": lambda: shells(3, 40, seed=4),
    "boxes": lambda: boxes(3, seed=2),
}


@pytest.mark.parametrize("name", BODIES)
def test_what_a_fingertip_meets_first_is_on_a_piece_with_its_normal(name: str) -> None:
    polyhedron = solid(BODIES[name]()).polyhedron
    L = polyhedron.diameter
    p_BC, _, face = random_contacts(polyhedron, 30, seed=3)
    seats = project_contacts(polyhedron, p_BC, face)
    counts, radius = [], 0.03 * L
    for p, n, k, ok in zip(seats.p_BC, seats.nhat_TB_B, face, seats.ok, strict=True):
        region = placement_region(polyhedron, p, n, int(k), radius) if ok else None
        if region and region.pieces:
            check_facets(polyhedron, p, n, region, radius)
            counts.append(len(region.pieces))
    assert len(counts) >= 5
    assert name == "boxes" or max(counts) > 3


@pytest.mark.parametrize("name", ["hull", "scan", "boxes", "holed", "cylinder"])
def test_grasps_together_have_the_regions_that_each_contact_has_alone(name: str) -> None:
    if name == "cylinder":
        polyhedron = build_polyhedron([curved_part(SOLIDS[name], 0.3)])
    else:
        body = holed_prism(7, 1, 2) if name == "holed" else BODIES[name]()
        polyhedron = solid(body).polyhedron
    p_BC, _, face = random_contacts(polyhedron, 90, seed=7)
    seats = project_contacts(polyhedron, p_BC, face)
    rows = np.flatnonzero(seats.ok)
    grasps = rows[: 3 * (len(rows) // 3)].reshape(-1, 3)
    radius = polyhedron.diameter * np.random.default_rng(1).choice(
        [1e-3, 0.01, 0.03, 0.4], grasps.shape
    )
    contacts = seats.p_BC[grasps], seats.nhat_TB_B[grasps], face[grasps], radius
    found = regions_of_grasps(polyhedron, *contacts)
    for pieces, *grasp in zip(found, *contacts, strict=True):
        alone = [
            placement_region(polyhedron, p, n, int(k), float(r)).pieces
            for p, n, k, r in zip(*grasp, strict=True)
        ]
        assert (pieces is None) == (not all(alone))
        for one, other in zip(pieces or (), alone, strict=pieces is not None):
            assert [piece.p_BV.tolist() for piece in one] == [p.p_BV.tolist() for p in other]
            assert [p.nhat_TB_B.tolist() for p in one] == [p.nhat_TB_B.tolist() for p in other]
            assert [piece.tan_spread for piece in one] == [piece.tan_spread for piece in other]
    assert any(pieces is not None for pieces in found)
    assert any(pieces is None for pieces in found)


def test_many_facets_make_few_pieces_that_hold_them_all() -> None:
    polyhedron = solid(round_body(20_000)).polyhedron
    p_BC, _, face = random_contacts(polyhedron, 2, seed=0)
    seats = project_contacts(polyhedron, p_BC, face)
    for p, n, k in zip(seats.p_BC, seats.nhat_TB_B, face, strict=True):
        region = placement_region(polyhedron, p, n, int(k), 0.015)
        assert 10 < len(region.pieces) <= MOST_PIECES
        check_facets(polyhedron, p, n, region, 0.015)


SOLIDS = {
    "sphere": Primitive("ellipsoid", frozen(R), frozen(P), frozen([0.05, 0.05, 0.05])),
    "ellipsoid": Primitive("ellipsoid", frozen(R), frozen(P), frozen([0.03, 0.05, 0.07])),
    "cylinder": Primitive("cylinder", frozen(R), frozen(P), frozen([0.03, 0.03, 0.05])),
    "capsule": Primitive("capsule", frozen(R), frozen(P), frozen([0.03, 0.03, 0.05])),
    "short capsule": Primitive("capsule", frozen(R), frozen(P), frozen([0.03, 0.03, 0.002])),
}


def levels(primitive: Primitive, p: Array) -> Array:
    """Below 0 inside the solid, smooth at its curved surface, (M, 3) to (M,)."""
    x, y, z = ((p - P) @ R).T
    a, b, c = primitive.radii
    if primitive.kind == "ellipsoid":
        return np.asarray((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 - 1)
    if primitive.kind == "cylinder":
        return np.asarray(np.maximum(np.hypot(x, y) - a, 100 * (np.abs(z) - c)))
    return np.asarray(np.sqrt(x**2 + y**2 + np.maximum(np.abs(z) - c, 0) ** 2) - a)


def first_entered(primitive: Primitive, start: Array, nhat: Array) -> tuple[Array, Array]:
    """The first point inside along a ray, to a picometre, and the inward normal by differences."""
    t = np.linspace(0, 0.4, 40_001)
    k = int(np.argmax(levels(primitive, start + t[:, None] * nhat) <= 0))
    low, high = t[k - 1], t[k]
    for _ in range(60):
        middle = (low + high) / 2
        if levels(primitive, start[None] + middle * nhat)[0] > 0:
            low = middle
        else:
            high = middle
    p, h = start + high * nhat, 1e-6
    steps = h * np.eye(3)
    gradient = levels(primitive, p + steps) - levels(primitive, p - steps)
    return p, -gradient / np.linalg.norm(gradient)


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("radius", [0.001, 0.006])
def test_on_curved_solids_pieces_hold_the_true_surface_and_its_normals(
    name: str, radius: float
) -> None:
    primitive = SOLIDS[name]
    polyhedron = build_polyhedron([curved_part(primitive, 0.3)])
    p_BC, _, face = random_contacts(polyhedron, 12, seed=2)
    seats = project_contacts(polyhedron, p_BC, face)
    found = 0
    for p, n, k in zip(seats.p_BC, seats.nhat_TB_B, face, strict=True):
        if polyhedron.faces[k].primitive is None:
            continue
        region = placement_region(polyhedron, p, n, int(k), radius)
        if not region.pieces:  # near the rim of a cylinder
            continue
        found += 1
        assert len(region.pieces) <= 12
        if radius == 0.001:
            assert max(piece.tan_spread for piece in region.pieces) < np.tan(np.radians(1.2))
        for offset in misses(24, radius, n, seed=int(k)):
            p_met, inward = first_entered(primitive, p + offset - 0.2 * n, n)
            # Differences over a micrometre make the normal no better than that.
            held = [
                SurfacePiece(piece.p_BV, piece.nhat_TB_B, piece.tan_spread + 1e-5)
                for piece in region.pieces
            ]
            assert is_held(p_met, inward, tuple(held), polyhedron.diameter)
    assert found >= 6


@pytest.mark.parametrize("kind", ["cylinder", "capsule"])
def test_last_bits_of_a_contact_do_not_turn_how_a_curve_is_cut(kind: str) -> None:
    """A file rounds contacts and normals to twelve digits; the pieces are found again from it."""
    solid_ = Primitive(kind, frozen(np.eye(3)), frozen(np.zeros(3)), frozen([0.033, 0.033, 0.05]))
    polyhedron = build_polyhedron([curved_part(solid_, 0.5)])
    face = next(k for k, each in enumerate(polyhedron.faces) if each.primitive is not None)
    for angle in np.arange(0.0, 2 * np.pi, 0.05):
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])
        contact = 0.033 * outward, -outward
        exact, rounded = (
            placement_region(polyhedron, *c, face, 0.004).pieces
            for c in (contact, [x.round(12) for x in contact])
        )
        assert len(exact) == len(rounded) > 1
        for piece in exact:
            (same,) = (x for x in rounded if np.allclose(x.nhat_TB_B, piece.nhat_TB_B, atol=1e-9))
            apart = np.abs(piece.p_BV[:, None] - same.p_BV[None]).max(axis=2).min(axis=1)
            # Corners within 6 mm of the contact move by 1e-12 m and, as their frame turns, less.
            assert apart.max() < 1e-11


def test_a_finely_faceted_sphere_and_the_sphere_itself_turn_alike() -> None:
    r, radius = 0.004, 0.05
    sphere = Primitive("ellipsoid", frozen(np.eye(3)), frozen(np.zeros(3)), frozen([radius] * 3))
    true = build_polyhedron([curved_part(sphere, 0.3)])
    fine = solid(round_body(20_000)).polyhedron
    leans = []
    for polyhedron in (true, fine):
        p_BC, _, face = random_contacts(polyhedron, 1, seed=0)
        seats = project_contacts(polyhedron, p_BC, face)
        p, n = seats.p_BC[0], seats.nhat_TB_B[0]
        pieces = placement_region(polyhedron, p, n, int(face[0]), r).pieces
        lean = [
            np.arccos(min(1.0, n @ piece.nhat_TB_B)) + np.arctan(piece.tan_spread)
            for piece in pieces
        ]
        leans.append(max(lean))
    exact = np.arcsin(r / radius)
    assert exact <= leans[0] < exact + np.radians(2.0)
    # Facets of a millimetre turn by a degree from one to the next.
    assert leans[1] == pytest.approx(exact, abs=np.radians(1.5))


def test_a_thin_face_is_missed() -> None:
    rod = solid(prism(shapely.box(0, 0, 0.004, 0.1), 0.05)).polyhedron
    nhat = np.array([0.0, 0.0, -1.0])
    p_BC, face = np.array([0.002, 0.05, 0.05]), face_towards(rod, nhat)
    assert len(placement_region(rod, p_BC, nhat, face, 0.0019).pieces) == 1
    region = placement_region(rod, p_BC, nhat, face, 0.0021)
    assert (region.pieces, region.reason) == ((), "the fingertip may miss the body")


def test_beside_steps_and_walls_there_is_no_region() -> None:
    profile = shapely.box(0, 0, 0.06, 0.06) - shapely.box(0.02, 0.02, 0.04, 0.06)
    channel = solid(prism(profile, 0.05)).polyhedron
    down, side = np.array([0.0, -1.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    on_floor = face_at_height(channel, down, -0.02)
    middle, beside = np.array([0.03, 0.02, 0.025]), np.array([0.0225, 0.02, 0.025])
    assert len(placement_region(channel, middle, down, on_floor, 0.003).pieces) == 1
    region = placement_region(channel, beside, down, on_floor, 0.003)
    assert region.reason == "the surface has a step where the fingertip may land"
    # On an inner wall, whose opposite wall is where the fingertip cannot come from.
    wall = face_at_height(channel, side, -0.02)
    high, low = np.array([0.02, 0.04, 0.025]), np.array([0.02, 0.0225, 0.025])
    assert len(placement_region(channel, high, side, wall, 0.003).pieces) == 1
    region = placement_region(channel, low, side, wall, 0.003)
    assert region.reason == "a wall of the body is in the fingertip's path"


def test_a_ledge_over_a_face_is_where_the_fingertip_lands() -> None:
    ledge = prism(shapely.box(0.03, -0.02, 0.06, 0.08), 0.01) + np.array([0, 0, 0.1])
    below = solid(prism(shapely.box(0, 0, 0.06, 0.06), 0.06), ledge).polyhedron
    nhat = np.array([0.0, 0.0, -1.0])
    face = face_at_height(below, nhat, -0.06)
    free = placement_region(below, np.array([0.02, 0.03, 0.06]), nhat, face, 0.008)
    assert len(free.pieces) == 1
    under = placement_region(below, np.array([0.026, 0.03, 0.06]), nhat, face, 0.008)
    assert under.reason == "the surface has a step where the fingertip may land"


def test_other_bodies_and_curved_parts_leave_no_region() -> None:
    box = prism(shapely.box(0, 0, 0.06, 0.06), 0.06)
    lid = prism(shapely.box(0.04, 0, 0.06, 0.06), 0.02) + np.array([0, 0, 0.06])
    ball = Primitive(
        "ellipsoid", frozen(np.eye(3)), frozen([0.05, 0.03, 0.06]), frozen([0.01, 0.01, 0.01])
    )
    nhat = np.array([0.0, 0.0, -1.0])
    near, far = np.array([0.036, 0.03, 0.06]), np.array([0.02, 0.03, 0.06])
    for other in (Part(lid, 0.3, own=False), curved_part(ball, 0.3)):
        polyhedron = build_polyhedron([Part(box, 0.3), other])
        face = face_towards(polyhedron, nhat)
        assert len(placement_region(polyhedron, far, nhat, face, 0.005).pieces) == 1
        assert not placement_region(polyhedron, near, nhat, face, 0.005).pieces


def test_a_region_has_no_part_of_less_friction_than_its_contact() -> None:
    """Two boxes with flush tops, coefficients 0.5 and 0.2: contacts 1 mm beside the seam."""
    box = prism(shapely.box(0, 0, 0.04, 0.04), 0.04)
    pair = build_polyhedron([Part(box, 0.5), Part(box + np.array([0.04, 0.0, 0.0]), 0.2)])
    down = np.array([0.0, 0.0, -1.0])
    for x, radius, reason in (
        (0.039, 0.0005, ""),
        (0.039, 0.002, "a part with less friction may be where the fingertip lands"),
        (0.041, 0.002, ""),
    ):
        rough = [k for k, face in enumerate(pair.faces) if face.nhat_TB_B @ down > 0.99]
        face = next(k for k in rough if pair.faces[k].mu == (0.5 if x < 0.04 else 0.2))
        region = placement_region(pair, np.array([x, 0.02, 0.04]), down, face, radius)
        assert region.reason == reason
        assert bool(region.pieces) == (not reason)


def test_default_errors_are_a_fiftieth_of_the_diameter_or_half_of_a_narrow_faces_inradius() -> None:
    bar = object_of(build_polyhedron([Part(prism(shapely.box(0, 0, 0.004, 0.1), 0.05), 0.3)]))
    L = float(np.linalg.norm([0.004, 0.1, 0.05]))
    errors = default_placement_errors(bar.polyhedron)
    for face, error in zip(bar.polyhedron.faces, errors, strict=True):
        along = int(np.argmax(np.abs(face.nhat_TB_B)))
        assert error == pytest.approx(0.02 * L if along == 0 else 0.001, rel=1e-9)
    turned = solid(bar.polyhedron.triangles_B @ Rotation.from_euler("xyz", [1, 2, 3]).as_matrix())
    other = default_placement_errors(turned.polyhedron)
    assert sorted(other) == pytest.approx(sorted(errors), rel=1e-9)
