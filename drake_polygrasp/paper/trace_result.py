"""What Sections 4 to 7 compute for one set of faces on each of their planes, to draw and to teach.

Every plane has two axes of its own, unit vectors in B; coordinates are measured along them from Bo.
"""

from __future__ import annotations

from dataclasses import dataclass

import shapely

from drake_polygrasp.arrays import Array, Shapes


@dataclass(frozen=True, eq=False)
class OnPiL:
    """Section 4.1, step 1, of a non-parallel set.

    Attributes:
        axes_B: shape (2, 3).
        faces: projections A_i^l [m], shape (3,); segments where a face is orthogonal to Pi_l.
        nprime: unit directions of n'_i, shape (3, 2).
        low: bounds of the strips along t_i = N x n'_i [m], shape (3,).
        high: upper end.
        gamma: half-angle alpha - phi of the cones C_ri [rad].
        region_l: r^l, where it is not empty; its centroid is the cones' apex.
    """

    axes_B: Array
    faces: Shapes
    nprime: Array
    low: Array
    high: Array
    gamma: float
    region_l: shapely.Polygon | None


@dataclass(frozen=True, eq=False)
class OnPiS:
    """Sections 4.1 (step 2), 4.2 and 5; the second axis is N, so Pi_p is level.

    Where faces are not opposed, or no direction meets them all, there are only their projections,
    on axes of no meaning.

    Attributes:
        axes_B: shape (2, 3).
        faces: projections A_i^s [m], shape (3,).
        common: a_aux2 of a parallel set, R_maxT (or the pocket that holds it) of a pair, else
            empty.
        low: bounds of R^s [m], where it is not empty.
        high: upper end.
        height: of Pi_p [m], where R^s is not empty.
        p_cm: c_m^s [m], shape (2,).
        heights: bounds along N of the portions A_li of a non-parallel set [m], shape (3, 2); where
            a portion is empty the lower is the greater.
    """

    axes_B: Array
    faces: Shapes
    common: shapely.Geometry
    low: float | None
    high: float | None
    height: float | None
    p_cm: Array
    heights: Array | None = None


@dataclass(frozen=True, eq=False)
class OnPiP:
    """Sections 6 and 7.

    Attributes:
        axes_B: shape (2, 3).
        height: N . p of the plane [m].
        segments: a_i, a LineString or MultiLineString each [m], shape (3,).
        directions: unit directions of L_i: n'_i, or n_bs of a parallel set or pair, shape (3, 2).
        nprime: directions of the normals' projections, shape (3, 2).
        region_p: P, which may be empty.
        p_cI: c_I^p, centroid of P [m], shape (2,), if it has one.
        p_ca: c_a, centroid of the segments' hull [m], shape (2,).
        p_cm: c_m^p [m], shape (2,).
        contacts: P_1, P_2, P_3 [m], shape (3, 2), if Section 7 found them.
    """

    axes_B: Array
    height: float
    segments: Shapes
    directions: Array
    nprime: Array
    region_p: shapely.Polygon
    p_cI: Array | None
    p_ca: Array
    p_cm: Array
    contacts: Array | None


@dataclass(frozen=True, eq=False)
class SetTrace:
    """One set of faces on its way through the paper, as far as it came.

    Attributes:
        faces: of A_1, A_2, A_3; of a pair A_3 is A_2, or another part of it.
        is_parallel: whether forces are planned to be parallel, as those of pairs are.
        alpha: friction angle [rad].
        phi: angle between normals and Pi_l, or half of what a pair lacks to pi [rad].
        reason: what rejected the set, one of reasons.REASONS; "not_evaluated" when contacts were
            found.
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: shape (3,).
        q: q_1 to q_5, if P is not empty; the paper's maxima are over sets of these faces alone.
        p_BC: contacts [m], shape (3, 3), if Section 7 found them.
        on_pi_l: what Section 4.1 or 4.2 computes on Pi_l.
        on_pi_s: what Section 4.1 or 4.2 computes on Pi_s.
        on_pi_p: what Sections 5 to 7 compute on Pi_p.
    """

    faces: tuple[int, int, int]
    is_parallel: bool
    alpha: float
    phi: float
    reason: str
    nhat_TB_B: Array
    mu: Array
    q: Array | None
    p_BC: Array | None
    on_pi_l: OnPiL | None = None
    on_pi_s: OnPiS | None = None
    on_pi_p: OnPiP | None = None
