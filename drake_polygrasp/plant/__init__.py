"""Does it hold in Drake? The grasp in a MultibodyPlant, side by side with the mathematics.

| file | what it holds |
|---|---|
| certify_in_plant.py | five verdicts on a grasp, of mathematics and of Drake: `certify_in_plant` |
| scratch_plant.py | plants of our own with the object and three fingertips |
| drake_calls.py | Drake's refusals as answers |
| surface_distance.py | signed distances to a body's own collision geometry |
| contact_geometry.py | whether fingertips touch the object where the grasp says |
| clearance.py | whether fingertips penetrate links on joints or the user's scene |
| statics.py | Drake's contact forces under gravity along each axis |
| simulation.py | fingertips that hold the object through time |
| fingertips.py | three force-controlled fingertips in any plant: `add_fingertips` |
| harness.py | simulates and records them: `GraspSimulation` |
| grasp_report.py | whether they held the object, and how far it slipped: `report_grasp` |
| approach.py | whether they reach their contacts along the normals: `is_approach_clear` |
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
