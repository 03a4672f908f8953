"""Whether wheels and gyro agree about the turn of the robot.

Wheels that slip, an encoder that stopped and a track that is not the true one all show as a turn
that the gyro does not see. The difference is summed with a memory of `MEMORY` and compared with
what noise may make of it.
"""

from math import exp
from typing import NamedTuple

from lodeline.ekf.belief import made
from lodeline.ekf.engine import Noise

MEMORY = 2.0  # s
ALARM, CALM = 4.0, 2.0  # sigmas of the summed difference at which wheels are doubted, and no more
SLIP_TIME = 2.0  # s: for about so long a slip goes on as it is


class Agreement(NamedTuple):
    """Summed gyro turn minus wheel turn [rad], its variance [rad^2], and the verdict on it."""

    difference: float = 0.0
    variance: float = 0.0
    doubted: bool = False

    def after(self, off: float, variance: float, seconds: float) -> "Agreement":
        """A step on, over which gyro and wheels differ by `off`, with the variance of that."""
        keep = exp(-seconds / MEMORY)
        difference, total, doubted = self
        difference = keep * difference + off
        total = keep * keep * total + variance
        limit = CALM if doubted else ALARM
        doubted = difference * difference > limit * limit * total
        return made(Agreement, (difference, total, doubted))


def doubting(noise: Noise, off: float, agreement: Agreement, seconds: float, track: float) -> Noise:
    """Noise of wheels that are doubted: what the gyro says they are wrong by, as it goes on.

    One wheel that is wrong by e turns the robot by e / track and moves it by e / 2.
    """
    wrong = max(abs(off), abs(agreement.difference) * seconds / MEMORY)
    more = wrong * wrong * max(1.0, 2.0 * SLIP_TIME / seconds)
    return noise._replace(ss=noise.ss + 0.25 * track * track * more, tt=noise.tt + more)
