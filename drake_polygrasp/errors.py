"""The errors this package raises: each message names the file, what is wrong and what mends it."""


class PolygraspError(Exception):
    """Base class of every error that is the input's fault and not the program's."""


class ModelError(PolygraspError):
    """A model, or a mesh it names, cannot be loaded or is no object to grasp."""


class MissingPackageError(ModelError):
    """A model names a package whose folder is unknown, or which is not on this machine."""


class GraspFileError(PolygraspError):
    """A grasp file cannot be read, or breaks the format."""


class UsageError(PolygraspError):
    """A parameter is outside what it may be."""


def with_remedy(reason: object, remedy: str) -> str:
    """Returns a reason and what mends it, where the reason does not say so after a semicolon."""
    return str(reason) if "; " in str(reason) else f"{reason}; {remedy}"
