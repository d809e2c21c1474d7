"""Loads a hand from its description: `load_hand`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
from pydrake.geometry import SceneGraphInspector
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import Joint
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp.arguments import check_packages, check_paths
from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import HandError, ModelError
from drake_polygrasp.hands.couplings import read_couplings
from drake_polygrasp.hands.description import HandDescription, read_description
from drake_polygrasp.hands.hand import Hand, Tip
from drake_polygrasp.hands.in_plant import HandInPlant, add_hand, in_order, listed
from drake_polygrasp.hands.tip_fit import measure_tip
from drake_polygrasp.loading.body_object import stated_friction
from drake_polygrasp.loading.model_source import ModelFiles, read_model_files
from drake_polygrasp.loading.packages import find_packages, is_uri, locate

_TIME_STEP = 1e-3
"""Step of the hand's own plant [s]; only discrete plants keep mimic joints."""
_MAX_MISFIT = 1.0
"""Our choice: a geometry whose median distance from the tip's sphere is more than this times the
radius is not the tip's."""
_MAX_TURN = math.pi
"""Our choice: joints without limits are limited to half a turn each way [rad]."""
_NUM_POSTURES = 20
"""Random postures at which joints are seen to move a tip. Our choice."""
_STILL = 1e-9
"""Derivatives of a tip's position below this are rounding."""


def load_hand(
    description: str | Path | HandDescription,
    *,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> Hand:
    """Loads a hand from its description and the model that this names.

        hand = load_hand("models/hands/three_finger/three_finger.hand.yaml")
        print(hand.joints, [tip.name for tip in hand.tips])

    Args:
        description: the file NAME.hand.yaml, or what `read_description` returns.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name, which take precedence.

    Returns:
        The hand.

    Raises:
        UsageError: when an argument has the wrong type.
        HandError: when a file is missing or malformed, the model lacks what the description names,
            or it is no hand that can grasp.
    """
    package_paths = check_paths("package_paths", package_paths)
    packages = check_packages("packages", packages)
    if not isinstance(description, HandDescription):
        description = read_description(description)
    where = description.where
    model: str | Path = description.model
    if not is_uri(model) and description.path is not None:
        model = description.path.parent / model
    try:
        package_map = find_packages(model, package_paths, packages)
        files = read_model_files(locate(model, package_map), package_map)
    except ModelError as error:
        raise HandError(f"{where}: model: {error}") from error
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, _TIME_STEP)
    found = add_hand(description, files, package_map, plant, scene_graph, weld_root=True)
    plant.Finalize()
    joints = sorted(found.joints, key=lambda joint: joint.position_start())
    names = tuple(joint.name() for joint in joints)
    found = in_order(found, names, where)
    if not joints or plant.num_positions() != len(joints):
        raise HandError(f"{where}: its model has no joints that move; a hand grasps by moving some")
    lower, upper = _limits(joints, where)
    actuator_of = _actuator_efforts(found)
    couplings = read_couplings(plant, np.array([n in actuator_of for n in names]), where)
    independent = tuple(names[j] for j in couplings.independent)
    effort, effort_from = _efforts(description, names, independent, actuator_of)
    tips = _tips(description, found, scene_graph.model_inspector())
    diagram = builder.Build()
    hand = Hand(
        description,
        names,
        lower,
        upper,
        independent,
        couplings.E,
        couplings.e0,
        effort,
        effort_from,
        tips,
        _allowed_fingers(description),
        found.root.name(),
        found.floats,
        _digest(description, files),
        found,
        files,
        package_map,
        diagram,
        diagram.CreateDefaultContext(),
    )
    _check_freedom(hand)
    return hand


def _limits(joints: Sequence[Joint], where: str) -> tuple[Array, Array]:
    """Returns the limits of joints; half a turn each way where the model states none."""
    lower, upper = [], []
    for joint in joints:
        low, high = float(joint.position_lower_limits()[0]), float(joint.position_upper_limits()[0])
        if joint.type_name() == "revolute":
            low, high = max(low, -_MAX_TURN), min(high, _MAX_TURN)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise HandError(
                f"{where}: joint '{joint.name()}' has limits {low:g} to {high:g}; state limits in "
                "the model that let it move"
            )
        lower.append(low)
        upper.append(high)
    return frozen(lower), frozen(upper)


def _actuator_efforts(found: HandInPlant) -> dict[str, float]:
    """Returns the greatest effort of each joint with an actuator, infinite if it is not stated."""
    plant = found.plant
    # Without the instance: that of one instance is empty before Finalize on some versions.
    every = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    return {
        actuator.joint().name(): float(actuator.effort_limit())
        for actuator in every
        if actuator.joint().model_instance() == found.instance
    }


def _efforts(
    description: HandDescription,
    joints: Sequence[str],
    independent: Sequence[str],
    actuators: Mapping[str, float],
) -> tuple[Array, tuple[str, ...]]:
    """Returns the efforts of independent joints, NaN where unknown, and where each is stated."""
    where, stated = description.where, description.effort
    by_name: Mapping[str, float] = {}
    if isinstance(stated, Mapping):
        by_name = stated
        for name in by_name:
            if name not in joints:
                raise HandError(
                    f"{where}: effort.{name} names no joint of the model, which has "
                    f"{listed(joints)}"
                )
    elif stated is not None:
        by_name = dict.fromkeys(joints, stated)
    if not actuators and not by_name:
        raise HandError(
            f"{where}: its model has no actuators, so what its joints can bear is unknown (in URDF "
            "each joint needs a <transmission>); state `effort` in the description"
        )
    efforts, sources = [], []
    for name in independent:
        limit = actuators.get(name, 0.0)
        if name in by_name:
            efforts.append(by_name[name])
            sources.append("description")
        elif math.isinf(limit):
            efforts.append(math.nan)
            sources.append("unknown")
        elif limit > 0:
            efforts.append(limit)
            sources.append("model")
        else:
            raise HandError(
                f"{where}: joint '{name}' has no actuator, or one with an effort limit of 0, so it "
                "can hold nothing; state its `effort` in the description"
            )
    return frozen(efforts), tuple(sources)


def _tips(
    description: HandDescription, found: HandInPlant, inspector: SceneGraphInspector
) -> tuple[Tip, ...]:
    """Returns the fingertips, each with friction and fit; HandError for a geometry far off."""
    tips = []
    for i, tip in enumerate(description.tips):
        geometries = found.tip_geometries[i]
        X_BF = found.tip_frames[i].GetFixedPoseInBodyFrame()
        fit = measure_tip(
            inspector, geometries, X_BF @ tip.p_FT, tip.radius, X_BF.rotation() @ tip.axis_F
        )
        if abs(fit.median) > _MAX_MISFIT * tip.radius:
            raise HandError(
                f"{description.where}: tips[{i}] '{tip.name}': its sphere is {fit.median:g} m from "
                f"{listed(tip.geometries)} (median), which is more than its radius; mend p, radius "
                "or geometries"
            )
        mu = description.friction
        if mu is None:
            pairs = [stated_friction(inspector, geometry) for geometry in geometries]
            mu = min(min(pair) if pair else 1.0 for pair in pairs)
            if mu <= 0:
                raise HandError(
                    f"{description.where}: tips[{i}] '{tip.name}' has friction {mu:g}; state "
                    "`friction` in the description"
                )
        tips.append(
            Tip(
                tip.name,
                tip.frame,
                found.tip_bodies[i].name(),
                tip.p_FT,
                tip.radius,
                tip.axis_F,
                tip.geometries,
                float(mu),
                fit,
            )
        )
    return tuple(tips)


def _allowed_fingers(description: HandDescription) -> tuple[tuple[int, int, int], ...]:
    """Returns the triples of tips that may grasp, as ascending indices."""
    names = [tip.name for tip in description.tips]
    if not description.fingers:
        return tuple(combinations(range(len(names)), 3))
    chosen = {tuple(sorted(names.index(name) for name in f)) for f in description.fingers}
    return tuple((i, j, k) for i, j, k in sorted(chosen))


def _check_freedom(hand: Hand) -> None:
    """Refuses tips that no joint moves, and two tips of a triple that no joint moves apart."""
    rng = np.random.default_rng(0)
    moves = np.zeros((len(hand.tips), len(hand.joints)), dtype=bool)
    for _ in range(_NUM_POSTURES):
        J = hand.tip_jacobians(rng.uniform(hand.lower, hand.upper)) @ hand.E
        moves |= (np.abs(J) > _STILL).any(axis=1) @ (np.abs(hand.E) > 0).T
    where = hand.description.where
    for tip, row in zip(hand.tips, moves, strict=True):
        if not row.any():
            raise HandError(
                f"{where}: tip '{tip.name}' moves with no joint of the hand; a tip that grasps is "
                "on a finger that moves"
            )
    groups = [_rigid_group(hand, i) for i in range(len(hand.tips))]
    for triple in hand.fingers:
        for i, j in combinations(triple, 2):
            if groups[i] == groups[j]:
                raise HandError(
                    f"{where}: tips '{hand.tips[i].name}' and '{hand.tips[j].name}' are on one "
                    "rigid body, so no joint moves them apart; leave one out, or name the triples "
                    "that may grasp in `fingers`"
                )


def _rigid_group(hand: Hand, tip: int) -> frozenset[int]:
    plant = hand.in_plant.plant
    welded = plant.GetBodiesWeldedTo(hand.in_plant.tip_bodies[tip])
    return frozenset(int(body.index()) for body in welded)


def _digest(description: HandDescription, files: ModelFiles) -> str | None:
    """Returns the digest of description, model and meshes; None without a description file."""
    if description.path is None:
        return None
    documents = {description.path: None, **files.documents}
    return ModelFiles(files.model_file, documents, files.meshes).sha256
