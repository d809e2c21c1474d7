"""Finds what `exact` checks: internal forces, the least friction, the twist of an escape.

Small second-order cone programs, solved by Clarabel by name: which solver Drake would choose
depends on the machine's licences. A solver's optimum decides nothing (it is 1e-8 on the boundary
of force closure and 0.75 for collinear contacts); only what passes the exact check is returned
as a proof.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.exact import (
    check_escaping_hinge,
    check_escaping_twist,
    check_force_closure,
)
from drake_polygrasp.wrench import contact_frames, contact_triangle, edge_forces, force_closure

MU_FLOOR = 1e-4
"""Ours: less friction than this is reported as none; near it the exact check's own room counts."""
_MU_STEP = 1.0 + 1e-3
"""Ours: how finely the least friction is found, as a factor."""
_GUESSES = 24
"""Coefficients that are tried in closed form at a time; three times is finer than `_MU_STEP`."""
_RESOLVED_DIGITS = 9
"""Ours: Clarabel stops at 1e-8; further digits of its solutions are noise."""


class _MarginProgram:
    """Maximise t over (x, t): nhat.f - |f - (nhat.f) nhat| / mu >= t / 3, sum of nhat.f = 1.

    f are the edge forces of x, so the program depends on the contacts by coefficients alone and
    is built once for many grasps.
    """

    def __init__(self) -> None:
        self._solver = ClarabelSolver()
        self._program = MathematicalProgram()
        self._x_t = self._program.NewContinuousVariables(4, "x")
        self._cones = [
            self._program.AddLorentzConeConstraint(
                np.zeros((3, 4)), np.zeros(3), self._x_t
            ).evaluator()
            for _ in range(3)
        ]
        self._sum = self._program.AddLinearEqualityConstraint(
            np.zeros((1, 3)), np.ones(1), self._x_t[:3]
        ).evaluator()
        self._program.AddLinearCost(-self._x_t[3])

    def solve(self, rows: Array, mu: Array) -> Array | None:
        """The x of the largest t for a triangle of unit size, or None if there is none.

        Args:
            rows: each contact's (nhat, t_1, t_2) components of the edge forces of unit x, shape
                (3 contacts, 3 components, 3).
            mu: friction coefficients, shape (3,).
        """
        A = np.zeros((3, 3, 4))
        A[:, :, :3] = rows
        with np.errstate(over="ignore"):
            A[:, 1:] /= mu[:, None, None]
        A[:, 0, 3] = -1.0 / 3.0
        if not np.isfinite(A).all():  # Drake would end the process.
            return None
        for cone, A_i in zip(self._cones, A, strict=True):
            cone.UpdateCoefficients(A_i, np.zeros(3))
        self._sum.UpdateCoefficients(rows[:, 0].sum(axis=0, keepdims=True), np.ones(1))
        result = self._solver.Solve(self._program)
        return np.array(result.GetSolution(self._x_t)[:3]) if result.is_success() else None


def _edge_rows(p_BC: Array, nhat_TB_B: Array) -> tuple[Array, Array]:
    """The edge forces of unit x in contact frames, for triangles of unit size.

    Returns:
        Shape (M, 3 contacts, 3 components, 3), and the triangles' sizes [m], shape (M,).
    """
    p, size = contact_triangle(p_BC)
    forces = np.stack([edge_forces(p, np.broadcast_to(x, (len(p), 3))) for x in np.eye(3)], axis=-1)
    return contact_frames(p_BC, nhat_TB_B) @ forces, size


def _printable(x: Array, rows: Array, size: float) -> Array:
    """The x [1/m] of the triangle as it is, from that of unit size: normal forces of sum 1."""
    rounded = np.round(x / np.abs(x).max(), _RESOLVED_DIGITS)
    return frozen(rounded / (rows[:, 0].sum(axis=0) @ rounded) / size)


def find_internal_forces(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Array:
    """The internal forces of the greatest margin, for M grasps; nothing is proved of them yet.

    Args:
        p_BC: contact points, not collinear [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, positive, shape (M, 3).

    Returns:
        x_12, x_13, x_23 [1/m], scaled so that all normal forces add up to 1, shape (M, 3); NaN
        where the solver finds none.
    """
    rows, size = _edge_rows(p_BC, nhat_TB_B)
    program = _MarginProgram()
    forces = np.full((len(p_BC), 3), np.nan)
    for k in range(len(p_BC)):
        x = program.solve(rows[k], mu[k])
        if x is not None:
            forces[k] = _printable(x, rows[k], size[k])
    return frozen(forces)


def friction_at(mu: Array, mu_min: float) -> Array:
    """The friction with which `mu_min_internal_force` passes the exact check, shape (3,).

    All coefficients lowered by one factor, until the greatest is `mu_min`, or `MU_FLOOR` where
    that is more: so a `mu_min` of 0 has a witness at `MU_FLOOR`, since without friction there is
    no force strictly inside a cone.
    """
    greatest = float(mu.max())
    return frozen(mu * (min(max(mu_min, MU_FLOOR), greatest) / greatest))


def least_friction(p_BC: Array, nhat_TB_B: Array, mu: Array, x: Array) -> tuple[float, Array]:
    """How little friction would still do.

    The margin grows with a common factor on all coefficients, so bisection finds the least factor
    (to 1e-3 of itself) whose internal force passes the exact check.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        x: an internal force that proves the grasp with `mu` [1/m], shape (3,).

    Returns:
        mu_min, the greatest coefficient then, 0 below `MU_FLOOR`; and the internal force that
        proves the grasp with `friction_at(mu, mu_min)` [1/m], shape (3,).
    """
    rows, size = _edge_rows(p_BC[None], nhat_TB_B[None])
    program = _MarginProgram()

    def proof(coefficient: float) -> Array | None:
        lowered = friction_at(mu, coefficient)
        solution = program.solve(rows[0], lowered)
        if solution is None:
            return None
        force = _printable(solution, rows[0], size[0])
        contacts = p_BC.tolist(), nhat_TB_B.tolist(), lowered.tolist()
        return force if check_force_closure(*contacts, force.tolist()).ok else None

    witness = proof(0.0)
    if witness is not None:
        return 0.0, witness
    lower, mu_min, witness = MU_FLOOR, float(mu.max()), frozen(x)
    guess = _least_friction_in_closed_form(p_BC, nhat_TB_B, mu)
    guesses = [guess * _MU_STEP**power for power in (-32, -4, -0.49, 32, 4, 0.49)]
    while mu_min > lower * _MU_STEP:
        middle = guesses.pop() if guesses else math.sqrt(lower * mu_min)
        if not lower < middle < mu_min:
            continue
        force = proof(middle)
        if force is None:
            lower = middle
        else:
            mu_min, witness = middle, force
    return mu_min, witness


def _least_friction_in_closed_form(p_BC: Array, nhat_TB_B: Array, mu: Array) -> float:
    """About what `least_friction` proves: where to look first, which saves most programs."""
    lower, upper = MU_FLOOR, float(mu.max())
    for _ in range(3):
        coefficients = np.geomspace(lower, upper, _GUESSES)
        lowered = mu * (coefficients / mu.max())[:, None]
        shape = (_GUESSES, 3, 3)
        holds = force_closure(
            np.broadcast_to(p_BC, shape), np.broadcast_to(nhat_TB_B, shape), lowered
        )
        first = int(np.append(holds[1:-1], True).argmax()) + 1
        lower, upper = float(coefficients[first - 1]), float(coefficients[first])
    return math.sqrt(lower * upper)


@dataclass(frozen=True, eq=False)
class Escape:
    """A twist along which no contact force does negative work: how the object leaves a grasp."""

    twist: Array
    """(omega, v_Bo) [rad/s, m/s], expressed in B, as in Drake's SpatialVelocity, shape (6,)."""
    hinge: tuple[int, int] | None = None
    """Where the object turns about the line through two contacts, from the first to the second:
    what `exact.check_escaping_hinge` takes. Elsewhere `exact.check_escaping_twist` takes the
    twist."""


def find_escape(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Escape | None:
    """How the object can leave three contacts, exactly checked; None where nothing is found.

    A grasp is not force closure iff there is such a twist (Ferrari & Canny's W then has the
    origin outside or on its boundary).

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, positive, shape (3,).
    """
    contacts = p_BC.tolist(), nhat_TB_B.tolist(), mu.tolist()
    for i, j in itertools.permutations(range(3), 2):
        if check_escaping_hinge(*contacts, (i, j)).ok:
            axis = p_BC[j] - p_BC[i]
            omega = axis / np.linalg.norm(axis)
            return Escape(frozen([*omega, *np.cross(p_BC[i], omega)]), (i, j))
    twist = _freest_twist(p_BC, nhat_TB_B, mu)
    if (
        twist is None
        or not check_escaping_twist(*contacts, twist[3:].tolist(), twist[:3].tolist()).ok
    ):
        return None
    return Escape(frozen(twist))


def _freest_twist(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Array | None:
    """(omega, v_Bo) of the largest s, or None where the solver fails.

    Maximise s: nhat.u - mu |u - (nhat.u) nhat| >= s for the velocity u of each contact, over
    twists of length 1 at most in units of the contact triangle.
    """
    p, size = contact_triangle(p_BC[None])
    frames = contact_frames(p_BC[None], nhat_TB_B[None])[0]
    frames[:, 1:] *= mu[:, None, None]
    # e.u = (p x e).omega + e.v for a velocity's component along e.
    rows = np.concatenate([np.cross(p[0][:, None], frames), frames], axis=-1)
    program = MathematicalProgram()
    twist_s = program.NewContinuousVariables(7, "V")
    for rows_i in rows:
        A = np.column_stack([rows_i, [-1.0, 0.0, 0.0]])
        program.AddLorentzConeConstraint(A, np.zeros(3), twist_s)
    program.AddLorentzConeConstraint(np.eye(7, 6, k=-1), np.eye(7)[0], twist_s[:6])
    program.AddLinearCost(-twist_s[6])
    result = ClarabelSolver().Solve(program)
    if not result.is_success():
        return None
    V = np.round(result.GetSolution(twist_s)[:6], _RESOLVED_DIGITS)
    omega = V[:3] / size[0]
    return np.concatenate([omega, V[3:] - np.cross(omega, p_BC.mean(axis=0))])
