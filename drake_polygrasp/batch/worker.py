"""What child processes run: plans one object, from its model to the text of its grasp file."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from drake_polygrasp._version import __version__, drake_version
from drake_polygrasp.errors import PolygraspError, SeveralBodiesError
from drake_polygrasp.files.grasp_file import grasp_file_text, load_grasps
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.hand_grasp import HandGrasp
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.pipeline.plan import GraspPlan, plan_grasps
from drake_polygrasp.pipeline.plant_ranking import rank_in_plant
from drake_polygrasp.settings import PlanSettings, Steps
from drake_polygrasp.verification.verify import verify_file

_TOP = 10
"""The default of `plan_grasps`."""
_MAX_PLANT_CHECKS = 2
"""Grasps that are checked in a plant at most, per grasp wanted, as `polygrasp plan` does."""


def plan_model(
    *,
    model: str,
    current_folder: str,
    folder: str,
    load: dict[str, Any],
    plan: dict[str, Any],
    plant: bool,
    hand: dict[str, Any] | None = None,
    file: str | None = None,
    text: str | None = None,
) -> dict[str, Any]:
    """Plans grasps of a model's body, or adopts the grasp file that an earlier run wrote of it.

    Args:
        model: a path or URI.
        current_folder: the driver's current folder, to which paths are relative.
        folder: where the grasp file will be, to which the model's path in it is relative.
        load: keyword arguments of `load_object`.
        plan: keyword arguments of `plan_grasps`, which need not be given in full.
        plant: whether grasps are also checked in a plant.
        hand: the hand's `description` and keyword arguments of `plan_hand_grasps`; None for grasps
            of three fingertips alone.
        file: path of a grasp file of it that has no row yet; it is adopted if all that it states
            holds.
        text: the text of such a file, where it is not on this machine.

    Returns:
        `bodies` where the model has several and none was named. Otherwise `status` and the row's
        columns, with `text`, that of the grasp file, if there are grasps.
    """
    with suppress(OSError):  # Another machine may lack it, and absolute paths do without.
        os.chdir(current_folder)
    if (file or text) and (adopted := _adopt(file, text, load)):
        return adopted
    start = perf_counter()
    try:
        object_ = load_object(model, **load)
        loaded = perf_counter()
        if hand is None:
            found = _plan(object_, plan, plant, load)
        else:
            found = _plan_hand(object_, plan, hand, load)
    except SeveralBodiesError as error:
        if load["body_name"] is None:
            return {"bodies": error.bodies}
        return {"status": "bad_model", "reason": str(error)}
    except PolygraspError as error:
        return {"status": "bad_model", "reason": str(error)}
    row: dict[str, Any] = {
        "status": "ok" if found.grasps else "no_grasp",
        "body": None if object_.source is None else object_.source.body_name,
        "num_faces": len(object_.polyhedron.faces),
        "num_sets": found.num_sets,
        "load_seconds": loaded - start,
        "plan_seconds": found.plan_seconds,
        "certify_seconds": found.certify_seconds,
    }
    if not found.grasps:
        return row | {"reason": found.reason}
    best = found.grasps[0]
    certificate = (best.certified if isinstance(best, HandGrasp) else best).certificate
    return row | {
        "text": grasp_file_text(Path(folder), object_, found.grasps, found.settings),
        "num_grasps": len(found.grasps),
        "epsilon": certificate.epsilon_lower,
        "margin": certificate.margin,
    }


class _Found(NamedTuple):
    """What planning found, with a hand or without."""

    grasps: tuple[CertifiedGrasp, ...] | tuple[HandGrasp, ...]
    settings: PlanSettings
    num_sets: int | None
    plan_seconds: float
    certify_seconds: float | None
    reason: str


def _plan(object_: GraspObject, asked: dict[str, Any], plant: bool, load: dict[str, Any]) -> _Found:
    """Plans, and ranks by verdicts in a plant where that is asked for."""
    options = dict(asked)
    if "steps" in options:
        options["steps"] = Steps(**options["steps"])
    top = options.pop("top", _TOP)
    found = plan_grasps(object_, top=_MAX_PLANT_CHECKS * top if plant else top, **options)
    if plant and found.grasps:
        found = rank_in_plant(object_, found, top=top, **_places(load))
    seconds, reason = found.seconds, "" if found.grasps else _no_grasp_reason(found)
    return _Found(
        found.grasps, found.settings, found.num_sets, seconds["plan"], seconds["certify"], reason
    )


def _plan_hand(
    object_: GraspObject, asked: dict[str, Any], hand: dict[str, Any], load: dict[str, Any]
) -> _Found:
    """Plans grasps that a hand can make."""
    from drake_polygrasp.hands.model import load_hand
    from drake_polygrasp.pipeline.hand_grasps import plan_hand_grasps

    places = _places(load)
    given = {name: value for name, value in (asked | hand).items() if value is not None}
    description, _ = given.pop("description"), given.pop("sha256")
    start = perf_counter()
    plan = plan_hand_grasps(object_, load_hand(description, **places), **given, **places)
    words = "; ".join(plan.sentences.values())
    reason = f"no grasp that the hand can make; {plan.tried} of {plan.candidates} candidates tried"
    reason = "" if plan.grasps else f"{reason}: {words}"
    return _Found(plan.grasps, plan.settings, None, perf_counter() - start, None, reason)


def _places(load: dict[str, Any]) -> dict[str, Any]:
    return {name: load[name] for name in ("package_paths", "packages")}


def _no_grasp_reason(found: GraspPlan) -> str:
    reasons = ", ".join(f"{count} {reason}" for reason, count in found.reasons.items())
    if found.outcome == "none_found":
        return (
            f"no grasp found; {found.num_not_evaluated} of {found.num_sets} sets of faces were "
            f"not evaluated ({reasons})"
        )
    if not reasons:
        return "no certified grasp; no two faces have room within the edge clearance"
    return f"no certified grasp; all {found.num_sets} sets of faces were evaluated ({reasons})"


def _adopt(file: str | None, text: str | None, load: dict[str, Any]) -> dict[str, Any] | None:
    """Returns the row of a grasp file that holds; None where it is to be planned again."""
    if file is None:
        with tempfile.NamedTemporaryFile("w", suffix=".grasp.yaml", encoding="utf-8") as copy:
            copy.write(text or "")
            copy.flush()
            return _adopt(copy.name, None, load)
    try:
        stated = load_grasps(file)
        report = verify_file(file, **_places(load))
    except PolygraspError:
        return None
    written = {"drake_polygrasp": __version__, "drake": drake_version()}
    if report.holds is False or dict(stated.generator) != written or not stated.grasps:
        return None
    best = stated.grasps[0].certificate
    return {
        "status": "ok",
        "body": stated.object_.body_name,
        "num_faces": stated.object_.num_faces,
        "num_grasps": len(stated.grasps),
        "epsilon": best.epsilon_lower,
        "margin": best.margin,
        "reason": "the grasp file was there, and holds; it was not planned again",
    }
