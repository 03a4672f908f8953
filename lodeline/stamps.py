"""Stamps [ns since the UNIX epoch, integers] and the seconds between them."""

from __future__ import annotations


def seconds(stamp: int) -> float:
    """A stamp in seconds, good to a quarter of a microsecond for today's dates."""
    return stamp * 1e-9


class Steps:
    """Time steps of a row of samples.

    A sample that is no newer than the one before gives None and changes nothing; the first gives
    0. A hole gives its whole length: what is to be made of it is for the filter to say.
    """

    def __init__(self) -> None:
        self.last: int | None = None

    def take(self, stamp: int) -> float | None:
        """Seconds since the sample before, or None if this one must be left out."""
        last = self.last
        if last is not None and stamp <= last:
            return None
        self.last = stamp
        return 0.0 if last is None else (stamp - last) * 1e-9
