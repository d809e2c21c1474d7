"""Finds the model files of a batch, one after the other, in an order that does not change."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeAlias

from drake_polygrasp.arguments import check_items, check_path
from drake_polygrasp.errors import UsageError

Sources: TypeAlias = str | Path | Iterable[str | Path]
"""A model file, a folder, a pattern, a text file of paths or a URI; or several of these."""
_MODEL_SUFFIXES = (".sdf", ".urdf", ".dmd.yaml", ".xml")
_MESH_SUFFIX = ".obj"
_URI = re.compile(r"(package|model|file)://")
_MAGIC = re.compile(r"[*?\[]")
_MUJOCO = re.compile(rb"<(\w+:)?mujoco[\s>/]")
_HEAD_BYTES = 1 << 16
"""Where a file's <mujoco> is looked for: other programs write .xml files too. Our choice."""


def find_models(sources: Sources, warn: Callable[[str], None]) -> Iterator[str]:
    """Finds the model files that sources name, lazily.

    A folder stands for every model file below it, sorted folder by folder. Its .obj files are
    models where it has no others, and are otherwise taken for meshes of those. A pattern has `*`,
    `?`, `[...]` or `**`, for any folders; a text file (.txt) names a path or URI in each line,
    relative to its folder, with comments after `#`.

    Args:
        sources: what names them.
        warn: called with a sentence where files are left out.

    Yields:
        Paths and URIs, as they were given or below a folder that was.

    Raises:
        UsageError: when a source is no path, is not there, or has no model file.
    """
    for source in check_sources(sources):
        if _URI.match(source):
            yield source
            continue
        found = False
        for model in _models_of(source, warn):
            found = True
            yield model
        if not found:
            raise UsageError(
                f"{source}: no model file is found there; Drake reads "
                f"{', '.join((*_MODEL_SUFFIXES, _MESH_SUFFIX))}"
            )


def check_sources(sources: Sources) -> tuple[str, ...]:
    """Returns sources as text, each known to be there unless it is a URI.

    Args:
        sources: one or several.

    Raises:
        UsageError: when one is no path, or is not there.
    """
    if isinstance(sources, bytes):
        check_path("sources", sources)
    items = [sources] if isinstance(sources, str | Path) else check_items("sources", sources)
    texts = tuple(str(check_path(f"sources[{i}]", item)) for i, item in enumerate(items))
    for text in texts:
        if not text:
            raise UsageError("a source is ''; it must be a model file, folder, pattern or URI")
        if not (_URI.match(text) or Path(text).exists() or _MAGIC.search(text)):
            raise UsageError(f"{text}: there is no such file or folder; mend the path")
    return texts


def _models_of(source: str, warn: Callable[[str], None]) -> Iterator[str]:
    path = Path(source)
    if path.is_dir():
        yield from _models_below(path, warn)
    elif path.exists() and path.suffix.lower() == ".txt":
        yield from _models_listed(path)
    elif path.exists():
        yield source
    else:
        yield from (match for match in _matches(Path(), _parts(source)) if not Path(match).is_dir())


def _models_below(folder: Path, warn: Callable[[str], None]) -> Iterator[str]:
    """Yields model files below a folder: .obj files only where there are no others."""
    is_mesh_folder = next(_walk(folder, _is_model), None) is None
    if is_mesh_folder:
        yield from _walk(folder, _is_mesh)
        return
    yield from _walk(folder, _is_model)
    if (meshes := sum(1 for _ in _walk(folder, _is_mesh))) > 0:
        warn(
            f"{folder}: {meshes} .obj files are taken for meshes of the models beside them; "
            f"'{folder}/**/*.obj' plans them as objects"
        )


def _is_mesh(name: str) -> bool:
    return name.lower().endswith(_MESH_SUFFIX)


def _is_model(name: str) -> bool:
    """Returns whether a file is a model, and not just XML."""
    if not name.lower().endswith(_MODEL_SUFFIXES):
        return False
    if not name.lower().endswith(".xml"):
        return True
    if not Path(name).is_file():  # Whoever opens a pipe waits for its other end.
        return True
    try:
        with Path(name).open("rb") as file:
            return _MUJOCO.search(file.read(_HEAD_BYTES)) is not None
    except OSError:
        return True  # The row of its result says why it cannot be read.


def _walk(folder: Path, is_wanted: Callable[[str], bool]) -> Iterator[str]:
    """Yields the wanted files below a folder, sorted folder by folder; hidden ones are left out."""
    for where, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(files):
            path = str(Path(where, name))
            if not name.startswith(".") and is_wanted(path):
                yield path


def _models_listed(path: Path) -> Iterator[str]:
    """Yields the paths in a text file, which are relative to its folder."""
    try:
        with path.open(encoding="utf-8") as lines:
            for line in lines:
                if name := re.sub(r"(^|\s)#.*", "", line).strip():
                    yield name if _URI.match(name) else str(path.parent / name)
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: cannot be read as a list of paths: {error}") from error


def _parts(pattern: str) -> list[str]:
    """Returns a pattern's parts between slashes; the first of an absolute one is "/"."""
    return [part for part in Path(pattern).parts if part != "."]


def _matches(folder: Path, parts: list[str]) -> Iterator[str]:
    """Yields what matches a pattern below a folder, sorted, without holding all of it."""
    if not parts:
        yield str(folder)
        return
    first, rest = parts[0], parts[1:]
    if first == "**":
        yield from _matches(folder, rest)
        for path in _inside(folder):
            if not path.name.startswith(".") and path.is_dir() and not path.is_symlink():
                yield from _matches(path, parts)
    elif _MAGIC.search(first):
        for path in _inside(folder):
            hidden = path.name.startswith(".") and not first.startswith(".")
            if fnmatchcase(path.name, first) and not hidden:
                yield from _matches(path, rest)
    elif (folder / first).exists() or (folder / first).is_symlink():
        yield from _matches(folder / first, rest)


def _inside(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []
