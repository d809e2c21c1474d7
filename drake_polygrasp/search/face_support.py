"""The support function of W as a function of where contacts lie on their faces.

W is the hull of three parts, one a contact, so h(w) = max_i h_i(w), and h_i depends on contact i
alone. Where contacts vary and directions w do not, h_i is computed once for each place, and every
combination of places costs a maximum.
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
        mu: of each face, shape (...).
    """

    v_F: Array
    w_F: Array
    mu: Array

    def support(self, p_FC: Array) -> Array:
        """h_i(w) of contacts at points of the faces [m]: (..., C, 2) to (..., C, K)."""
        x, y = p_FC[..., 0, None], p_FC[..., 1, None]
        v_x, v_y, v_z = (self.v_F[..., None, axis, :] for axis in range(3))
        w_x, w_y, w_z = (self.w_F[..., None, axis, :] for axis in range(3))
        g_x, g_y = v_x - w_z * y, v_y + w_z * x
        # The inward normal is -Fz.
        h: Array = self.mu[..., None, None] * np.sqrt(g_x * g_x + g_y * g_y)
        h -= v_z + w_x * y - w_y * x
        return h


def face_twists(regions: Regions, region: Ints, w: Array, p_BBcm: Array, rho: float) -> FaceTwists:
    """Directions w, shape (..., K, 6), on regions, shape (...); the shapes broadcast."""
    R_FB = regions.R_BF[region].swapaxes(-1, -2)
    v, omega = w[..., :3], w[..., 3:]
    v = v + cross(omega, (regions.p_BF[region] - p_BBcm)[..., None, :] / rho)
    v_F = product(R_FB, v.swapaxes(-1, -2))
    w_F = product(R_FB, (omega / rho).swapaxes(-1, -2))
    return FaceTwists(v_F, w_F, regions.mu[region])


def contacts_on(regions: Regions, region: Ints, p_BC: Array) -> tuple[Array, Array, Array]:
    """Contacts at points of regions, as the functions of `wrenches` take them."""
    return p_BC, regions.nhat_TB_B[region], regions.mu[region]


def points_on(regions: Regions, region: Ints, p_FC: Array) -> Array:
    """p_BC [m] of points of regions in their faces' frames, (..., 2) to (..., 3)."""
    p_BC: Array = regions.p_BF[region] + transformed(regions.R_BF[region][..., :2], p_FC)
    return p_BC


def points_in_faces(regions: Regions, region: Ints, p_BC: Array) -> Array:
    """Coordinates in their faces' frames of points of regions [m], (..., 3) to (..., 2)."""
    axes = np.swapaxes(regions.R_BF[region][..., :2], -1, -2)
    return transformed(axes, p_BC - regions.p_BF[region])
