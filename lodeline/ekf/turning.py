"""The turn of a step from wheels and gyro together, and whether the two agree.

Wheels that slip, an encoder that stopped and a track that is not the true one all show as a turn
that the gyro does not see. The difference is summed with a memory of `MEMORY` and compared with
what noise may make of it.
"""

import math
from typing import NamedTuple

from lodeline.ekf.engine import Noise
from lodeline.ekf.motion import Delta

MEMORY = 2.0  # s
ALARM, CALM = 4.0, 2.0  # sigmas of the summed difference at which wheels are doubted, and no more
SLIP_TIME = 2.0  # s: for about so long a slip goes on as it is
RATE_LIFE = 0.1  # s: after it a reading of the gyro is no reading of the present


class Agreement(NamedTuple):
    """Summed gyro turn minus wheel turn [rad], its variance [rad^2], and the verdict on it."""

    difference: float = 0.0
    variance: float = 0.0
    doubted: bool = False

    @property
    def sigmas(self) -> float:
        """How many standard deviations wheels and gyro are apart."""
        return abs(self.difference) / math.sqrt(self.variance) if self.variance > 0.0 else 0.0


def fused(delta: Delta, noise: Noise, turn: float, variance: float) -> tuple[Delta, Noise]:
    """The step of the wheels, corrected by the `turn` [rad] of the gyro of that variance.

    The input U = (ds, dtheta) with covariance Q is itself a Gaussian: this is its Kalman update
    by a measurement of dtheta.
    """
    total = noise.tt + variance
    if total <= 0.0:
        return delta, noise
    k_s, k_t = noise.st / total, noise.tt / total
    off = turn - delta.turn
    half = 0.5 * (delta.turn + k_t * off)
    way = math.copysign(math.hypot(delta.ahead, delta.left), delta.ahead) + k_s * off
    return (
        # the chord of an arc points half-way through its turn
        Delta(way * math.cos(half), way * math.sin(half), 2.0 * half),
        noise._replace(
            ss=max(0.0, noise.ss - k_s * noise.st),
            st=noise.st - k_s * noise.tt,
            tt=noise.tt - k_t * noise.tt,
        ),
    )


def compared(agreement: Agreement, off: float, variance: float, seconds: float) -> Agreement:
    """After a step over which gyro and wheels differ by `off`, with the variance of that."""
    keep = math.exp(-seconds / MEMORY)
    difference = keep * agreement.difference + off
    total = keep * keep * agreement.variance + variance
    limit = CALM if agreement.doubted else ALARM
    return Agreement(difference, total, difference * difference > limit * limit * total)


def doubting(noise: Noise, off: float, agreement: Agreement, seconds: float, track: float) -> Noise:
    """Noise of wheels that are doubted: what the gyro says they are wrong by, as it goes on.

    One wheel that is wrong by e turns the robot by e / track and moves it by e / 2.
    """
    wrong = max(abs(off), abs(agreement.difference) * seconds / MEMORY)
    more = wrong * wrong * max(1.0, 2.0 * SLIP_TIME / seconds)
    return noise._replace(ss=noise.ss + 0.25 * track * track * more, tt=noise.tt + more)
