"""Stamps [ns since the UNIX epoch, integers] and the seconds between them."""

from __future__ import annotations

MAX_STEP_S = 1.0


def seconds(stamp: int) -> float:
    """A stamp in seconds, good to a quarter of a microsecond for today's dates."""
    return stamp * 1e-9


class Steps:
    """Time steps of a row of samples.

    A sample that is no newer than the one before gives None and changes nothing; a gap longer
    than `MAX_STEP_S`, and the first sample, give 0: nobody knows what happened in between.
    """

    def __init__(self) -> None:
        self.last: int | None = None

    def take(self, stamp: int) -> float | None:
        """Seconds since the sample before, or None if this one must be left out."""
        last = self.last
        if last is not None and stamp <= last:
            return None
        self.last = stamp
        step = 0.0 if last is None else (stamp - last) * 1e-9
        return step if step <= MAX_STEP_S else 0.0
