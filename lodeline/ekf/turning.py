"""The turn of a step by gyro and wheels together."""

from math import cos, sin
from typing import NamedTuple

from lodeline.ekf.agreement import Agreement
from lodeline.ekf.belief import made
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
        last, last_ns, spiked, agreement = self
        if last_ns is not None and not spiked and abs(rate - last) > SPIKE:
            age_ns = stamp_ns - last_ns
            if age_ns <= RATE_LIFE_NS and abs(rate - last) > SWING * 1e-9 * age_ns:
                return self._replace(stamp_ns=stamp_ns, spiked=True)
        return made(Turning, (rate, stamp_ns, False, agreement))

    def over(self, begin_ns: float, seconds: float, noise: float, wander: float) -> Turn | None:
        """The turn in the `seconds` from `begin_ns` on; None if nobody measured it.

        The rate is that of the last reading. Its `noise` [rad^2/s] is white; since then the true
        one may have gone elsewhere, a random walk by `wander` [rad^2/s^3]: a gap is no turn.
        """
        rate, stamp_ns, _, _ = self
        if stamp_ns is None or begin_ns - stamp_ns > RATE_LIFE_NS:
            return None
        age = 1e-9 * (begin_ns - stamp_ns)
        then = age + seconds
        # of a long gap in several parts each brings its share of the variance of the whole
        gone = wander * (then * then * then - age * age * age) / 3.0
        return made(Turn, (rate * seconds, noise * seconds + gone))


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
    more = k_t * off
    ahead += k_s * off
    c, s = cos(0.5 * more), sin(0.5 * more)
    ss -= k_s * st
    left_over = (ss if ss > 0.0 else 0.0), st - k_s * tt, tt - k_t * tt, position, heading
    return (
        # a turn that is more by so much turns the way, however it went, by half of that
        made(Delta, (c * ahead - s * left, s * ahead + c * left, wheels + more)),
        made(Noise, left_over),
    )
