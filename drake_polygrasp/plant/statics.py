"""Checks static equilibrium of object and fingertips in Drake, with gravity along each axis.

The forces that `holding_forces` plans are checked twice. Inverse dynamics of the plant gives the
unbalanced force for any geometry. `StaticEquilibriumProblem`, with the object's pose fixed, must
find contact forces itself: of all that balance the weight, the nearest to the planned ones. It
needs distances in AutoDiff, which Drake has only between spheres and boxes, so the fingertips touch
pads. Pads check the forces and not the surface, so they count only if the geometry is confirmed.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.geometry import GeometryId
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.optimization import StaticEquilibriumProblem
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant, MultibodyPlant_
from pydrake.multibody.tree import MultibodyForces
from pydrake.solvers import SnoptSolver, SolutionResult, SolverOptions
from pydrake.systems.framework import Diagram, DiagramBuilder

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.holding_forces import Holding, spare_friction
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.grasp import HeldWeight
from drake_polygrasp.plant.scratch_plant import ScratchScene, add_pads, add_tip

_TOLERANCE = 1e-6
"""Greatest unbalanced force over the weight, and SNOPT's tolerance over the weight (for torques,
over the weight times rho). Our choice."""


@dataclass(frozen=True, eq=False)
class Equilibrium(HeldWeight):
    """Equilibrium under the weight along one axis, with the contact forces that Drake finds.

    Attributes:
        drake_residual: unbalanced wrench with Drake's forces, torques over rho, over the weight;
            infinite if Drake found none.
        drake_spare_friction: `Holding.spare_friction` of Drake's forces [N]; minus infinity if
            Drake found none.
    """

    drake_residual: float
    drake_spare_friction: float

    @property
    def fault(self) -> str:
        """Why this is not an equilibrium; empty if it is one."""
        weight = float(np.linalg.norm(self.weight_B))
        if not self.residual <= _TOLERANCE:
            return f"the planned forces leave {self.residual:.2g} of the weight unbalanced"
        if not len(self.f_Bc_B):
            return "StaticEquilibriumProblem finds no contact forces"
        if not self.drake_residual <= _TOLERANCE:
            return (
                f"the forces of StaticEquilibriumProblem leave {self.drake_residual:.2g} of the "
                "weight unbalanced"
            )
        if not self.drake_spare_friction >= -_TOLERANCE * weight:
            return "the forces of StaticEquilibriumProblem are outside the friction cones"
        return ""


def find_equilibria(scene: ScratchScene, holding: Holding) -> tuple[Equilibrium, ...]:
    """Checks the equilibrium under each load in a plant.

    Args:
        scene: object and grasp.
        holding: loads that are the weight in K directions, and contact forces that balance each.

    Returns:
        K equilibria.
    """
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    body = plant.AddRigidBody("object", scene.solid.M_BBo_B)
    pads = add_pads(plant, body, scene)
    tips = [add_tip(plant, plant.world_body(), scene, i, on_pad=True) for i in range(3)]
    plant.Finalize()
    weight = scene.solid.M_BBo_B.get_mass() * GRAVITY
    tolerance = _TOLERANCE * weight * min(1.0, scene.object_.rho)
    solver = _EquilibriumSolver(builder.Build(), pads, tips, tolerance)
    equilibria = []
    for wrench, f_Bc_B in zip(holding.wrench_B, holding.f_Bc_B, strict=True):
        gravity = wrench[:3] / scene.solid.M_BBo_B.get_mass()
        plant.mutable_gravity_field().set_gravity_vector(gravity)
        residual = _residual(scene, plant, scene.grasp.p_BC, f_Bc_B)
        p_BC, f_D = solver.solve(gravity, scene.grasp.nhat_TB_B, f_Bc_B)
        drake_residual, drake_spare = math.inf, -math.inf
        if len(f_D):
            drake_residual = _residual(scene, plant, p_BC, f_D)
            drake_spare = float(spare_friction(scene.grasp, f_D))
        weight, p_BC, f_D = frozen(wrench[:3]), frozen(p_BC), frozen(f_D)
        equilibria.append(Equilibrium(weight, residual, p_BC, f_D, drake_residual, drake_spare))
    return tuple(equilibria)


def _residual(scene: ScratchScene, plant: MultibodyPlant, p_BC: Array, f_Bc_B: Array) -> float:
    """Returns the unbalanced wrench of contact forces and gravity over the weight.

    Torques are divided by rho.
    """
    context = plant.CreateDefaultContext()
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    body = plant.GetBodyByName("object")
    for p, f in zip(p_BC, f_Bc_B, strict=True):
        body.AddInForce(context, p, SpatialForce(tau=np.zeros(3), f=f), body.body_frame(), forces)
    tau = plant.CalcInverseDynamics(context, np.zeros(plant.num_velocities()), forces)
    # A floating body's generalised forces: torque about Bo, then force.
    unbalanced = np.append(tau[:3] / scene.object_.rho, tau[3:])
    weight = scene.solid.M_BBo_B.get_mass() * plant.gravity_field().gravity_vector()
    return float(np.linalg.norm(unbalanced) / np.linalg.norm(weight))


class _EquilibriumSolver:
    """Solves for static equilibrium of a plant with the object at its default pose."""

    def __init__(
        self,
        diagram: Diagram,
        pads: list[GeometryId],
        tips: list[GeometryId],
        tolerance: float,
    ) -> None:
        self._diagram = diagram.ToAutoDiffXd()
        self._context = self._diagram.CreateDefaultContext()
        self._plant: MultibodyPlant_[AutoDiffXd] = self._diagram.GetSubsystemByName("plant")
        touching = {frozenset(pair) for pair in zip(pads, tips, strict=True)}
        self._ignored = {
            pair
            for pair in itertools.permutations([*pads, *tips], 2)
            if frozenset(pair) not in touching
        }
        self._options = SolverOptions()
        for name in ("Major feasibility", "Major optimality", "Minor feasibility"):
            self._options.SetOption(SnoptSolver.id(), f"{name} tolerance", tolerance)

    def solve(self, gravity: Array, nhat_TB_B: Array, guess: Array) -> tuple[Array, Array]:
        """Returns contact points [m] and forces on B [N], shape (3, 3), or (0, 3) if none found."""
        plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        self._plant.mutable_gravity_field().set_gravity_vector(gravity)
        problem = StaticEquilibriumProblem(self._plant, plant_context, self._ignored)
        program, q = problem.get_mutable_prog(), problem.q_vars()
        q_0 = [x.value() for x in self._plant.GetPositions(plant_context)]
        program.AddBoundingBoxConstraint(q_0, q_0, q)
        # Drake's unknowns are forces on the tips, the second bodies of its pairs.
        f_Tc = program.decision_variables()[len(q) : len(q) + 9]
        squeeze = -float((nhat_TB_B * guess).sum())
        program.AddLinearEqualityConstraint(nhat_TB_B.reshape(1, 9), [squeeze], f_Tc)
        # Many forces balance the weight: seek those nearest to the planned ones.
        program.AddQuadraticErrorCost(np.eye(9) / squeeze**2, -guess.ravel(), f_Tc)
        start = np.zeros(program.num_vars())
        start[: len(q)] = q_0
        start[len(q) : len(q) + 9] = -guess.ravel()
        result = SnoptSolver().Solve(program, start, self._options)
        if result.get_solution_result() == SolutionResult.kIterationLimit:
            # SNOPT makes short steps along a friction cone; restarted, it converges in a few.
            reached = result.GetSolution(program.decision_variables())
            result = SnoptSolver().Solve(program, reached, self._options)
        if not result.is_success():
            return np.empty((0, 3)), np.empty((0, 3))
        wrenches = problem.GetContactWrenchSolution(result)
        return (
            np.array([wrench.p_WCb_W for wrench in wrenches]),
            np.array([-wrench.F_Cb_W.translational() for wrench in wrenches]),
        )
