"""Computes joint torques that hold an object: the least share of a hand's efforts, and a squeeze.

Contact forces f stay inside cones of a share of the friction, balance the load, and are applied by
the torques tau = J^T f of the independent joints. All of it is one small cone program.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.digits import at_least
from drake_polygrasp.grasp import Grasp
from drake_polygrasp.hand_grasp import HandRefusal, HandTorque
from drake_polygrasp.hands.squeeze import total_normal
from drake_polygrasp.wrenches.support import cone_wrenches

FRICTION_SHARE = 0.8
"""Share of the contacts' friction that contact forces use. Our choice."""
GRAVITY_LOAD = 1.2
"""Load against a known up direction, over the weight. Our choice: a fifth is left to lift with."""
SQUEEZE_SHARE = 0.6
"""Share of the efforts that a squeeze may use. Our choice."""
SHARE_ABOVE_LOADS = 1.3
"""Share of the efforts that a squeeze may use, over what the loads need. Our choice."""
MIN_SQUEEZE = 10.0
"""Total normal force that every squeeze may have [N]. Our choice."""
SQUEEZE_PER_WEIGHT = 6.0
"""Total normal force of a squeeze, over the weight divided by friction. Our choice."""
_DECIMALS = 7
"""Decimals of forces [N], about as many as the solver finds."""


@dataclass(frozen=True, eq=False)
class Load:
    """What a hand must hold.

    Attributes:
        mass: mass of the object [kg]; None if it is unknown.
        p_BBcm: centre of mass [m], shape (3,).
        rho: length by which torques are divided [m].
        up_B: unit vector against gravity, shape (3,); None for every orientation.
        squeeze: total normal force that the squeeze should have at least [N], where the efforts
            allow it, such as that of a region certificate; None for the usual one.
    """

    mass: float | None
    p_BBcm: Array
    rho: float
    up_B: Array | None = None
    squeeze: float | None = None

    @property
    def weights_B(self) -> Array:
        """Forces that must be held [N], shape (K, 3); one of zero if the mass is unknown."""
        if self.mass is None:
            return np.zeros((1, 3))
        weight = self.mass * GRAVITY
        if self.up_B is None:
            return weight * np.vstack([np.eye(3), -np.eye(3)])
        return -GRAVITY_LOAD * weight * self.up_B[None]

    @property
    def carried_B(self) -> Array:
        """The weight that the squeeze balances [N], shape (3,); zero for every orientation."""
        if self.mass is None or self.up_B is None:
            return np.zeros(3)
        return np.asarray(-self.mass * GRAVITY * self.up_B)


class HandForces:
    """The cone programs of contact forces and joint torques, built once for a posture.

    Torques tau = J^T f are those of a hand without weight at rest; f is the force on the object.
    """

    def __init__(
        self,
        grasp: Grasp,
        J_Bc: Array,
        effort: Array,
        p_BBcm: Array,
        rho: float,
        friction_share: float = FRICTION_SHARE,
    ) -> None:
        """Builds the programs.

        Args:
            grasp: three contacts.
            J_Bc: velocities of the fingers' points at the contacts in B per speed of each
                independent joint [m/rad], shape (3 contacts, 3, k).
            effort: greatest torque of each independent joint [N m or N], shape (k,); infinite
                where it is unlimited or unknown.
            p_BBcm: centre of mass [m], shape (3,).
            rho: length by which torques are divided [m].
            friction_share: share of the contacts' friction that forces may use.
        """
        cones = cone_wrenches(
            grasp.p_BC[None], grasp.nhat_TB_B[None], friction_share * grasp.mu[None], p_BBcm, rho
        )[0]
        # A cone's three wrenches are those of nhat, mu t_1 and mu t_2; their first rows are forces.
        self._spokes = cones[:, :, :3]
        self._balance = cones.reshape(9, 6).T
        self._normal = np.tile([1.0, 0.0, 0.0], 3)
        torque_of = np.einsum("irk,ikj->jir", self._spokes, J_Bc).reshape(-1, 9)
        self.torque_of_forces = np.einsum("ikj->jik", J_Bc).reshape(-1, 9)
        limited = np.isfinite(effort)
        self._relative_torque = torque_of[limited] / effort[limited, None]
        self._solver = ClarabelSolver()

    def least_share(self, weight_B: Array) -> tuple[float, Array] | None:
        """Computes the least share of the efforts with which a load is held.

        Args:
            weight_B: force on B at its centre of mass [N], shape (3,).

        Returns:
            The share, which may exceed 1, and forces on B at the contacts [N], shape (3, 3); None
            if no forces in the cones balance the load.
        """
        scale = float(np.linalg.norm(weight_B))
        if scale == 0:
            return 0.0, np.zeros((3, 3))
        # Forces in units of the load; s in units of the share that one load's weight takes.
        relative = self._relative_torque * scale
        unit = max(float(np.abs(relative).max(initial=0.0)), 1e-12)
        program = MathematicalProgram()
        x, s = program.NewContinuousVariables(9), program.NewContinuousVariables(1)
        self._add_balance(program, x, weight_B / scale)
        self._add_cones(program, x, spare=None)
        self._add_torque_bounds(program, x, s, relative / unit)
        program.AddBoundingBoxConstraint(0.0, np.inf, s)
        program.AddLinearCost(s[0])
        result = self._solver.Solve(program)
        if not result.is_success():
            return None
        share = float(result.GetSolution(s)[0]) * unit
        return max(share, 0.0), scale * self._forces(result.GetSolution(x))

    def firmest(self, weight_B: Array, share: float, max_normal: float) -> Array | None:
        """Computes the forces with the most spare friction, within shares of effort and force.

        Args:
            weight_B: force on B at its centre of mass that the forces balance [N], shape (3,).
            share: share of the efforts that they may use.
            max_normal: greatest sum of the normal forces [N].

        Returns:
            Forces on B at the contacts [N], shape (3, 3); None if there are none.
        """
        relative = self._relative_torque * max_normal
        program = MathematicalProgram()
        x, t = program.NewContinuousVariables(9), program.NewContinuousVariables(1)
        self._add_balance(program, x, weight_B / max_normal)
        self._add_cones(program, x, spare=t)
        if len(relative):
            program.AddLinearConstraint(
                relative, np.full(len(relative), -share), np.full(len(relative), share), x
            )
        program.AddLinearConstraint(self._normal[None], [-np.inf], [1.0], x)
        program.AddLinearCost(-t[0])
        result = self._solver.Solve(program)
        if not result.is_success() or result.GetSolution(t)[0] < 0:
            return None
        return max_normal * self._forces(result.GetSolution(x))

    def torque(self, f_Bc_B: Array) -> Array:
        """Computes the torques of the independent joints that apply contact forces.

        Args:
            f_Bc_B: forces on B at the contacts [N], shape (3, 3).

        Returns:
            J^T f [N m or N], shape (k,).
        """
        return np.asarray(self.torque_of_forces @ f_Bc_B.ravel())

    def _forces(self, x: Array) -> Array:
        return np.asarray(np.einsum("ir,irk->ik", x.reshape(3, 3), self._spokes))

    def _add_balance(self, program: MathematicalProgram, x: Array, weight: Array) -> None:
        program.AddLinearEqualityConstraint(self._balance, np.append(-weight, np.zeros(3)), x)

    def _add_cones(self, program: MathematicalProgram, x: Array, spare: Array | None) -> None:
        """Keeps each contact's force in its cone, by at least `spare` times its friction."""
        for i in range(3):
            if spare is None:
                program.AddLorentzConeConstraint(np.eye(3), np.zeros(3), x[3 * i : 3 * i + 3])
                continue
            A = np.column_stack([np.eye(3), [-1.0, 0.0, 0.0]])
            variables = np.concatenate([x[3 * i : 3 * i + 3], spare])
            program.AddLorentzConeConstraint(A, np.zeros(3), variables)

    def _add_torque_bounds(
        self, program: MathematicalProgram, x: Array, s: Array, relative: Array
    ) -> None:
        """Adds |tau| <= s effort, joint by joint."""
        if not len(relative):
            return
        ones, free = np.ones((len(relative), 1)), np.full(len(relative), -np.inf)
        for sign in (1.0, -1.0):
            A = np.hstack([sign * relative, -ones])
            program.AddLinearConstraint(A, free, np.zeros(len(relative)), np.concatenate([x, s]))


def friction_refusal(
    grasp: Grasp, load: Load, friction_share: float = FRICTION_SHARE
) -> HandRefusal | None:
    """Tells whether friction lets any hand hold a load, however strong it is.

    Args:
        grasp: three contacts.
        load: what the hand must hold.
        friction_share: share of the contacts' friction that forces may use.

    Returns:
        A refusal "friction" if no forces in the cones balance some load; None if all are held.
    """
    nothing = np.zeros((3, 3, 1))
    forces = HandForces(grasp, nothing, np.ones(1), load.p_BBcm, load.rho, friction_share)
    for weight_B in load.weights_B:
        if forces.least_share(weight_B) is None:
            return _slips(load, weight_B, friction_share)
    return None


def holding_torque(
    grasp: Grasp,
    J_Bc: Array,
    effort: Mapping[str, float],
    load: Load,
    friction_share: float = FRICTION_SHARE,
) -> HandTorque | HandRefusal:
    """Computes the torques of a squeeze, and whether the hand's efforts hold every load.

    Args:
        grasp: three contacts.
        J_Bc: velocities of the fingers' points at the contacts in B per speed of each independent
            joint [m/rad], shape (3 contacts, 3, k).
        effort: greatest torque of each independent joint by name, in the order of `J_Bc` [N m or
            N]; NaN where it is unknown, so that shares are not checked.
        load: what the hand must hold.
        friction_share: share of the contacts' friction that forces may use.

    Returns:
        The torques; a refusal "friction" if no forces in the cones hold some load, "torque" if
        those that do need all of the efforts or more.
    """
    names, limits = tuple(effort), np.array([*effort.values()])
    known = bool(np.isfinite(limits).all()) and load.mass is not None
    limits = np.where(np.isfinite(limits), limits, np.inf)
    forces = HandForces(grasp, J_Bc, limits, load.p_BBcm, load.rho, friction_share)
    share, carrying = 0.0, np.zeros((3, 3))
    for weight_B in load.weights_B:
        held = forces.least_share(weight_B)
        if held is None:
            return _slips(load, weight_B, friction_share)
        if held[0] >= 1:
            return _too_weak(names, forces.torque(held[1]) / limits, held[0], load)
        share = max(share, held[0])
    if load.carried_B.any():
        # The loads above include this one, so that it is held.
        held = forces.least_share(load.carried_B)
        if held is None:
            return _slips(load, load.carried_B, friction_share)
        carrying = held[1]
    f_Bc_B = np.round(_squeeze(grasp, forces, load, share, carrying), _DECIMALS)
    torque = np.round(forces.torque(f_Bc_B), _DECIMALS + 2)
    return HandTorque(
        share=at_least(share) if known else None,
        mass=load.mass,
        loads="six" if load.up_B is None else "up",
        up_B=None if load.up_B is None else frozen(load.up_B),
        friction_share=friction_share,
        f_Bc_B=frozen(f_Bc_B),
        torque=dict(zip(names, torque.tolist(), strict=True)),
    )


def _squeeze(grasp: Grasp, forces: HandForces, load: Load, share: float, carrying: Array) -> Array:
    """Returns the forces of the usual squeeze, or of a harder one if the load asks for it.

    Where the efforts do not reach what it asks for, they are all used.
    """
    weight = 0.0 if load.mass is None else load.mass * GRAVITY
    most = max(MIN_SQUEEZE, SQUEEZE_PER_WEIGHT * weight / float(grasp.mu.min()))
    allowed = min(max(SQUEEZE_SHARE, SHARE_ABOVE_LOADS * share), 1.0)
    usual = _mixed(grasp, forces, load, allowed, most, carrying)
    if load.squeeze is None or total_normal(grasp, usual) >= load.squeeze:
        return usual
    harder = _mixed(grasp, forces, load, 1.0, load.squeeze, carrying)
    return max(usual, harder, key=lambda f_Bc_B: total_normal(grasp, f_Bc_B))


def _mixed(
    grasp: Grasp, forces: HandForces, load: Load, allowed: float, most: float, carrying: Array
) -> Array:
    """Mixes the firmest forces with the least so that normal forces add up to no more than `most`.

    Both are in the cones and in balance, and so is every mixture.
    """
    # Without a bound of the efforts, the firmest forces have the greatest sum that is allowed.
    firmest = forces.firmest(load.carried_B, allowed, 10.0 * most)
    if firmest is None:
        return carrying
    least, greatest = total_normal(grasp, carrying), total_normal(grasp, firmest)
    if greatest <= most:
        return firmest
    part = max(most - least, 0.0) / max(greatest - least, 1e-9)
    return np.asarray(carrying + part * (firmest - carrying))


def _slips(load: Load, weight_B: Array, friction_share: float) -> HandRefusal:
    weight = float(np.linalg.norm(weight_B))
    way = "in every orientation" if load.up_B is None else "against the way up"
    return HandRefusal(
        "friction",
        f"no forces within {friction_share:g} of the friction hold {weight:.3g} N {way}",
        {"load": weight, "friction_share": friction_share},
    )


def _too_weak(names: tuple[str, ...], used: Array, share: float, load: Load) -> HandRefusal:
    joint = names[int(np.abs(used).argmax())]
    mass = load.mass or 0.0
    return HandRefusal(
        "torque",
        f"holding {mass:.3g} kg takes {share:.2f} of the effort of joint '{joint}'",
        {"share": share, "mass": mass},
    )
