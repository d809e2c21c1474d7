"""Which versions files and the command state."""

from __future__ import annotations

from importlib import metadata

import pytest

from drake_polygrasp._version import __version__, drake_version
from drake_polygrasp.cli.main import main


def test_the_version_of_drake_is_the_one_that_is_installed() -> None:
    assert drake_version() == metadata.version("drake")


def test_the_command_prints_its_version_and_drake_s(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr() == (f"polygrasp {__version__}, Drake {drake_version()}\n", "")
