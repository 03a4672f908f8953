"""A cumulative count out of angles of 14 bits, which begin again with each turn."""

from __future__ import annotations

TURN = 1 << 14  # counts
BRIDGE = 1.0  # s
GAP = 0.1  # s: in less than this no wheel changes its speed so much that it hides half a turn
GAP_PERIODS = 3  # and a driver that reads this slowly anyway has no gap
DISTRUST = 5  # readings that do not fit and are refused, before the counter gives way
SLACK = 16  # counts that noise may add to a step
SPEED_BASE = 0.02  # s, so that a count of noise is no speed
AFTER_GAP = 0.015  # s, so that a reading that is some ms late on a busy machine is no speed


class Counter:
    """Turns angles of 14 bits into a cumulative count.

    A gap of up to 1 s is bridged with the mean of the speeds seen before and after it, so that a
    wheel may turn on by more than half a turn while the bus is silent: the first reading after it
    waits for one that tells the speed. Longer ones cannot be bridged, nor those over which the
    speed changed so much that a whole turn may hide in them. A step that no wheel makes is refused;
    if the angle stays there, the count starts anew. `why` tells why it last did.
    """

    def __init__(self, max_speed: float = float("inf")) -> None:
        """Take the largest speed that is believed [turns/s]."""
        self.count = 0
        self.refused = 0  # of the last readings, in a row
        self.why = ""
        self._fastest = max_speed * TURN
        self._margin = 0.0
        self._angle = -1
        self._now_s = 0.0
        self._speed = 0.0  # counts/s
        self._base_count = 0
        self._base_s = 0.0
        self._period = 0.0
        self._ashore: tuple[float, int] | None = None  # time and angle at the far side of a gap

    @property
    def waiting(self) -> bool:
        """Whether the last reading came after a gap and is counted with a later one."""
        return self._ashore is not None

    def update(self, now_s: float, angle: int) -> bool:
        """Take an angle (0 to 16383) read at `now_s` [s]; False if the count had to start anew.

        After a step that is refused or waits (see `refused`, `waiting`) all is as it was.
        """
        if self._angle < 0:
            self._begin(now_s, angle)
            return True
        if now_s - self._now_s > BRIDGE:
            return self._begin_anew(now_s, angle, f"silent for over {BRIDGE:g} s")
        dt = now_s - (self._ashore[0] if self._ashore else self._now_s)
        if dt > max(GAP, GAP_PERIODS * self._period):
            self._ashore = now_s, angle
            return True
        if self._ashore:
            return self._bridge(*self._ashore, now_s, angle)
        self._period = dt
        return self._step(now_s, angle)

    def _bridge(self, then_s: float, seen: int, now_s: float, angle: int) -> bool:
        """Count over the gap before `seen` [counts] at `then_s` [s], and on from there to now."""
        dt = now_s - then_s
        if dt < AFTER_GAP:
            return True
        self._ashore = None
        before, after = self._speed, _shortest(angle - seen) / dt
        if abs(after - before) * (then_s - self._now_s) > TURN / 2:
            return self._begin_anew(now_s, angle, "speed changed while silent")
        self._speed = 0.5 * (before + after)
        if self._step(then_s, seen) and not self.refused:
            self._speed = after
        return self._step(now_s, angle)

    def _step(self, now_s: float, angle: int) -> bool:
        dt = now_s - self._now_s
        expected = round(self._speed * dt)
        rest = _shortest(angle - self._angle - expected)
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
        return self._begin_anew(now_s, angle, "angle jumped")

    def _begin_anew(self, now_s: float, angle: int, why: str) -> bool:
        self.why = why
        self.refused = 0
        self._begin(now_s, angle)
        return False

    def _begin(self, now_s: float, angle: int) -> None:
        self._angle, self._now_s, self._ashore = angle, now_s, None
        self.restart()

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


def _shortest(counts: int) -> int:
    """The same angle the shorter way round [counts]."""
    return (counts + TURN // 2) % TURN - TURN // 2
