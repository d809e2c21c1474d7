"""The models of this project, by name, their three best grasps, and plans without errors."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from drake_polygrasp import CertifiedGrasp, GraspObject, GraspPlan, load_object, plan_grasps
from drake_polygrasp.settings import NO_ERRORS

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*/*.*df"))


def exact_plan(object_: GraspObject, **options: Any) -> GraspPlan:
    """Plans without the default errors, for tests that are not about errors and need no regions."""
    return plan_grasps(object_, **NO_ERRORS | options)


def model(name: str) -> Path:
    return next(path for path in MODELS if path.stem == name)


@cache
def planned(name: str) -> tuple[GraspObject, tuple[CertifiedGrasp, ...]]:
    object_ = load_object(model(name))
    return object_, exact_plan(object_, top=3).grasps
