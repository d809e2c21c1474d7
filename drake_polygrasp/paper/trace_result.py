"""What Sections 4 to 7 compute for one set of faces on each of their planes, to draw and to teach.

Every plane has two axes of its own, unit vectors in B; coordinates are measured along them from Bo.
"""

from __future__ import annotations

from dataclasses import dataclass

import shapely

from drake_polygrasp.arrays import Array, Shapes


@dataclass(frozen=True, eq=False)
class OnPiL:
    """Section 4.1, step 1, of a non-parallel set."""

    axes_B: Array
    """Shape (2, 3)."""
    faces: Shapes
    """Projections A_i^l [m], shape (3,); segments where a face is orthogonal to Pi_l."""
    nprime: Array
    """Unit directions of n'_i, shape (3, 2)."""
    low: Array
    """Bounds of the strips along t_i = N x n'_i [m], shape (3,)."""
    high: Array
    gamma: float
    """Half-angle alpha - phi of the cones C_ri [rad]."""
    region_l: shapely.Polygon | None
    """R^l, where it is not empty; its centroid is the cones' apex."""


@dataclass(frozen=True, eq=False)
class OnPiS:
    """Sections 4.1 (step 2), 4.2 and 5; the second axis is N, so Pi_p is level.

    Where faces are not opposed, or no direction meets them all, there are only their projections,
    on axes of no meaning.
    """

    axes_B: Array
    """Shape (2, 3)."""
    faces: Shapes
    """Projections A_i^s [m], shape (3,)."""
    common: shapely.Geometry
    """A_aux2 of a parallel set, R_maxT (or the pocket that holds it) of a pair, else empty."""
    low: float | None
    """Bounds of R^s [m], where it is not empty."""
    high: float | None
    height: float | None
    """Of Pi_p [m], where R^s is not empty."""
    p_cm: Array
    """c_m^s [m], shape (2,)."""
    heights: Array | None = None
    """Bounds along N of the portions A_li of a non-parallel set [m], shape (3, 2); where a portion
    is empty the lower is the greater."""


@dataclass(frozen=True, eq=False)
class OnPiP:
    """Sections 6 and 7."""

    axes_B: Array
    """Shape (2, 3)."""
    height: float
    """N . p of the plane [m]."""
    segments: Shapes
    """a_i, a LineString or MultiLineString each [m], shape (3,)."""
    directions: Array
    """Unit directions of L_i: n'_i, or n_bs of a parallel set or pair, shape (3, 2)."""
    nprime: Array
    """Directions of the normals' projections, shape (3, 2)."""
    region_p: shapely.Polygon
    """P, which may be empty."""
    p_cI: Array | None
    """c_I^p, centroid of P [m], shape (2,), if it has one."""
    p_ca: Array
    """c_a, centroid of the segments' hull [m], shape (2,)."""
    p_cm: Array
    """c_m^p [m], shape (2,)."""
    contacts: Array | None
    """P_1, P_2, P_3 [m], shape (3, 2), if Section 7 found them."""


@dataclass(frozen=True, eq=False)
class SetTrace:
    """One set of faces on its way through the paper, as far as it came."""

    faces: tuple[int, int, int]
    """Of A_1, A_2, A_3; of a pair A_3 is A_2, or another part of it."""
    is_parallel: bool
    """Whether forces are planned to be parallel, as those of pairs are."""
    alpha: float
    """Friction angle [rad]."""
    phi: float
    """Angle between normals and Pi_l, or half of what a pair lacks to pi [rad]."""
    reason: str
    """What rejected the set, one of reasons.REASONS; "not_evaluated" when contacts were found."""
    nhat_TB_B: Array
    """Inward unit normals, shape (3, 3)."""
    mu: Array
    """Shape (3,)."""
    q: Array | None
    """q_1 to q_5, if P is not empty; the paper's maxima are over sets of these faces alone."""
    p_BC: Array | None
    """Contacts [m], shape (3, 3), if Section 7 found them."""
    on_pi_l: OnPiL | None = None
    on_pi_s: OnPiS | None = None
    on_pi_p: OnPiP | None = None
