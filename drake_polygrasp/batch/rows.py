"""The row of each result, and what becomes of an object."""

from __future__ import annotations

from dataclasses import dataclass

STATUSES = ("ok", "no_grasp", "bad_model", "crash", "timeout", "out_of_memory")
"""How planning of an object ends: with grasps; with none; with a model, or options for it, that are
refused; or as its process ended."""


@dataclass(frozen=True, kw_only=True)
class BatchRow:
    """The result of one object of a batch.

    Attributes:
        key: SHA-256 of the model's files, the options and the versions; it names the grasp file.
        source: the model as it was named first.
        body: name of the body; None where it was not known.
        status: one of `STATUSES`.
        reason: why there is no grasp file, in one line; empty where there is one.
        return_code: return code of the process that ended with the object; minus the signal's
            number where a signal ended it; None where it went on.
        attempts: how often planning was started.
        num_faces: number of the object's faces.
        num_sets: number of its sets of faces.
        num_grasps: number of grasps in the file.
        epsilon: lower bound of the best grasp's epsilon.
        margin: margin of the best grasp's proof.
        load_seconds: time to load the model [s].
        plan_seconds: time to plan [s].
        certify_seconds: time to rank and certify [s].
        seconds: time of all, or until its process ended [s].
        peak_bytes: greatest resident memory of the process, as far as it was seen.
        finished: when the result was committed [s since 1970].
    """

    key: str
    source: str
    body: str | None = None
    status: str
    reason: str = ""
    return_code: int | None = None
    attempts: int = 1
    num_faces: int | None = None
    num_sets: int | None = None
    num_grasps: int = 0
    epsilon: float | None = None
    margin: float | None = None
    load_seconds: float | None = None
    plan_seconds: float | None = None
    certify_seconds: float | None = None
    seconds: float = 0.0
    peak_bytes: int = 0
    finished: float = 0.0
