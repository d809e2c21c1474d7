"""Plans grasps of three frictional point contacts on two or three faces, and proves each one.

It implements Prado & Suárez, "Heuristic Grasp Planning with Three Frictional Contacts on Two or
Three Faces of a Polyhedron", for any object that Drake's Parser loads:

    from drake_polygrasp import load_object, plan_grasps, save_grasps, verify_file

    box = load_object("models/brick/brick.urdf")
    plan = plan_grasps(box)
    best = plan.grasps[0]
    print(best.grasp.p_BC, best.certificate.epsilon_lower)
    save_grasps("brick.grasp.yaml", box, plan.grasps, plan.settings)
    assert verify_file("brick.grasp.yaml").holds

Points, normals and forces are expressed in the object's body frame B, in SI units. Every error is a
`PolygraspError`, whose message says what is wrong and what would mend it. `help` of a name says
what it takes, returns and raises.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from drake_polygrasp._version import __version__

if TYPE_CHECKING:
    from drake_polygrasp.batch.rows import BatchRow
    from drake_polygrasp.batch.run import BatchReport, iter_batch, plan_batch
    from drake_polygrasp.errors import (
        BatchError,
        GraspFileError,
        HandError,
        ModelError,
        PolygraspError,
        UsageError,
    )
    from drake_polygrasp.exporters.directives import export_directives
    from drake_polygrasp.exporters.poses import contact_poses
    from drake_polygrasp.files.grasp_file import load_grasps, save_grasps
    from drake_polygrasp.files.stated_grasp import GraspFile
    from drake_polygrasp.geometry.obstacles import Obstacles
    from drake_polygrasp.grasp import (
        Certificate,
        CertifiedGrasp,
        Grasp,
        GraspObject,
        PlantRecord,
        PlantVerdict,
        RegionCertificate,
    )
    from drake_polygrasp.hand_grasp import HandGrasp, HandRefusal
    from drake_polygrasp.hands.check import HandReport, check_hand
    from drake_polygrasp.hands.hand import Hand
    from drake_polygrasp.hands.model import load_hand
    from drake_polygrasp.loading.examples import example_models
    from drake_polygrasp.loading.mesh_object import object_from_mesh
    from drake_polygrasp.loading.object_model import load_object
    from drake_polygrasp.loading.plant_object import object_from_plant
    from drake_polygrasp.loading.plant_obstacles import obstacles_from_plant
    from drake_polygrasp.loading.surroundings import (
        Surroundings,
        load_surroundings,
        surroundings_from_plant,
    )
    from drake_polygrasp.optimality.gap import BetterGrasp, OptimalityGap, epsilon_gap
    from drake_polygrasp.pipeline.explain import Explanation, explain_sets
    from drake_polygrasp.pipeline.hand_grasps import plan_hand_grasps
    from drake_polygrasp.pipeline.hand_plan import HandPlan
    from drake_polygrasp.pipeline.one_hand_grasp import hand_grasp_for
    from drake_polygrasp.pipeline.plan import GraspPlan, plan_grasps
    from drake_polygrasp.pipeline.plant_ranking import rank_in_plant
    from drake_polygrasp.pipeline.region_certificates import certify_region
    from drake_polygrasp.plant.certify_in_plant import PlantReport, certify_in_plant
    from drake_polygrasp.plant.grasp_forces import GraspForces
    from drake_polygrasp.plant.hand_control import HandController
    from drake_polygrasp.plant.hand_lift import LiftOutcome, lift_with_hand
    from drake_polygrasp.settings import NO_ERRORS, PlanSettings
    from drake_polygrasp.verification.report import VerificationReport
    from drake_polygrasp.verification.stated_model import load_planned_object
    from drake_polygrasp.verification.verify import verify_file

__all__ = [
    "NO_ERRORS",
    "BatchError",
    "BatchReport",
    "BatchRow",
    "BetterGrasp",
    "Certificate",
    "CertifiedGrasp",
    "Explanation",
    "Grasp",
    "GraspFile",
    "GraspFileError",
    "GraspForces",
    "GraspObject",
    "GraspPlan",
    "Hand",
    "HandController",
    "HandError",
    "HandGrasp",
    "HandPlan",
    "HandRefusal",
    "HandReport",
    "LiftOutcome",
    "ModelError",
    "Obstacles",
    "OptimalityGap",
    "PlanSettings",
    "PlantRecord",
    "PlantReport",
    "PlantVerdict",
    "PolygraspError",
    "RegionCertificate",
    "Surroundings",
    "UsageError",
    "VerificationReport",
    "__version__",
    "certify_in_plant",
    "certify_region",
    "check_hand",
    "contact_poses",
    "epsilon_gap",
    "example_models",
    "explain_sets",
    "export_directives",
    "hand_grasp_for",
    "iter_batch",
    "lift_with_hand",
    "load_grasps",
    "load_hand",
    "load_object",
    "load_planned_object",
    "load_surroundings",
    "object_from_mesh",
    "object_from_plant",
    "obstacles_from_plant",
    "plan_batch",
    "plan_grasps",
    "plan_hand_grasps",
    "rank_in_plant",
    "save_grasps",
    "surroundings_from_plant",
    "verify_file",
]

_HOMES = {
    "batch.rows": ("BatchRow",),
    "batch.run": ("BatchReport", "iter_batch", "plan_batch"),
    "errors": (
        *("BatchError", "GraspFileError", "HandError", "ModelError", "PolygraspError"),
        "UsageError",
    ),
    "exporters.directives": ("export_directives",),
    "exporters.poses": ("contact_poses",),
    "files.grasp_file": ("load_grasps", "save_grasps"),
    "files.stated_grasp": ("GraspFile",),
    "geometry.obstacles": ("Obstacles",),
    "grasp": (
        *("Certificate", "CertifiedGrasp", "Grasp", "GraspObject"),
        *("PlantRecord", "PlantVerdict", "RegionCertificate"),
    ),
    "hand_grasp": ("HandGrasp", "HandRefusal"),
    "hands.check": ("HandReport", "check_hand"),
    "hands.hand": ("Hand",),
    "hands.model": ("load_hand",),
    "loading.examples": ("example_models",),
    "loading.mesh_object": ("object_from_mesh",),
    "loading.object_model": ("load_object",),
    "loading.plant_object": ("object_from_plant",),
    "loading.plant_obstacles": ("obstacles_from_plant",),
    "loading.surroundings": ("Surroundings", "load_surroundings", "surroundings_from_plant"),
    "optimality.gap": ("BetterGrasp", "OptimalityGap", "epsilon_gap"),
    "pipeline.explain": ("Explanation", "explain_sets"),
    "pipeline.hand_grasps": ("plan_hand_grasps",),
    "pipeline.hand_plan": ("HandPlan",),
    "pipeline.one_hand_grasp": ("hand_grasp_for",),
    "pipeline.plan": ("GraspPlan", "plan_grasps"),
    "pipeline.plant_ranking": ("rank_in_plant",),
    "pipeline.region_certificates": ("certify_region",),
    "plant.certify_in_plant": ("PlantReport", "certify_in_plant"),
    "plant.grasp_forces": ("GraspForces",),
    "plant.hand_control": ("HandController",),
    "plant.hand_lift": ("LiftOutcome", "lift_with_hand"),
    "settings": ("NO_ERRORS", "PlanSettings"),
    "verification.report": ("VerificationReport",),
    "verification.stated_model": ("load_planned_object",),
    "verification.verify": ("verify_file",),
}


def lazy_names(
    package: str, homes: Mapping[str, tuple[str, ...]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Makes the functions with which a package imports each of its names at its first use.

    So verifying a file never loads the planner, and planning loads no matplotlib.

    Args:
        package: full name of the package, its `__name__`.
        homes: names that the package offers, by the module in it that defines them.

    Returns:
        Two functions, for its `__getattr__` and its `__dir__`.
    """
    home = {name: module for module, names in homes.items() for name in names}

    def load(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{home[name]}"), name)

    def names() -> list[str]:
        return sorted({*vars(import_module(package)), *home})

    return load, names


__getattr__, __dir__ = lazy_names(__name__, _HOMES)
