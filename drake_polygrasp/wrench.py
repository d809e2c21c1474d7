"""Which wrenches three frictional point contacts can apply, for many grasps at once.

Hard point contacts with Coulomb friction and the exact quadratic cone. A batch holds M grasps:
points `p_BC` (M, 3, 3) and inward unit normals `nhat_TB_B` (M, 3, 3), one row a contact, and
friction `mu` (M, 3). A wrench is (force, torque about the centre of mass / rho), six numbers of
one unit, and W is the convex hull of what the contacts apply with normal forces that add up to
1 (Ferrari & Canny, 1992). Everything here is a filter or a bound in floating point: the proof is
`certification.exact`.
"""

from __future__ import annotations

import itertools

import numpy as np

from drake_polygrasp.arrays import Array, Bools

MIN_AREA_RATIO = 1e-3
"""Ours: twice the contacts' area over the square of their longest side, at least. A non-zero area
alone means nothing: collinear points, once turned, have one of 1e-19 m^2."""
_ON_A_SIDE = 1e-9
"""Ours: of unit wrenches, what is nearer to a plane than this is on it."""
_STEPS = np.geomspace(0.3, 0.01, 30)
_SOFTNESS = np.geomspace(0.5, 0.01, 30)
_STARTS = 16
"""Ours, from trials: more of each cost more than they lower the bound."""
_CHUNK = 64
"""Grasps at a time, which keeps the arrays of their directions in the cache."""
_TINY = 1e-100
"""Keeps divisions finite."""
_PAIRS = np.array(list(itertools.combinations(range(6), 2)))
_ORDERS = np.array(list(itertools.permutations(range(3)))).T
_TURNS = 16
"""Ours: points of a rim that are tried; 32 lower the bound by 0.1 percent more."""
_ANGLES = 2 * np.pi * (np.arange(_TURNS) + 0.5) / _TURNS
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)
_NUM_TWISTS = 2 * _TURNS * _ORDERS.shape[1]


def _unit(vectors: Array) -> Array:
    """The vectors divided by their lengths; zero stays zero."""
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    unit: Array = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)
    return unit


def cross(a: Array, b: Array) -> Array:
    """Vector products over the last axis; several times faster than NumPy's for short arrays."""
    a_x, a_y, a_z = a[..., 0], a[..., 1], a[..., 2]
    b_x, b_y, b_z = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0] = a_y * b_z - a_z * b_y
    product[..., 1] = a_z * b_x - a_x * b_z
    product[..., 2] = a_x * b_y - a_y * b_x
    return product


def contact_triangle(p_BC: Array) -> tuple[Array, Array]:
    """The contacts seen from their centroid, and their size.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).

    Returns:
        Points relative to the centroid and divided by the longest side (zero where the three
        points are one), shape (M, 3, 3), and the longest side [m], shape (M,).
    """
    sides = p_BC - p_BC[:, (2, 0, 1)]
    longest = np.sqrt(_dot(sides, sides).max(axis=1))
    centred = p_BC - (p_BC[:, :1] + p_BC[:, 1:2] + p_BC[:, 2:]) / 3.0
    scale = np.where(longest > 0, longest, 1.0)
    return centred / scale[:, None, None], longest


def plane_normal(p_BC: Array) -> Array:
    """Unit normal of the plane Pi_p through the contacts, shape (M, 3).

    Its sign follows the order of the contacts; it is zero where all three are exactly collinear.
    """
    p, _ = contact_triangle(p_BC)
    return _unit(cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))


def non_collinear(p_BC: Array) -> Bools:
    """Whether the contacts span a triangle with room, shape (M,); needed for force closure."""
    p, longest = contact_triangle(p_BC)
    area = np.linalg.norm(cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=-1)
    spread: Bools = (area >= MIN_AREA_RATIO) & (longest > 0)
    return spread


def edge_forces(p_BC: Array, x: Array) -> Array:
    """The internal forces that push along the sides of the contact triangle.

    Equal and opposite pairs, so they balance whatever x is; for contacts that are not collinear
    they are all the forces that do (Murray, Li & Sastry, 1994, ch. 5).

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        x: x_12, x_13, x_23 [1/m], shape (M, 3).

    Returns:
        f_Bc_B, the force on B at each contact, shape (M, 3, 3).
    """
    along_12, along_13, along_23 = (
        x[:, k, None] * (p_BC[:, j] - p_BC[:, i])
        for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)))
    )
    return np.stack(
        [along_12 + along_13, along_23 - along_12, -along_13 - along_23],
        axis=1,
    )


def contact_frames(p_BC: Array, nhat_TB_B: Array) -> Array:
    """Orthonormal (nhat, t_1, t_2) of each contact as rows, shape (M, 3, 3, 3).

    t_1 is the part of the contact plane's normal that is tangent to the face, so that nothing
    computed in these frames depends on the body frame; where that part vanishes (such a grasp
    cannot hold) t_1 is the part of an axis of B.
    """
    N = np.broadcast_to(plane_normal(p_BC)[:, None], nhat_TB_B.shape)
    tangent = N - (N * nhat_TB_B).sum(-1, keepdims=True) * nhat_TB_B
    axis = np.eye(3)[np.abs(nhat_TB_B).argmin(axis=-1)]
    fallback = cross(nhat_TB_B, axis)
    usable = np.linalg.norm(tangent, axis=-1, keepdims=True) > _ON_A_SIDE
    t_1 = _unit(np.where(usable, tangent, fallback))
    return np.stack([nhat_TB_B, t_1, cross(nhat_TB_B, t_1)], axis=2)


def force_closure(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Bools:
    """Whether each grasp is force closure, in closed form (Li, Liu & Cai, 2003), shape (M,).

    Three contacts are force closure iff they are not collinear, their plane cuts every friction
    cone in its interior, and the planar grasp it cuts out is force closure: the origin is interior
    to the hull of the six planar wrenches along the edges of the cut cones. That is so unless a
    plane through two of them and the origin has all others on one closed side.
    """
    p, _ = contact_triangle(p_BC)
    N = plane_normal(p_BC)
    sin_phi = np.einsum("mij,mj->mi", nhat_TB_B, N)
    cos_phi = np.sqrt(np.clip(1.0 - sin_phi**2, 0.0, 1.0))
    cos_alpha = 1.0 / np.sqrt(1.0 + mu**2)
    cuts = (cos_phi > cos_alpha + _ON_A_SIDE).all(axis=1)

    axis = _unit(nhat_TB_B - sin_phi[..., None] * N[:, None])
    cos_beta = np.minimum(np.divide(cos_alpha, cos_phi, out=np.ones_like(mu), where=cos_phi > 0), 1)
    across = np.sqrt(1.0 - cos_beta**2)[..., None] * cross(N[:, None], axis)
    edges = np.stack([cos_beta[..., None] * axis + s * across for s in (-1, 1)], axis=2)
    # (fx, fy, tau) of each edge without a choice of axes in the plane: the planar force turned
    # into B, plus its torque along N.
    torque = cross(p[:, :, None], edges)
    wrenches = _unit((edges + torque).reshape(len(p), 6, 3))

    facet = cross(wrenches[:, _PAIRS[:, 0]], wrenches[:, _PAIRS[:, 1]])
    independent = np.linalg.norm(facet, axis=-1) > _ON_A_SIDE
    side = facet @ wrenches.transpose(0, 2, 1)
    both = (side.max(axis=-1) > _ON_A_SIDE) & (side.min(axis=-1) < -_ON_A_SIDE)
    encloses = (both | ~independent).all(axis=1) & independent.any(axis=1)
    closed: Bools = non_collinear(p_BC) & cuts & encloses
    return closed


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
    forces = contact_frames(p_BC, nhat_TB_B)
    forces[:, :, 1:] *= mu[..., None, None]
    torques = cross((p_BC - p_BBcm)[:, :, None], forces) / rho
    return np.concatenate([forces, torques], axis=-1)


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
    rows = (directions @ cones.reshape(M, 9, 6).transpose(0, 2, 1)).reshape(M, K, 3, 3)
    tangential = np.hypot(rows[..., 1], rows[..., 2])
    h = rows[..., 0] + tangential
    # Where the cone's rim is level all of it attains h: take its centre, not a rounding error.
    level = tangential <= _ON_A_SIDE * np.linalg.norm(directions, axis=-1)[..., None]
    weights = np.ones_like(rows)
    weights[..., 1:] = np.where(level[..., None], 0.0, _unit(rows[..., 1:]))
    points = (weights.transpose(0, 2, 1, 3) @ cones).transpose(0, 2, 1, 3)
    return h, points


def epsilon_upper_bound(
    p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float, *, refine: bool = True
) -> Array:
    """An upper bound of each grasp's epsilon, close to it: to rank and to prune.

    epsilon is the least h(w) over unit w, and any w bounds it: here those of
    `critical_directions`, which alone are mostly close. Descents from rotations about lines that
    the contacts single out catch most of the rest, for several times the work.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        refine: whether to descend as well.

    Returns:
        Shape (M,), not negative; it does not depend on the frame or the order of the contacts.
    """
    bounds: list[Array] = []
    for rows in np.array_split(np.arange(len(p_BC)), len(p_BC) // _CHUNK + 1):
        contacts = p_BC[rows], nhat_TB_B[rows], mu[rows]
        cones = cone_wrenches(*contacts, p_BBcm, rho)
        twists = _rim_twists(*contacts, p_BBcm, rho)
        bound = _radii(cones, twists.reshape(len(rows), _NUM_TWISTS, 6)).min(axis=1)
        if refine:
            rotations = _rotations(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
            bound = np.minimum(bound, _least_support(cones, rotations))
        bounds.append(bound)
    highest: Array = np.maximum(np.concatenate(bounds), 0.0)
    return highest


def critical_directions(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    num: int = 12,
    *,
    turns: bool = False,
) -> tuple[Array, Array]:
    """The unit w in which W reaches least far: what a change of the contacts must improve on.

    Contacts and scale as of `epsilon_upper_bound`; with `turns`, rotations about lines that the
    contacts single out count too, by which the object often leaves contacts that do not hold.

    Returns:
        `num` directions of little h for each grasp, in no order, shape (M, num, 6), and the least
        of h, which bounds epsilon from above where the grasp holds, shape (M,).
    """
    found = []
    for rows in np.array_split(np.arange(len(p_BC)), len(p_BC) // _CHUNK + 1):
        contacts = p_BC[rows], nhat_TB_B[rows], mu[rows]
        w = _rim_twists(*contacts, p_BBcm, rho)
        cones = cone_wrenches(*contacts, p_BBcm, rho)
        radius = _radii(cones, w.reshape(len(rows), _NUM_TWISTS, 6))
        radius = radius.reshape(w.shape[:-1])
        before, after = np.roll(radius, 1, axis=2), np.roll(radius, -1, axis=2)
        is_least = (radius <= before) & (radius <= after)
        order = np.where(is_least, radius, radius + radius.max(initial=0.0))
        w, order = w.reshape(len(rows), _NUM_TWISTS, 6), order.reshape(len(rows), _NUM_TWISTS)
        if turns:
            rotations = _rotations(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
            w = np.concatenate([w, rotations], axis=1)
            order = np.concatenate([order, _radii(cones, rotations)], axis=1)
        best = np.argpartition(order, num, axis=1)[:, :num]
        w = np.take_along_axis(w, best[..., None], axis=1)
        least = order.min(axis=1)
        found.append((_unit(w), np.maximum(least, 0.0)))
    directions, bound = zip(*found, strict=True)
    return np.concatenate(directions), np.concatenate(bound)


def _rim_twists(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """Normals of the facets of W that hold one contact's disc whole, shape (M, 6, _TURNS, 2, 6).

    A contact's part of W is a disc, the wrenches of its cone with normal force 1. The facet
    nearest to the origin nearly always holds the disc of some contact i and touches the rims of
    the others, j and k, in a point each. Seen as a twist with velocities g at the contacts, such
    a w has g_i = n_i, and g_j and g_k with h = 1; rigidity leaves one freedom, the angle of the
    point on rim j, sampled here, and two solutions for k. (i, j, k) are all permutations.
    """
    i, j, k = _ORDERS
    frames = contact_frames(p_BC, nhat_TB_B)[:, j]
    r = (p_BC - p_BBcm) / rho
    r_i, r_ij, r_ik = (a[:, :, None] for a in (r[:, i], r[:, j] - r[:, i], r[:, k] - r[:, i]))
    n_i, n_j, n_k = (nhat_TB_B[:, c, None] for c in (i, j, k))
    mu_j, mu_k = mu[:, j, None], mu[:, k, None] ** 2

    along = _COSINES[:, None] * frames[:, :, None, 1] + _SINES[:, None] * frames[:, :, None, 2]
    along = along - mu_j[..., None] * n_j
    # g_j = n_j + s along has h_j = 1; rigidity: (g_j - n_i) . r_ij = 0.
    rate = _dot(along, r_ij)
    s = _dot(n_i - n_j, r_ij) / np.where(np.abs(rate) < _ON_A_SIDE, _ON_A_SIDE, rate)
    g_ij = n_j + s[..., None] * along - n_i
    omega = cross(r_ij, g_ij) / (_dot(r_ij, r_ij) + _TINY)[..., None]
    # What is left is a turn t about r_ij; h_k = 1 is quadratic in it.
    g_k, rise = n_i + cross(omega, r_ik), cross(r_ij, r_ik)
    x, x_t = _dot(n_k, g_k), _dot(n_k, rise)
    a = mu_k * _dot(rise, rise) - (1 + mu_k) * x_t * x_t
    b = mu_k * _dot(g_k, rise) - (1 + mu_k) * x * x_t + x_t
    c = mu_k * _dot(g_k, g_k) - (1 + mu_k) * x * x + 2 * x - 1
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    t = np.stack([-b - root, -b + root], axis=-1)
    t = t / np.where(np.abs(a) < _TINY, _TINY, a)[..., None]
    omega = omega[..., None, :] + t[..., None] * r_ij[..., None, :]
    v = n_i[..., None, :] - cross(omega, r_i[..., None, :])
    twists: Array = np.concatenate([v, omega], axis=-1)
    return twists


def _dot(a: Array, b: Array) -> Array:
    product: Array = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return product


def _radii(cones: Array, w: Array) -> Array:
    """h(w) / |w| for cones (M, 3, 3, 6) and directions (M, K, 6), shape (M, K)."""
    rows = w @ cones.reshape(len(w), 9, 6).transpose(0, 2, 1)
    n, t_1, t_2 = rows[..., 0::3], rows[..., 1::3], rows[..., 2::3]
    h = n + np.sqrt(t_1 * t_1 + t_2 * t_2)
    highest = np.maximum(np.maximum(h[..., 0], h[..., 1]), h[..., 2])
    radius: Array = highest / (np.sqrt(np.einsum("mki,mki->mk", w, w)) + _TINY)
    return radius


def _rotations(p_BC: Array, nhat_TB_B: Array, p_BBcm: Array, rho: float) -> Array:
    """Rotations about lines through each contact and their centroid, shape (M, 128, 6).

    The lines run along the contact frames' axes, the triangle's sides and its altitudes; a
    rotation is (velocity of the centre of mass, rho times angular velocity), which pairs with
    wrenches.
    """
    N = plane_normal(p_BC)[:, None]
    sides = _unit(p_BC - p_BC[:, (2, 0, 1)])
    frames = contact_frames(p_BC, nhat_TB_B).reshape(-1, 9, 3)
    omega = np.concatenate([N, sides, cross(N, sides), frames], axis=1)[:, None]
    points = np.concatenate([p_BC, p_BC.mean(axis=1, keepdims=True)], axis=1)
    v = cross(p_BBcm - points[:, :, None], -omega)
    twists = np.concatenate([v, np.broadcast_to(rho * omega, v.shape)], axis=-1)
    twists = twists.reshape(-1, 64, 6)
    return np.concatenate([twists, -twists], axis=1)


def _least_support(cones: Array, directions: Array) -> Array:
    """Descend h(w) / |w| from the best directions, shape (M,).

    Steps are taken in the metric of W's second moment, in which W is about round, along the
    gradients of the contacts' parts of h, weighted by how nearly they attain it.
    """
    moment = np.einsum("mcri,mcrj,r->mij", cones, cones, (1.0, 0.5, 0.5), optimize=True)
    floor = _TINY + 1e-12 * np.trace(moment, axis1=1, axis2=2)
    inverse = np.linalg.inv(moment + floor[:, None, None] * np.eye(6))

    def metric_norm(w: Array) -> Array:
        square = ((w @ moment) * w).sum(-1, keepdims=True)
        norm: Array = np.sqrt(np.maximum(square, 0.0)) + _TINY
        return norm

    start = _radii(cones, directions)
    best = np.argsort(start, axis=1)[:, :_STARTS]
    w = np.take_along_axis(directions, best[..., None], axis=1)
    w = w / metric_norm(w)
    least = start.min(axis=1)
    for step, softness in zip(_STEPS, _SOFTNESS, strict=True):
        h, points = support(cones, w)
        highest = h.max(axis=-1, keepdims=True)
        radii = highest[..., 0] / (np.linalg.norm(w, axis=-1) + _TINY)
        least = np.minimum(least, radii.min(axis=1))
        weights = np.exp((h - highest) / (softness * np.abs(highest) + _TINY))
        weights /= weights.sum(axis=-1, keepdims=True)
        slope = (weights[:, :, None] @ points)[:, :, 0]
        value = np.maximum((weights * h).sum(-1, keepdims=True), _TINY)
        descent = (slope / value - w / ((w * w).sum(-1, keepdims=True) + _TINY)) @ inverse
        w = w - step * descent / metric_norm(descent)
        w /= metric_norm(w)
    bound: Array = np.minimum(least, _radii(cones, w).min(axis=1))
    return bound
