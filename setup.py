"""Puts the example models into the package that is built; all else is in pyproject.toml."""

from __future__ import annotations

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithModels(build_py):
    """Copies `models/` beside the modules, where `example_models` finds it once it is installed."""

    def run(self) -> None:
        """Runs the usual step, and copies."""
        super().run()
        if not self.editable_mode:
            target = Path(self.build_lib) / "drake_polygrasp" / "models"
            shutil.copytree("models", target, dirs_exist_ok=True)


setup(cmdclass={"build_py": BuildWithModels})
