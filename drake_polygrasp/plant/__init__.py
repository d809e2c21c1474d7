"""Checks grasps in a MultibodyPlant: contacts, statics and simulation with Drake's own contact.

| file | what it holds |
|---|---|
| certify_in_plant.py | two verdicts of the certificate and three of Drake: `certify_in_plant` |
| scratch_plant.py | parts of temporary plants with the object and three fingertips |
| drake_calls.py | returns Drake's errors and failed assertions as values |
| surface_distance.py | signed distances to a body's collision geometry |
| contact_geometry.py | checks that fingertips touch the object at the contacts of the grasp |
| clearance.py | checks that fingertips penetrate neither links on joints nor the user's scene |
| loads.py | plans a squeeze, the loads to check it with, and the contact forces that hold them |
| statics.py | static equilibrium of the plant under gravity along each axis |
| simulation.py | simulates fingertips that hold the object under each load |
| load_test.py | simulates planned loads and judges them |
| misses.py | simulates errors within those that a grasp is certified to bear |
| fingertips.py | adds three force-controlled fingertips to any plant: `add_fingertips` |
| harness.py | simulates fingertips and records forces and poses: `GraspSimulation` |
| grasp_report.py | whether fingertips held the object, and how far it slipped: `report_grasp` |
| approach.py | whether fingertips can reach contacts along the normals: `is_approach_clear` |
| hand_control.py | commands a hand that closes and squeezes: `HandController` |
| hand_lift.py | lifts the object with a whole hand: `lift_with_hand` |
| lift_plant.py | a plant with a hand on two carriages and the object under it |
| supports.py | where an object stands, and spheres may carry it |
| grasp_forces.py | a grasp as a system of a diagram: `GraspForces` |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drake_polygrasp import lazy_names

if TYPE_CHECKING:
    from drake_polygrasp.plant.approach import is_approach_clear
    from drake_polygrasp.plant.fingertips import (
        DISSIPATION,
        Fingertips,
        FingertipSpheres,
        add_fingertips,
        add_slider,
        contact_material,
        fingertip_friction,
        fingertip_modulus,
        fingertip_spheres,
    )
    from drake_polygrasp.plant.grasp_report import Event, GraspReport, report_grasp
    from drake_polygrasp.plant.hand_control import HandTimes, add_hand_actuators
    from drake_polygrasp.plant.harness import (
        GraspRecord,
        GraspSample,
        GraspSimulation,
        connect_commands,
    )

__all__ = [
    "DISSIPATION",
    "Event",
    "FingertipSpheres",
    "Fingertips",
    "GraspRecord",
    "GraspReport",
    "GraspSample",
    "GraspSimulation",
    "HandTimes",
    "add_fingertips",
    "add_hand_actuators",
    "add_slider",
    "connect_commands",
    "contact_material",
    "fingertip_friction",
    "fingertip_modulus",
    "fingertip_spheres",
    "is_approach_clear",
    "report_grasp",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "approach": ("is_approach_clear",),
        "fingertips": (
            "DISSIPATION",
            "FingertipSpheres",
            "Fingertips",
            "add_fingertips",
            "add_slider",
            "contact_material",
            "fingertip_friction",
            "fingertip_modulus",
            "fingertip_spheres",
        ),
        "grasp_report": ("Event", "GraspReport", "report_grasp"),
        "hand_control": ("HandTimes", "add_hand_actuators"),
        "harness": ("GraspRecord", "GraspSample", "GraspSimulation", "connect_commands"),
    },
)
