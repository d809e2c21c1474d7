"""A report says what was held, what slipped and what was lost, of motions known by hand."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from drake_polygrasp.arrays import Array
from drake_polygrasp.plant.grasp_report import Event, GraspReport, report_grasp
from drake_polygrasp.plant.harness import GraspRecord

X, _, Z = np.eye(3)


def judged(X_HB: list[RigidTransform], push: Array) -> GraspReport:
    """Of an object of 0.1 m whose first contact is pushed along x; its lift begins at sample 90."""
    p_BC, p_BBcm = np.array([[0.0, 0.02, 0.0], [0.0] * 3, [0.0] * 3]), np.zeros(3)
    time, poses = 0.01 * np.arange(100), tuple(X_HB)
    record = GraspRecord(time, poses, poses, push, np.full_like(push, 2.0))
    phases = ["squeeze"] * 90 + ["lift"] * 10
    return report_grasp(record, phases, 89, p_BC, np.array([X, X, X]), p_BBcm, 0.1)


def test_what_moves_along_the_normal_drifts_and_what_moves_across_it_slips() -> None:
    still, push = [RigidTransform()] * 90, np.full((100, 3), 2.0)
    along = judged(still + [RigidTransform(5e-4 * X)] * 10, push)
    assert along.drift == pytest.approx(5e-4)
    assert along.slip == pytest.approx((0.0, 0.0, 0.0))
    assert along.held
    across = judged(still + [RigidTransform(2e-3 * Z)] * 10, push)
    assert across.slip == pytest.approx((2e-3, 2e-3, 2e-3))
    assert across.slipped == Event(pytest.approx(0.9), "lift")
    assert not across.held
    turned = RigidTransform(RotationMatrix.MakeXRotation(0.01))
    twisted = judged(still + [turned] * 10, push)
    assert twisted.turn == pytest.approx(0.01)
    assert twisted.drift == pytest.approx(0.0)
    assert twisted.slip == pytest.approx((2e-4, 0.0, 0.0), rel=1e-3)


def test_a_tip_without_force_has_lost_the_object_and_before_the_lift_has_not() -> None:
    still, push = [RigidTransform()] * 100, np.full((100, 3), 2.0)
    push[10] = 0.0
    assert judged(still, push).held
    push[95, 1] = 0.0
    report = judged(still, push)
    assert not report.held
    assert report.lost == (None, Event(pytest.approx(0.95), "lift"), None)
