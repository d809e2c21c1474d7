"""What exporters of all formats share: the checks of their arguments, and writing a text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from drake_polygrasp.arguments import check_instance, check_path
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.stated_grasp import GraspFile


def write_export(file: GraspFile, output: Path | str, render: Callable[[GraspFile], str]) -> None:
    """Writes a grasp file in another format; the grasp file itself is never replaced.

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file to write.
        render: returns the text of a grasp file in the format.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `output` cannot be written, or is the grasp file.
    """
    check_instance("file", file, GraspFile, "as load_grasps returns it")
    output = Path(check_path("output", output))
    if output.exists() and output.samefile(file.path):
        raise GraspFileError(f"{output}: is the grasp file; name another for the export")
    text = render(file)
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise GraspFileError(f"{output}: cannot be written: {error.strerror}") from error
