"""Both ends of a measured chain, the same in each: what was sent when, what came when.

Stamps are ns on the machine's monotonic clock, which all its processes share.
"""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

SENT, HEARD, FLOWS = "sent.json", "heard.json", "flows"

SAMPLE: dict[str, Any] = {
    "stamp": 0,
    "seq": 0,
    "x": 1.25,
    "y": -0.75,
    "yaw": 0.5,
    "v": 0.3,
    "w": 0.1,
    "pose_covariance": (1e-4, 1e-6, 1e-6, 1e-6, 1e-4, 1e-6, 1e-6, 1e-6, 1e-3),
    "twist_covariance": (1e-5, 1e-7, 1e-7, 1e-5),
    "interval": 0.005,
    "resets": 0,
}
"""What the baselines hand on: as many fields and bytes as an odometry of ours."""


class Sent:
    """The stamps that a source gave, and for a source that computes, when it had done so."""

    def __init__(self, folder: str) -> None:
        self._file = Path(folder) / SENT
        self._stamps: list[int] = []
        self._done: list[int] = []
        self.add = self._stamps.append
        self.done = self._done.append

    def write(self) -> None:
        self._file.write_text(json.dumps([self._stamps, self._done]))


class Heard:
    """Stamp, age and time of arrival [ns] of each sample that came through."""

    def __init__(self, folder: str) -> None:
        self._file = Path(folder) / HEARD
        self._flows = Path(folder) / FLOWS
        self._samples: list[tuple[int, int, int]] = []

    def add(self, stamp: int, now: int) -> None:
        """A sample stamped by a clock that now shows `now`."""
        if not self._samples:
            self._flows.touch()
        self._samples.append((stamp, now - stamp, time.monotonic_ns()))

    def write(self) -> None:
        self._file.write_text(json.dumps(self._samples))


class Stop:
    """Set by the signal that ends a chain."""

    def __init__(self) -> None:
        self.set = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._signalled)

    def _signalled(self, _number: int, _frame: FrameType | None) -> None:
        self.set = True

    def wait(self) -> None:
        while not self.set:
            time.sleep(0.1)


def paced(rate: float, stop: Stop) -> Iterator[int]:
    """Numbers at `rate` Hz by absolute deadlines, until stopped."""
    period, deadline, number = 1.0 / rate, time.monotonic(), 0
    while not stop.set:
        yield number
        number += 1
        deadline += period
        wait = deadline - time.monotonic()
        if wait > 0:
            time.sleep(wait)
