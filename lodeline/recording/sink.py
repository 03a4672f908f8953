"""A file that can still be closed when the disk is full.

The index of a recording is written at its end: just when there is no room for it. So room is
held back from the start, in a nameless file beside it, and given up at the first refusal.
"""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from pathlib import Path

from mcap.opcode import Opcode

from lodeline.recording import RecordingError

BALLAST = 256 << 10
"""Bytes held back: the longest chunk, the index of a short recording, the footer."""
INDEX_BYTES = 400
"""What a chunk costs in the index at the end, for up to 30 keys."""
FULL = {errno.ENOSPC, errno.EDQUOT}
_CHUNK = bytes([Opcode.CHUNK])


class Sink:
    """What an MCAP writer writes to: takes all it is given, and never raises for the disk's sake.

    `full` says that the disk refused and that the ballast is gone: close now. `error` is what
    the disk said if not even that helped; then what is `pending` is not in the file.
    """

    def __init__(self, path: Path, *, replace: bool = False) -> None:
        """RecordingError if there is such a file already, or no room or right to make it."""
        self.path = path
        self.full = False
        self.error: OSError | None = None
        self.written = 0
        self._pending = b""
        self._chunks = 0
        self._held = 0
        flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | (os.O_TRUNC if replace else os.O_EXCL)
        try:
            self._file = os.open(path, flags, 0o644)
        except FileExistsError:
            raise RecordingError(
                f"{path} exists already: give another name, or --force to replace it"
            ) from None
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise RecordingError(f"{path}: cannot be written: {why}") from None
        try:
            # Its owner's death frees the room, whatever he died of.
            self._ballast = tempfile.TemporaryFile(dir=path.parent, buffering=0)  # noqa: SIM115
            self._hold(BALLAST)
        except OSError as error:
            os.close(self._file)
            path.unlink(missing_ok=True)
            raise RecordingError(f"{path}: cannot be written: {error.strerror}") from None

    @property
    def pending(self) -> int:
        """Bytes that the disk has refused."""
        return len(self._pending)

    def write(self, data: bytes) -> int:
        """Write, or keep until the ballast is gone; as the writer wants it, says how much."""
        if data[:1] == _CHUNK:  # a chunk begins a write of its own
            self._chunks += 1
        self._pending += data
        self._drain()
        return len(data)

    def tell(self) -> int:
        return self.written + len(self._pending)

    def flush(self) -> None:
        """All is with the operating system already."""

    def fileno(self) -> int:
        return self._file

    def hold(self) -> None:
        """Let the ballast grow with the index; `full` if there is no room even for that."""
        try:
            self._hold(BALLAST + self._chunks * INDEX_BYTES)
        except OSError as error:
            # A file system that cannot hold room back still takes the recording.
            self.full |= error.errno in FULL

    def sync(self) -> None:
        """Wait until the disk has what was written; may be called beside `write`."""
        try:
            os.fdatasync(self._file)
        except OSError as error:
            self.error = error

    def close(self) -> None:
        """Close both files; nothing is raised, see `error`."""
        self._release()
        self._drain()
        with contextlib.suppress(OSError):
            os.fsync(self._file)
        os.close(self._file)

    def _hold(self, size: int) -> None:
        if size > self._held and not self.full:
            size = (size + BALLAST - 1) // BALLAST * BALLAST
            os.posix_fallocate(self._ballast.fileno(), 0, size)
            self._held = size

    def _release(self) -> None:
        self._ballast.close()
        self._held = 0

    def _drain(self) -> None:
        while self._pending and self.error is None:
            try:
                count = os.write(self._file, self._pending)
            except OSError as error:
                if error.errno in FULL and not self._ballast.closed:
                    self.full = True
                    self._release()
                else:
                    self.error = error
                continue
            self.written += count
            self._pending = self._pending[count:]
