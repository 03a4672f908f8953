"""How long TCP waits on the link between hosts, no longer than zenoh does; and what waits there.

zenoh gives a silent link up after its lease, but waits with its end until the kernel has taken
what it was sending. On a cut link with full buffers TCP tries for minutes, at ever longer
intervals; until the next of them fails the old link is half dead, and the new one deaf.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

LINK_MS = 3000
"""Data that nobody confirms for so long end a link: zenoh's lease."""
OPENING_MS = 1500
"""A new link that nobody answers is given up and tried again, so that tries stay 1 s apart."""
AGAIN_US = 50_000
"""How soon at least what was lost is sent again: TCP's own 0.2 s, doubled for what is lost twice,
make samples 0.6 s old. More than the 40 ms that a receiver may keep a confirmation back.
"""
LOOK_S = 0.2
_TCP_ESTABLISHED, _TCP_SYN_SENT = 1, 2
_THIN_LINEAR_TIMEOUTS, _RTO_MIN_US = 16, 45  # linux/tcp.h; the second since Linux 6.15
_CONFIRMED = struct.Struct("=120xQ")  # bytes, in struct tcp_info of linux/tcp.h

Look = Callable[[str, float, bool, int], None]


class Impatience(threading.Thread):
    """Sets the patience of all TCP connections of this process, until `close`.

    `look(who, now, held_back, confirmed)` is told of each at each look, see `Slowness`.
    """

    def __init__(self, look: Look) -> None:
        super().__init__(name="impatience", daemon=True)
        self._look = look
        self._over = threading.Event()

    def run(self) -> None:
        while not self._over.wait(LOOK_S):
            for fd in _sockets():
                _limit(fd, self._look)

    def close(self) -> None:
        """Leave those that come later as they are."""
        self._over.set()
        self.join()


def _sockets() -> list[int]:
    links = ((link.name, _target(link)) for link in Path("/proc/self/fd").iterdir())
    return [int(name) for name, target in links if target.startswith("socket:")]


def _target(link: Path) -> str:
    try:
        return str(link.readlink())
    except OSError:
        return ""  # closed meanwhile


def _limit(fd: int, look: Look) -> None:
    """By a descriptor of our own: the other may be closed at any time."""
    try:
        with socket.socket(fileno=os.dup(fd)) as end:
            if end.family == socket.AF_UNIX or end.type != socket.SOCK_STREAM:
                return
            known = end.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
            patience = OPENING_MS if known[0] == _TCP_SYN_SENT else LINK_MS
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, patience)
            end.setsockopt(socket.IPPROTO_TCP, _THIN_LINEAR_TIMEOUTS, 1)
            with contextlib.suppress(OSError):
                end.setsockopt(socket.IPPROTO_TCP, _RTO_MIN_US, AGAIN_US)
            if known[0] == _TCP_ESTABLISHED and len(known) >= _CONFIRMED.size:
                (confirmed,) = _CONFIRMED.unpack_from(known)
                held_back = not select.select([], [end], [], 0.0)[1]
                host, port = end.getpeername()[:2]
                look(f"{host}:{port}", time.monotonic(), held_back, confirmed)
    except OSError:
        return
