"""Which versions files state."""

from __future__ import annotations

from importlib import metadata

from drake_polygrasp._version import drake_version


def test_the_version_of_drake_is_the_one_that_is_installed() -> None:
    assert drake_version() == metadata.version("drake")
