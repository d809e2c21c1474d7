"""Where grasp files go: a folder, or a bucket that fsspec reaches; each is written whole, once."""

from __future__ import annotations

import fcntl
import os
import re
import socket
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, TextIO

from drake_polygrasp.errors import BatchError

_ENDING = ".grasp.yaml"
_URL = re.compile(r"([a-z0-9]{2,})://.+")
_EXTRAS = {"s3": ("s3fs", "s3"), "gs": ("gcsfs", "gcs"), "gcs": ("gcsfs", "gcs")}
"""The package that reaches each kind of bucket, and the extra that brings it."""


class GraspOutput(Protocol):
    """A place of grasp files by their keys. It can be sent to other processes."""

    @property
    def folder(self) -> Path:
        """The folder to which paths of models in the files are relative."""
        ...

    def has(self, key: str) -> bool:
        """Returns whether there is a file.

        Args:
            key: its key.
        """
        ...

    def adoption(self, key: str) -> dict[str, str]:
        """Returns the arguments with which a worker adopts a file that is there.

        Args:
            key: its key.
        """
        ...

    def write(self, key: str, text: str) -> None:
        """Writes a file, whole or not at all.

        Args:
            key: its key.
            text: its text.

        Raises:
            BatchError: when it cannot be written.
        """
        ...


@dataclass(frozen=True)
class LocalOutput:
    """Grasp files in a folder of this machine, or one that machines share.

    Attributes:
        folder: the folder.
    """

    folder: Path

    def path(self, key: str) -> Path:
        """Returns the path of a file.

        Args:
            key: its key.
        """
        return self.folder / f"{key}{_ENDING}"

    def has(self, key: str) -> bool:
        """Returns whether there is a file.

        Args:
            key: its key.
        """
        return self.path(key).exists()

    def adoption(self, key: str) -> dict[str, str]:
        """Returns the arguments with which a worker adopts a file that is there.

        Args:
            key: its key.
        """
        return {"file": str(self.path(key))}

    def write(self, key: str, text: str) -> None:
        """Writes a file, whole or not at all, and waits until it is on the disk.

        Args:
            key: its key.
            text: its text.

        Raises:
            BatchError: when it cannot be written.
        """
        scratch = self.folder / f".{key}.{socket.gethostname()}-{os.getpid()}.tmp"
        try:
            with _open_locked(scratch) as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
                scratch.replace(self.path(key))
        except OSError as error:
            with suppress(OSError):
                scratch.unlink(missing_ok=True)
            raise BatchError(
                f"{self.folder}: a grasp file cannot be written: {error.strerror}; mend that and "
                "give the same command again, which goes on from here"
            ) from error


def _open_locked(scratch: Path) -> TextIO:
    """Opens a file to write, with a lock that tells `remove_scratch` that it is being written."""
    while True:
        file = scratch.open("w", encoding="utf-8")
        fcntl.flock(file, fcntl.LOCK_EX)
        if os.fstat(file.fileno()).st_nlink:
            return file
        file.close()  # Another driver has removed it before it was locked.


@dataclass(frozen=True)
class RemoteOutput:
    """Grasp files in a bucket, each created only where there is none.

    Attributes:
        url: address of the files' folder.
        folder: folder of this machine to which they would be copied.
    """

    url: str
    folder: Path

    def has(self, key: str) -> bool:
        """Returns whether there is a file.

        Args:
            key: its key.

        Raises:
            BatchError: when the bucket cannot be reached.
        """
        files = self._files()
        try:
            files.invalidate_cache()
            return bool(files.exists(self._address(key)))
        except Exception as error:
            raise self._unreachable(error) from error

    def adoption(self, key: str) -> dict[str, str]:
        """Returns the arguments with which a worker adopts a file that is there.

        Args:
            key: its key.

        Raises:
            BatchError: when the bucket cannot be reached.
        """
        try:
            return {"text": self._files().cat_file(self._address(key)).decode()}
        except Exception as error:
            raise self._unreachable(error) from error

    def write(self, key: str, text: str) -> None:
        """Creates a file; one that is there already is of the same key and stays.

        Args:
            key: its key.
            text: its text.

        Raises:
            BatchError: when it cannot be written.
        """
        try:
            self._files().pipe_file(self._address(key), text.encode(), mode="create")
        except FileExistsError:
            return
        except Exception as error:
            raise self._unreachable(error) from error

    def _address(self, key: str) -> str:
        return f"{self.url.rstrip('/')}/{key}{_ENDING}"

    def _files(self) -> Any:
        protocol = self.url.partition("://")[0]
        package, extra = _EXTRAS.get(protocol, ("fsspec", "s3"))
        try:
            import_module(package)
            return import_module("fsspec").filesystem(protocol)
        except ImportError:
            raise BatchError(
                f"{protocol}:// needs {package}: pip install 'drake_polygrasp[{extra}]'"
            ) from None
        except ValueError as error:
            raise BatchError(f"{self.url}: {error}; name a folder, s3:// or gs://") from error

    def _unreachable(self, error: Exception) -> BatchError:
        reason = " ".join(str(error).split()) or type(error).__name__
        return BatchError(
            f"{self.url}: cannot be used: {reason}; mend that and give the same command again, "
            "which goes on from here"
        )


def is_remote(out: str | Path) -> bool:
    """Returns whether an output is a bucket.

    Args:
        out: the output as it was named.
    """
    return isinstance(out, str) and _URL.fullmatch(out) is not None


def state_folder(out: str | Path) -> Path:
    """Returns the folder of this machine in which an output's rows are.

    Args:
        out: a folder, which is its own; or a bucket's address, of which it is the last name, in the
            current folder.
    """
    return Path(str(out).rstrip("/").rpartition("/")[2]) if is_remote(out) else Path(out)


def open_output(out: str | Path) -> GraspOutput:
    """Returns where an output's grasp files are.

    Args:
        out: a folder, or a bucket's address.
    """
    folder = state_folder(out).absolute() / "grasps"
    if not is_remote(out):
        return LocalOutput(folder)
    output = RemoteOutput(f"{str(out).rstrip('/')}/grasps", folder)
    output.has("")  # Says at once what is missing or cannot be reached.
    return output


def remove_scratch(folder: Path) -> None:
    """Removes what processes that died left half-written in a folder; nobody has a lock on it.

    Args:
        folder: the folder of grasp files.
    """
    for path in folder.glob(".*.tmp"):
        with suppress(OSError), path.open("a") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink(missing_ok=True)
