"""The wrenches that span the wrench set W, and its support function h(w)."""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import cross, unit
from drake_polygrasp.wrenches.contacts import ON_A_SIDE, contact_frames


def cone_wrenches(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """Returns the wrenches of the forces nhat, mu t_1 and mu t_2 at each contact, which span W.

    The rim of a contact's friction disc is row 0 plus the cosine and sine of any angle times rows
    1 and 2.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: length that torques are divided by [m].

    Returns:
        Shape (M, 3 contacts, 3 wrenches, 6).
    """
    return frame_wrenches(contact_frames(p_BC, nhat_TB_B), (p_BC - p_BBcm) / rho, mu)


def frame_wrenches(frames: Array, r: Array, mu: Array) -> Array:
    """Returns the wrenches of `cone_wrenches` for contacts whose frames are known.

    Args:
        frames: (nhat, t_1, t_2) as rows, shape (..., 3, 3).
        r: contact points from the centre of mass, divided by rho, shape (..., 3).
        mu: friction coefficients, shape (...).

    Returns:
        Shape (..., 3 wrenches, 6).
    """
    wrenches = np.empty((*frames.shape[:-1], 6))
    wrenches[..., :3] = frames
    wrenches[..., 1:, :3] *= mu[..., None, None]
    wrenches[..., 3:] = cross(r[..., None, :], wrenches[..., :3])
    return wrenches


def support(cones: Array, directions: Array) -> tuple[Array, Array]:
    """Returns the support h_i(w) of each contact's friction disc, and the points that attain it.

    Args:
        cones: from `cone_wrenches`, shape (M, 3, 3, 6).
        directions: K directions w for each grasp, of any length, shape (M, K, 6).

    Returns:
        h_i(w), of which the greatest over i is h(w), shape (M, K, 3), and points of the discs with
        w . x = h_i(w), shape (M, K, 3, 6).
    """
    M, K, _ = directions.shape
    rows = np.einsum("mkd,mrd->mkr", directions, cones.reshape(M, 9, 6)).reshape(M, K, 3, 3)
    tangential = np.sqrt(rows[..., 1] ** 2 + rows[..., 2] ** 2)
    h = rows[..., 0] + tangential
    # Where w . x is constant on the disc, return its centre, not a rim point chosen by rounding.
    level = tangential <= ON_A_SIDE * np.linalg.norm(directions, axis=-1)[..., None]
    weights = np.ones_like(rows)
    weights[..., 1:] = np.where(level[..., None], 0.0, unit(rows[..., 1:]))
    points = np.einsum("mkcr,mcrd->mkcd", weights, cones)
    return h, points
