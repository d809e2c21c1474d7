"""Defines a grasp as a system of a Drake diagram."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import (
    BasicVector,
    Context,
    InputPort,
    LeafSystem,
    ValueProducer,
)

from drake_polygrasp.arguments import check_instance, check_number, refuse
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.certify import prove
from drake_polygrasp.certification.holding_forces import HoldingProgram
from drake_polygrasp.errors import UsageError
from drake_polygrasp.grasp import AnyGrasp, Grasp, GraspObject, Verdict, grasp_of
from drake_polygrasp.plant.loads import default_squeeze

LOAD_PORT = "F_BBcm_W"
"""Name of the input port of the load."""


class GraspForces(LeafSystem):  # type: ignore[misc]  # Drake's stubs are not followed.
    """Ideal fingertips as a system: holds an object against a load with forces at three contacts.

    The load is an input; without it, nothing holds the weight.

    It applies those contact forces that balance the load with normal parts that add up to the
    squeeze, and that are farthest inside the friction cones.

        forces = builder.AddSystem(GraspForces(mug, plan.grasps[0], 20.0, body))
        builder.Connect(plant.get_body_poses_output_port(), forces.GetInputPort("body_poses"))
        builder.Connect(
            forces.GetOutputPort("applied_spatial_force"),
            plant.get_applied_spatial_force_input_port(),
        )
        weight = SpatialForce(tau=np.zeros(3), f=[0, 0, -9.81 * mug.mass])
        load = builder.AddSystem(ConstantValueSource(Value(weight)))
        builder.Connect(load.get_output_port(), forces.GetInputPort("F_BBcm_W"))

    Input ports:
        - body_poses: the plant's output port of that name.
        - F_BBcm_W: the load, a `SpatialForce` on body B at its centre of mass, expressed in the
          world W: torque [N m] and force [N], the weight included. If the port is not connected it
          is zero: the fingertips squeeze, and gravity takes the object.

    Output ports:
        - applied_spatial_force: for the plant's input port of that name.
        - holds: 1, or 0 if no contact forces balance the load; then only internal forces of the
          total `squeeze` are applied, which hold no load.
    """

    def __init__(
        self,
        object_: GraspObject,
        grasp: AnyGrasp,
        squeeze: float | None,
        body: RigidBody | BodyIndex,
    ) -> None:
        """Makes the system.

        Args:
            object_: object that is grasped.
            grasp: three contacts in force closure, alone or with their certificate.
            squeeze: total normal force [N], above 0; None for that of the plant's checks: the
                squeeze that the grasp's region certificate states, and at least 1.25 times the
                one that holds the weight without errors.
            body: body B of the object in the plant, or its index.

        Raises:
            UsageError: when an argument has the wrong type, the squeeze is not above 0, there is
                none that could be used by default, or the grasp is not force closure.
        """
        super().__init__()
        check_instance("object_", object_, GraspObject, "as load_object returns it")
        self._grasp = grasp_of(grasp)
        if squeeze is not None:
            squeeze = check_number("squeeze", squeeze, "a force above 0 N, or None", above=0.0)
        self._body_index = _index_of(body)
        proof = prove(self._grasp)
        if proof.verdict is not Verdict.HOLDS:
            raise UsageError(f"the grasp is not proved force closure: {proof.reason}")
        if squeeze is None:
            region = None if isinstance(grasp, Grasp) else grasp.region
            squeeze = default_squeeze(object_, self._grasp, region)
        if squeeze is None:
            raise UsageError(
                "no squeeze is known that holds the weight, as the model states no mass or no "
                "squeeze is enough: give squeeze, a force above 0 N"
            )
        self._squeeze = squeeze
        self._program = HoldingProgram(self._grasp, object_.p_BBcm, object_.rho)
        squeeze_f_B = self._program.forces(np.zeros(6), self._squeeze)
        if squeeze_f_B is None:
            raise UsageError(
                "no contact forces found that squeeze the object, though the grasp is force closure"
            )
        self._squeeze_f_B: Array = squeeze_f_B
        self._poses = self.DeclareAbstractInputPort(
            "body_poses", AbstractValue.Make([RigidTransform()])
        )
        self._load = self.DeclareAbstractInputPort(
            LOAD_PORT, AbstractValue.Make(SpatialForce.Zero())
        )
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

    def GetInputPort(self, port_name: str) -> InputPort:
        """Returns an input port.

        Args:
            port_name: "body_poses" or "F_BBcm_W".

        Raises:
            UsageError: when there is no such port.
        """
        if port_name == "load_W":
            raise UsageError(
                f"the port 'load_W' is now '{LOAD_PORT}' and takes a SpatialForce, torque before "
                "force, as Drake has it"
            )
        if port_name not in ("body_poses", LOAD_PORT):
            raise refuse("port_name", port_name, f"'body_poses' or '{LOAD_PORT}'")
        return super().GetInputPort(port_name)

    def _rotation(self, context: Context) -> Array:
        poses, index = self._poses.Eval(context), int(self._body_index)
        if index >= len(poses):
            raise UsageError(
                f"the object's body has index {index}, and the plant has {len(poses)} bodies: "
                "give GraspForces a body of the plant whose body_poses are connected"
            )
        return np.asarray(poses[index].rotation().matrix())

    def _calc_forces(self, context: Context, forces: AbstractValue) -> None:
        load = self._load.Eval(context) if self._load.HasValue(context) else SpatialForce.Zero()
        R_WB = self._rotation(context)
        load_B = np.concatenate([load.translational() @ R_WB, load.rotational() @ R_WB])
        f_Bc_B = self._program.forces(load_B, self._squeeze)
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


def _index_of(body: RigidBody | BodyIndex) -> BodyIndex:
    if isinstance(body, RigidBody):
        return body.index()
    if isinstance(body, BodyIndex):
        return body
    raise refuse("body", body, "a body of the plant, or its index: plant.GetBodyByName(name)")
