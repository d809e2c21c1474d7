"""What exporters of all formats share: the checks of their arguments, and writing a text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from drake_polygrasp.arguments import check_instance, check_path, check_text
from drake_polygrasp.errors import GraspFileError
from drake_polygrasp.files.stated_grasp import GraspFile
from drake_polygrasp.files.whole_file import is_regular, write_whole


def write_export(
    file: GraspFile,
    output: Path | str,
    instance: str | None,
    render: Callable[[GraspFile, str], str],
) -> None:
    """Writes a grasp file in another format; the grasp file itself is never replaced.

    A file is written whole or not at all. Pipes, devices and open files, such as /dev/stdout, are
    written to as they are.

    Args:
        file: the grasp file, as `load_grasps` returns it.
        output: file to write.
        instance: name of the object's model in the other program; None for the file's.
        render: returns the text of a grasp file in the format, given that name too.

    Raises:
        UsageError: when an argument has the wrong type.
        GraspFileError: when `output` cannot be written, or is the grasp file.
    """
    check_instance("file", file, GraspFile, "as load_grasps returns it")
    output = Path(check_path("output", output))
    if instance is not None:
        check_text("instance", instance)
    if output.exists() and output.samefile(file.path):
        raise GraspFileError(f"{output}: is the grasp file; name another for the export")
    text = render(file, file.object_.model_name if instance is None else instance)
    if is_regular(output):
        write_whole(output, text)
        return
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as error:
        raise GraspFileError(f"{output}: cannot be written: {error.strerror}") from error
