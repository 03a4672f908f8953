"""A cumulative count out of angles of 14 bits, which begin again with each turn."""

from __future__ import annotations

TURN = 1 << 14  # counts
BRIDGE = 1.0  # s
DISTRUST = 5  # readings that do not fit and are refused, before the counter gives way
SLACK = 16  # counts that noise may add to a step
SPEED_BASE = 0.02  # s, so that a count of noise is no speed


class Counter:
    """Turns angles of 14 bits into a cumulative count.

    A gap of up to 1 s is bridged with the speed seen before it, so that a wheel may turn on by
    more than half a turn while the bus is silent. Longer ones cannot be: whole turns would be
    missing. A step that no wheel makes is refused; if the angle stays there, the count starts anew.
    """

    def __init__(self, max_speed: float = float("inf")) -> None:
        """Take the largest speed that is believed [turns/s]."""
        self.count = 0
        self.refused = 0  # of the last readings, in a row
        self._fastest = max_speed * TURN
        self._margin = 0.0
        self._angle = -1
        self._now_s = 0.0
        self._speed = 0.0  # counts/s
        self._base_count = 0
        self._base_s = 0.0

    def update(self, now_s: float, angle: int) -> bool:
        """Take an angle (0 to 16383) read at `now_s` [s]; False if the count had to start anew.

        After a step that is refused (see `refused`) count and angle are what they were.
        """
        dt = now_s - self._now_s
        if self._angle < 0 or dt > BRIDGE:
            known = self._angle < 0
            self.restart()
            self._angle, self._now_s, self._base_s = angle, now_s, now_s
            return known
        expected = round(self._speed * dt)
        rest = (angle - self._angle - expected + TURN // 2) % TURN - TURN // 2
        # while readings are refused, the bound on what differs from the way expected stays as it is
        if not self.refused:
            self._margin = self._fastest * dt + SLACK
        if abs(rest) > self._margin or abs(expected + rest) > self._fastest * dt + SLACK:
            return self._refuse(now_s, angle)
        self.refused = 0
        self.count += expected + rest
        self._angle, self._now_s = angle, now_s
        if now_s - self._base_s >= SPEED_BASE:
            self._speed = (self.count - self._base_count) / (now_s - self._base_s)
            self._base_count, self._base_s = self.count, now_s
        return True

    def _refuse(self, now_s: float, angle: int) -> bool:
        self.refused += 1
        if self.refused <= DISTRUST:
            return True
        self.refused = 0
        self.restart()
        self._angle, self._now_s, self._base_s = angle, now_s, now_s
        return False

    def restart(self) -> None:
        """Count from 0 again, from the last angle on."""
        self.count = self._base_count = 0
        self._base_s = self._now_s
        self._speed = 0.0

    def resume(self, now_s: float, count: int, angle: int, speed: float) -> None:
        """Go on from where another counter stood at `now_s` [s]; speed in counts/s."""
        self.count = self._base_count = count
        self._now_s = self._base_s = now_s
        self._angle, self._speed = angle, speed

    @property
    def reading(self) -> tuple[float, int, int, float]:
        """What `resume` takes; the angle is -1 before the first reading."""
        return self._now_s, self.count, self._angle, self._speed
