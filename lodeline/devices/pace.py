"""Whether a driver ticks as evenly as it should."""

from __future__ import annotations

TOLERATED = 0.1  # part of a period


class Pace:
    """Finds ticks that came late, by the time since the one before."""

    def __init__(self, rate: float) -> None:
        """Take the ticks a second that there should be."""
        self._longest = (1.0 + TOLERATED) / rate
        self._last_s = float("inf")

    def late(self, now_s: float) -> bool:
        """Take the time of a tick [s]; tell whether it was late by over a tenth of a period."""
        late = now_s - self._last_s > self._longest
        self._last_s = now_s
        return late
