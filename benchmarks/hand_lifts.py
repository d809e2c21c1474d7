"""How often the grasps of a hand lift their object: close, squeeze, lift 10 cm and hold.

    python -m benchmarks.hand_lifts [FOLDER ...] [--hand HAND.yaml] [--package NAME=DIR]
        [--top 3] [--mass 0.15] [--most N] [--controls] [--require SHARE]

Objects are those of `benchmarks.hands`, each on a table. Every grasp that is returned is lifted in
simulation by the whole hand; with `--controls` also without the planned torques, and with friction
0.05, where it should drop. Slip is that of contacts from their tips while the object is lifted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.hand_objects import MU, HandObject, resting, subjects
from drake_polygrasp import (
    Hand,
    HandGrasp,
    PolygraspError,
    lift_with_hand,
    load_hand,
    load_object,
    plan_hand_grasps,
)
from drake_polygrasp.plant.hand_lift import LiftOutcome

OWN = Path(__file__).parents[1] / "models" / "hands" / "three_finger" / "three_finger.hand.yaml"


def main(arguments: Iterable[str] | None = None) -> int:
    """Prints what became of each object's grasps, and the totals.

    Args:
        arguments: of the command line.

    Returns:
        1 if fewer lifts held than were required.
    """
    asked = _parser().parse_args(None if arguments is None else list(arguments))
    packages = dict(pair.split("=", 1) for pair in asked.package)
    hand = load_hand(asked.hand, packages=packages)
    lifted: list[LiftOutcome] = []
    idle: list[LiftOutcome] = []
    slippery: list[LiftOutcome] = []
    with TemporaryDirectory() as folder:
        every = list(subjects(Path(folder), asked.folders))
        for subject in every[: asked.most]:
            try:
                grasps = _grasps(subject, hand, asked.top, asked.mass)
            except PolygraspError as error:
                print(f"{subject.name}: {error}", file=sys.stderr)
                continue
            here = [_lift(subject, hand, each) for each in grasps]
            lifted += here
            print(_line(subject, here), flush=True)
            if asked.controls:
                idle += [_lift(subject, hand, each, feedforward=False) for each in grasps]
                slippery += [_lift(subject, hand, each, mu=0.05) for each in grasps]
    held = [outcome for outcome in lifted if outcome.held]
    print(f"{hand.name}: {len(held)} of {len(lifted)} lifts held")
    if held:
        slips = 1000 * np.array([outcome.slip for outcome in held])
        print(f"slip {np.median(slips):.2f} mm (median), {np.quantile(slips, 0.95):.2f} mm (p95)")
    if asked.controls:
        for name, outcomes in (("without torques", idle), ("with friction 0.05", slippery)):
            print(f"{name}: {sum(o.held for o in outcomes)} of {len(outcomes)} held")
    return int(len(held) < asked.require * len(lifted))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hand_lifts", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folders", metavar="FOLDER", nargs="*", type=Path, help="more models")
    parser.add_argument("--hand", default=OWN, type=Path, help="description (default: our own)")
    parser.add_argument("--package", default=[], action="append", help="NAME=DIR of its package")
    parser.add_argument("--top", default=3, type=int, help="grasps of each object")
    parser.add_argument("--mass", default=0.15, type=float, help="of each object [kg]")
    parser.add_argument("--most", type=int, help="objects at most")
    parser.add_argument("--controls", action="store_true", help="also without torques or friction")
    parser.add_argument("--require", type=float, default=0.0, help="share that must be held")
    return parser


def _grasps(subject: HandObject, hand: Hand, top: int, mass: float) -> tuple[HandGrasp, ...]:
    object_ = load_object(subject.file, mu=MU)
    up_B, table = resting(object_)
    plan = plan_hand_grasps(
        object_,
        hand,
        top=top,
        surroundings=table,
        up_B=up_B,
        avoid_directions=[-up_B],
        load_mass=mass,
    )
    return tuple(plan.grasps)


def _lift(
    subject: HandObject,
    hand: Hand,
    each: HandGrasp,
    *,
    mu: float | None = None,
    feedforward: bool = True,
) -> LiftOutcome:
    object_ = load_object(subject.file, mu=MU)
    return lift_with_hand(object_, each.certified, hand, each, mu=mu, feedforward=feedforward)


def _line(subject: HandObject, outcomes: list[LiftOutcome]) -> str:
    lost = [outcome for outcome in outcomes if not outcome.held]
    notes = [f"rise {1000 * o.rise:.0f} mm, touching {o.touching}" for o in lost]
    return "; ".join([f"{subject.name}: {len(outcomes) - len(lost)} of {len(outcomes)}", *notes])


if __name__ == "__main__":
    sys.exit(main())
