"""Plans grasps of three frictional point contacts on two or three faces, and proves each one.

    from drake_polygrasp import load_object, plan_grasps, save_grasps, verify_file

    box = load_object("models/brick/brick.urdf")
    plan = plan_grasps(box)
    best = plan.grasps[0]
    print(best.grasp.p_BC, best.certificate.epsilon_lower)
    save_grasps("brick.grasp.yaml", box, plan.grasps, plan.settings)
    assert verify_file("brick.grasp.yaml").holds

After Prado & Suárez, "Heuristic Grasp Planning with Three Frictional Contacts on Two or Three Faces
of a Polyhedron". Points, normals and forces are expressed in the object's body frame B; SI units.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from drake_polygrasp._version import __version__

if TYPE_CHECKING:
    from drake_polygrasp.certification.in_plant import PlantReport, certify_in_plant
    from drake_polygrasp.errors import GraspFileError, ModelError, PolygraspError, UsageError
    from drake_polygrasp.explain import Explanation, explain_sets
    from drake_polygrasp.export import contact_poses, export_directives
    from drake_polygrasp.gap import BetterGrasp, Gap, epsilon_gap
    from drake_polygrasp.geometry.obstacles import Obstacles
    from drake_polygrasp.grasp import (
        Certificate,
        CertifiedGrasp,
        Grasp,
        GraspObject,
        PlantRecord,
        PlantVerdict,
    )
    from drake_polygrasp.grasp_file import load_grasps, save_grasps
    from drake_polygrasp.loading.object_model import load_object
    from drake_polygrasp.loading.plant_object import object_from_plant
    from drake_polygrasp.loading.plant_obstacles import obstacles_from_plant
    from drake_polygrasp.loading.surroundings import (
        Surroundings,
        load_surroundings,
        surroundings_from_plant,
    )
    from drake_polygrasp.pipeline import GraspPlan, plan_grasps
    from drake_polygrasp.plant_ranking import rank_in_plant
    from drake_polygrasp.stated_grasp import GraspFile
    from drake_polygrasp.systems import GraspForces
    from drake_polygrasp.verification import verify_file
    from drake_polygrasp.verification_report import Report

__all__ = [
    "BetterGrasp",
    "Certificate",
    "CertifiedGrasp",
    "Explanation",
    "Gap",
    "Grasp",
    "GraspFile",
    "GraspFileError",
    "GraspForces",
    "GraspObject",
    "GraspPlan",
    "ModelError",
    "Obstacles",
    "PlantRecord",
    "PlantReport",
    "PlantVerdict",
    "PolygraspError",
    "Report",
    "Surroundings",
    "UsageError",
    "__version__",
    "certify_in_plant",
    "contact_poses",
    "epsilon_gap",
    "explain_sets",
    "export_directives",
    "load_grasps",
    "load_object",
    "load_surroundings",
    "object_from_plant",
    "obstacles_from_plant",
    "plan_grasps",
    "rank_in_plant",
    "save_grasps",
    "surroundings_from_plant",
    "verify_file",
]

_HOMES = {
    "certification.in_plant": ("PlantReport", "certify_in_plant"),
    "errors": ("GraspFileError", "ModelError", "PolygraspError", "UsageError"),
    "export": ("contact_poses", "export_directives"),
    "gap": ("BetterGrasp", "Gap", "epsilon_gap"),
    "geometry.obstacles": ("Obstacles",),
    "grasp": ("Certificate", "CertifiedGrasp", "Grasp", "GraspObject"),
    "grasp_file": ("load_grasps", "save_grasps"),
    "loading.object_model": ("load_object",),
    "loading.plant_object": ("object_from_plant",),
    "loading.plant_obstacles": ("obstacles_from_plant",),
    "loading.surroundings": ("Surroundings", "load_surroundings", "surroundings_from_plant"),
    "pipeline": ("Explanation", "GraspPlan", "explain_sets", "plan_grasps"),
    "plant_ranking": ("rank_in_plant",),
    "plant_verdicts": ("PlantRecord", "PlantVerdict"),
    "stated_grasp": ("GraspFile",),
    "systems": ("GraspForces",),
    "verification": ("Report", "verify_file"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    # Loaded when asked for: who only verifies never loads the planner.
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
