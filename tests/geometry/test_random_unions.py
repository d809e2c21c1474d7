"""Properties of random unions of boxes and prisms, and of what careless software makes of them."""

from __future__ import annotations

import numpy as np
import shapely
from hypothesis import given, settings

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.regions import erode
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.geometry.surface_contact import (
    face_at,
    fingertip_fits,
    locate_contacts,
    project_contacts,
)
from tests.support.lp_judge import is_force_closure
from tests.support.planned import exact_plan
from tests.support.random_unions import Body, bodies
from tests.support.solids import object_of
from tests.support.surface_judge import contact_faults, distances, inside


def build(parts: list[Array]) -> Polyhedron:
    return build_polyhedron([Part(part, 0.3) for part in parts])


def contacts_everywhere(polyhedron: Polyhedron) -> tuple[Array, Array]:
    """Points [m] all over the eroded faces, (M, 3), and their faces."""
    regions = erode(polyhedron)
    pieces, region = shapely.get_parts(
        shapely.constrained_delaunay_triangles(regions.polygon_F), return_index=True
    )
    pieces, owner = shapely.get_parts(pieces, return_index=True)
    region = region[owner]
    xy = shapely.get_coordinates(shapely.centroid(pieces))
    p_BC = regions.p_BF[region] + np.einsum("nij,nj->ni", regions.R_BF[region][:, :, :2], xy)
    return p_BC, regions.face[region]


@settings(max_examples=25)
@given(bodies(4))
def test_contacts_are_on_the_true_open_surface_however_damaged(body: Body) -> None:
    polyhedron = build(body.raw)
    L = polyhedron.diameter
    p_BC, face = contacts_everywhere(polyhedron)
    projected = project_contacts(polyhedron, p_BC, face)
    p_BC, nhat_TB_B = projected.p_BC[projected.ok], projected.nhat_TB_B[projected.ok]
    found = locate_contacts(polyhedron, p_BC, nhat_TB_B).face >= 0
    for tip_radius in (0.0, 0.02 * L):
        fits = found & fingertip_fits(polyhedron, p_BC, nhat_TB_B, tip_radius)
        contacts = p_BC[fits], nhat_TB_B[fits]
        assert not contact_faults(*contacts, body.raw, body.solids, L, tip_radius)


@settings(max_examples=25)
@given(bodies(4))
def test_what_the_judge_finds_open_to_a_tip_is_on_a_face(body: Body) -> None:
    polyhedron = build(body.raw)
    L = polyhedron.diameter
    triangles = np.concatenate(body.raw)
    nhat_TB_B = np.cross(triangles[:, 2] - triangles[:, 0], triangles[:, 1] - triangles[:, 0])
    nhat_TB_B /= np.linalg.norm(nhat_TB_B, axis=1, keepdims=True)
    shares = np.random.default_rng(0).dirichlet([1, 1, 1], (len(triangles), 3))
    p_BC = np.einsum("tki,tij->tkj", shares, triangles).reshape(-1, 3)
    # Of facets that may be turned, whichever side is outside.
    p_BC = np.tile(p_BC, (2, 1))
    nhat_TB_B = np.concatenate([nhat_TB_B, -nhat_TB_B]).repeat(3, axis=0)
    center = p_BC - 0.02 * L * nhat_TB_B
    is_open = distances(center, triangles).min(axis=1) > 0.0199 * L
    is_open &= ~inside(center, body.solids)
    is_open &= inside(p_BC + 1e-3 * L * nhat_TB_B, body.solids)
    if polyhedron.cavities is None:
        assert (face_at(polyhedron, p_BC[is_open], nhat_TB_B[is_open]) >= 0).all()


@settings(max_examples=7)
@given(bodies(3))
def test_every_grasp_holds_by_a_linear_program_and_has_room(body: Body) -> None:
    object_ = object_of(build(body.raw))
    L = object_.polyhedron.diameter
    for certified in exact_plan(object_, top=3).grasps:
        grasp = certified.grasp
        assert is_force_closure(grasp.p_BC, grasp.nhat_TB_B, grasp.mu, around=True)
        contacts = grasp.p_BC, grasp.nhat_TB_B
        assert not contact_faults(*contacts, body.raw, body.solids, L, tip_radius=0.02 * L)
