"""Compares public models as they load with the mass, centre and friction of Drake's plant.

    python -m benchmarks.public_models FOLDER ... [--kinds .sdf .urdf .xml] [--bodies 4] [--list]

Walks folders for models, for instance those that PyPI's packages of robotics bring along, and loads
each rigid body that has collision geometry. Mass and centre of mass are compared with what Drake
computes of the body's links. Friction, and a mass of 1 kg, are compared with Drake's too, but
only where the model states them: the model is read once more from a copy in which each coefficient
and mass of 1 is written as another number, and what stays 1 is Drake's own default. It prints how
many bodies agree, and each that does not or is refused, with the reason. The exit status is 1 when
any disagrees.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody, WeldJoint

from drake_polygrasp.cli.child_process import ChildLimits, call_in_child
from drake_polygrasp.errors import ModelError, PolygraspError
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.body_object import DEFAULT_MU
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.loading.packages import find_packages, use_packages, without_network

KINDS = (".sdf", ".urdf", ".xml")
SECONDS = 120.0
"""For one body, ours."""
ROUNDING = 1e-9
"""Relative: sums of links' inertias in another order, and decimals of a grasp file."""
OTHER = 1.7
"""What a coefficient or a mass of 1 becomes in the copy."""
_ONE = r"(?:1|1\.0*|1(?:\.0*)?[eE][+-]?0+)"
_STATED = re.compile(
    rf"""(
        \bfriction \s* = \s* ["'] \s*                                # MJCF, the first of three
      | <(?:mu|mu2|drake:mu_static|drake:mu_dynamic|static_friction|dynamic_friction) > \s*
      | <(?:drake:mu_static|drake:mu_dynamic) \s+ value \s* = \s* ["'] \s*
      | <mass> \s*
    ) {_ONE} (?= [\s"'<])""",
    re.VERBOSE,
)


class Outcome(StrEnum):
    """What became of a body."""

    AGREES = "agrees"
    DISAGREES = "DISAGREES"
    REFUSED = "refused"


@dataclass(frozen=True)
class Finding:
    """What became of one body of one model."""

    model_file: Path
    body: str
    outcome: Outcome
    reason: str = ""


@dataclass(frozen=True)
class DrakeBody:
    """What Drake's plant states of a rigid body."""

    name: str
    mass: float | None
    """[kg]; None where the model states none."""
    p_BBcm: tuple[float, float, float]
    friction: tuple[float, ...]
    """To plan with, of each collision geometry."""


def main(argv: Sequence[str] | None = None) -> int:
    """Compares all models below the folders and prints what was found."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.public_models")
    parser.add_argument("folders", metavar="FOLDER", nargs="+", type=Path)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS))
    parser.add_argument("--bodies", type=int, default=4, help="at most of each model (default: 4)")
    parser.add_argument("--list", action="store_true", help="print bodies that agree too")
    arguments = parser.parse_args(argv)
    findings: list[Finding] = []
    unread: list[str] = []
    num_models = 0
    for folder in arguments.folders:
        with tempfile.TemporaryDirectory() as temporary:
            copy = Path(temporary)
            write_copy(folder, copy)
            for model_file in sorted(find_models(folder, arguments.kinds)):
                try:
                    found = compare_model(
                        model_file, copy / model_file.relative_to(folder), arguments.bodies
                    )
                except UnreadError as error:
                    unread.append(str(error))
                    continue
                num_models += bool(found)
                findings += found
                for finding in found:
                    if arguments.list or finding.outcome is not Outcome.AGREES:
                        print(_line(finding), flush=True)
    print_summary(num_models, findings, unread)
    return int(any(finding.outcome is Outcome.DISAGREES for finding in findings))


def print_summary(num_models: int, findings: Sequence[Finding], unread: Sequence[str]) -> None:
    """Prints counts, and why bodies were refused and models are not Drake's."""
    counts = Counter(finding.outcome for finding in findings)
    agreeing = {f.model_file for f in findings if f.outcome is Outcome.AGREES}
    print(f"\n{num_models} models with {len(findings)} bodies; {len(unread)} files are not Drake's")
    print(f"{len(agreeing)} models have bodies that agree")
    for outcome in Outcome:
        print(f"{outcome}: {counts[outcome]}")
    reasons = Counter(_kind(f.reason) for f in findings if f.outcome is Outcome.REFUSED)
    for reason, count in reasons.most_common():
        print(f"  {count} x {reason}")
    print("files that Drake refuses:")
    for reason, count in Counter(map(_kind, unread)).most_common():
        print(f"  {count} x {reason}")


def _line(finding: Finding) -> str:
    reason = f": {finding.reason}" if finding.reason else ""
    return f"{finding.outcome} {finding.model_file} {finding.body}{reason}"


def _kind(reason: str) -> str:
    """A reason without what is of one file only."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"|\S*/\S*|-?\d+(\.\d+)?(e-?\d+)?", "*", reason)
    return text[:120]


def find_models(folder: Path, kinds: Sequence[str]) -> Iterator[Path]:
    """Yields files that may be models; of .xml those that look like MJCF."""
    for path in folder.rglob("*"):
        if not path.is_file() or path.suffix.lower() not in kinds:
            continue
        if path.suffix.lower() == ".xml" and b"<mujoco" not in path.read_bytes()[:100_000]:
            continue
        yield path


def write_copy(folder: Path, copy: Path) -> None:
    """Copies a folder with another number for each coefficient and mass of 1; meshes are linked."""
    for where, _, names in os.walk(folder.resolve()):
        target = copy / Path(where).relative_to(folder.resolve())
        target.mkdir(parents=True, exist_ok=True)
        for name in names:
            source = Path(where, name)
            if source.suffix.lower() in KINDS:
                text = source.read_bytes().decode(errors="surrogateescape")
                changed = _STATED.sub(rf"\g<1>{OTHER}", text)
                (target / name).write_bytes(changed.encode(errors="surrogateescape"))
            else:
                (target / name).symlink_to(source)


class UnreadError(Exception):
    """Drake does not load a file."""


def compare_model(model_file: Path, copy: Path, max_bodies: int) -> list[Finding]:
    """Compares the bodies of one model; UnreadError when Drake loads no body with geometry."""
    try:
        bodies, _ = call_in_child(
            "benchmarks.public_models:drake_bodies",
            model_file,
            copy,
            limits=ChildLimits(f"reading {model_file}", SECONDS),
        )
    except ModelError as error:
        raise UnreadError(str(error)) from error
    return [compare_body(model_file, body) for body in bodies[:max_bodies]]


def compare_body(model_file: Path, body: DrakeBody) -> Finding:
    """Compares one body with what Drake states of it."""
    try:
        object_, _ = call_in_child(
            "benchmarks.public_models:load",
            model_file,
            body.name,
            limits=ChildLimits(f"loading {model_file}", SECONDS),
        )
    except PolygraspError as error:
        return Finding(model_file, body.name, Outcome.REFUSED, str(error))
    differences = list(_differences(object_, body))
    outcome = Outcome.DISAGREES if differences else Outcome.AGREES
    return Finding(model_file, body.name, outcome, "; ".join(differences))


def load(model_file: Path, body_name: str) -> GraspObject:
    """As `load_object`, in a child process."""
    return load_object(model_file, body_name=body_name)


def _differences(object_: GraspObject, body: DrakeBody) -> Iterator[str]:
    if (object_.mass is None) != (body.mass is None):
        yield f"mass {object_.mass}, Drake's {body.mass}"
    elif object_.mass is not None and body.mass is not None:
        if abs(object_.mass - body.mass) > ROUNDING * body.mass:
            yield f"mass {object_.mass}, Drake's {body.mass}"
        if np.abs(object_.p_BBcm - body.p_BBcm).max() > ROUNDING * object_.rho:
            yield f"centre of mass {object_.p_BBcm.tolist()}, Drake's {list(body.p_BBcm)}"
    ours, theirs = {face.mu for face in object_.polyhedron.faces}, set(body.friction)
    # What one part covers of another leaves no face.
    if not ours <= theirs or (len(theirs) == 1 and ours != theirs):
        yield f"friction {sorted(ours)}, Drake's {sorted(theirs)}"


def drake_bodies(model_file: Path, copy: Path) -> list[DrakeBody]:
    """Reads what Drake states of each rigid body with collision geometry.

    Raises ModelError when Drake does not load the model.
    """
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        plant, inspector = _parse(model_file)
        changed, changed_inspector = _parse(copy)
    except (Exception, SystemExit) as error:
        raise ModelError(" ".join(str(error).split())) from error
    finally:
        logger.setLevel(level)
    context = plant.CreateDefaultContext()
    bodies = []
    for links in _rigid_bodies(plant):
        colliders = [
            (link, geometry)
            for link in links
            for geometry in plant.GetCollisionGeometriesForBody(link)
        ]
        if not colliders:
            continue
        friction = []
        for link, geometry in colliders:
            k = plant.GetCollisionGeometriesForBody(link).index(geometry)
            twin = changed.get_body(link.index())
            other = changed.GetCollisionGeometriesForBody(twin)[k]
            pair = _friction(inspector, geometry)
            is_stated = pair != (1.0, 1.0) or _friction(changed_inspector, other) != (1.0, 1.0)
            friction.append(min(pair) if is_stated else DEFAULT_MU)
        name = colliders[0][0]
        M_BBo_B = plant.CalcSpatialInertia(
            context, name.body_frame(), [link.index() for link in links]
        )
        is_stated = all(
            _states_mass(link, changed.get_body(link.index()), model_file)
            or (link.default_mass() == 0 and not plant.GetCollisionGeometriesForBody(link))
            for link in links
        )
        bodies.append(
            DrakeBody(
                str(name.scoped_name()),
                float(M_BBo_B.get_mass()) if is_stated else None,
                tuple(M_BBo_B.get_com()) if M_BBo_B.get_mass() > 0 else (0.0, 0.0, 0.0),
                tuple(friction),
            )
        )
    return bodies


def _states_mass(link: RigidBody, twin: RigidBody, model_file: Path) -> bool:
    """Whether a mass is stated: 1 kg is SDF's default, and in the copy then still 1."""
    mass, suffix = link.default_mass(), model_file.suffix.lower()
    if suffix in (".sdf", ".yaml") and mass == 1:
        return bool(twin.default_mass() != 1)
    return suffix != ".obj" and mass > 0


def _parse(model_file: Path) -> tuple[MultibodyPlant, Any]:
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant, scene_graph)
    use_packages(parser, find_packages(model_file))
    with without_network():
        parser.AddModels(str(model_file))
    plant.Finalize()
    return plant, scene_graph.model_inspector()


def _rigid_bodies(plant: MultibodyPlant) -> list[list[RigidBody]]:
    """Links that welds join, but not through the world."""
    label = list(range(plant.num_bodies()))
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        ends = int(joint.parent_body().index()), int(joint.child_body().index())
        if isinstance(joint, WeldJoint) and 0 not in ends:
            old, new = sorted((label[ends[0]], label[ends[1]]), reverse=True)
            label = [new if k == old else k for k in label]
    return [
        [plant.get_body(BodyIndex(k)) for k in range(1, len(label)) if label[k] == group]
        for group in sorted(set(label[1:]))
    ]


def _friction(inspector: Any, geometry: Any) -> tuple[float, float]:
    """Static and dynamic coefficient; Drake gives an OBJ file none."""
    properties = inspector.GetProximityProperties(geometry)
    if not properties.HasProperty("material", "coulomb_friction"):
        return 1.0, 1.0
    pair = properties.GetProperty("material", "coulomb_friction")
    return pair.static_friction(), pair.dynamic_friction()


if __name__ == "__main__":
    sys.exit(main())
