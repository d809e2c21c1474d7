"""Whether a hand holds a grasp as a file states it, from the hand's own model.

The hand is posed by the file's numbers alone; where tips are, what it is clear of and which torques
hold the object are computed again. A stated number is rejected if it is more favourable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import HandError, MissingPackageError
from drake_polygrasp.files.stated_grasp import StatedGrasp
from drake_polygrasp.geometry.surface_contact import locate_contacts
from drake_polygrasp.grasp import Grasp, GraspObject, PlantVerdict
from drake_polygrasp.hand_grasp import HandPlacement, HandSource, HandTorque
from drake_polygrasp.hands.approach import closes_freely, way_is_free
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.measured_posture import (
    TIP_OVERLAP,
    Posture,
    measure_posture,
    tip_places,
    tips_fit,
)
from drake_polygrasp.hands.model import load_hand
from drake_polygrasp.hands.scene import Fingers, HandScene
from drake_polygrasp.hands.squeeze import squeeze_remark
from drake_polygrasp.hands.torque import HandForces, Load
from drake_polygrasp.loading.surroundings import Surroundings
from drake_polygrasp.verification.report import CheckResult, Status

MOST_TIP_ERROR = 5e-4
"""Greatest distance of a tip from where it touches its contact [m]. Our choice."""
_LENGTH, _ANGLE = 1e-6, 1e-6
"""Rounding of stated lengths [m] and angles [rad]."""
_DISTANCE = 1e-4
"""Accuracy of Drake's distances between some shapes, which it finds by iteration [m]."""
_FORCE = 1e-6
"""Rounding of stated forces [N] and torques [N m], over the total normal force if that is more."""
_SHARE = 1e-4
"""Relative accuracy of a share that a solver finds."""


class HandCheck:
    """Checks how a hand holds the grasps of one file; its model is loaded once."""

    def __init__(
        self,
        source: HandSource,
        object_: GraspObject,
        surroundings: Surroundings | None = None,
        package_paths: Sequence[Path | str] = (),
        packages: Mapping[str, str | Path] | None = None,
    ) -> None:
        """Loads the hand beside the object.

        Args:
            source: the hand that the file names.
            object_: the object that is grasped.
            surroundings: other bodies of its scene (default: unknown).
            package_paths: folders searched for the packages of package:// URIs.
            packages: folders of packages by name.
        """
        self._object, self._package_paths, self._packages = object_, package_paths, packages
        self._scene: HandScene | None = None
        self._line = CheckResult(Status.RECOMPUTED)
        try:
            hand = _load(source, package_paths, packages)
        except MissingPackageError as error:
            self._line = CheckResult(Status.NOT_CHECKED, str(error))
            return
        except HandError as error:
            self._line = CheckResult(Status.FAILED, str(error))
            return
        fault = next(_source_violations(source, hand), None)
        if fault is not None:
            self._line = CheckResult(Status.FAILED, fault)
            return
        self._scene = HandScene(
            hand,
            object_,
            surroundings=surroundings,
            package_paths=package_paths,
            packages=packages,
        )

    def check(self, stated: StatedGrasp) -> CheckResult:
        """Checks how the hand holds a grasp.

        Args:
            stated: a grasp of the file, with a hand.

        Returns:
            The line HAND.
        """
        placement = stated.hand
        if self._scene is None or placement is None:
            return self._line
        try:
            fault = next(self._violations(self._scene, stated.grasp, placement), None)
        # Numbers that no hand has make Drake's queries fail.
        except (RuntimeError, SystemExit) as error:
            fault = f"Drake cannot measure this posture: {error}"
        if fault is not None:
            return CheckResult(Status.FAILED, fault)
        remarks = self._remarks(self._scene, stated, placement)
        return CheckResult(Status.RECOMPUTED, "; ".join(remarks))

    def verdicts(self, stated: StatedGrasp) -> Iterator[PlantVerdict]:
        """Yields the verdict "hand" of a simulated lift, if there is a hand whose model is there.

        Args:
            stated: a grasp of the file.
        """
        # Simulation is loaded only if it is asked for.
        from drake_polygrasp.plant.hand_lift import judge_lift

        if self._scene is not None and stated.hand is not None:
            yield judge_lift(
                self._object,
                stated,
                self._scene.hand,
                stated.hand,
                package_paths=self._package_paths,
                packages=self._packages,
            )

    def _violations(
        self, scene: HandScene, grasp: Grasp, placement: HandPlacement
    ) -> Iterator[str]:
        """Yields one message for each violated claim, what later ones need first."""
        hand = scene.hand
        try:
            fingers = _indices(hand, placement.fingers)
            q, q_before = (hand.joint_array(q) for q in (placement.q, placement.pregrasp.q))
        except HandError as error:
            yield str(error)
            return
        yield from _joint_violations(hand, q, "q")
        yield from _joint_violations(hand, q_before, "pregrasp.q")
        pose = placement.p_BPalm, placement.quaternion_BPalm
        posture = measure_posture(scene, grasp, fingers, *pose, q)
        yield from _posture_violations(hand, placement, posture)
        if not tips_fit(scene, grasp, fingers):
            yield "a tip is too large for the surface at its contact"
        yield from _friction_violations(scene, grasp, fingers)
        yield from _torque_violations(scene, grasp, placement.torque, posture)
        yield from _way_violations(scene, grasp, placement, posture, q_before)

    def _remarks(
        self, scene: HandScene, stated: StatedGrasp, placement: HandPlacement
    ) -> Iterator[str]:
        """Yields what was not checked, and what the hand does not do."""
        unknown = [name for name in placement.surroundings if name not in scene.surroundings]
        if unknown:
            names = ", ".join(unknown)
            yield f"clearance from {names} is not checked, as the file does not hold it"
        torque, mass = placement.torque, self._object.mass
        if torque.share is None:
            yield "torques are not compared with efforts, as no share is stated"
        elif mass is not None and torque.mass is not None and torque.mass < mass * (1 - 1e-9):
            yield f"torques are for {torque.mass:.3g} kg, the model has {mass:.3g} kg"
        if remark := squeeze_remark(stated.grasp, stated.region, mass, torque):
            yield remark


def _load(
    source: HandSource,
    package_paths: Sequence[Path | str],
    packages: Mapping[str, str | Path] | None,
) -> Hand:
    """Loads the hand; MissingPackageError if its description, or a package, is not there."""
    file = source.description_file
    if file is None or not file.is_file():
        raise MissingPackageError(f"{file}: there is no such description of a hand")
    try:
        return load_hand(file, package_paths=package_paths, packages=packages)
    except HandError as error:
        if isinstance(error.__cause__, MissingPackageError):
            raise error.__cause__ from error
        raise


def _source_violations(source: HandSource, hand: Hand) -> Iterator[str]:
    name, description = source.description_file, hand.description
    if hand.sha256 != source.sha256:
        yield f"{name} or the hand's model has changed since: sha256 differs"
    if hand.name != source.name:
        yield f"hand.name is '{source.name}', the description's is '{hand.name}'"
    if description.palm_frame != source.palm_frame:
        yield f"palm_frame is '{source.palm_frame}', the hand's is '{description.palm_frame}'"
    if not np.abs(source.approach_P - hand.approach_P).max() <= _ANGLE:
        yield "approach_P is not the hand's"


def _indices(hand: Hand, names: Sequence[str]) -> Fingers:
    """Returns the indices of tips; HandError for names of none, or of tips that may not grasp."""
    tips = [tip.name for tip in hand.tips]
    for name in names:
        if name not in tips:
            raise HandError(f"fingers names '{name}', which is no tip of the hand: {tips}")
    first, second, third = (tips.index(name) for name in names)
    if tuple(sorted((first, second, third))) not in hand.fingers:
        raise HandError(f"fingers are {[*names]}, which do not grasp by the hand's description")
    return first, second, third


def _joint_violations(hand: Hand, q: Array, key: str) -> Iterator[str]:
    for name, value, lower, upper in zip(hand.joints, q, hand.lower, hand.upper, strict=True):
        if not lower - _ANGLE <= value <= upper + _ANGLE:
            yield f"{key} of joint '{name}' is {value:.6g}, its limits {lower:.6g} and {upper:.6g}"
    z = q[[hand.joints.index(name) for name in hand.independent]]
    off = np.abs(q - hand.E @ z - hand.e0)
    if not off.max() <= _ANGLE:
        name = hand.joints[int(off.argmax())]
        yield f"{key} of joint '{name}' is {off.max():.2g} off what joints coupled to it make it"


def _posture_violations(hand: Hand, placement: HandPlacement, posture: Posture) -> Iterator[str]:
    if not posture.tip_error <= MOST_TIP_ERROR:
        yield f"a tip is {1000 * posture.tip_error:.3g} mm off its place at its contact"
    if not posture.tip_error <= placement.tip_error + _LENGTH:
        yield f"tip_error is {placement.tip_error:.3g}, less than the {posture.tip_error:.3g} found"
    if not posture.tip_angle <= hand.description.max_angle + _ANGLE:
        degrees = math.degrees(posture.tip_angle)
        yield f"a tip touches at {degrees:.0f} degrees to its axis, more than the hand's may"
    if not posture.tip_angle <= placement.tip_angle + _ANGLE:
        yield f"tip_angle is {placement.tip_angle:.3g}, less than the {posture.tip_angle:.3g} found"
    if not posture.clearance > 0 or not placement.clearance > 0:
        least = min(posture.clearance, placement.clearance)
        yield f"the hand overlaps the object, itself or what is around by {-1000 * least:.3g} mm"
    if not placement.clearance <= posture.clearance + _DISTANCE:
        yield f"clearance is {placement.clearance:.3g}, more than the {posture.clearance:.3g} found"
    if not posture.tip_link_clearance >= -_DISTANCE:
        depth = -1000 * posture.tip_link_clearance
        yield f"the link of a tip is {depth:.3g} mm inside the object"
    if not posture.tip_overlap <= TIP_OVERLAP + _DISTANCE:
        yield f"the geometry of a tip is {1000 * posture.tip_overlap:.3g} mm inside the object"


def _friction_violations(scene: HandScene, grasp: Grasp, fingers: Fingers) -> Iterator[str]:
    """Yields contacts that claim more friction than the pair of surface and tip has."""
    polyhedron, tips = scene.object_.polyhedron, scene.hand.tips
    found = locate_contacts(polyhedron, grasp.p_BC, grasp.nhat_TB_B)
    for i, (face, k) in enumerate(zip(found.face, fingers, strict=True)):
        mu, tip_mu = polyhedron.faces[face].mu, tips[k].mu
        pair = 2 * mu * tip_mu / (mu + tip_mu)
        if face >= 0 and grasp.mu[i] > pair * (1 + _ANGLE):
            yield (
                f"contact {i + 1} claims friction {grasp.mu[i]:.6g}; its face and tip "
                f"'{tips[k].name}' have {pair:.6g}"
            )


def _torque_violations(
    scene: HandScene, grasp: Grasp, torque: HandTorque, posture: Posture
) -> Iterator[str]:
    hand, context = scene.hand, scene.context(posture.fingers)
    if {*torque.torque} != {*hand.independent}:
        yield f"torque is of joints {[*torque.torque]}, the hand's are {[*hand.independent]}"
        return
    load = Load(torque.mass, scene.object_.p_BBcm, scene.object_.rho, torque.up_B)
    yield from _force_violations(grasp, torque, load)
    scene.place(context, posture.X_BPalm, posture.q)
    J_Bc = scene.jacobians(context, posture.fingers, grasp.p_BC)[:, 3:] @ hand.E
    effort = np.where(np.isfinite(hand.effort), hand.effort, np.inf)
    forces = HandForces(grasp, J_Bc, effort, load.p_BBcm, load.rho, torque.friction_share)
    stated = np.array([torque.torque[name] for name in hand.independent])
    rounding = _FORCE * max(1.0, float(np.abs(torque.f_Bc_B).sum()))
    if not np.abs(stated - forces.torque(torque.f_Bc_B)).max() <= rounding:
        yield "torque is not what f_Bc_B makes it"
    for name, value, most in zip(hand.independent, stated, effort, strict=True):
        if abs(value) > most + rounding:
            yield f"torque of joint '{name}' is {value:.6g}, its effort is {most:.6g}"
    if torque.share is None:
        return
    if torque.mass is None or not np.isfinite(effort).all():
        yield "torque.share is stated, but the mass or an effort of the hand is not known"
        return
    held = [forces.least_share(weight_B) for weight_B in load.weights_B]
    needed = max(math.inf if share is None else share[0] for share in held)
    if not torque.share >= needed * (1 - _SHARE) or not torque.share < 1:
        yield f"torque.share is {torque.share:.6g}, and loads need {needed:.6g} of the efforts"


def _force_violations(grasp: Grasp, torque: HandTorque, load: Load) -> Iterator[str]:
    """Yields why forces are not in their cones, or not in balance."""
    f, n = torque.f_Bc_B, grasp.nhat_TB_B
    push = (f * n).sum(axis=1)
    rounding = _FORCE * max(1.0, float(np.abs(f).sum()))
    sideways = np.linalg.norm(f - push[:, None] * n, axis=1)
    for i, spare in enumerate(torque.friction_share * grasp.mu * push - sideways):
        if not spare >= -rounding:
            yield f"f_Bc_B of contact {i + 1} is outside its friction cone"
    force = f.sum(axis=0) + load.carried_B
    turn = np.cross(grasp.p_BC - load.p_BBcm, f).sum(axis=0)
    if not max(np.abs(force).max(), np.abs(turn).max() / load.rho) <= rounding:
        yield "f_Bc_B is not in balance with the weight that it carries"


def _way_violations(
    scene: HandScene, grasp: Grasp, placement: HandPlacement, posture: Posture, q_before: Array
) -> Iterator[str]:
    before, fingers, X_BPalm = placement.pregrasp, posture.fingers, posture.X_BPalm
    if not closes_freely(scene, fingers, X_BPalm, q_before, posture.q):
        yield "the hand overlaps something while its fingers close"
    if not way_is_free(scene, fingers, X_BPalm, q_before, before.direction_B, before.distance):
        yield "the hand overlaps something on its straight way"
    context = scene.context(fingers)
    scene.place(context, X_BPalm, q_before)
    p_BT, _ = scene.tips(context, fingers)
    away = -((p_BT - tip_places(scene, grasp, fingers)) * grasp.nhat_TB_B).sum(axis=1)
    # Opening is measured from where the tips are, which may be off their places.
    if not before.opening <= away.min() + MOST_TIP_ERROR:
        yield f"pregrasp.opening is {before.opening:.3g}, more than the {away.min():.3g} found"
