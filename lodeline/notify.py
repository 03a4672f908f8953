"""A node process's word to its supervisor, in the wording of sd_notify."""

from __future__ import annotations

import contextlib
import os
import socket


class Notifier:
    """Sends datagrams to the socket that NOTIFY_SOCKET names; silent where there is none."""

    def __init__(self) -> None:
        self._socket: socket.socket | None = None
        path = os.environ.get("NOTIFY_SOCKET")
        if path:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)
            with contextlib.suppress(OSError):  # the supervisor is gone: stdin will say so
                self._socket.connect(path)

    def send(self, text: str) -> None:
        """`READY=1`, `LINKED=1`, `WATCHDOG=1`, `STATUS=...`; lost if nobody reads."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.send(text.encode())
