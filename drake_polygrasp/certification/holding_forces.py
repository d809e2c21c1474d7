"""Which contact forces hold an object against a load: exact friction cones, one small program.

Of all forces in the cones whose wrench cancels the load's and whose normal parts add up to the
squeeze, those farthest inside the cones. That such forces exist is what force closure promises; a
hand must still find them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.wrenches.support import cone_wrenches


@dataclass(frozen=True, eq=False)
class Holding:
    """Contact forces that hold an object against K loads, each with one total normal force.

    Attributes:
        squeeze: total normal force [N].
        wrench_B: the loads: force [N] and torque about the centre of mass [N m], shape (K, 6).
        f_Bc_B: forces on B at the contacts [N], shape (K, 3, 3).
        spare_friction: the least over contacts of mu n.f less the tangential force [N], shape (K,).
    """

    squeeze: float
    wrench_B: Array
    f_Bc_B: Array
    spare_friction: Array

    def rows(self, which: slice) -> Holding:
        """Only some of the loads."""
        return Holding(
            self.squeeze, self.wrench_B[which], self.f_Bc_B[which], self.spare_friction[which]
        )


class HoldingProgram:
    """Maximise t: n.f - |f - (n.f) n| / mu >= t / 3 for forces that balance a load.

    Forces are in units of the squeeze and torques in units of rho. Loads change the right-hand
    side alone, so the program is built once for a grasp.
    """

    def __init__(self, grasp: Grasp, p_BBcm: Array, rho: float) -> None:
        """Of `grasp`; centre of mass p_BBcm [m], shape (3,), and torque scale rho [m]."""
        self._grasp, self._rho, self._solver = grasp, rho, ClarabelSolver()
        cones = cone_wrenches(grasp.p_BC[None], grasp.nhat_TB_B[None], grasp.mu[None], p_BBcm, rho)[
            0
        ]
        # A cone's first three columns are forces: nhat, mu t_1, mu t_2.
        self._spokes = cones[:, :, :3]
        self._A = np.vstack([cones.reshape(9, 6).T, np.tile([1.0, 0.0, 0.0], 3)])
        self._program = MathematicalProgram()
        self._x = self._program.NewContinuousVariables(9, "f")
        self._t = self._program.NewContinuousVariables(1, "t")
        self._balance = self._program.AddLinearEqualityConstraint(
            self._A, np.eye(7)[6], self._x
        ).evaluator()
        inside = np.column_stack([np.eye(3), [-1.0 / 3.0, 0.0, 0.0]])
        for i in range(3):
            variables = np.concatenate([self._x[3 * i : 3 * i + 3], self._t])
            self._program.AddLorentzConeConstraint(inside, np.zeros(3), variables)
        self._program.AddLinearCost(-self._t[0])

    def forces(self, wrench_B: Array, squeeze: float) -> Array | None:
        """The forces on B at the contacts [N], shape (3, 3); None where none hold the load.

        Args:
            wrench_B: the load: force [N] and torque about the centre of mass [N m], shape (6,).
            squeeze: total normal force [N].
        """
        scale = squeeze * np.array([1.0, 1.0, 1.0, self._rho, self._rho, self._rho])
        self._balance.UpdateCoefficients(self._A, np.append(-wrench_B / scale, 1.0))
        result = self._solver.Solve(self._program)
        if not result.is_success() or result.GetSolution(self._t)[0] < 0:
            return None
        x = result.GetSolution(self._x).reshape(3, 3)
        return np.asarray(squeeze * np.einsum("ir,irk->ik", x, self._spokes))


def hold(
    grasp: Grasp, p_BBcm: Array, rho: float, wrench_B: Array, squeeze: float
) -> Holding | None:
    """Forces that hold an object against every one of several loads; None where one has none.

    Args:
        grasp: three contacts.
        p_BBcm: centre of mass [m], shape (3,).
        rho: torque scale [m].
        wrench_B: loads, shape (K, 6), as `HoldingProgram.forces` takes them.
        squeeze: total normal force [N].
    """
    program = HoldingProgram(grasp, p_BBcm, rho)
    forces = [program.forces(wrench, squeeze) for wrench in wrench_B]
    found = [f for f in forces if f is not None]
    if len(found) < len(forces):
        return None
    f_Bc_B = np.array(found)
    return Holding(squeeze, frozen(wrench_B), frozen(f_Bc_B), frozen(spare_friction(grasp, f_Bc_B)))


def friction_needed(
    grasp: Grasp,
    p_BBcm: Array,
    rho: float,
    wrench_B: Array,
    squeeze: float,
    tolerance: float = 1e-3,
) -> float:
    """Computes the friction coefficient below which no contact forces hold a load.

    Args:
        grasp: three contacts, whose forces hold the load at their own friction.
        p_BBcm: centre of mass [m], shape (3,).
        rho: torque scale [m].
        wrench_B: the load, shape (6,), as `HoldingProgram.forces` takes it.
        squeeze: total normal force [N].
        tolerance: how far above the least such coefficient the result may be.

    Returns:
        A coefficient with which the load is held where no contact has more.
    """
    low, high = 0.0, float(grasp.mu.max())
    while high - low > tolerance:
        mu = (low + high) / 2
        weaker = replace(grasp, mu=np.minimum(grasp.mu, mu))
        holds = HoldingProgram(weaker, p_BBcm, rho).forces(wrench_B, squeeze) is not None
        low, high = (low, mu) if holds else (mu, high)
    return high


def spare_friction(grasp: Grasp, f_Bc_B: Array) -> Array:
    """How much more tangential force the contact that has least could take [N], shape (...).

    Of forces f_Bc_B [N], shape (..., 3, 3).
    """
    push = normal_forces(grasp, f_Bc_B)
    sideways = f_Bc_B - push[..., None] * grasp.nhat_TB_B
    return np.asarray((grasp.mu * push - np.linalg.norm(sideways, axis=-1)).min(axis=-1))


def normal_forces(grasp: Grasp, f_Bc_B: Array) -> Array:
    """The normal parts of forces [N], shape (..., 3), of f_Bc_B, shape (..., 3, 3)."""
    return np.asarray(np.einsum("...ij,ij->...i", f_Bc_B, grasp.nhat_TB_B))
