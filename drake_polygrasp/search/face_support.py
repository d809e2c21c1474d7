"""The support function h(w) of W as a function of the places of contacts on their faces.

W is the hull of three parts, one for each contact, so h(w) = max_i h_i(w), where h_i depends on
contact i alone. For fixed directions w, h_i is computed once for each place of a contact, and every
combination of places costs only a maximum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.vectors import cross, product, transformed


@dataclass(frozen=True, eq=False)
class FaceTwists:
    """Directions w read as twists (v, rho omega), each expressed in the frame of a face F.

    Attributes:
        v_F: velocity of the body at Fo, shape (..., 3, K).
        w_F: angular velocity [1/m], shape (..., 3, K).
        mu: friction coefficient of each face, shape (...).
    """

    v_F: Array
    w_F: Array
    mu: Array

    def support(self, p_FC: Array) -> Array:
        """Computes h_i(w) of contacts at points of the faces.

        Args:
            p_FC: points in the faces' planes [m], shape (..., C, 2).

        Returns:
            h_i(w), shape (..., C, K).
        """
        x, y = p_FC[..., 0, None], p_FC[..., 1, None]
        v_x, v_y, v_z = (self.v_F[..., None, axis, :] for axis in range(3))
        w_x, w_y, w_z = (self.w_F[..., None, axis, :] for axis in range(3))
        g_x, g_y = v_x - w_z * y, v_y + w_z * x
        # The inward normal is -Fz.
        h: Array = self.mu[..., None, None] * np.sqrt(g_x * g_x + g_y * g_y)
        h -= v_z + w_x * y - w_y * x
        return h


def face_twists(regions: Regions, region: Ints, w: Array, p_BBcm: Array, rho: float) -> FaceTwists:
    """Expresses directions w as twists in the frames of faces.

    Args:
        regions: all regions.
        region: index of the region of each row, shape (...).
        w: directions, shape (..., K, 6), broadcast with `region`.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        The twists.
    """
    R_FB = regions.R_BF[region].swapaxes(-1, -2)
    v, omega = w[..., :3], w[..., 3:]
    v = v + cross(omega, (regions.p_BF[region] - p_BBcm)[..., None, :] / rho)
    v_F = product(R_FB, v.swapaxes(-1, -2))
    w_F = product(R_FB, (omega / rho).swapaxes(-1, -2))
    return FaceTwists(v_F, w_F, regions.mu[region])


def contacts_on(regions: Regions, region: Ints, p_BC: Array) -> tuple[Array, Array, Array]:
    """Returns contacts at points of regions as the functions of `wrenches` take them.

    Args:
        regions: all regions.
        region: region of each contact, shape (..., 3).
        p_BC: contact points expressed in B [m], shape (..., 3, 3).

    Returns:
        p_BC, the inward unit normals and the friction coefficients.
    """
    return p_BC, regions.nhat_TB_B[region], regions.mu[region]


def points_on(regions: Regions, region: Ints, p_FC: Array) -> Array:
    """Converts points in faces' frames to points expressed in B.

    Args:
        regions: all regions.
        region: region of each point, shape (...).
        p_FC: coordinates in the faces' planes [m], shape (..., 2).

    Returns:
        p_BC [m], shape (..., 3).
    """
    p_BC: Array = regions.p_BF[region] + transformed(regions.R_BF[region][..., :2], p_FC)
    return p_BC


def points_in_faces(regions: Regions, region: Ints, p_BC: Array) -> Array:
    """Converts points expressed in B to coordinates in their faces' planes.

    Args:
        regions: all regions.
        region: region of each point, shape (...).
        p_BC: points expressed in B [m], shape (..., 3).

    Returns:
        p_FC [m], shape (..., 2).
    """
    axes = np.swapaxes(regions.R_BF[region][..., :2], -1, -2)
    return transformed(axes, p_BC - regions.p_BF[region])
