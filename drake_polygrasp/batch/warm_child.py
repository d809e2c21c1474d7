"""A child process that stays alive between tasks: starts it, talks to it, measures and kills it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import IO, Any

_READ_BYTES = 1 << 20
"""How much is read at once: a child may print without end. Our choice."""
_TAIL_BYTES = 4096
"""How much of what a child prints is kept for messages. Our choice: a line of Drake's fits."""
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


class WarmChild:
    """A process that calls one function for each request, in a session of its own.

    The function is imported once. Requests and replies are lines of JSON on pipes. BLAS is held to
    one thread, for parallelism is among children.

    Args:
        function: the function, as "package.module:name"; its keyword arguments and its result are
            plain data.
        memory: limit of its writable memory, libraries included [bytes].
    """

    def __init__(self, function: str, memory: int) -> None:
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [
                *(sys.executable, "-P", "-m", "drake_polygrasp.batch.child"),
                *(function, str(os.getpid()), str(memory)),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            # It imports what this process can import.
            env=os.environ | threads | {"PYTHONPATH": os.pathsep.join(p or "." for p in sys.path)},
        )
        for stream in (self.replies, self.messages):
            os.set_blocking(stream.fileno(), False)
        self._unread, self._printed = bytearray(), b""
        self.started = monotonic()

    @property
    def replies(self) -> IO[bytes]:
        """The pipe on which replies come, to wait for."""
        assert self._process.stdout is not None
        return self._process.stdout

    @property
    def messages(self) -> IO[bytes]:
        """The pipe on which comes what the process prints, to wait for."""
        assert self._process.stderr is not None
        return self._process.stderr

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    def send(self, request: dict[str, Any]) -> bool:
        """Sends a request.

        Args:
            request: keyword arguments of the function.

        Returns:
            Whether it could be sent; it cannot when the process has ended.
        """
        assert self._process.stdin is not None
        self._printed = b""
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            return False
        return True

    def receive(self) -> dict[str, Any] | None:
        """Reads what has come, without waiting.

        Returns:
            The next reply; None where none is complete.
        """
        self._printed = (self._printed + self._read(self.messages))[-_TAIL_BYTES:]
        self._unread += self._read(self.replies)
        line, newline, rest = self._unread.partition(b"\n")
        if not newline:
            return None
        self._unread = rest
        reply: dict[str, Any] = json.loads(line)
        return reply

    def has_ended(self) -> bool:
        """Returns whether the process has ended."""
        return self._process.poll() is not None

    def end(self) -> int:
        """Kills the process and all that it started, if it still runs.

        Returns:
            Its return code; minus the signal's number where a signal ended it.
        """
        if self._process.poll() is None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self.pid, signal.SIGKILL)
        code = self._process.wait()
        for stream in (self._process.stdin, self.replies, self.messages):
            with suppress(OSError):
                if stream is not None:
                    stream.close()
        return code

    def resident_bytes(self) -> int:
        """Returns the memory that the process has now; 0 where the system does not say."""
        with suppress(OSError, ValueError, IndexError):
            return _PAGE_BYTES * int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
        return 0

    def last_line(self) -> str:
        """Returns the last line that the process printed since the last request; empty if none."""
        self._printed = (self._printed + self._read(self.messages))[-_TAIL_BYTES:]
        lines = self._printed.decode(errors="replace").splitlines()
        return next((line.strip() for line in reversed(lines) if line.strip()), "")

    @staticmethod
    def _read(stream: IO[bytes]) -> bytes:
        try:
            return os.read(stream.fileno(), _READ_BYTES)
        except BlockingIOError:
            return b""
