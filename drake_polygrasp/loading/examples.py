"""The models that come with the package: `example_models`."""

from __future__ import annotations

from pathlib import Path

_SUFFIXES = {".sdf", ".urdf", ".xml"}


def example_models() -> dict[str, Path]:
    """Returns the models that come with the package, by their names.

        cube = load_object(example_models()["cube"])

    Returns:
        Paths of model files, in the order of their names: in a clone of the repository those of its
        folder `models`, else the copies that were installed.
    """
    package = Path(__file__).parents[1]
    folders = (package.parent / "models", package / "models")
    folder = next(folder for folder in folders if (folder / "cube").is_dir())
    return {
        file.stem: file
        for file in sorted(folder.glob("*/*.*"))
        if file.suffix in _SUFFIXES and file.stem == file.parent.name
    }
