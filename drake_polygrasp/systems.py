"""A grasp as a system of a Drake diagram."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import BasicVector, Context, LeafSystem, ValueProducer

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.holding import HoldingProgram
from drake_polygrasp.errors import UsageError
from drake_polygrasp.grasp import Grasp, GraspObject


class GraspForces(LeafSystem):  # type: ignore[misc]  # Drake's stubs are not followed.
    """Ideal fingertips: holds an object against a measured load with forces at three contacts.

    Of all contact forces inside the friction cones that cancel the load, with normal parts that add
    up to the squeeze, those farthest inside.

    Input ports:
        - body_poses: the plant's output port of that name.
        - load_W: force on the object [N] and torque about its centre of mass [N m], expressed in
          W, size 6; the weight is part of it. Not connected, it is zero.

    Output ports:
        - applied_spatial_force: for the plant's input port of that name.
        - holds: 1, or 0 where no contact forces cancel the load; then the squeeze alone is applied.
    """

    def __init__(
        self, object_: GraspObject, grasp: Grasp, squeeze: float, body_index: BodyIndex
    ) -> None:
        """Makes the system.

        Args:
            object_: what is grasped.
            grasp: three contacts, force closure.
            squeeze: total normal force [N].
            body_index: of the object's body in the plant.

        Raises:
            UsageError: when the squeeze is not positive, or the contacts cannot squeeze.
        """
        super().__init__()
        if not 0 < squeeze < np.inf:
            raise UsageError(f"the squeeze is {squeeze}; it must be a force above 0 N")
        self._grasp, self._squeeze, self._body_index = grasp, squeeze, body_index
        self._program = HoldingProgram(grasp, object_.p_BBcm, object_.rho)
        squeeze_f_B = self._program.forces(np.zeros(6), squeeze)
        if squeeze_f_B is None:
            raise UsageError("the contacts cannot squeeze: the grasp is not force closure")
        self._squeeze_f_B: Array = squeeze_f_B
        self._poses = self.DeclareAbstractInputPort(
            "body_poses", AbstractValue.Make([RigidTransform()])
        )
        self._load = self.DeclareVectorInputPort("load_W", 6)
        self._forces = self.DeclareCacheEntry(
            description="forces on B, expressed in B, and whether they hold the load",
            value_producer=ValueProducer(
                allocate=lambda: AbstractValue.Make((self._squeeze_f_B, False)),
                calc=self._calc_forces,
            ),
        )
        self.DeclareAbstractOutputPort(
            "applied_spatial_force",
            alloc=lambda: AbstractValue.Make([ExternallyAppliedSpatialForce()]),
            calc=self._calc_applied,
        )
        self.DeclareVectorOutputPort("holds", 1, self._calc_holds)

    def _rotation(self, context: Context) -> Array:
        poses = self._poses.Eval(context)
        return np.asarray(poses[int(self._body_index)].rotation().matrix())

    def _calc_forces(self, context: Context, forces: AbstractValue) -> None:
        load_W = self._load.Eval(context) if self._load.HasValue(context) else np.zeros(6)
        load_B = load_W.reshape(2, 3) @ self._rotation(context)
        f_Bc_B = self._program.forces(load_B.ravel(), self._squeeze)
        holds = f_Bc_B is not None
        forces.set_value((f_Bc_B if holds else self._squeeze_f_B, holds))

    def _calc_applied(self, context: Context, applied: AbstractValue) -> None:
        f_Bc_B, _ = self._forces.Eval(context)
        f_Bc_W = f_Bc_B @ self._rotation(context).T
        forces = []
        for p_BC, f in zip(self._grasp.p_BC, f_Bc_W, strict=True):
            force = ExternallyAppliedSpatialForce()
            force.body_index = self._body_index
            force.p_BoBq_B = p_BC
            force.F_Bq_W = SpatialForce(tau=np.zeros(3), f=f)
            forces.append(force)
        applied.set_value(forces)

    def _calc_holds(self, context: Context, holds: BasicVector) -> None:
        holds.SetFromVector([float(self._forces.Eval(context)[1])])
