"""Plans a squeeze and the loads that it should hold: the weight and disturbances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.holding_forces import Holding, hold
from drake_polygrasp.certification.robustness import GRAVITY, epsilon_interval, squeeze_force
from drake_polygrasp.grasp import Grasp, GraspObject, RegionCertificate, Verdict
from drake_polygrasp.loading.object_model import Solid
from drake_polygrasp.plant.scratch_plant import ScratchScene

LOAD_SHARE = 0.8
"""Share of what the squeeze holds in the worst direction that the loads use. Our choice.

The fingertips squeeze with the squeeze force divided by this; disturbances, the weight included,
are this times squeeze times epsilon."""
LABELS = (
    *(f"weight along {sign}{axis}" for sign in "+-" for axis in "xyz"),
    *(
        f"{kind} {sign}{axis}"
        for sign in "+-"
        for kind in ("force along", "torque about")
        for axis in "xyz"
    ),
    "the wrench that the grasp bears least",
)
"""Names of the loads of every `LoadPlan`, in their order."""
NO_INERTIA = "the model states no rotational inertia about some axis"
"""Why an object cannot be simulated."""
_NUM_WEIGHTS = 6


@dataclass(frozen=True)
class LoadsUnavailable:
    """The reason why no loads can be planned, or why they cannot be simulated.

    Attributes:
        verdict: the verdict of the checks that need the loads.
        reason: what is missing, for the user.
    """

    verdict: Verdict
    reason: str


@dataclass(frozen=True, eq=False)
class LoadPlan:
    """A squeeze, loads that it should hold, and contact forces that hold them.

    Attributes:
        squeeze_f_B: contact forces on B without a load [N], shape (3, 3).
        holding: the loads, and the contact forces that balance each; its rows follow `labels`.
        labels: names of the loads.
    """

    squeeze_f_B: Array
    holding: Holding
    labels: tuple[str, ...]

    @property
    def weight(self) -> Holding:
        """The part of `holding` whose loads are the weight along +x, +y, +z, -x, -y, -z of B."""
        return self.holding.rows(slice(_NUM_WEIGHTS))


def default_squeeze(
    object_: GraspObject, grasp: Grasp, region: RegionCertificate | None = None
) -> float | None:
    """Returns the total normal force of the fingertips where the user gives none [N].

    Args:
        object_: the object.
        grasp: three contacts.
        region: the errors that the grasp is certified to bear; None if there are none.

    Returns:
        The least force that holds the weight in every orientation, over `LOAD_SHARE`, or the
        region's `squeeze_force`, whichever is greater; None if the mass is unknown or no squeeze
        holds the weight.
    """
    if object_.mass is None:
        return None
    contacts = grasp.p_BC, grasp.nhat_TB_B, grasp.mu
    needed = squeeze_force(*contacts, object_.p_BBcm, object_.rho, object_.mass)
    if needed is None:
        return None
    certified = None if region is None else region.squeeze_force
    return max(needed / LOAD_SHARE, certified or 0.0)


def plan_loads(
    scene: ScratchScene, region: RegionCertificate | None = None
) -> LoadPlan | LoadsUnavailable:
    """Plans loads: the weight along each axis, and disturbances.

    A disturbance includes the weight. It is a force along an axis of B, a torque about one, or the
    wrench that the grasp bears least, along the normal of the facet of W nearest to the origin.

    Args:
        scene: object and grasp.
        region: the errors that the grasp is certified to bear, whose squeeze is used; None if there
            are none.

    Returns:
        The loads with contact forces that hold them; or the reason if the model states no mass or
        no inertia, or no contact forces hold the loads.
    """
    object_, grasp = scene.object_, scene.grasp
    if object_.mass is None:
        return LoadsUnavailable(Verdict.UNDECIDED, "not run: the model states no mass")
    if not has_inertia(scene.solid):
        return LoadsUnavailable(Verdict.UNDECIDED, f"not run: {NO_INERTIA}")
    squeeze = default_squeeze(object_, grasp, region)
    if squeeze is None:
        return LoadsUnavailable(Verdict.FAILS, "no squeeze holds the weight in every orientation")
    axes = np.concatenate([np.eye(6), -np.eye(6)])
    narrowest, epsilon = _narrowest(scene)
    disturbances = LOAD_SHARE * squeeze * epsilon * np.vstack([axes, narrowest])
    return _planned(scene, object_.mass, squeeze, disturbances, LABELS)


def plan_missed_loads(
    scene: ScratchScene, squeeze: float, epsilon: float
) -> LoadPlan | LoadsUnavailable:
    """Plans the loads of a grasp whose fingertips missed: the weight, and one disturbance.

    Args:
        scene: object, with mass and inertia, and grasp, both with their errors.
        squeeze: total normal force of the fingertips [N].
        epsilon: lower bound of epsilon under the certified errors.

    Returns:
        The weight along each axis, and the wrench that the grasp bears least, of size `LOAD_SHARE`
        squeeze epsilon; or the reason if no contact forces hold them.
    """
    narrowest, least = _narrowest(scene)
    if not least > 0:
        return LoadsUnavailable(Verdict.FAILS, "the contacts are not force closure")
    disturbance = LOAD_SHARE * squeeze * epsilon * narrowest[None]
    labels = (*LABELS[:_NUM_WEIGHTS], LABELS[-1])
    return _planned(scene, scene.object_.mass or 0.0, squeeze, disturbance, labels)


def _narrowest(scene: ScratchScene) -> tuple[Array, float]:
    """Returns the wrench of unit length that the grasp bears least, shape (6,), and epsilon."""
    grasp, object_ = scene.grasp, scene.object_
    contacts = grasp.p_BC, grasp.nhat_TB_B, grasp.mu
    epsilon = epsilon_interval(*contacts, object_.p_BBcm, object_.rho)
    if not epsilon.lower > 0:
        return np.zeros(6), 0.0
    return -epsilon.normals[epsilon.offsets.argmin()], epsilon.lower


def _planned(
    scene: ScratchScene,
    mass: float,
    squeeze: float,
    disturbances: Array,
    labels: tuple[str, ...],
) -> LoadPlan | LoadsUnavailable:
    """Plans contact forces for weights and disturbances, whose torques are divided by rho."""
    object_ = scene.object_
    weight = mass * GRAVITY * np.concatenate([np.eye(3, 6), -np.eye(3, 6)])
    scale = np.array([1.0, 1.0, 1.0, object_.rho, object_.rho, object_.rho])
    loads = np.vstack([np.zeros(6), weight, disturbances * scale])
    holding = hold(scene.grasp, object_.p_BBcm, object_.rho, loads, squeeze)
    if holding is None:
        return LoadsUnavailable(Verdict.FAILS, "no contact forces hold the loads")
    return LoadPlan(holding.f_Bc_B[0], holding.rows(slice(1, None)), labels)


def has_inertia(solid: Solid) -> bool:
    """Returns whether all principal moments of inertia are positive, as Drake needs.

    Args:
        solid: the object.
    """
    M = solid.M_BBo_B
    central = M.Shift(M.get_com()).CalcRotationalInertia()
    return bool(min(central.CalcPrincipalMomentsOfInertia()) > 0)
