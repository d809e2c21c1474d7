"""The errors that this package raises: each message says what is wrong and what would mend it."""


class PolygraspError(Exception):
    """Base class of all errors of the package, each caused by a file or an argument.

        try:
            box = load_object("box.sdf")
        except PolygraspError as error:
            print(f"error: {error}")

    The message is one line that names the file or argument, what is wrong with it, and what would
    mend it.
    """


class ModelError(PolygraspError):
    """A model, or a mesh that it names, cannot be loaded or is no object to grasp."""


class SeveralBodiesError(ModelError):
    """A model has several bodies to grasp, and none was named.

    Attributes:
        bodies: names by which each can be asked for.
    """

    bodies: tuple[str, ...] = ()


class MissingPackageError(ModelError):
    """A model names a package whose folder is unknown or missing."""


class GraspFileError(PolygraspError):
    """A grasp file cannot be read or written, or breaks the format."""


class HandError(PolygraspError):
    """A hand's description or model cannot be used for grasps."""


class BatchError(PolygraspError):
    """The results of a batch cannot be kept or read, or what it runs on is lost."""


class UsageError(PolygraspError):
    """An argument or option has the wrong type or value, or does not go with another."""


def with_remedy(reason: object, remedy: str) -> str:
    """Returns a reason and, unless it has one after a semicolon already, its remedy.

    Args:
        reason: what is wrong: text, or an error whose message says so.
        remedy: what the user can do about it.
    """
    return str(reason) if "; " in str(reason) else f"{reason}; {remedy}"
