"""What fails in a plant goes behind what holds, and nothing that was asked is thrown away."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from drake_polygrasp import (
    GraspObject,
    GraspPlan,
    UsageError,
    load_grasps,
    rank_in_plant,
)
from drake_polygrasp.cli.main import main
from drake_polygrasp.grasp import AnyGrasp, PlantVerdict, Verdict
from drake_polygrasp.plant import certify_in_plant as in_plant
from drake_polygrasp.plant.certify_in_plant import PlantReport
from tests.support.planned import exact_plan
from tests.support.plant_scenes import model

HOLDS, FAILS, UNDECIDED = Verdict.HOLDS, Verdict.FAILS, Verdict.UNDECIDED
MODELS = Path(__file__).parents[2] / "models"


@pytest.fixture
def plan() -> GraspPlan:
    return exact_plan(model("cube"), top=6)


def answer(monkeypatch: pytest.MonkeyPatch, *verdicts: Verdict) -> list[AnyGrasp]:
    """Has plants answer so, in this order; the list fills with the grasps they are asked about."""
    asked: list[AnyGrasp] = []

    def certify(_: GraspObject, grasp: AnyGrasp, **__: Any) -> PlantReport:
        asked.append(grasp)
        verdict = PlantVerdict("simulation", verdicts[len(asked) - 1], 0.5, "1")
        return PlantReport((verdict,), {})

    monkeypatch.setattr(in_plant, "certify_in_plant", certify)
    return asked


def test_the_next_best_are_asked_until_enough_hold(
    plan: GraspPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = answer(monkeypatch, FAILS, HOLDS, UNDECIDED, HOLDS, HOLDS, HOLDS)
    told: list[tuple[int, int]] = []
    ranked = rank_in_plant(
        model("cube"), plan, top=2, progress=lambda done, total: told.append((done, total))
    )
    assert asked == list(plan.grasps[:4])
    assert told == [(0, 6), (1, 6), (2, 6), (3, 6)]
    order = [plan.grasps[k].grasp for k in (1, 3, 2, 0)]
    assert [grasp.grasp for grasp in ranked.grasps] == order
    verdicts = [grasp.plant.verdict for grasp in ranked.grasps if grasp.plant is not None]
    assert verdicts == [HOLDS, HOLDS, UNDECIDED, FAILS]
    assert ranked.settings.top_in_plant == 2
    assert ranked.reasons == plan.reasons


def test_where_too_few_hold_all_are_asked(plan: GraspPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = answer(monkeypatch, *[FAILS] * 6)
    ranked = rank_in_plant(model("cube"), plan, top=2)
    assert len(asked) == len(ranked.grasps) == 6


def test_where_all_are_undecided_for_one_reason_no_more_are_asked_than_wanted(
    plan: GraspPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = answer(monkeypatch, *[UNDECIDED] * 6)
    ranked = rank_in_plant(model("cube"), plan, top=2)
    assert len(asked) == len(ranked.grasps) == 2


def test_one_that_fails_among_undecided_ones_has_the_others_asked(
    plan: GraspPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = answer(monkeypatch, UNDECIDED, FAILS, UNDECIDED, UNDECIDED, UNDECIDED, UNDECIDED)
    rank_in_plant(model("cube"), plan, top=2)
    assert len(asked) == 6


def test_without_a_wish_every_grasp_is_asked(
    plan: GraspPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(answer(monkeypatch, *[HOLDS] * 6)) == 0
    assert len(rank_in_plant(model("cube"), plan).grasps) == 6


@pytest.mark.parametrize("wrong", [{"top": 0}, {"top": 2.5}, {"progress": 3}])
def test_wrong_arguments_are_said(plan: GraspPlan, wrong: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=next(iter(wrong))):
        rank_in_plant(model("cube"), plan, **wrong)


def test_plan_writes_what_the_plant_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", str(MODELS / "cube" / "cube.sdf"), "--plant", "--top", "1", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    (stated,) = load_grasps("cube.grasp.yaml").grasps
    assert stated.plant is not None
    assert [verdict.verdict for verdict in stated.plant.verdicts] == [HOLDS] * 5
    assert printed["seconds"]["plant"] > 0
    assert [v["verdict"] for v in printed["grasps"][0]["plant"]["verdicts"]] == ["holds"] * 5
    assert main(["verify", "cube.grasp.yaml"]) == 0
    assert "stated: holds" in capsys.readouterr().out


def test_where_nothing_holds_in_the_plant_the_file_says_so_and_the_exit_status(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    answer(monkeypatch, *[FAILS] * 2)  # the command's child process is a fork
    assert main(["plan", str(MODELS / "cube" / "cube.sdf"), "--plant", "--top", "1"]) == 1
    out, err = capsys.readouterr()
    assert "in a plant 0 of 2 grasps hold" in out
    assert "grasps 1, 2, simulation does not hold\n" in out
    assert "none of the grasps holds in the plant" in err
    records = [stated.plant for stated in load_grasps("cube.grasp.yaml").grasps]
    assert [record.verdict for record in records if record] == [FAILS, FAILS]


def test_a_weightless_object_is_undecided_in_the_plant() -> None:
    """Without a mass nothing is simulated: neither holds nor fails, and said so."""
    weightless = replace(model("cube"), mass=None)
    plan = exact_plan(weightless, top=1)
    (grasp,) = rank_in_plant(weightless, plan).grasps
    assert grasp.plant is not None
    assert grasp.plant.verdict is UNDECIDED
