"""The models of this project, by name, and their three best grasps."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from drake_polygrasp import CertifiedGrasp, GraspObject, load_object, plan_grasps

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*/*.*df"))


def model(name: str) -> Path:
    return next(path for path in MODELS if path.stem == name)


@cache
def planned(name: str) -> tuple[GraspObject, tuple[CertifiedGrasp, ...]]:
    object_ = load_object(model(name))
    return object_, plan_grasps(object_, top=3).grasps
