"""Named contacts and random ones, shared by the tests."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.certify import ProvedGrasp, certify_proved, prove
from drake_polygrasp.certification.radii import Interval
from drake_polygrasp.certification.robustness import squeeze_intervals
from drake_polygrasp.grasp import CertifiedGrasp, Grasp, GraspPlane

RHO_BOX = float(np.linalg.norm([0.05, 0.05, 0.1]))


def grasp(p_BC: Array, nhat_TB_B: Array, mu: float | Array) -> Grasp:
    """A grasp of which only the contacts matter."""
    plane = GraspPlane(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    return Grasp(
        np.array(p_BC, dtype=float),
        np.array(nhat_TB_B, dtype=float),
        np.broadcast_to(np.array(mu, dtype=float), (3,)),
        "two_faces",
        (0, 1, 1),
        plane,
    )


def certified_grasp(
    found: Grasp, mass: float | None, rho: float, p_BBcm: Array, edge_distance: float | None = None
) -> CertifiedGrasp:
    """A grasp that holds, with its certificate."""
    proved = ProvedGrasp(found, prove(found), edge_distance)
    (certified,) = certify_proved([proved], mass=mass, p_BBcm=p_BBcm, rho=rho)
    return certified


def squeeze_interval(
    p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float, **gap: float
) -> Interval:
    """Bounds of r_w of one grasp."""
    contacts = p_BC[None], nhat_TB_B[None], mu[None]
    (r_w,) = squeeze_intervals(*contacts, p_BBcm, rho, **gap)
    return r_w


def box_grasp(mu: float = 0.3) -> Grasp:
    """The grasp file's example: two faces of a box of 0.1 x 0.1 x 0.2 m."""
    return grasp(
        [[0.05, 0.0, 0.0], [-0.05, 0.02, 0.0], [-0.05, -0.02, 0.0]],
        [[-1, 0, 0], [1, 0, 0], [1, 0, 0]],
        mu,
    )


def prism_grasp(mu: float = 0.3, radius: float = 0.05, outward: bool = False) -> Grasp:
    """Three contacts 120 degrees apart on a prism, or on the wall of a hole from inside."""
    angle = 2 * np.pi * np.arange(3) / 3
    spokes = np.stack([np.cos(angle), np.sin(angle), np.zeros(3)], axis=1)
    return grasp(radius * spokes, spokes if outward else -spokes, mu)


def wedge_grasp(phi: float, mu: float) -> Grasp:
    """Two faces that converge at 2 phi; force closure iff mu > tan(phi)."""
    left = [np.cos(phi), np.sin(phi), 0.0]
    right = [-np.cos(phi), np.sin(phi), 0.0]
    return grasp([[-0.1, 0, 0], [0.1, 0, 0.05], [0.1, 0, -0.05]], [left, right, right], mu)


def random_contacts(
    num: int, seed: int = 0, mu: tuple[float, float] = (0.1, 1.0)
) -> tuple[Array, Array, Array]:
    """Contacts on and in the unit ball, normals roughly inward; about one in seven holds."""
    rng = np.random.default_rng(seed)
    spokes = rng.normal(size=(num, 3, 3))
    spokes /= np.linalg.norm(spokes, axis=-1, keepdims=True)
    nhat = -spokes + 0.5 * rng.normal(size=spokes.shape)
    nhat /= np.linalg.norm(nhat, axis=-1, keepdims=True)
    return spokes * rng.uniform(0.5, 1, (num, 3, 1)), nhat, rng.uniform(*mu, (num, 3))


def lattice_contacts(num: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Contacts on a lattice of 1 cm with normals along axes, diagonals: full of coincidences."""
    rng = np.random.default_rng(seed)
    directions = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]) - 1.0
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    p = 0.01 * rng.integers(-3, 4, (num, 3, 3))
    return p, directions[rng.integers(0, 26, (num, 3))], rng.choice([0.3, 0.5, 1.0], (num, 3))


def collinear_contacts(num: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Opposed contacts on a line, turned in floating point: collinear but for rounding."""
    rng = np.random.default_rng(seed)
    along = np.sort(rng.uniform(-1, 1, (num, 3)), axis=1)
    R = random_rotations(num, rng)
    nhat = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0]])
    return along[..., None] * R[:, None, :, 0], nhat @ R.transpose(0, 2, 1), np.full((num, 3), 0.5)


def random_rotations(num: int, rng: np.random.Generator) -> Array:
    """Rotation matrices, uniformly distributed, shape (num, 3, 3)."""
    Q, upper = np.linalg.qr(rng.normal(size=(num, 3, 3)))
    Q = Q * np.sign(np.diagonal(upper, axis1=1, axis2=2))[:, None]
    return Q * np.linalg.det(Q)[:, None, None]


def round_body(
    num_facets: int,
    radii: tuple[float, float, float] = (0.05, 0.05, 0.05),
    noise: float = 0.0,
    seed: int = 0,
) -> Array:
    """An ellipsoid of so many facets, an even number: vertices on a spiral, moved by noise [m].

    Triangles of shape (T, 3, 3), counter-clockwise from outside.
    """
    count = num_facets // 2 + 2
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + np.sqrt(5)) * k
    sphere = np.c_[np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)]
    corners = ConvexHull(sphere).simplices
    inward = np.linalg.det(sphere[corners]) < 0
    corners[inward] = corners[inward, ::-1]
    points = sphere * radii + noise * np.random.default_rng(seed).normal(size=sphere.shape)
    triangles: Array = points[corners]
    return triangles


def damaged(triangles: Array, seed: int) -> Array:
    """The same solid as careless software writes it: facets doubled, turned, jittered, split."""
    rng = np.random.default_rng(seed)
    L = np.ptp(triangles.reshape(-1, 3), axis=0).max()
    vertices, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    vertices = vertices + 1e-8 * L * rng.uniform(-1, 1, vertices.shape)
    out = list(vertices[index.reshape(-1, 3)])
    for k in rng.choice(len(out), size=3, replace=False):
        a, b, c = out[k]
        match rng.integers(3):
            case 0:
                out.append(out[k].copy())
            case 1:
                out[k] = out[k][::-1]
            case _:  # The neighbour across ab keeps its side whole: a T-junction.
                middle = a + rng.uniform(0.2, 0.8) * (b - a)
                out[k] = np.array([a, middle, c])
                out.append(np.array([middle, b, c]))
    return np.array(out)
