"""What Sections 4 to 7 compute for one set of faces in each of their planes, to draw and to teach.

Every plane has two unit axes, expressed in B; coordinates in the plane are measured along them from
Bo.
"""

from __future__ import annotations

from dataclasses import dataclass

import shapely

from drake_polygrasp.arrays import Array, Shapes


@dataclass(frozen=True, eq=False)
class OnPiL:
    """The plane Pi_l of a non-parallel set (Section 4.1, step 1).

    Attributes:
        axes_B: unit axes of the plane, t_1 first, shape (2, 3).
        faces: projections of the faces A_i [m], segments where a face is orthogonal to Pi_l, shape
            (3,).
        nprime: unit directions of n'_i in the plane, shape (3, 2).
        low, high: bounds of t_i . p in the strips, with t_i = N x n'_i [m], shape (3,).
        gamma: half-angle alpha - phi of the cones C_ri [rad].
        region_l: R^l, whose centroid is the apex of the cones; None where it is empty.
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
    """The plane Pi_s (Section 4.1, step 2, Sections 4.2 and 5).

    The second axis is N, so that Pi_p is horizontal. Where the faces are not opposed, or no
    direction s_e or l_u exists, only projections and `p_cm` are meaningful, on arbitrary axes.

    Attributes:
        axes_B: unit axes of the plane, shape (2, 3).
        faces: projections A_i^s [m], shape (3,).
        common: A_aux2 of a parallel set; A_12 of a pair, or the pocket that contains R_i; empty for
            a non-parallel set.
        low, high: bounds of R^s along N [m]; None where there is no plane Pi_p.
        height: N . p of the points of Pi_p [m]; None where there is no plane.
        p_cm: c_m^s, the projected centre of mass [m], shape (2,).
        heights: bounds along N of the portions A_li of a non-parallel set whose R^s is empty [m],
            shape (3, 2); where a portion is empty the lower bound is the greater.
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
    """The grasp plane Pi_p (Sections 6 and 7).

    Attributes:
        axes_B: unit axes of the plane, shape (2, 3).
        height: N . p of the points of the plane [m].
        segments: a_i as a MultiLineString each [m], shape (3,).
        directions: unit directions of the lines L_i: n'_i of a non-parallel set, else n_bs, shape
            (3, 2).
        nprime: unit directions of the projections of n_i on the plane, shape (3, 2).
        region_p: P, which may be empty.
        p_cI: c_I^p, the centroid of P [m], shape (2,); None where P is empty.
        p_ca: c_a, the centroid of hull(a_1, a_2, a_3) [m], shape (2,).
        p_cm: c_m^p, the projected centre of mass [m], shape (2,).
        contacts: P_1, P_2, P_3 [m], shape (3, 2); None where Section 7 found none.
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
    """What the paper's method computes for one set of faces, up to the step that ends it.

    Attributes:
        faces: faces A_1, A_2, A_3; for a pair A_3 is A_2.
        is_parallel: whether forces are planned to be parallel, as those of pairs are.
        alpha: half-angle of the friction cones [rad].
        phi: angle between the normals and Pi_l, or (pi - angle(n_1, n_2)) / 2 of a pair [rad].
        reason: what ended the set, one of `reasons.REASONS`; "not_evaluated" where contacts were
            constructed, because a trace does not certify them.
        nhat_TB_B: inward unit normals n_i, shape (3, 3).
        mu: friction coefficients, shape (3,).
        q: q_1 to q_5, with maxima over the sets of these faces alone; None where P is empty.
        p_BC: contact points expressed in B [m], shape (3, 3); None where Section 7 found none.
        on_pi_l: what is computed in Pi_l; None for parallel sets and pairs.
        on_pi_s: what is computed in Pi_s; None where an earlier step ends the set.
        on_pi_p: what is computed in Pi_p; None where an earlier step ends the set.
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
