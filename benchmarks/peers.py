"""Other ways to find three contacts on the same eroded faces, made as strong and as fast as ours.

They share with the planner what decides, measures and proves (closed form, room for tips, epsilon,
certificate), so that they differ in nothing but where they look.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Batch, Bools, Ints
from drake_polygrasp.certification.certify import prove_many
from drake_polygrasp.certification.robustness import RELATIVE_GAP, epsilon_interval
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.geometry.surface_contact import face_at, fingertip_fits, project_contacts
from drake_polygrasp.grasp import GraspObject, Verdict
from drake_polygrasp.paper.orientation import friction_angle, opposes
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates

NUM_TRIPLES = 5_000
ROUNDING = 1e-3
"""Relative: what estimates in single precision may be short of."""
_RAYS = 256
"""Rays intersected at once, which bounds memory."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The eroded regions cut into triangles, to draw points of equal chance by area."""

    regions: Regions
    triangles_B: Array
    """[m], shape (T, 3, 3)."""
    region: Ints
    """Shape (T,)."""
    area: Array
    """Cumulative [m^2], shape (T,)."""


@dataclass(frozen=True, eq=False)
class Triples(Batch):
    """Three contacts a row."""

    p_BC: Array
    """[m], shape (M, 3, 3)."""
    region: Ints
    """Shape (M, 3)."""
    nhat_TB_B: Array
    """Shape (M, 3, 3)."""
    mu: Array
    """Shape (M, 3)."""

    @property
    def contacts(self) -> tuple[Array, Array, Array]:
        """What the functions of `wrenches` take first."""
        return self.p_BC, self.nhat_TB_B, self.mu


@dataclass(frozen=True, eq=False)
class Found:
    """What a search found, and what its stages cost."""

    best: Triples
    """One row, or none."""
    epsilon: float
    num_closed: int
    """Triples of force closure with room for tips."""
    seconds: dict[str, float]


def surface_of(regions: Regions) -> Surface:
    """Regions as triangles."""
    triangles, region = shapely.get_parts(
        shapely.constrained_delaunay_triangles(regions.polygon_F), return_index=True
    )
    triangles = shapely.orient_polygons(triangles)
    corners_F = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    axes = regions.R_BF[region][:, :, :2]
    corners_B = regions.p_BF[region, None] + np.einsum("tij,tvj->tvi", axes, corners_F)
    return Surface(regions, corners_B, region, np.cumsum(shapely.area(triangles)))


def draw_points(
    surface: Surface, shape: tuple[int, ...], rng: np.random.Generator
) -> tuple[Array, Ints]:
    """Points drawn by area [m], shape (*shape, 3), and their regions."""
    u = rng.random((3, *shape))
    t = np.searchsorted(surface.area, u[0] * surface.area[-1], side="right")
    t = np.minimum(t, len(surface.area) - 1)
    a, b = np.sqrt(u[1]), u[2]
    weights = np.stack([1 - a, a * (1 - b), a * b], axis=-1)
    points: Array = (weights[..., None, :] @ surface.triangles_B[t])[..., 0, :]
    return points, surface.region[t]


def triples_at(regions: Regions, p_BC: Array, region: Ints) -> Triples:
    """Contacts of points on regions."""
    return Triples(p_BC, region, regions.nhat_TB_B[region], regions.mu[region])


def random_triples(surface: Surface, num: int, rng: np.random.Generator) -> Triples:
    """Three points drawn by area, each alone."""
    return triples_at(surface.regions, *draw_points(surface, (num, 3), rng))


def antipodal_triples(surface: Surface, num: int, rng: np.random.Generator) -> Triples:
    """Two points whose line lies in both friction cones, and a third drawn by area.

    The line starts at a point drawn by area and runs anywhere in its cone, uniformly by the
    tangent; of the regions it meets, one that it meets within the other cone is taken.
    """
    regions = surface.regions
    p_1, r_1 = draw_points(surface, (num,), rng)
    p_3, r_3 = draw_points(surface, (num,), rng)
    along = _in_cones(regions.R_BF[r_1], regions.mu[r_1], rng)
    chance = rng.random(num)
    hits = [_opposite(surface, p_1[k], along[k], chance[k]) for k in _chunks(num, _RAYS)]
    reach, r_2 = (np.concatenate(column) for column in zip(*hits, strict=True))
    hit = np.isfinite(reach)
    p_2 = p_1[hit] + reach[hit, None] * along[hit]
    return triples_at(
        regions,
        np.stack([p_1[hit], p_2, p_3[hit]], axis=1),
        np.stack([r_1[hit], r_2[hit], r_3[hit]], axis=1),
    )


def _chunks(num: int, size: int) -> list[Ints]:
    return np.array_split(np.arange(num), num // size + 1)


def _in_cones(R_BF: Array, mu: Array, rng: np.random.Generator) -> Array:
    """Unit vectors in the friction cones of faces, inward, shape (M, 3)."""
    turn = 2 * np.pi * rng.random(len(mu))
    tangential = mu * np.sqrt(rng.random(len(mu)))
    local = np.stack([tangential * np.cos(turn), tangential * np.sin(turn), -np.ones_like(mu)], -1)
    unit: Array = np.einsum("mij,mj->mi", R_BF, local) / np.sqrt(1 + tangential**2)[:, None]
    return unit


def _opposite(surface: Surface, p: Array, along: Array, chance: Array) -> tuple[Array, Ints]:
    """Where each line meets a region within its friction cone: how far [m], nan if nowhere.

    Lines of fingers that spread, in a hole, meet it behind them.
    """
    nhat = surface.regions.nhat_TB_B[surface.region]
    least = 1 / np.sqrt(1 + surface.regions.mu[surface.region] ** 2)
    slope = along @ nhat.T
    a, b, c = np.moveaxis(surface.triangles_B, 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = ((a * nhat).sum(-1) - p @ nhat.T) / slope
    inside = (slope <= -least) & np.isfinite(reach)
    ray, t = np.nonzero(inside)
    point = p[ray] + reach[ray, t, None] * along[ray]
    for start, end in ((a, b), (b, c), (c, a)):
        turn = np.cross(end[t] - start[t], point - start[t])
        # Triangles run counter-clockwise from outside; nhat points inward.
        kept = (turn * nhat[t]).sum(-1) <= 0
        ray, t, point = ray[kept], t[kept], point[kept]
    # One hit a line: the one at `chance` of those it has.
    count = np.bincount(ray, minlength=len(p))
    first = np.cumsum(count) - count
    rows = np.flatnonzero(count)
    chosen = (first + (chance * count).astype(int))[rows]
    distance, region = np.full(len(p), np.nan), np.zeros(len(p), dtype=np.int64)
    distance[rows] = reach[rows, t[chosen]]
    region[rows] = surface.region[t[chosen]]
    return distance, region


def closed(object_: GraspObject, triples: Triples, tip_radius: float) -> Ints:
    """Rows of force closure with room for tips, ascending."""
    rows = np.flatnonzero(opposes(triples.nhat_TB_B, friction_angle(triples.mu)))
    rows = rows[force_closure(*triples.take(rows).contacts)]
    return rows[have_room(object_, triples.take(rows), tip_radius)]


def have_room(object_: GraspObject, triples: Triples, tip_radius: float) -> Bools:
    """Whether tips fit at all three contacts, shape (M,)."""
    p, nhat = triples.p_BC.reshape(-1, 3), triples.nhat_TB_B.reshape(-1, 3)
    fits = fingertip_fits(object_.polyhedron, p, nhat, tip_radius).reshape(-1, 3)
    return np.asarray(fits.all(axis=1))


def upper_bound(object_: GraspObject, triples: Triples) -> Array:
    """`epsilon_bound.epsilon_upper_bound`, shape (M,)."""
    return epsilon_upper_bound(*triples.contacts, object_.p_BBcm, object_.rho)


def epsilon_of(
    object_: GraspObject,
    triple: Triples,
    *,
    at_least: float = 0.0,
    relative_gap: float = RELATIVE_GAP,
) -> float:
    """The lower bound of one row's epsilon; anything below where it is less than `at_least`."""
    p_BC, nhat_TB_B, mu = (values[0] for values in triple.contacts)
    interval = epsilon_interval(
        p_BC,
        nhat_TB_B,
        mu,
        object_.p_BBcm,
        object_.rho,
        at_least=at_least,
        relative_gap=relative_gap,
    )
    return interval.lower


def best_of(object_: GraspObject, triples: Triples) -> tuple[Triples, float]:
    """The row of greatest epsilon, none of no rows, and its lower bound."""
    # As the planner compares many; where an estimate is too low, by less than this.
    estimate = epsilon_estimates(*triples.contacts, object_.p_BBcm, object_.rho) * (1 + ROUNDING)
    best, epsilon = np.empty(0, dtype=np.int64), 0.0
    for k in np.argsort(-estimate, kind="stable"):
        if estimate[k] <= epsilon:
            break
        row = np.array([k])
        lower = epsilon_of(object_, triples.take(row), at_least=epsilon)
        if lower > epsilon:
            best, epsilon = row, lower
    return triples.take(best), epsilon


def is_proved(object_: GraspObject, triple: Triples, face: Ints, tip_radius: float) -> bool:
    """Whether one row on faces (1, 3) is a grasp, as the planner proves its own.

    On the true surface, with room for tips, by the exact certificate.
    """
    projected = project_contacts(object_.polyhedron, triple.p_BC[0], face[0])
    contacts = projected.p_BC, projected.nhat_TB_B
    on_face = face_at(object_.polyhedron, *contacts) >= 0
    fits = fingertip_fits(object_.polyhedron, *contacts, tip_radius)
    if not (projected.ok & on_face & fits).all():
        return False
    (proof,) = prove_many(projected.p_BC[None], projected.nhat_TB_B[None], triple.mu)
    return proof.verdict is Verdict.HOLDS


class Stopwatch:
    """Seconds of consecutive stages."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, stage: str) -> None:
        """Ends the stage `stage`."""
        now = perf_counter()
        self.seconds[stage] = now - self._last
        self._last = now
