"""Simulates a grasp whose fingertips miss, within the errors that its region certificate states.

A miss displaces each fingertip in the tangent plane of its contact, from where it moves along the
contact's normal to the true surface. It pushes along the surface's normal there, with less
friction, on a body whose centre of mass is elsewhere. The fingertips squeeze as in the simulation
without errors, and the contact forces are planned for the contacts as they are: the certificate
states that such forces exist, not that a hand finds them.

A tilt of the normals is not drawn. Drake computes the direction of contact forces from the surface,
and a tilted joint of the fingertip changes no contact force.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
from pydrake.multibody.tree import SpatialInertia

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.geometry.surface_contact import CRACK
from drake_polygrasp.geometry.tolerances import ON_SURFACE
from drake_polygrasp.geometry.triangles import face_frame
from drake_polygrasp.grasp import Grasp, PlantVerdict, RegionCertificate, Verdict
from drake_polygrasp.loading.object_model import Solid
from drake_polygrasp.plant.drake_calls import Refusal, ask_drake
from drake_polygrasp.plant.load_test import ask_for_loads, simulate_loads
from drake_polygrasp.plant.loads import LoadsUnavailable, plan_missed_loads
from drake_polygrasp.plant.scratch_plant import ScratchScene
from drake_polygrasp.plant.surface_distance import SurfaceDistance

NO_REGION = "no errors are certified"
"""What is said of a grasp without a region certificate."""
_SEED = 2017
_EXTREME = 3
"""Our choice: one miss of so many has the greatest errors of all kinds, in random directions."""
_STEP = CRACK / 10
"""Least step of a fingertip toward the surface, times L. Our choice."""
_ABOVE = ON_SURFACE
"""Height over the surface at which its normal is measured, times L. Our choice."""
_HALVINGS = 60


def check_misses(
    scene: ScratchScene, region: RegionCertificate, squeeze: float, count: int
) -> PlantVerdict:
    """Draws misses within certified errors and simulates the weight and a disturbance under each.

    The same arguments give the same misses, and a greater count adds to them.

    Args:
        scene: object and grasp without errors.
        region: the errors.
        squeeze: total normal force of the fingertips [N].
        count: number of misses.

    Returns:
        The verdict "misses": whether all hold, how many do, the least margin of their simulations,
        and why the first one that does not hold fails.
    """
    if region.squeeze_force is None:
        reason = "not run: no squeeze is certified to hold the weight under the errors"
        return PlantVerdict("misses", Verdict.UNDECIDED, None, "1", reason)
    surface = SurfaceDistance(scene.solid.parts)
    verdicts = [
        _check_miss(scene, surface, region, squeeze, number) for number in range(1, count + 1)
    ]
    found = [verdict.verdict for verdict in verdicts]
    margins = [verdict.margin for verdict in verdicts if verdict.margin is not None]
    overall, reason = Verdict.HOLDS, f"{found.count(Verdict.HOLDS)} of {count} hold"
    for worse in (Verdict.FAILS, Verdict.UNDECIDED):
        if worse in found:
            first = found.index(worse)
            overall, reason = worse, f"{reason}; miss {first + 1}: {verdicts[first].reason}"
            break
    return PlantVerdict("misses", overall, min(margins, default=None), "1", reason)


def _check_miss(
    scene: ScratchScene,
    surface: SurfaceDistance,
    region: RegionCertificate,
    squeeze: float,
    number: int,
) -> PlantVerdict:
    """Returns the verdict of the simulation of one miss."""
    missed = ask_drake(lambda: draw_miss(scene, surface, region, number))
    if isinstance(missed, Refusal):
        return PlantVerdict("misses", Verdict.UNDECIDED, None, "1", missed.reason)
    if isinstance(missed, str):
        return PlantVerdict("misses", Verdict.FAILS, None, "1", missed)
    epsilon = region.epsilon_lower or 0.0
    plan = ask_for_loads(lambda: plan_missed_loads(missed, squeeze, epsilon))
    if isinstance(plan, LoadsUnavailable):
        return PlantVerdict("misses", plan.verdict, None, "1", plan.reason)
    return simulate_loads(missed, plan).verdict


def draw_miss(
    scene: ScratchScene, surface: SurfaceDistance, region: RegionCertificate, number: int
) -> ScratchScene | str:
    """Draws a miss within certified errors.

    Displacements are uniform in discs, friction coefficients in their intervals and the centre of
    mass in a ball; every third miss has the greatest errors of all kinds, in random directions. The
    certificate is of points: where the planned fingertip does not fit, a smaller one is used.

    Args:
        scene: object and grasp without errors.
        surface: the object's own geometry.
        region: the errors.
        number: number of the miss, from 1.

    Returns:
        Object and grasp with the errors; or why there are none: a fingertip that meets no surface.
    """
    rng = np.random.default_rng([_SEED, number])
    is_extreme = number % _EXTREME == 0
    turn, share, less, far = (rng.uniform(size=n) for n in (3, 3, 3, 1))
    direction = rng.normal(size=3)
    if is_extreme:
        share = less = far = np.ones(3)
    radius = region.placement_error * np.sqrt(share)
    L = scene.object_.polyhedron.diameter
    p_BC, nhat_TB_B = scene.grasp.p_BC.copy(), scene.grasp.nhat_TB_B.copy()
    for i in range(3):
        angle, R_BC = 2 * math.pi * float(turn[i]), face_frame(nhat_TB_B[i])
        across = radius[i] * (R_BC[:, :2] @ [math.cos(angle), math.sin(angle)])
        landed = _land(surface, p_BC[i], nhat_TB_B[i], across, L)
        if landed is None:
            return f"fingertip {i + 1} meets no surface"
        p_BC[i], nhat_TB_B[i] = landed
    mu = scene.grasp.mu * (1.0 - region.friction_error * less)
    grasp = replace(scene.grasp, p_BC=frozen(p_BC), nhat_TB_B=frozen(nhat_TB_B), mu=frozen(mu))
    shift = region.com_error * np.cbrt(far[0]) * direction / np.linalg.norm(direction)
    return ScratchScene(
        replace(scene.object_, p_BBcm=frozen(scene.object_.p_BBcm + shift)),
        _with_com_moved(scene.solid, shift),
        grasp,
        _radius_that_fits(surface, grasp, scene.tip_radius, L),
        scene.pad_width,
    )


def _land(
    surface: SurfaceDistance, p_BC: Array, nhat_TB_B: Array, across: Array, diameter: float
) -> tuple[Array, Array] | None:
    """Returns where a fingertip that is off by `across` [m] lands, and the normal there.

    It starts outside the body or, where a part of the body is opposite the contact, half way to it.
    """
    hair = _ABOVE * diameter
    opposite = _way(surface, p_BC - hair * nhat_TB_B, -nhat_TB_B, 2 * diameter, diameter)
    height = diameter if opposite is None else (hair + opposite) / 2
    start = p_BC + across - height * nhat_TB_B
    way = _way(surface, start, nhat_TB_B, height + diameter, diameter)
    if way is None:
        return None
    above = start + (way - hair) * nhat_TB_B
    p_BN = surface.nearest(above).p_BN
    return p_BN, (p_BN - above) / np.linalg.norm(p_BN - above)


def _way(
    surface: SurfaceDistance, p_BQ: Array, direction: Array, longest: float, diameter: float
) -> float | None:
    """Returns how far a point can move before it meets the surface [m]; None if it meets none.

    Where the surface is nearest, no nearer part of it is in the way: so far it moves at once.
    """
    clear = way = 0.0
    while (distance := surface.nearest(p_BQ + way * direction).distance) > 0:
        if way > longest:
            return None
        clear, way = way, way + max(distance, _STEP * diameter)
    if way == 0:
        return None
    for _ in range(_HALVINGS):
        middle = (clear + way) / 2
        if surface.nearest(p_BQ + middle * direction).distance > 0:
            clear = middle
        else:
            way = middle
    return clear


def _with_com_moved(solid: Solid, shift: Array) -> Solid:
    """Returns the body with its centre of mass elsewhere, and the same inertia about it."""
    M, p_BBcm = solid.M_BBo_B, solid.M_BBo_B.get_com()
    central = M.Shift(p_BBcm).CalcRotationalInertia()
    moved = SpatialInertia.MakeFromCentralInertia(M.get_mass(), p_BBcm + shift, central)
    return replace(solid, M_BBo_B=moved)


def _radius_that_fits(
    surface: SurfaceDistance, grasp: Grasp, tip_radius: float, diameter: float
) -> float:
    """Returns a radius of fingertips that penetrate neither the object nor each other [m]."""
    least, slack = CRACK / 2 * diameter, ON_SURFACE * diameter
    while tip_radius / 2 >= least:
        p_BT = grasp.p_BC - tip_radius * grasp.nhat_TB_B
        apart = min(float(np.linalg.norm(p - q)) for p, q in itertools.combinations(p_BT, 2))
        clear = min(surface.nearest(p).distance for p in p_BT)
        if apart >= 2 * tip_radius and clear >= tip_radius - slack:
            break
        tip_radius /= 2
    return tip_radius
