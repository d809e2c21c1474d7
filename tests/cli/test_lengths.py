"""Lengths in messages are plain numbers in a fitting unit."""

from __future__ import annotations

import pytest

from drake_polygrasp.cli.plan_table import _length_text


@pytest.mark.parametrize(
    ("length", "text"),
    [
        (1.0, "1 m"),
        (1234.0, "1230 m"),
        (0.9996, "1 m"),
        (0.9994, "999 mm"),
        (0.00208, "2.08 mm"),
        (0.05, "50 mm"),
        (1e-8, "0.00001 mm"),
        (0.0, "0 mm"),
    ],
)
def test_a_length_is_a_plain_number_in_metres_or_millimetres(length, text):
    assert _length_text(length) == text
