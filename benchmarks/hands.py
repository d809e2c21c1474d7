"""How often a hand makes a grasp: postures, torques and ways for many objects of its size.

    python -m benchmarks.hands [FOLDER ...] [--hand HAND.yaml] [--package NAME=DIR]
        [--scale 1 1.8] [--mass 0.15 0.2] [--scene table air] [--most N] [--lift]
        [--skip-planner] [--require SHARE]

Objects are generated boxes, cans, balls, capsules, mugs and a hammer, our models, and those of the
folders, scaled into a range of 2.5 to 13 cm, and again by the factors of `--scale`. Each stands on
a table, where nothing is touched from below, or floats in the air, where the weight is held in
every orientation. "planner" takes the ten best grasps of `plan_grasps`, for exact contacts at the
same distance from edges, in place of those within the hand's reach. Friction is 0.5.

All grasps that are returned are judged again, in a plant of the models as Drake's Parser makes it:
tips, angles, distances; and proved again in exact arithmetic. They bear all default errors of
plans, or "less", a half or a quarter or on narrow faces a smaller miss, or none. Seconds are of the
processor. With `--lift` each is lifted in simulation, and again without the planned torques and
with friction 0.05, which should drop it.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np

from benchmarks.hand_objects import MU, HandObject, resting, subjects
from drake_polygrasp import (
    GraspObject,
    Hand,
    HandGrasp,
    HandPlan,
    PolygraspError,
    Surroundings,
    load_hand,
    load_object,
    plan_grasps,
    plan_hand_grasps,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.exact import check_force_closure
from drake_polygrasp.hands.hand_search import HandSearch, HoldOptions
from drake_polygrasp.hands.library import hand_reach
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.loading.surroundings import obstacles_of
from drake_polygrasp.plant.hand_lift import lift_with_hand
from drake_polygrasp.settings import NO_ERRORS
from tests.support.hand_judge import HandJudge

ROOT = Path(__file__).resolve().parents[1]
OWN = ROOT / "models" / "hands" / "three_finger" / "three_finger.hand.yaml"
BUDGET = 30.0
"""Time for the postures of one object [s], several times what they take on a free processor."""


@dataclass
class Row:
    """What became of one set of objects in one scene."""

    asked: int = 0
    made: int = 0
    first: int = 0
    planner: int = 0
    seconds: list[float] = field(default_factory=list)
    worst: dict[str, float] = field(default_factory=dict)
    proved: int = 0
    returned: int = 0
    bears: Counter[str] = field(default_factory=Counter)
    misses: dict[str, str] = field(default_factory=dict)
    slips: list[float] = field(default_factory=list)
    lifts: Counter[str] = field(default_factory=Counter)
    dropped: list[str] = field(default_factory=list)


def main(arguments: Iterable[str] | None = None) -> int:
    options = _parser().parse_args(None if arguments is None else list(arguments))
    packages = dict(word.split("=", 1) for word in options.package)
    hand = load_hand(options.hand, packages=packages)
    start = process_time()
    reach = hand_reach(hand)  # kept, so that no object waits for it
    drawn = process_time() - start
    print(f"{hand.name}: library of {len(reach.q)} postures in {drawn:.2f} s")
    code = 0
    with TemporaryDirectory() as folder:
        for scale, mass in zip(options.scale, options.mass, strict=True):
            out = Path(folder)
            files = list(subjects(out, options.folders, scale))[: options.most]
            for scene in options.scene:
                row = Row()
                for subject in files:
                    _measure(row, subject, hand, scene, mass, packages, options)
                _print(row, hand, scene, scale, mass)
                if row.made < options.require * row.asked or row.proved < row.returned:
                    code = 1
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hands", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folders", metavar="FOLDER", nargs="*", type=Path, help="more models")
    parser.add_argument("--hand", default=OWN, type=Path, help="description (default: our own)")
    parser.add_argument("--package", default=[], action="append", help="NAME=DIR of its package")
    parser.add_argument("--scale", default=[1.0], nargs="+", type=float, help="default: 1")
    parser.add_argument("--mass", default=[0.15], nargs="+", type=float, help="of each scale [kg]")
    parser.add_argument(
        "--scene", default=["table", "air"], nargs="+", choices=("table", "air"), help="both"
    )
    parser.add_argument("--most", type=int, help="objects at most")
    parser.add_argument("--lift", action="store_true", help="lift each in simulation")
    parser.add_argument("--skip-planner", action="store_true", help="leave out the comparison")
    parser.add_argument("--require", type=float, default=0.0, help="share that must be grasped")
    return parser


def _measure(
    row: Row,
    subject: HandObject,
    hand: Hand,
    scene: str,
    mass: float,
    packages: dict[str, str],
    options: argparse.Namespace,
) -> None:
    object_ = load_object(subject.file, mu=MU)
    up_B, table = resting(object_)
    surroundings = table if scene == "table" else None
    standing = scene == "table"
    start = process_time()
    plan = plan_hand_grasps(
        object_,
        hand,
        top=1,
        surroundings=surroundings,
        up_B=up_B if standing else None,
        avoid_directions=[-up_B] if standing else (),
        load_mass=mass,
        budget=BUDGET,
    )
    row.seconds.append(process_time() - start)
    row.asked += 1
    if not options.skip_planner:
        row.planner += _planner_makes_one(object_, hand, surroundings, up_B, mass)
    if not plan.grasps:
        row.misses[subject.name] = ", ".join(f"{n} {why}" for why, n in plan.refusals.items())
        return
    row.made += 1
    row.first += plan.tried == 1
    _judge(row, plan, hand, subject, packages)
    if options.lift:
        _lift(row, object_, hand, plan.grasps[0], subject.name, packages)


def _lift(
    row: Row,
    object_: GraspObject,
    hand: Hand,
    best: HandGrasp,
    name: str,
    packages: dict[str, str],
) -> None:
    ways: dict[str, dict[str, Any]] = {
        "lifts": {},
        "without torques": {"feedforward": False},
        "friction 0.05": {"mu": 0.05},
    }
    for way, asked in ways.items():
        try:
            found = lift_with_hand(object_, best.certified, hand, best, packages=packages, **asked)
        except PolygraspError as error:
            row.lifts[f"{way}: not simulated"] += 1
            print(f"{name}: {error}")
            continue
        row.lifts[f"{way}: {'held' if found.held else 'dropped'}"] += 1
        if not asked and found.held:
            row.slips.append(1e3 * found.slip)
        elif not asked:
            row.dropped.append(name)


def _planner_makes_one(
    object_: GraspObject,
    hand: Hand,
    surroundings: Surroundings | None,
    up_B: Array,
    mass: float,
) -> bool:
    """Whether one of the ten best grasps for exact contacts can be made."""
    radius = max(tip.radius for tip in hand.tips)
    around = None
    if surroundings is not None:
        around = obstacles_of(surroundings, object_, object_.polyhedron.diameter + 4 * radius)
    plan = plan_grasps(
        object_,
        top=10,
        tip_radius=radius,
        edge_clearance=0.3 * radius,
        obstacles=around,
        avoid_directions=() if around is None else [-up_B],
        **NO_ERRORS,
    )
    scene = HandScene(hand, object_, surroundings=surroundings)
    hold = HoldOptions(mass=mass, up_B=None if around is None else up_B)
    search = HandSearch(scene, hand_reach(hand), plan.grasps, hold)
    return next(search.run(BUDGET), None) is not None


def _judge(
    row: Row, plan: HandPlan, hand: Hand, subject: HandObject, packages: dict[str, str]
) -> None:
    """Judges the returned grasps by the exact proof, and by a plant of our own hand's model."""
    judge = None
    if not packages:
        judge = HandJudge(hand, OWN.with_name("three_finger.sdf"), subject.file)
    for found in plan.grasps:
        row.returned += 1
        row.bears[_borne(found, plan)] += 1
        grasp = found.certified.grasp
        points, normals, mu = (v.tolist() for v in (grasp.p_BC, grasp.nhat_TB_B, grasp.mu))
        witness = found.certified.certificate.internal_force.tolist()
        row.proved += check_force_closure(points, normals, mu, witness).ok
        stated = {
            "tip error mm": 1e3 * found.tip_error,
            "tip angle deg": float(np.degrees(found.tip_angle)),
            "clearance mm": -1e3 * found.clearance,
            "tip link mm": -1e3 * found.tip_link_clearance,
        }
        measured = stated if judge is None else _measured(judge, found)
        for name, value in measured.items():
            row.worst[name] = max(row.worst.get(name, -np.inf), value)


def _borne(found: HandGrasp, plan: HandPlan) -> str:
    """Which of the default errors a grasp is proved to bear."""
    region, asked = found.certified.region, plan.settings
    if region is None:
        return "none"
    # Stated errors are rounded down.
    shares = [region.tilt_error / asked.tilt_error, *region.placement_error / asked.placement_error]
    return "all" if min(shares) > 0.999 else "less"


def _measured(judge: HandJudge, found: HandGrasp) -> dict[str, float]:
    """The same numbers in a plant that knows nothing of the search; distances are negative."""
    grasp, hand = found.certified.grasp, judge.hand
    judge.place(found.X_BPalm, found.q)
    by_name = {tip.name: tip for tip in hand.tips}
    radii = np.array([[by_name[name].radius] for name in found.fingers])
    off = judge.tip_centres(found.fingers) - (grasp.p_BC - radii * grasp.nhat_TB_B)
    cosines = (judge.tip_axes(found.fingers) * grasp.nhat_TB_B).sum(axis=1)
    bodies = {by_name[name].body for name in found.fingers}
    tips = {f"{by_name[n].body}/{g}" for n in found.fingers for g in by_name[n].geometries}
    clearance, link = [np.inf], [np.inf]
    for pair, distance in judge.distances().items():
        of_hand = [name for name in pair if not name.startswith("object/")]
        if len(of_hand) == 1 and of_hand[0].partition("/")[0] in bodies:
            if of_hand[0] not in tips:
                link.append(distance)
        else:
            clearance.append(distance)
    return {
        "tip error mm": 1e3 * float(np.linalg.norm(off, axis=1).max()),
        "tip angle deg": float(np.degrees(np.arccos(np.clip(cosines, -1, 1))).max()),
        "clearance mm": -1e3 * min(clearance),
        "tip link mm": -1e3 * min(link),
    }


def _print(row: Row, hand: Hand, scene: str, scale: float, mass: float) -> None:
    seconds = np.array(row.seconds)
    print(f"\n{hand.name}, {scene}, scale {scale:g}, {mass:g} kg:")
    print(f"  grasped: {row.made} of {row.asked} objects")
    if row.planner:
        print(f"  by the planner's ten best: {row.planner}")
    print(f"  first candidate succeeds: {row.first} of {row.made}")
    print(
        f"  seconds, library apart: median {np.median(seconds):.2f}, 95 percent "
        f"{np.quantile(seconds, 0.95):.2f}, most {seconds.max():.2f}"
    )
    print(f"  proved again: {row.proved} of {row.returned}")
    print(f"  bear default errors: {dict(sorted(row.bears.items()))}")
    for name, value in row.worst.items():
        sign = -1 if name.startswith(("clearance", "tip link")) else 1
        print(f"  worst {name}: {sign * value:.3f}")
    for name, why in row.misses.items():
        print(f"  not grasped: {name} ({why})")
    if row.lifts:
        print(f"  {dict(sorted(row.lifts.items()))}; dropped: {', '.join(row.dropped) or 'none'}")
    if row.slips:
        low, high = np.quantile(row.slips, [0.5, 0.95])
        print(f"  slip mm: median {low:.2f}, 95 percent {high:.2f}")
    reasons = Counter(why.partition(" ")[2].partition(",")[0] for why in row.misses.values())
    if reasons:
        print(f"  first reasons: {dict(reasons)}", flush=True)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except PolygraspError as error:
        sys.exit(str(error))
