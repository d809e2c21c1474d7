"""The wrenches that span W, and its support function h(w), for many grasps at once.

Shapes, units and W itself are as in `contacts`.
"""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import cross, unit
from drake_polygrasp.wrenches.contacts import ON_A_SIDE, contact_frames


def cone_wrenches(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """What spans W: the wrenches of the forces nhat, mu t_1 and mu t_2 at each contact.

    The wrenches of a contact's friction cone with normal force 1 are row 0 plus row 1 and row 2
    times the cosine and sine of any angle.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: what torques are divided by [m].

    Returns:
        Shape (M, 3 contacts, 3 rows, 6).
    """
    return frame_wrenches(contact_frames(p_BC, nhat_TB_B), (p_BC - p_BBcm) / rho, mu)


def frame_wrenches(frames: Array, r: Array, mu: Array) -> Array:
    """`cone_wrenches` of contacts with known frames.

    Args:
        frames: (nhat, t_1, t_2) as rows, shape (..., 3, 3).
        r: contact points, from the centre of mass over rho, shape (..., 3).
        mu: friction coefficients, shape (...).

    Returns:
        Shape (..., 3 rows, 6).
    """
    wrenches = np.empty((*frames.shape[:-1], 6))
    wrenches[..., :3] = frames
    wrenches[..., 1:, :3] *= mu[..., None, None]
    wrenches[..., 3:] = cross(r[..., None, :], wrenches[..., :3])
    return wrenches


def support(cones: Array, directions: Array) -> tuple[Array, Array]:
    """The support function of W, exact for the quadratic cone.

    Args:
        cones: from `cone_wrenches`, shape (M, 3, 3, 6).
        directions: wrenches w, shape (M, K, 6).

    Returns:
        h(w) of each contact's part of W, whose greatest is that of W, shape (M, K, 3), and the
        points of W that attain them, shape (M, K, 3, 6).
    """
    M, K, _ = directions.shape
    rows = np.einsum("mkd,mrd->mkr", directions, cones.reshape(M, 9, 6)).reshape(M, K, 3, 3)
    tangential = np.sqrt(rows[..., 1] ** 2 + rows[..., 2] ** 2)
    h = rows[..., 0] + tangential
    # Where the cone's rim is level all of it attains h: take its centre, not a rounding error.
    level = tangential <= ON_A_SIDE * np.linalg.norm(directions, axis=-1)[..., None]
    weights = np.ones_like(rows)
    weights[..., 1:] = np.where(level[..., None], 0.0, unit(rows[..., 1:]))
    points = np.einsum("mkcr,mcrd->mkcd", weights, cones)
    return h, points
