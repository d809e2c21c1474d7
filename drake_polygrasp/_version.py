"""The versions of this package and of the Drake that it runs with."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

__version__ = "0.2.0"


def drake_version() -> str:
    """Returns the version of the installed Drake.

    `importlib.metadata` reads it too, but is slow to import, as it parses what pip installed as
    mail; the name of the folder beside `pydrake` has the version too.

    Raises:
        PackageNotFoundError: when Drake is not installed.
    """
    pydrake = find_spec("pydrake")
    if pydrake is not None and pydrake.origin is not None:
        folders = [*Path(pydrake.origin).parents[1].glob("drake-*.dist-info")]
        if len(folders) == 1:
            return folders[0].stem.removeprefix("drake-")
    from importlib import metadata

    return metadata.version("drake")
