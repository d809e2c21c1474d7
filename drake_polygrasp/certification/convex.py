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
from drake_polygrasp.digits import at_least, significant
from drake_polygrasp.vectors import dot, product, unit
from drake_polygrasp.wrenches.contacts import contact_frames, contact_triangle, edge_forces

MU_FLOOR = 1e-4
"""Ours: less friction than this is reported as none; near it the exact check's own room counts."""
_MU_STEP = 1.0 + 1e-4
"""Ours: the least friction is found when it falls by a factor of less."""
_MAX_STEPS = 50
"""Ours: 2 to 5 are usual; the friction falls at every step."""
_ROOM = 1.1e-9
"""Ours: a little more than the exact check asks for, so that rounding does not matter."""
_RESOLVED_DIGITS = 6
"""Ours: Clarabel stops when its optimum is known to 1e-8; of where it is fewer digits are."""
_TWIST_DIGITS = 9
"""Ours: an escaping twist may have no room, and what stands for 0 in it must be 0."""
_ZEROS, _ONE = np.zeros(3), np.ones(1)


class _MarginProgram:
    """Maximise t over (x, t): nhat.f - |f - (nhat.f) nhat| / mu >= share t, sum of nhat.f = 1.

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

    def solve(self, rows: Array, mu: Array, share: Array) -> Array:
        """The x of the largest t, NaN where there is none, for M triangles of unit size, (M, 3).

        Args:
            rows: each contact's (nhat, t_1, t_2) components of the edge forces of unit x, shape
                (M, 3 contacts, 3 components, 3).
            mu: friction coefficients, shape (M, 3).
            share: of t at each contact, shape (M, 3).
        """
        A = np.zeros((len(rows), 3, 3, 4))
        A[..., :3] = rows
        with np.errstate(all="ignore"):
            A[:, :, 1:] /= mu[..., None, None]
        A[:, :, 0, 3] = -share
        pushes = rows[:, :, 0].sum(axis=1)[:, None]
        x = np.full((len(rows), 3), np.nan)
        # Drake would end the process for coefficients that are not finite.
        for k in np.flatnonzero(np.isfinite(A).all(axis=(1, 2, 3))):
            for cone, A_i in zip(self._cones, A[k], strict=True):
                cone.UpdateCoefficients(A_i, _ZEROS)
            self._sum.UpdateCoefficients(pushes[k], _ONE)
            result = self._solver.Solve(self._program)
            if result.is_success():
                x[k] = result.GetSolution(self._x_t)[:3]
        return x


def _edge_rows(p_BC: Array, nhat_TB_B: Array) -> tuple[Array, Array]:
    """The edge forces of unit x in contact frames, for triangles of unit size.

    Returns:
        Shape (M, 3 contacts, 3 components, 3), and the triangles' sizes [m], shape (M,).
    """
    p, size = contact_triangle(p_BC)
    # One triangle and x after another, each with all three units.
    forces = edge_forces(np.repeat(p, 3, axis=0), np.tile(np.eye(3), (len(p), 1)))
    forces = np.moveaxis(forces.reshape(-1, 3, 3, 3), 1, -1)
    return product(contact_frames(p_BC, nhat_TB_B), forces), size


def _printable(x: Array, rows: Array, size: Array) -> Array:
    """The x [1/m] of the triangles as they are, from unit size: normal forces of sum 1, (M, 3).

    What `_RESOLVED_DIGITS` are of is the share of each; their sum has `digits.EXACT`.
    """
    rounded = np.round(x / np.abs(x).max(axis=1, keepdims=True), _RESOLVED_DIGITS)
    push = (rows[:, :, 0].sum(axis=1) * rounded).sum(axis=1)
    return frozen(significant(rounded / (push * size)[:, None]))


def find_internal_forces(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Array:
    """The internal forces of the greatest margin, for M grasps; nothing is proved of them yet.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).

    Returns:
        x_12, x_13, x_23 [1/m], scaled so that all normal forces add up to 1, shape (M, 3); NaN
        where the solver finds none.
    """
    rows, size = _edge_rows(p_BC, nhat_TB_B)
    share = np.full(mu.shape, 1.0 / 3.0)
    return _printable(_MarginProgram().solve(rows, mu, share), rows, size)


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

    An internal force has a friction that it needs, and the one of the greatest margin there needs
    less: so the friction falls to the least, as fast as Newton's method does (Dinkelbach, 1967).

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        x: an internal force that proves the grasp with `mu` [1/m], shape (3,).

    Returns:
        mu_min, the greatest coefficient then, 0 below `MU_FLOOR`; and the internal force that
        proves the grasp with `friction_at(mu, mu_min)` [1/m], shape (3,), exactly checked.
    """
    rows, size = _edge_rows(p_BC[None], nhat_TB_B[None])
    program, greatest = _MarginProgram(), float(mu.max())
    mu_min, witness = min(_friction_needed(rows[0], mu, x), greatest), x
    tried = MU_FLOOR
    for _ in range(_MAX_STEPS):
        if mu_min <= MU_FLOOR:
            break
        # In shares of the forces at hand t counts friction alike at all contacts.
        share = size * dot(rows[..., 0, :], witness)
        force = _printable(program.solve(rows, friction_at(mu, tried)[None], share), rows, size)[0]
        needed = _friction_needed(rows[0], mu, force)
        is_last = tried > MU_FLOOR and not needed * _MU_STEP < mu_min
        if needed < mu_min:
            mu_min, witness = needed, force
        if is_last:
            break
        tried = mu_min
    mu_min = min(at_least(mu_min), greatest) if mu_min > MU_FLOOR else 0.0
    contacts = p_BC.tolist(), nhat_TB_B.tolist(), friction_at(mu, mu_min).tolist()
    is_proved = check_force_closure(*contacts, witness.tolist()).ok
    return (mu_min, frozen(witness)) if is_proved else (greatest, frozen(x))


def _friction_needed(rows: Array, mu: Array, x: Array) -> float:
    """The greatest coefficient with which x passes the exact check, all lowered by one factor."""
    f = dot(rows, x)
    if not (f[:, 0] > 0.0).all():
        return math.inf
    squared = (f[:, 1] ** 2 + f[:, 2] ** 2) / f[:, 0] ** 2
    return float((np.sqrt(squared + _ROOM * (1.0 + squared)) / mu).max() * mu.max())


@dataclass(frozen=True, eq=False)
class Escape:
    """A twist along which no contact force does negative work: how the object leaves a grasp.

    Attributes:
        twist: (omega, v_Bo) [rad/s, m/s], expressed in B, as in Drake's SpatialVelocity, shape
            (6,).
        hinge: where the object turns about the line through two contacts, from the first to the
            second: what `exact.check_escaping_hinge` takes. Elsewhere `exact.check_escaping_twist`
            takes the twist.
    """

    twist: Array
    hinge: tuple[int, int] | None = None


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
            omega = unit(axis)
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
    V = np.round(result.GetSolution(twist_s)[:6], _TWIST_DIGITS)
    omega = V[:3] / size[0]
    return np.concatenate([omega, V[3:] - np.cross(omega, p_BC.mean(axis=0))])
