"""A bad cable between two machines: delays, loses, throttles or cuts what goes through it.

It stands in for the kernel's network emulator, which many kernels lack: each end is a TAP device
on its machine, and a thread of this process carries the frames from one to the other.
"""

from __future__ import annotations

import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import threading
import time
from dataclasses import dataclass
from typing import Annotated

from lodeline.bench.machines import Machine

_TUNSETIFF, _IFF_TAP, _IFF_NO_PI, _CLONE_NEWNET = 0x400454CA, 0x2, 0x1000, 0x40000000
_FRAME = 1 << 16
_LOOK_S = 0.05


@dataclass(frozen=True, slots=True)
class Fault:
    """What is wrong with a cable, in either direction.

    A frame takes `delay`, plus or minus up to `jitter`, so that frames overtake each other; `loss`
    is the part that never arrives. At a `rate` frames queue for up to `buffer`, then they are lost.
    """

    delay: Annotated[float, "s"] = 0.0
    jitter: Annotated[float, "s"] = 0.0
    loss: Annotated[float, "1"] = 0.0
    rate: Annotated[float | None, "bit/s"] = None
    buffer: Annotated[float, "s"] = 0.5
    cut: bool = False


class Cable:
    """Joins two machines with the addresses `10.214.0.1` and `10.214.0.2`; `close` unplugs it."""

    addresses = ("10.214.0.1", "10.214.0.2")

    def __init__(self, one: Machine, other: Machine, seed: int = 1) -> None:
        self.fault = Fault()
        self._uniform = random.Random(seed).uniform
        self._ends = [_tap(one, "tap0"), _tap(other, "tap0")]
        for machine, address in zip((one, other), self.addresses, strict=True):
            machine.run("sysctl", "-qw", "net.ipv6.conf.tap0.disable_ipv6=1")
            machine.run("ip", "addr", "add", f"{address}/24", "dev", "tap0")
            machine.run("ip", "link", "set", "tap0", "up")
        self._queue: list[tuple[float, int, int, bytes]] = []
        self._number = 0
        self._busy = [0.0, 0.0]
        self._over = False
        self._thread = threading.Thread(target=self._run, name="cable", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Take it away."""
        self._over = True
        self._thread.join()
        for end in self._ends:
            os.close(end)

    def _run(self) -> None:
        while not self._over:
            now = time.monotonic()
            self._deliver(now)
            wait = min(_LOOK_S, max(0.0, self._queue[0][0] - now)) if self._queue else _LOOK_S
            for end in select.select(self._ends, [], [], wait)[0]:
                self._take(self._ends.index(end))

    def _deliver(self, now: float) -> None:
        while self._queue and self._queue[0][0] <= now:
            _, _, end, frame = heapq.heappop(self._queue)
            try:
                os.write(self._ends[end], frame)
            except OSError:
                continue  # its device is down: lost, as on any cable

    def _take(self, end: int) -> None:
        while True:
            try:
                frame = os.read(self._ends[end], _FRAME)
            except OSError:
                return
            at = self._arrival(end, len(frame), time.monotonic())
            if at is not None:
                self._number += 1
                heapq.heappush(self._queue, (at, self._number, 1 - end, frame))

    def _arrival(self, end: int, size: int, now: float) -> float | None:
        """When a frame comes out at the other end; None if it never does."""
        fault = self.fault
        if fault.cut or self._uniform(0.0, 1.0) < fault.loss:
            return None
        at = now + fault.delay + self._uniform(-fault.jitter, fault.jitter)
        if fault.rate is None:
            return at
        begin = max(self._busy[end], now)
        if begin - now > fault.buffer:
            return None
        self._busy[end] = begin + 8 * size / fault.rate
        return at + self._busy[end] - now


def _tap(machine: Machine, name: str) -> int:
    """Descriptor of a new TAP device on a machine."""
    made: list[int] = []
    failed: list[OSError] = []

    def run() -> None:
        # A thread can live in another network namespace than its process.
        libc = ctypes.CDLL(None, use_errno=True)
        try:
            with open(f"/proc/{machine.pid}/ns/net") as network:  # noqa: PTH123
                if libc.setns(network.fileno(), _CLONE_NEWNET):
                    raise OSError(ctypes.get_errno(), "setns")
            tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
            fcntl.ioctl(tap, _TUNSETIFF, struct.pack("16sH", name.encode(), _IFF_TAP | _IFF_NO_PI))
            made.append(tap)
        except OSError as error:
            failed.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    if failed:
        raise failed[0]
    return made[0]
