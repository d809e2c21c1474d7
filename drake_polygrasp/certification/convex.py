"""Finds internal forces, the least friction and escaping twists, for `exact` to check.

These are small second-order cone programs, solved by Clarabel by name, because Drake's own choice
of a solver depends on the machine's licences. A solver's optimum decides nothing: it is 1e-8 on the
boundary of force closure and 0.75 for collinear contacts. Only what passes the exact check counts
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
"""Our choice: less friction than this is reported as 0; below it the room that the exact check
demands inside the cone would matter."""
_MU_STEP = 1.0 + 1e-4
"""Our choice: the iteration ends when the friction falls by a smaller factor."""
_MAX_STEPS = 50
"""Our choice: most iterations; 2 to 5 are usual, and the friction falls at each."""
_ROOM = 1.1e-9
"""Our choice: a little more room than the exact check demands, to allow for rounding."""
_RESOLVED_DIGITS = 6
"""Our choice: Clarabel stops when the optimum is known to 1e-8, and its place to fewer digits."""
_TWIST_DIGITS = 9
"""Our choice: an escaping twist may have no room, so its rounding errors must become zeros."""
_ZEROS, _ONE = np.zeros(3), np.ones(1)


class _MarginProgram:
    """The program for the internal force of the greatest margin, built once for many grasps.

    It maximises t over (x, t), nhat.f - |f - (nhat.f) nhat| / mu >= share t, sum of nhat.f = 1. The
    forces f are the edge forces of x; contacts change only coefficients.
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
        """Solves the program for M contact triangles of unit size.

        Args:
            rows: components (nhat, t_1, t_2) at each contact of the edge forces of unit x, shape
                (M, 3 contacts, 3 components, 3).
            mu: friction coefficients, shape (M, 3).
            share: share of t at each contact, shape (M, 3).

        Returns:
            The x of the greatest t, shape (M, 3); NaN if the solver finds none.
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
    """Computes the edge forces of unit x in contact frames, for triangles scaled to unit size.

    Returns:
        The forces, shape (M, 3 contacts, 3 components, 3), and the triangles' sizes [m], shape
        (M,).
    """
    p, size = contact_triangle(p_BC)
    # Each triangle is repeated for the three unit vectors x.
    forces = edge_forces(np.repeat(p, 3, axis=0), np.tile(np.eye(3), (len(p), 1)))
    forces = np.moveaxis(forces.reshape(-1, 3, 3, 3), 1, -1)
    return product(contact_frames(p_BC, nhat_TB_B), forces), size


def _printable(x: Array, rows: Array, size: Array) -> Array:
    """Rescales and rounds the x of unit triangles: total normal force 1 [1/m], shape (M, 3).

    The ratios of the x are rounded to `_RESOLVED_DIGITS`, then the scaled x to `digits.EXACT`.
    """
    rounded = np.round(x / np.abs(x).max(axis=1, keepdims=True), _RESOLVED_DIGITS)
    push = (rows[:, :, 0].sum(axis=1) * rounded).sum(axis=1)
    return frozen(significant(rounded / (push * size)[:, None]))


def find_internal_forces(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Array:
    """Finds the internal forces of the greatest margin for M grasps; they are not checked yet.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).

    Returns:
        x_12, x_13, x_23 [1/m] with total normal force 1, shape (M, 3); NaN if the solver finds
        none.
    """
    rows, size = _edge_rows(p_BC, nhat_TB_B)
    share = np.full(mu.shape, 1.0 / 3.0)
    return _printable(_MarginProgram().solve(rows, mu, share), rows, size)


def friction_at(mu: Array, mu_min: float) -> Array:
    """Computes the friction at which `mu_min_internal_force` has to pass the exact check.

    All coefficients are scaled down by one factor until the greatest is `mu_min`, or `MU_FLOOR` if
    that is more: no force is strictly inside a cone without friction, so the proof of `mu_min` 0
    is one at `MU_FLOOR`.

    Args:
        mu: friction coefficients, shape (3,).
        mu_min: least friction of a certificate.

    Returns:
        The lowered coefficients, shape (3,).
    """
    greatest = float(mu.max())
    return frozen(mu * (min(max(mu_min, MU_FLOOR), greatest) / greatest))


def least_frictions(
    p_BC: Array, nhat_TB_B: Array, mu: Array, x: Array
) -> list[tuple[float, Array]]:
    """Finds the least friction, all coefficients scaled by one factor, that keeps force closure.

    Each internal force needs some friction, and the one of the greatest margin at that friction
    needs less. This iteration converges to the least as fast as Newton's method (Dinkelbach, 1967).

    Args:
        p_BC: contact points of M grasps [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        x: internal forces that prove the grasps with `mu` [1/m], shape (M, 3).

    Returns:
        For each grasp mu_min, the greatest of the scaled coefficients, or 0 below `MU_FLOOR`; and
        the internal force [1/m], shape (3,), that proves the grasp at `friction_at(mu, mu_min)`,
        exactly checked.
    """
    rows, size = _edge_rows(p_BC, nhat_TB_B)
    program, greatest = _MarginProgram(), mu.max(axis=1)
    mu_min, witness = np.minimum(_friction_needed(rows, mu, x), greatest), x.copy()
    tried = np.full(len(mu), MU_FLOOR)
    going = np.flatnonzero(mu_min > MU_FLOOR)
    for _ in range(_MAX_STEPS):
        if not len(going):
            break
        part, scale = rows[going], size[going]
        # With these shares, t lowers the friction needed at all contacts by one factor.
        share = scale[:, None] * dot(part[..., 0, :], witness[going, None])
        lowered = np.stack([friction_at(mu[k], float(tried[k])) for k in going])
        force = _printable(program.solve(part, lowered, share), part, scale)
        needed = _friction_needed(part, mu[going], force)
        is_last = (tried[going] > MU_FLOOR) & ~(needed * _MU_STEP < mu_min[going])
        is_less = needed < mu_min[going]
        mu_min[going[is_less]], witness[going[is_less]] = needed[is_less], force[is_less]
        going = going[~is_last & (mu_min[going] > MU_FLOOR)]
        tried[going] = mu_min[going]
    return [
        _checked_friction(*grasp)
        for grasp in zip(p_BC, nhat_TB_B, mu, x, mu_min.tolist(), witness, strict=True)
    ]


def _checked_friction(
    p_BC: Array, nhat_TB_B: Array, mu: Array, x: Array, mu_min: float, witness: Array
) -> tuple[float, Array]:
    """Returns the least friction, rounded, if it is proved; else the given one."""
    greatest = float(mu.max())
    mu_min = min(at_least(mu_min), greatest) if mu_min > MU_FLOOR else 0.0
    contacts = p_BC.tolist(), nhat_TB_B.tolist(), friction_at(mu, mu_min).tolist()
    is_proved = check_force_closure(*contacts, witness.tolist()).ok
    return (mu_min, frozen(witness)) if is_proved else (greatest, frozen(x))


def _friction_needed(rows: Array, mu: Array, x: Array) -> Array:
    """Scales coefficients to the least with which x passes; returns the greatest of each grasp.

    Args:
        rows: as `_edge_rows` returns them, shape (M, 3, 3, 3).
        mu: friction coefficients, shape (M, 3).
        x: internal forces, shape (M, 3).

    Returns:
        Shape (M,); infinite where x pulls at a contact.
    """
    n, t_1, t_2 = np.moveaxis(dot(rows, x[:, None, None]), -1, 0)
    is_pushing = (n > 0.0).all(axis=1)
    squared = (t_1**2 + t_2**2) / np.where(is_pushing[:, None], n, 1.0) ** 2
    factor = (np.sqrt(squared + _ROOM * (1.0 + squared)) / mu).max(axis=1)
    return np.where(is_pushing, factor * mu.max(axis=1), math.inf)


@dataclass(frozen=True, eq=False)
class Escape:
    """A twist along which no contact force does negative work, so that the object can leave.

    Attributes:
        twist: (omega, v_Bo) [rad/s, m/s], expressed in B, in the order of Drake's SpatialVelocity,
            shape (6,).
        hinge: indices of two contacts if the object turns about the line from the first to the
            second, which `exact.check_escaping_hinge` checks; None for other twists, which
            `exact.check_escaping_twist` checks.
    """

    twist: Array
    hinge: tuple[int, int] | None = None


def find_escape(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Escape | None:
    """Finds a twist along which the object can leave three contacts.

    A grasp is not force closure iff there is one: then the origin is not strictly inside W.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, positive, shape (3,).

    Returns:
        The twist, exactly checked; None if none is found.
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
    """Maximises s, nhat.u - mu |u - (nhat.u) nhat| >= s for the velocity u of each contact.

    Twists have a length of at most 1 in units of the contact triangle.

    Returns:
        (omega, v_Bo) [rad/s, m/s], shape (6,); None if the solver fails.
    """
    p, size = contact_triangle(p_BC[None])
    frames = contact_frames(p_BC[None], nhat_TB_B[None])[0]
    frames[:, 1:] *= mu[:, None, None]
    # The component of a velocity u along e is e.u = (p x e).omega + e.v.
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
