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
    "add_fingertips",
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
        "harness": ("GraspRecord", "GraspSample", "GraspSimulation", "connect_commands"),
    },
)
