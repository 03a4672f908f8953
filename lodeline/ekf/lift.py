"""A robot that is tilted for long was lifted: nobody knows where it is put down."""

from typing import NamedTuple

TILT, TILT_TIME_NS = 0.17, 300_000_000  # rad and ns: no floor does that, a hand does


class Lift(NamedTuple):
    """Since when the robot is tilted (None: it is level), and whether that was called a lift."""

    since_ns: int | None = None
    lifted: bool = False

    def after(self, tilt: float, stamp_ns: int) -> "Lift":
        """With a tilt [rad] read at `stamp_ns`."""
        if not tilt > TILT:
            return LEVEL
        if self.since_ns is None:
            return Lift(stamp_ns)
        if self.lifted or stamp_ns - self.since_ns < TILT_TIME_NS:
            return self
        return Lift(self.since_ns, lifted=True)


LEVEL = Lift()
