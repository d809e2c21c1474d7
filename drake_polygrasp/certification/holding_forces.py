"""Computes contact forces that hold an object against a load, within the exact friction cones.

Of all forces in the cones that balance the load and whose normal parts add up to the squeeze, it
finds those farthest inside the cones. Force closure says that there are such forces for a large
enough squeeze; a hand must still apply them.
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
    """Contact forces that hold an object against K loads, with one total normal force for all.

    Attributes:
        squeeze: total normal force [N].
        wrench_B: loads, force [N] and torque about the centre of mass [N m], shape (K, 6).
        f_Bc_B: forces on B at the contacts [N], shape (K, 3, 3).
        spare_friction: least over contacts of mu n.f - |tangential f| [N], shape (K,).
    """

    squeeze: float
    wrench_B: Array
    f_Bc_B: Array
    spare_friction: Array

    def rows(self, which: slice) -> Holding:
        """Returns the forces for some of the loads.

        Args:
            which: slice of the K loads.
        """
        return Holding(
            self.squeeze, self.wrench_B[which], self.f_Bc_B[which], self.spare_friction[which]
        )


class HoldingProgram:
    """The program that finds contact forces for a load, built once for a grasp and many loads.

    It maximises t, n.f - |f - (n.f) n| / mu >= t / 3 at each contact, over forces that balance the
    load. Forces are in units of the squeeze and torques in units of squeeze times rho, so that a
    load changes only the right-hand side.
    """

    def __init__(self, grasp: Grasp, p_BBcm: Array, rho: float) -> None:
        """Builds the program.

        Args:
            grasp: three contacts.
            p_BBcm: centre of mass [m], shape (3,).
            rho: length by which torques are divided [m].
        """
        self._grasp, self._rho, self._solver = grasp, rho, ClarabelSolver()
        cones = cone_wrenches(grasp.p_BC[None], grasp.nhat_TB_B[None], grasp.mu[None], p_BBcm, rho)[
            0
        ]
        # The force parts of a cone's three wrenches: nhat, mu t_1, mu t_2.
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
        """Computes the contact forces farthest inside their friction cones that balance a load.

        Args:
            wrench_B: load on B: force [N] and torque about the centre of mass [N m], shape (6,).
            squeeze: total normal force [N].

        Returns:
            Forces on B at the contacts [N], shape (3, 3); None if no forces in the cones balance
            the load.
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
    """Computes contact forces that hold an object against each of several loads.

    Args:
        grasp: three contacts.
        p_BBcm: centre of mass [m], shape (3,).
        rho: length by which torques are divided [m].
        wrench_B: loads on B, force [N] and torque about the centre of mass [N m], shape (K, 6).
        squeeze: total normal force [N].

    Returns:
        The forces; None if some load cannot be held.
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
        rho: length by which torques are divided [m].
        wrench_B: load on B, force [N] and torque about the centre of mass [N m], shape (6,).
        squeeze: total normal force [N].
        tolerance: greatest error of the result.

    Returns:
        A coefficient with which the load is held if no contact has more, at most `tolerance`
        above the least one.
    """
    low, high = 0.0, float(grasp.mu.max())
    while high - low > tolerance:
        mu = (low + high) / 2
        weaker = replace(grasp, mu=np.minimum(grasp.mu, mu))
        holds = HoldingProgram(weaker, p_BBcm, rho).forces(wrench_B, squeeze) is not None
        low, high = (low, mu) if holds else (mu, high)
    return high


def spare_friction(grasp: Grasp, f_Bc_B: Array) -> Array:
    """Computes how much more tangential force the contact nearest to slipping could bear.

    Args:
        grasp: three contacts.
        f_Bc_B: forces on B at the contacts [N], shape (..., 3, 3).

    Returns:
        The least over contacts of mu n.f - |tangential f| [N], shape (...).
    """
    push = normal_forces(grasp, f_Bc_B)
    sideways = f_Bc_B - push[..., None] * grasp.nhat_TB_B
    return np.asarray((grasp.mu * push - np.linalg.norm(sideways, axis=-1)).min(axis=-1))


def normal_forces(grasp: Grasp, f_Bc_B: Array) -> Array:
    """Computes the normal components of contact forces.

    Args:
        grasp: three contacts.
        f_Bc_B: forces on B at the contacts [N], shape (..., 3, 3).

    Returns:
        n.f at each contact [N], shape (..., 3).
    """
    return np.asarray(np.einsum("...ij,ij->...i", f_Bc_B, grasp.nhat_TB_B))
