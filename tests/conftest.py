"""Settings of all tests, and what several files share."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Read when NumPy is imported: tests of several processes are to share the processors.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The same examples in every run, and no time limit on them: machines are shared.
settings.register_profile(
    "drake_polygrasp",
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("drake_polygrasp")


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The documentation as a site, built without a warning."""
    directory = tmp_path_factory.mktemp("site")
    # In a process of its own: it loads what lazy imports leave out.
    command = [sys.executable, "-m", "docs.website", str(directory)]
    root = Path(__file__).parents[1]
    result = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=1800)
    assert (result.returncode, result.stderr) == (0, "")
    return directory
