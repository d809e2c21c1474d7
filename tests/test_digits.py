"""Numbers are rounded before anything is claimed of them, and never in the grasp's favour."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from drake_polygrasp import digits
from drake_polygrasp.certification import exact
from drake_polygrasp.certification.convex import friction_at
from drake_polygrasp.certification.robustness import epsilon_interval
from drake_polygrasp.files.grasp_file import grasp_document, load_grasps, save_grasps
from drake_polygrasp.loading.object_model import load_object
from tests.support.common import squeeze_interval
from tests.support.planned import exact_plan

MODELS = Path(__file__).parent.parent / "models"
POSITIVE = st.floats(1e-12, 1e12)


def num_digits(value: float) -> int:
    """Significant digits of the shortest decimal that is read as this number."""
    return len(Decimal(repr(value)).normalize().as_tuple().digits)


def decimals(value: float) -> int:
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    assert isinstance(exponent, int)
    return max(0, -exponent)


@given(POSITIVE)
def test_bounds_are_rounded_away_from_what_they_bound_by_the_last_digit_at_most(
    value: float,
) -> None:
    low, high = digits.at_most(value), digits.at_least(value)
    assert Fraction(low) <= Fraction(value) <= Fraction(high)
    assert high - low <= 1.001e-5 * value
    for rounded in (low, high):
        assert num_digits(rounded) <= digits.BOUNDS
        assert digits.at_most(rounded) == rounded == digits.at_least(rounded)


@given(st.floats(-100, 100), st.floats(1e-3, 1e3))
def test_lengths_keep_twelve_digits_of_the_size_and_are_rounded_once(
    ratio: float, size: float
) -> None:
    rounded = digits.on_grid(np.array([ratio * size]), size)
    # Doubles have 16 digits, two of which the ratio takes.
    assert abs(rounded[0] - ratio * size) <= 0.51e-11 * size
    assert decimals(float(rounded[0])) <= 11 - Decimal(size).adjusted()
    assert (digits.on_grid(rounded, size) == rounded).all()


def test_rounding_by_hand() -> None:
    lengths = np.array([1 / 3, -2e-13, 0.05, 1.2345678901234567])
    assert digits.on_grid(lengths, 0.12).tolist() == [0.333333333333, 0.0, 0.05, 1.234567890123]
    assert digits.on_grid(lengths, 12.0).tolist() == [0.3333333333, 0.0, 0.05, 1.2345678901]
    assert "-" not in repr(digits.on_grid(np.array([-1e-20]), 1.0).tolist())
    assert digits.significant(np.array([[2 / 3e9, -4e7 / 3]])).tolist() == [
        [6.66666666667e-10, -13333333.3333]
    ]
    assert np.isnan(digits.significant(np.array([np.nan])))
    assert (digits.at_most(0.0), digits.at_least(0.0)) == (0.0, 0.0)
    assert (digits.at_most(0.1), digits.at_least(0.1)) == (0.1, 0.1)
    assert (digits.at_most(2 / 3), digits.at_least(2 / 3)) == (0.666666, 0.666667)


def numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return [number for item in value.values() for number in numbers(item)]
    if isinstance(value, list):
        return [number for item in value for number in numbers(item)]
    return [value] if isinstance(value, float) else []


@pytest.mark.parametrize("name", ["skewed_block", "l_bracket", "tilted_barrel"])
def test_what_is_claimed_is_true_of_the_decimals_in_the_file(name: str, tmp_path: Path) -> None:
    file = MODELS / name / f"{name}.sdf"
    if name == "tilted_barrel":
        # Curved, and turned so that no coordinate is a short decimal.
        file = tmp_path / "barrel.sdf"
        file.write_text(BARREL)
    object_ = load_object(file, mu=0.45)
    plan = exact_plan(object_, top=4)
    path = tmp_path / "one.grasp.yaml"
    save_grasps(path, object_, plan.grasps, plan.settings)
    stated = load_grasps(path)
    document = yaml.safe_load(path.read_text())
    L = object_.polyhedron.diameter
    assert len(stated.grasps) == 4
    for planned, read, text in zip(plan.grasps, stated.grasps, document["grasps"], strict=True):
        # What is in memory is what is saved.
        assert grasp_document(planned) == text
        for contact in text["contacts"]:
            assert max(map(decimals, contact["p_BC"])) <= 11 - Decimal(L).adjusted()
            assert max(map(decimals, contact["nhat_TB_B"] + contact["f_Bc_B"])) <= digits.EXACT
        certificate = text["certificate"]
        for key, value in certificate.items():
            is_exact = ("force" in key and key != "squeeze_force") or key == "margin"
            most = digits.EXACT if is_exact else digits.BOUNDS
            assert max(map(num_digits, numbers([value]))) <= most, key

        p_BC, nhat_TB_B, mu = read.grasp.p_BC, read.grasp.nhat_TB_B, read.grasp.mu
        contacts = p_BC.tolist(), nhat_TB_B.tolist(), mu.tolist()
        check, margin = exact.check_and_margin(*contacts, certificate["internal_force"])
        assert check.ok
        assert margin - 1e-11 < certificate["margin"] <= margin
        least = friction_at(mu, certificate["mu_min"]).tolist()
        witness = certificate["mu_min_internal_force"]
        assert exact.check_force_closure(*contacts[:2], least, witness).ok
        scale = stated.object_.p_BBcm, stated.object_.rho
        # The same function of the same doubles: no tolerance but rounding's own direction.
        epsilon = epsilon_interval(p_BC, nhat_TB_B, mu, *scale)
        assert certificate["epsilon_lower"] <= epsilon.lower
        assert certificate["epsilon_upper"] >= epsilon.upper
        assert stated.object_.mass is not None
        r_w = squeeze_interval(p_BC, nhat_TB_B, mu, *scale).lower
        assert certificate["squeeze_force"] >= stated.object_.mass * 9.81 / r_w


BARREL = """<?xml version="1.0"?>
<sdf version="1.9"><model name="barrel"><link name="barrel">
<inertial><mass>0.7</mass></inertial>
<collision name="c"><pose>0.01 0.02 0.03 0.3 0.5 0.7</pose>
<geometry><cylinder><radius>0.04</radius><length>0.11</length></cylinder></geometry></collision>
</link></model></sdf>
"""
