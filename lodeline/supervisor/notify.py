"""The ear of the supervisor: a datagram socket on which one process says how it fares.

The wording is sd_notify's, so that a node also runs under systemd. The kernel says who speaks.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

CREDENTIALS = struct.Struct("3i")
MAX_DATAGRAM = 4096


class NotifySocket:
    """One socket for each process: the kernel keeps ten datagrams, and a READY must not be the
    eleventh because the neighbours talk much while the supervisor is busy."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        self._socket.bind(str(path))

    def fileno(self) -> int:
        return self._socket.fileno()

    def words(self, pid: int) -> Iterator[tuple[str, str]]:
        """What process `pid` itself has said since the last call: ("READY", "1"), ..."""
        while True:
            try:
                data, notes, _, _ = self._socket.recvmsg(
                    MAX_DATAGRAM, socket.CMSG_SPACE(CREDENTIALS.size)
                )
            except OSError:
                return
            if _speaker(notes) != pid:
                continue  # a child of the node, or a stranger
            for line in data.decode("utf-8", "replace").splitlines():
                name, equals, value = line.partition("=")
                if equals:
                    yield name, value

    def close(self) -> None:
        self._socket.close()
        with contextlib.suppress(OSError):
            self.path.unlink()


def _speaker(notes: list[tuple[int, int, bytes]]) -> int:
    for level, kind, data in notes:
        if (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS):
            return int(CREDENTIALS.unpack(data[: CREDENTIALS.size])[0])
    return 0
