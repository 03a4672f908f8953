"""The turn of a step by gyro and wheels together."""

import math
from typing import NamedTuple

from lodeline.ekf.agreement import Agreement
from lodeline.ekf.engine import Noise
from lodeline.ekf.motion import Delta

RATE_LIFE_NS = 50_000_000  # after it a reading of the gyro is no reading of the present
SWING, SPIKE = 100.0, 0.5  # rad/s^2 and rad/s: no robot changes its turn faster than by this


class Turn(NamedTuple):
    """A turn that the gyro measured [rad], and its variance [rad^2]."""

    angle: float
    variance: float


class Turning(NamedTuple):
    """The last believed reading of the gyro [rad/s] and its stamp (None: there was none).

    `spiked`: the one after it was not believed.
    """

    rate: float = 0.0
    stamp_ns: int | None = None
    spiked: bool = False
    agreement: Agreement = Agreement()

    def after(self, rate: float, stamp_ns: int) -> "Turning":
        """With one reading more, which is taken unless it is a lone spike."""
        if self.stamp_ns is not None and not self.spiked:
            age_ns = stamp_ns - self.stamp_ns
            jump = abs(rate - self.rate)
            if age_ns <= RATE_LIFE_NS and jump > max(SPIKE, SWING * 1e-9 * age_ns):
                return self._replace(stamp_ns=stamp_ns, spiked=True)
        return Turning(rate, stamp_ns, False, self.agreement)

    def over(self, begin_ns: float, seconds: float, noise: float, wander: float) -> Turn | None:
        """The turn in the `seconds` from `begin_ns` on; None if nobody measured it.

        The rate is that of the last reading. Its `noise` [rad/s^0.5] is white; since then the true
        one may have gone elsewhere, a random walk by `wander` [rad/s^1.5]: a gap is no turn.
        """
        if self.stamp_ns is None or begin_ns - self.stamp_ns > RATE_LIFE_NS:
            return None
        age = 1e-9 * (begin_ns - self.stamp_ns)
        # of a long gap in several parts each brings its share of the variance of the whole
        gone = wander * wander * ((age + seconds) ** 3 - age**3) / 3.0
        return Turn(self.rate * seconds, noise * noise * seconds + gone)


def fused(delta: Delta, noise: Noise, turn: Turn) -> tuple[Delta, Noise]:
    """The step of the wheels, corrected by the turn of the gyro.

    The input U = (ds, dtheta) with covariance Q is itself a Gaussian: this is its Kalman update
    by a measurement of dtheta.
    """
    ss, st, tt, position, heading = noise
    ahead, left, wheels = delta
    angle, variance = turn
    total = tt + variance
    if total <= 0.0:
        return delta, noise
    k_s, k_t = st / total, tt / total
    off = angle - wheels
    turned = 0.5 * k_t * off
    ahead += k_s * off
    c, s = math.cos(turned), math.sin(turned)
    return (
        # a turn that is more by so much turns the way, however it went, by half of that
        Delta(c * ahead - s * left, s * ahead + c * left, wheels + k_t * off),
        Noise(max(0.0, ss - k_s * st), st - k_s * tt, tt - k_t * tt, position, heading),
    )
