"""`polygrasp batch` whose children start no more objects than a test allows.

The test says how many, and hears of those that are started, by `Progress` of a folder that an
environment variable names. What runs is never too quick for the test, and waits for no clock.
"""

from __future__ import annotations

import os
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.chaos_moments import Progress
from drake_polygrasp.batch import request
from drake_polygrasp.batch.worker import plan_model
from drake_polygrasp.cli.main import main

FOLDER = "HELD_BATCH_FOLDER"
PATIENCE = "--timeout=3600"
"""Children that wait are not to be taken for children that hang."""


def held_command(*arguments: str) -> list[str]:
    """The command; its environment, and that of its workers, must have `held_environment`."""
    return [sys.executable, "-m", "tests.support.held_batch", *arguments, PATIENCE]


def held_environment(folder: Path) -> dict[str, str]:
    """The environment of processes whose `Progress` is in a folder."""
    root = str(Path(__file__).parents[2])
    return os.environ | {"PYTHONPATH": root, FOLDER: str(folder)}


def plan_when_allowed(**asked: Any) -> dict[str, Any]:
    """What children run: the planner, as soon as the object may be started."""
    progress = Progress(Path(os.environ[FOLDER]))
    progress.add_start(Path(asked["model"]).stem)
    while progress.is_held():
        time.sleep(0.01)
    return plan_model(**asked)


if __name__ == "__main__":
    function = "tests.support.held_batch:plan_when_allowed"
    request.make_batch_request = partial(request.make_batch_request, function=function)
    sys.exit(main(["batch", *sys.argv[1:]]))
