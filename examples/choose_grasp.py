"""Plans a grasp of an object where it lies, and how hard to squeeze."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from drake_polygrasp import (
    CertifiedGrasp,
    GraspObject,
    UsageError,
    object_from_plant,
    obstacles_from_plant,
    plan_grasps,
)
from drake_polygrasp.certification import GRAVITY, friction_needed
from drake_polygrasp.plant import (
    FingertipSpheres,
    fingertip_friction,
    fingertip_spheres,
    is_approach_clear,
)
from examples.motion import Array, Task, Z, plan_motion

STANDOFF = 0.02
"""[m] from the contacts, where the fingertips start."""
LOAD_SHARE = 0.8
"""Of what the squeeze bears in any direction: the most that weight and inertia ask of it."""


@dataclass(frozen=True, eq=False)
class Target:
    """An object at rest, and how it is to be squeezed."""

    object_: GraspObject
    X_WB: RigidTransform
    found: CertifiedGrasp
    tip_radius: float
    """[m]"""
    squeeze: float
    """Total normal force [N]."""

    def loads(self, a_WH: Array) -> Array:
        """Weight and inertia under accelerations a_WH [m/s^2], shape (N, 3), as `hold` takes them.

        Returns forces [N] and torques about the centre of mass [N m], expressed in B, shape (N, 6).
        """
        assert self.object_.mass is not None
        f_W = -self.object_.mass * (GRAVITY * Z + a_WH)
        return np.hstack([f_W @ self.X_WB.rotation().matrix(), np.zeros_like(f_W)])

    def spheres(self, mu: float | None = None) -> FingertipSpheres:
        """Fingertips at the contacts, in the world, with the friction planned or `mu` if less."""
        if mu is not None and not mu > 0:
            raise UsageError(f"the friction is {mu}; it must be above 0")
        grasp = self.found.grasp
        pair = grasp.mu if mu is None else np.minimum(grasp.mu, mu)
        mu_T = fingertip_friction(pair, grasp.mu)
        return fingertip_spheres(grasp, self.tip_radius, mu_T, self.X_WB)

    @property
    def least_friction(self) -> float:
        """The friction below which no forces of this squeeze bear the weight."""
        object_, weight = self.object_, self.loads(np.zeros((1, 3)))[0]
        return friction_needed(self.found.grasp, object_.p_BBcm, object_.rho, weight, self.squeeze)


def describe(target: Target, mu: float | None) -> str:
    """The grasp that is tried."""
    grasp, certificate = target.found.grasp, target.found.certificate
    planned = float(grasp.mu.min())
    there = planned if mu is None else min(mu, planned)
    return (
        f"grasp                  {grasp.kind} {grasp.faces}\n"
        f"epsilon                {certificate.epsilon_lower:.4f}\n"
        f"squeeze                {target.squeeze:.1f} N\n"
        f"friction               {there:.3g}, planned {planned:.3g}; "
        f"the weight needs {target.least_friction:.3f}"
    )


def choose_grasp(plant: MultibodyPlant, body: RigidBody, context: Context, task: Task) -> Target:
    """The best grasp of an object where it lies that fingertips reach along their normals.

    Its squeeze holds weight and inertia whichever way they point.
    """
    object_ = object_from_plant(plant, body, context)
    if object_.mass is None:
        raise UsageError("the model states no mass, and without it there is no weight to hold")
    obstacles = obstacles_from_plant(plant, body, context)
    plan = plan_grasps(object_, top=20, obstacles=obstacles)
    most = np.linalg.norm(GRAVITY * Z + plan_motion(task).a_WH, axis=1).max() / GRAVITY
    for found in plan.grasps:
        if found.certificate.squeeze_force is not None:
            squeeze = float(found.certificate.squeeze_force * most / LOAD_SHARE)
            tip_radius = plan.settings.tip_radius
            target = Target(object_, obstacles.X_WB, found, tip_radius, squeeze)
            if is_approach_clear(plant, context, target.spheres(), STANDOFF):
                return target
    raise UsageError("there is no grasp that fingertips reach along the normals of its contacts")
