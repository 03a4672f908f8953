"""When a chip took its samples, found out from how many it had taken at each look.

A chip samples on a clock of its own, some per cent off and drifting, and tells no times. But each
look at its counter says that the newest sample was taken before the look, and the one to come not
yet. Of all pairs (time of the newest sample, period) each look cuts those off that do not agree,
and as the looks slide over the chip's period, what is left gets small. It is a convex polygon,
kept as its corners: no noise is assumed, so what is believed can only be wrong with a look that is.
"""

from __future__ import annotations

Corner = tuple[float, float]

TOLERANCE = 0.03  # part by which a chip's clock may be off
DRIFT = 5e-6  # per second, of the period
WANDER = 20e-6  # s per second, of the phase
MAX_CORNERS = 16


class SampleClock:
    """Follows the samples of one chip. Times are seconds; where they count from is the caller's."""

    def __init__(self, period: float) -> None:
        """Take the period [s] that the chip is set to."""
        self._nominal = period
        self._corners: list[Corner] = []
        self._stopped = False
        self._look_s = 0.0
        self._periods = (period * (1.0 - TOLERANCE), period * (1.0 + TOLERANCE))

    @property
    def period(self) -> float:
        """The chip's period by our clock [s]."""
        return 0.5 * (self._periods[0] + self._periods[1])

    def taken(self, back: int = 0) -> tuple[float, float]:
        """When the sample `back` before the newest was taken [s], and how far off that may be."""
        times = [u - back * period for u, period in self._corners]
        if not times:
            return self._look_s, float("inf")
        low, high = min(times), max(times)
        return self._look_s + 0.5 * (low + high), 0.5 * (high - low)

    def restart(self) -> None:
        """Forget which sample is which, as after some were lost; the period stays known."""
        self._corners = []
        self._stopped = False

    def update(self, before_s: float, after_s: float, new: int) -> None:
        """Take a look at the counter: it began and ended then, and found `new` more samples."""
        width = after_s - before_s
        corners = self._moved(before_s, new) if self._corners else []
        self._look_s = before_s
        corners = _cut(_cut(corners, 1.0, 0.0, width), -1.0, -1.0, 0.0)
        self._stopped = new == 0 and (self._stopped or bool(self._corners and not corners))
        if self._stopped:
            self._corners = []
            return
        if not corners:  # the first look, or one that agrees with nothing before
            low, high = self._periods
            if self._corners:
                low, high = self._nominal * (1.0 - TOLERANCE), self._nominal * (1.0 + TOLERANCE)
            corners = [(-low, low), (width, low), (width, high), (-high, high)]
        self._corners = corners
        periods = [period for _, period in corners]
        self._periods = (min(periods), max(periods))

    def _moved(self, before_s: float, new: int) -> list[Corner]:
        """Carry the corners on to a later look, a little further apart each."""
        corners = self._corners
        if len(corners) > MAX_CORNERS:
            times = [u for u, _ in corners]
            (u0, u1), (t0, t1) = (min(times), max(times)), self._periods
            corners = [(u0, t0), (u1, t0), (u1, t1), (u0, t1)]
        passed = before_s - self._look_s
        middle = sum(u for u, _ in corners) / len(corners)
        mean = sum(period for _, period in corners) / len(corners)
        wander, drift = WANDER * passed, DRIFT * passed * mean
        moved = []
        for u, period in corners:
            t = period + (drift if period > mean else -drift)
            moved.append((u + (wander if u > middle else -wander) + new * t - passed, t))
        return moved


def _cut(corners: list[Corner], a: float, b: float, limit: float) -> list[Corner]:
    """Return the part of a convex polygon where a u + b T <= limit (Sutherland and Hodgman)."""
    left: list[Corner] = []
    for place, (u, t) in enumerate(corners):
        u0, t0 = corners[place - 1]
        over, over0 = a * u + b * t - limit, a * u0 + b * t0 - limit
        if (over > 0.0) != (over0 > 0.0):
            part = over0 / (over0 - over)
            left.append((u0 + part * (u - u0), t0 + part * (t - t0)))
        if over <= 0.0:
            left.append((u, t))
    return left
