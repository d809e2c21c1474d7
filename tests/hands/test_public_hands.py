"""Descriptions of public hands fit their models, where the models are found on this machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drake_polygrasp import Hand, HandError, check_hand, load_hand
from drake_polygrasp.hands.description import read_description
from tests.support.hands import MODELS

HANDS = sorted((MODELS / "hands").glob("*.hand.yaml"))


def found(file: Path) -> Hand:
    """The hand, or a skipped test with the reason."""
    try:
        return load_hand(file)
    except HandError as error:
        if "package '" not in str(error):
            raise
        return pytest.skip(str(error))


@pytest.mark.parametrize("file", HANDS, ids=lambda file: file.name)
def test_a_description_is_one_and_names_a_package(file: Path) -> None:
    description = read_description(file)
    assert file.name == f"{description.name}.hand.yaml"
    assert description.model.startswith("package://")
    assert description.effort is not None


@pytest.mark.parametrize("file", HANDS, ids=lambda file: file.name)
def test_a_public_hand_can_grasp_where_its_model_is_found(file: Path) -> None:
    report = check_hand(found(file), num=500)
    assert report.errors == ()
    assert report.kept_share > 0.1
    assert max(report.tip_ranks.values()) >= 2


def test_the_tips_of_allegro_are_its_own_spheres() -> None:
    hand = found(MODELS / "hands" / "allegro.hand.yaml")
    assert len(hand.joints) == 16
    assert len(hand.fingers) == 4
    for tip in hand.tips:
        assert np.abs(tip.fit).max() < 1e-6
