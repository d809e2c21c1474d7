"""Which joints of a hand are independent, and how the others follow them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydrake.multibody.inverse_kinematics import AddMultibodyPlantConstraints
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import BoundingBoxConstraint, LinearEqualityConstraint, MathematicalProgram

from drake_polygrasp.arrays import Array, Bools, Ints, frozen
from drake_polygrasp.errors import HandError

_ZERO = 1e-9
"""Coefficients below this are rounding."""


class Couplings(NamedTuple):
    """The joint positions of a hand as functions of the independent ones: q = E z + e0.

    Attributes:
        independent: indices of the k independent joints among all n, ascending, shape (k,).
        E: shape (n, k); the rows of independent joints are those of the identity.
        e0: shape (n,).
    """

    independent: Ints
    E: Array
    e0: Array


def read_couplings(plant: MultibodyPlant, actuated: Bools, where: str) -> Couplings:
    """Returns how the joints of a plant follow each other, by its mimic and coupler constraints.

    Drake has no getter of coupler constraints; as constraints of a mathematical program they are
    linear equations of the positions.

    Args:
        plant: the plant, finalized, with the hand alone, its root welded; n positions.
        actuated: whether each position has an actuator, shape (n,); of a coupled pair, the one
            with an actuator is independent.
        where: what messages call the hand.

    Raises:
        HandError: when the model has constraints of another kind, or contradictory ones.
    """
    program = MathematicalProgram()
    q = program.NewContinuousVariables(plant.num_positions(), "q")
    context = plant.CreateDefaultContext()
    try:
        bindings = AddMultibodyPlantConstraints(plant, q, program, context)
    except RuntimeError:
        bindings = None
    rows, sides = [], []
    for binding in bindings or ():
        constraint = binding.evaluator()
        if isinstance(constraint, LinearEqualityConstraint):
            columns = program.FindDecisionVariableIndices(binding.variables())
            for a, b in zip(constraint.GetDenseA(), constraint.lower_bound(), strict=True):
                row = np.zeros(len(q))
                row[columns] = a
                rows.append(row)
                sides.append(b)
        elif not isinstance(constraint, BoundingBoxConstraint):
            bindings = None
            break
    if bindings is None:
        raise HandError(
            f"{where}: its model has constraints between bodies other than mimic joints; a hand of "
            "closed loops cannot be used: leave them out of the model"
        )
    return _solve(np.reshape(rows, (-1, len(q))), np.asarray(sides), actuated, where)


def _solve(A: Array, b: Array, actuated: Bools, where: str) -> Couplings:
    """Solves A q = b for as many joints as there are equations, such without actuators first."""
    n = A.shape[1]
    A, b = A.copy(), b.copy()
    pivots: list[tuple[int, int]] = []
    for row in range(len(A)):
        size = np.abs(A[row])
        if size.max(initial=0.0) < _ZERO:
            if abs(b[row]) > _ZERO:
                raise HandError(f"{where}: its mimic joints contradict each other; mend the model")
            continue
        usable = np.where(size > _ZERO, size, 0.0)
        passive = np.where(actuated, 0.0, usable)
        pivot = int(np.argmax(passive if passive.any() else usable))
        b[row] /= A[row, pivot]
        A[row] /= A[row, pivot]
        for other in range(len(A)):
            if other != row:
                b[other] -= A[other, pivot] * b[row]
                A[other] -= A[other, pivot] * A[row]
        pivots.append((row, pivot))
    dependent = {pivot for _, pivot in pivots}
    independent = np.array([j for j in range(n) if j not in dependent], dtype=np.int64)
    E, e0 = np.zeros((n, len(independent))), np.zeros(n)
    E[independent, np.arange(len(independent))] = 1.0
    for row, pivot in pivots:
        E[pivot], e0[pivot] = -A[row, independent], b[row]
    return Couplings(frozen(independent, np.int64), frozen(E), frozen(e0))
