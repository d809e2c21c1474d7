"""Plans a squeeze and the loads that it should hold: the weight and disturbances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.holding_forces import Holding, hold
from drake_polygrasp.certification.robustness import GRAVITY, epsilon_interval, squeeze_force
from drake_polygrasp.grasp import Verdict
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


def plan_loads(scene: ScratchScene) -> LoadPlan | LoadsUnavailable:
    """Plans loads: the weight along each axis, and disturbances.

    A disturbance includes the weight. It is a force along an axis of B, a torque about one, or the
    wrench that the grasp bears least, along the normal of the facet of W nearest to the origin.

    Args:
        scene: object and grasp.

    Returns:
        The loads with contact forces that hold them; or the reason if the model states no mass or
        no inertia, or no contact forces hold the loads.
    """
    object_, grasp = scene.object_, scene.grasp
    if object_.mass is None:
        return LoadsUnavailable(Verdict.UNDECIDED, "not run: the model states no mass")
    if not _has_inertia(scene.solid):
        return LoadsUnavailable(
            Verdict.UNDECIDED, "not run: the model states no rotational inertia about some axis"
        )
    contacts = grasp.p_BC, grasp.nhat_TB_B, grasp.mu
    needed = squeeze_force(*contacts, object_.p_BBcm, object_.rho, object_.mass)
    if needed is None:
        return LoadsUnavailable(Verdict.FAILS, "no squeeze holds the weight in every orientation")
    squeeze = needed / LOAD_SHARE
    axes = np.concatenate([np.eye(6), -np.eye(6)])
    weight = object_.mass * GRAVITY * np.concatenate([np.eye(3, 6), -np.eye(3, 6)])
    epsilon = epsilon_interval(*contacts, object_.p_BBcm, object_.rho)
    narrowest = -epsilon.normals[epsilon.offsets.argmin()]
    disturbances = LOAD_SHARE * squeeze * epsilon.lower * np.vstack([axes, narrowest])
    disturbances[:, 3:] *= object_.rho
    loads = np.vstack([np.zeros(6), weight, disturbances])
    holding = hold(grasp, object_.p_BBcm, object_.rho, loads, squeeze)
    if holding is None:
        return LoadsUnavailable(Verdict.FAILS, "no contact forces hold the loads")
    return LoadPlan(holding.f_Bc_B[0], holding.rows(slice(1, None)), LABELS)


def _has_inertia(solid: Solid) -> bool:
    """Returns whether all principal moments of inertia are positive, as Drake needs."""
    M = solid.M_BBo_B
    central = M.Shift(M.get_com()).CalcRotationalInertia()
    return bool(min(central.CalcPrincipalMomentsOfInertia()) > 0)
