"""Children end badly in every way, and every task has its outcome."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import deque
from dataclasses import replace
from pathlib import Path

import pytest

from drake_polygrasp.batch.supervisor import (
    GRACE_SECONDS,
    MAX_ATTEMPTS,
    ChildTask,
    Supervisor,
    TaskLimits,
    TaskOutcome,
)
from drake_polygrasp.errors import BatchError

WORKER = "tests.support.batch_workers:misbehave"
LIMITS = TaskLimits(seconds=600.0, memory=512 << 20)
CLOCK = "drake_polygrasp.batch.supervisor.monotonic"


def tasks_of(*whats: str, log: str = "") -> deque[ChildTask]:
    """Tasks that are named by their numbers."""
    return deque(
        ChildTask(str(i), {"what": what, "value": i, "log": log}) for i, what in enumerate(whats)
    )


def run(
    *whats: str, slots: int = 2, limits: TaskLimits = LIMITS, log: str = ""
) -> list[TaskOutcome]:
    """The outcomes of tasks, in the tasks' order."""
    tasks = tasks_of(*whats, log=log)
    with Supervisor(WORKER, slots, limits) as supervisor:
        outcomes = supervisor.run(lambda: tasks.popleft() if tasks else None, lambda: False)
        return sorted(outcomes, key=lambda outcome: int(outcome.task.name))


def test_each_bad_end_is_told_apart_and_harms_no_other_task() -> None:
    bad = {
        "abort": ("crash", -signal.SIGABRT, "Drake crashed (SIGABRT): terminate called after"),
        "leave": ("crash", 0, "the process ended without a result"),
        "hog": ("out_of_memory", None, "runs out of memory (0.5 GiB at most)"),
        "grow": ("out_of_memory", None, "runs out of memory (0.5 GiB at most)"),
        "raise": ("error", None, "ValueError: on two lines"),
        "exit": ("error", None, "SystemExit: goodbye"),
        "unprintable": ("error", None, "TypeError: "),
    }
    whats = [what for one in bad for what in ("good", one, "good")]
    for what, outcome in zip(whats, run(*whats), strict=True):
        assert outcome.attempts == 1
        if what == "good":
            assert outcome.ending == "answered", outcome
            assert outcome.value["value"] == 2 * int(outcome.task.name)
            continue
        ending, code, reason = bad[what]
        assert outcome.ending == ending, (what, outcome)
        # The system may refuse memory or the supervisor may see that it is too much.
        assert outcome.return_code == code or what in ("hog", "grow")
        assert outcome.reason.startswith(reason), (what, outcome.reason)


def test_what_never_ends_is_stopped_and_harms_no_other_task(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, now, outcomes = tmp_path / "log", 0.0, list[TaskOutcome]()

    def clock() -> float:
        """Time passes, a little at each look, only while both tasks run that never end."""
        nonlocal now
        begun = {*log.read_text().split()} if log.exists() else set()
        if begun >= {"hang", "spin"} and all(outcome.ending != "timeout" for outcome in outcomes):
            now += 0.1
        return now

    monkeypatch.setattr(CLOCK, clock)
    whats = ("good", "hang", "good", "spin", "good", "good")
    tasks = tasks_of(*whats, log=str(log))
    with Supervisor(WORKER, 2, replace(LIMITS, seconds=2.0)) as supervisor:
        for outcome in supervisor.run(lambda: tasks.popleft() if tasks else None, lambda: False):
            outcomes.append(outcome)
    assert sorted(outcome.task.name for outcome in outcomes) == [str(i) for i in range(6)]
    for outcome in outcomes:
        number = int(outcome.task.name)
        assert outcome.attempts == 1
        if whats[number] == "good":
            assert outcome.value["value"] == 2 * number
        else:
            assert outcome.ending == "timeout", outcome
            assert (outcome.return_code, outcome.reason) == (-signal.SIGKILL, "stopped after 2 s")


def test_a_child_is_warm_and_has_one_thread() -> None:
    outcomes = run(*["good"] * 6, slots=1)
    assert len({outcome.value["pid"] for outcome in outcomes}) == 1
    assert {outcome.value["threads"] for outcome in outcomes} == {"1"}
    assert all(outcome.peak_bytes > 1 << 20 for outcome in outcomes)


def test_what_a_child_prints_and_reads_does_not_reach_the_pipes() -> None:
    outcomes = run("junk", "good", "junk", "good", slots=1)
    assert [outcome.value["value"] for outcome in outcomes] == [0, 2, 4, 6]


def test_a_task_whose_child_is_killed_from_outside_is_started_again(tmp_path: Path) -> None:
    log = tmp_path / "log"
    once, always = run("killed_once", "killed", log=str(log))
    assert (once.ending, once.attempts) == ("answered", 2)
    assert (always.ending, always.attempts) == ("crash", MAX_ATTEMPTS)
    assert always.return_code == -signal.SIGKILL
    assert f"killed from outside {MAX_ATTEMPTS} times (SIGKILL)" in always.reason
    started = [line.split()[0] for line in log.read_text().splitlines()]
    assert started.count("killed_once") == 2
    assert started.count("killed") == MAX_ATTEMPTS


def test_a_function_that_cannot_be_imported_is_one_line() -> None:
    tasks = [ChildTask("", {})]
    with (
        Supervisor("tests.support.nowhere:nothing", 1, LIMITS) as supervisor,
        pytest.raises(BatchError, match=r"cannot start: ModuleNotFoundError: .*nowhere") as caught,
    ):
        list(supervisor.run(lambda: tasks.pop() if tasks else None, lambda: False))
    assert "\n" not in str(caught.value)


def test_a_stop_lets_tasks_in_flight_finish_and_starts_no_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("drake_polygrasp.batch.supervisor.GRACE_SECONDS", 600.0)
    tasks = tasks_of(*["good"] * 100)
    asked: list[bool] = []
    with Supervisor(WORKER, 2, LIMITS) as supervisor:
        outcomes = []
        for outcome in supervisor.run(lambda: tasks.popleft(), lambda: bool(asked)):
            outcomes.append(outcome)
            asked.append(True)
    assert {outcome.ending for outcome in outcomes} == {"answered"}
    assert len(outcomes) + len(tasks) == 100
    assert len(outcomes) == 2


def test_a_task_that_does_not_finish_in_its_grace_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, now = tmp_path / "log", 0.0

    def clock() -> float:
        nonlocal now
        now += 0.1 if log.exists() else 0.0
        return now

    monkeypatch.setattr(CLOCK, clock)
    tasks = tasks_of("hang", log=str(log))
    with Supervisor(WORKER, 1, LIMITS) as supervisor:
        assert not [*supervisor.run(lambda: tasks.popleft() if tasks else None, log.exists)]
    assert GRACE_SECONDS < now < LIMITS.seconds


def test_a_slow_caller_does_not_take_time_from_tasks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, go = tmp_path / "log", tmp_path / "log.go"
    now, looks = 0.0, 0
    monkeypatch.setattr(CLOCK, lambda: now)
    tasks = tasks_of("wait", "good", log=str(log))

    def next_task() -> ChildTask | None:
        """Adds a task when the first runs, which may end when it was looked at for long enough."""
        nonlocal looks
        looks += now > 0
        if looks == 5:
            go.touch()
        return tasks.popleft() if len(tasks) == 2 or (tasks and log.exists()) else None

    endings = []
    with Supervisor(WORKER, 2, LIMITS) as supervisor:
        for outcome in supervisor.run(next_task, lambda: False):
            endings.append((outcome.task.request["what"], outcome.ending))
            now += 10 * LIMITS.seconds  # So long the caller takes with it.
    assert endings == [("good", "answered"), ("wait", "answered")]
    assert looks >= 5


def test_no_child_outlives_a_parent_that_is_killed(tmp_path: Path) -> None:
    log = tmp_path / "log"
    code = (
        "from tests.batch.test_supervisor import run\n"
        f"run('hang', 'spin', limits=__import__('drake_polygrasp.batch.supervisor', fromlist=['x'])"
        f".TaskLimits(10_000.0), log={str(log)!r})"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parents[2])
    deadline = time.monotonic() + 300
    while not log.exists() or len(log.read_text().splitlines()) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    children = [int(line.split()[2]) for line in log.read_text().splitlines()]
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 300.0  # They would go on for longer.
    while any(map(is_alive, children)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_alive, children))


def is_alive(process: int) -> bool:
    """Whether a process runs; a dead one that nobody has waited for does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        pass
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return not Path("/proc").is_dir()
