"""The two clocks that ages are measured by: the host's, and that of a recording."""

from __future__ import annotations

import time
from typing import Protocol

STEP_NS = 1_000_000_000


class Clock(Protocol):
    """Time now in ns since the UNIX epoch, and a word with each sample that comes in."""

    def now(self) -> int: ...

    def saw(self, stamp: int) -> None: ...


class HostClock:
    """The monotonic clock plus an offset taken once, so that no step of the host's time bends it.

    `epoch_offset` [ns] is UNIX time less monotonic time when the pipeline was started.
    """

    def __init__(self, epoch_offset: int) -> None:
        self._offset = epoch_offset

    def now(self) -> int:
        return time.monotonic_ns() + self._offset

    def saw(self, stamp: int) -> None:
        """Time goes its own way."""

    def follow(self, epoch_offset: int) -> None:
        """Take another host's time from now on: a machine that samples come to goes by theirs."""
        self._offset = epoch_offset


class RecordingClock:
    """Time as far as the samples have told it: the newest stamp seen.

    A leap of more than a second is taken back when a sample comes from before it: then it was one
    wrong stamp, and no hole in the recording. After another second it stands.
    """

    def __init__(self) -> None:
        self._newest = 0
        self._before_leap: int | None = None
        self._leapt_to = 0

    def now(self) -> int:
        return self._newest

    def saw(self, stamp: int) -> None:
        if stamp > self._newest + STEP_NS:
            self._before_leap, self._newest = self._newest, stamp
            self._leapt_to = stamp
        elif self._before_leap is None:
            self._newest = max(self._newest, stamp)
        elif abs(stamp - self._before_leap) < STEP_NS:
            self._before_leap, self._newest = None, stamp
        else:
            self._newest = max(self._newest, stamp)
            if self._newest > self._leapt_to + STEP_NS:
                self._before_leap = None


class StepWatch:
    """Notices when the wall clock is stepped against the monotonic one."""

    def __init__(self, epoch_offset: int) -> None:
        self._offset = epoch_offset

    def look(self) -> float:
        """Seconds that it was stepped by since the last look, 0.0 for less than one."""
        step = epoch_offset() - self._offset
        if abs(step) < STEP_NS:
            return 0.0
        self._offset += step
        return step * 1e-9


def epoch_offset() -> int:
    """UNIX time less monotonic time, now [ns]."""
    return time.time_ns() - time.monotonic_ns()
