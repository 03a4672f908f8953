"""What the gyro said lately: how far the robot turned between any two moments, and its tilt.

Readings are kept with the sum of all turns before them. So the turn of a step is a difference of
two sums, however many readings lie in it, and one that comes late needs no step of its own.
"""

from bisect import bisect_left, bisect_right
from typing import NamedTuple

from lodeline.ekf.belief import made
from lodeline.ekf.lift import LEVEL, Lift
from lodeline.ekf.samples import Spin

RATE_LIFE_NS = 50_000_000  # after it a reading of the gyro is no reading of the present
SWING, SPIKE = 100.0, 0.5  # rad/s^2 and rad/s: no robot changes its turn faster than by this
LONG = 60.0  # s: after it nobody knows the heading, and sums keep their digits
CAPACITY = 4096  # readings, against a flood
SPARE = 64  # readings that may be kept in vain: so many are forgotten at once


class Turn(NamedTuple):
    """A turn that the gyro measured [rad], and its variance [rad^2]."""

    angle: float
    variance: float


class Reading(NamedTuple):
    """The rate [rad/s] that is believed from `stamp_ns` on, and what had come together by then.

    `angle` [rad] is all turn before, `gone` [rad^2] what it may be wrong by as the rate was not
    looked at all the time. `spiked`: the rate is that of the reading before, this was not believed.
    `lifts` counts the times that the robot was lifted, and `lift` is how it stands now.
    """

    stamp_ns: int
    rate: float
    angle: float
    gone: float
    spiked: bool
    lift: Lift
    lifts: int


class Gyro:
    """Readings in the order of their stamps, taken in any.

    The rate is that of the last reading. Its `noise` [rad^2/s] is white; since then the true one
    may have gone elsewhere, a random walk by `wander` [rad^2/s^3]: a gap is no turn. What is asked
    for a moment hangs on the readings before it, not on one of that very stamp.
    """

    def __init__(self, noise: float, wander: float) -> None:
        self._noise, self._third = noise, wander / 3.0
        self.restart()

    def restart(self, lift: Lift = LEVEL) -> None:
        """Forgets all; the robot stood so until now."""
        self._stamps: list[int] = []
        self._spins: list[Spin] = []
        self._readings: list[Reading] = []
        self._level = lift == LEVEL
        self._start = Reading(0, 0.0, 0.0, 0.0, False, LEVEL if self._level else lift, 0)

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest reading."""
        return self._stamps[-1] if self._stamps else None

    def add(self, spin: Spin) -> bool:
        """Takes a reading; False if there is one of this stamp."""
        stamps, spins, readings = self._stamps, self._spins, self._readings
        stamp_ns = spin[0]
        if not stamps or stamp_ns > stamps[-1]:
            stamps.append(stamp_ns)
            spins.append(spin)
            readings.append(self._after(readings[-1] if readings else None, spin))
        else:
            i = bisect_left(stamps, stamp_ns)
            if stamps[i] == stamp_ns:
                return False
            stamps.insert(i, stamp_ns)
            spins.insert(i, spin)
            del readings[i:]
            for each in spins[i:]:
                readings.append(self._after(readings[-1] if readings else None, each))
        if len(stamps) > CAPACITY:
            self._forget(SPARE)
        return True

    def forget(self, before_ns: int) -> None:
        """Nobody will ask for a moment before this one."""
        stamps = self._stamps
        if len(stamps) > SPARE and stamps[SPARE] < before_ns:
            self._forget(bisect_left(stamps, before_ns) - 1)

    def over(self, from_ns: int, to_ns: int) -> Turn | None:
        """The turn from one moment to another; None if nobody measured it at its begin."""
        stamps = self._stamps
        i = bisect_right(stamps, from_ns) - 1
        if i < 0 or from_ns - stamps[i] > RATE_LIFE_NS:
            return None
        begin_ns, rate, angle, gone, _, _, _ = self._readings[i]
        age = 1e-9 * (from_ns - begin_ns)
        angle += rate * age
        gone += self._third * age * age * age
        begin_ns, rate, end, more, _, _, _ = self._readings[bisect_left(stamps, to_ns, i + 1) - 1]
        age = 1e-9 * (to_ns - begin_ns)
        age = age if age < LONG else LONG
        more += self._third * age * age * age - gone
        variance = self._noise * 1e-9 * (to_ns - from_ns) + more
        return made(Turn, (end + rate * age - angle, variance if variance > 0.0 else 0.0))

    def seam(self, from_ns: int, to_ns: int) -> int | None:
        """When it begins to know the rate between two moments, of which it knew none at first."""
        i = bisect_right(self._stamps, from_ns)
        return self._stamps[i] if i < len(self._stamps) and self._stamps[i] < to_ns else None

    def lifted(self, from_ns: int, to_ns: int) -> tuple[Lift, bool]:
        """How the robot stands at the second moment, and whether it was lifted since the first."""
        if self._level:  # as nearly always
            return LEVEL, False
        before, after = (self._before(each) for each in (from_ns, to_ns))
        return after.lift, after.lifts > before.lifts

    def _before(self, at_ns: int) -> Reading:
        i = bisect_left(self._stamps, at_ns)
        return self._readings[i - 1] if i else self._start

    def _after(self, last: Reading | None, spin: Spin) -> Reading:
        """With one reading more, which is believed unless it is a lone spike."""
        stamp_ns, rate, tilt = spin
        _, _, _, _, _, stood, lifts = last or self._start
        lift = stood.after(tilt, stamp_ns)
        if lift is not LEVEL:
            self._level = False
            lifts += lift.lifted and not stood.lifted
        if last is None:
            return Reading(stamp_ns, rate, 0.0, 0.0, False, lift, lifts)
        last_ns, before, angle, gone, spiked, _, _ = last
        age_ns = stamp_ns - last_ns
        age, off = 1e-9 * age_ns, abs(rate - before)
        is_spike = off > SPIKE and not spiked and age_ns <= RATE_LIFE_NS and off > SWING * age
        age = age if age < LONG else LONG
        angle += before * age
        gone += self._third * age * age * age
        rate = before if is_spike else rate
        return made(Reading, (stamp_ns, rate, angle, gone, is_spike, lift, lifts))

    def _forget(self, count: int) -> None:
        """Forgets the oldest."""
        self._start = self._readings[count - 1]
        del self._stamps[:count], self._spins[:count], self._readings[:count]
        self._level = all(each.lift is LEVEL for each in (self._start, *self._readings))
