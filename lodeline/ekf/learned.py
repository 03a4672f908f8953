"""Constants of the robot learned on the way, as further states of the filter beside the pose.

They are c = (share by which the way of the wheels is too short, the same of their turn, bias of the
gyro [rad/s]). A step goes wrong by G dc, so pose and constants become correlated, and what a
measurement says about the pose it says about them too:

    C <- A C + G Pcc,   P <- P + A C G^T + G C^T A^T + G Pcc G^T      (C = cov(pose, c))
    J = C^T P^-1,   c <- c + J dx,   Pcc <- Pcc - J (P - P+) J^T,   C^T <- J P+

The second line needs nothing of the measurement but what it did to the pose (dx, and P to P+):
given the pose, it says no more about c. That is the joint Kalman update.
"""

from itertools import product
from typing import NamedTuple

from lodeline.ekf.belief import Belief
from lodeline.rotation import wrap_angle

Nine = tuple[float, ...]
"""A 3x3 matrix, row-major."""
NONE: Nine = (0.0,) * 9
BIAS_WALK = 6e-5  # rad/s/sqrt(s): a gyro's bias goes with its temperature
AXES = range(3)
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class Learned(NamedTuple):
    """The constants and their covariance; `cross`: that of (x, y, yaw) with them. Row-major."""

    way: float
    turn: float
    bias: float
    covariance: Nine
    cross: Nine = NONE

    @property
    def sigmas(self) -> tuple[float, float, float]:
        """Standard deviations of the three."""
        a, b, c = (max(0.0, self.covariance[4 * i]) ** 0.5 for i in AXES)
        return a, b, c

    def alone(self) -> "Learned":
        """Without what ties them to the pose: it is open again which magnets tell it."""
        return self._replace(cross=NONE)


def start(way: float, turn: float, bias: float) -> Learned:
    """Nothing learned yet; standard deviations of the three."""
    return Learned(0.0, 0.0, 0.0, (way * way, 0.0, 0.0, 0.0, turn * turn, 0.0, 0.0, 0.0, bias**2))


def moved(
    learned: Learned, before: Belief, after: Belief, wheels: float, gyro: float, seconds: float
) -> tuple[Learned, Belief]:
    """After a step from one belief to the other, the second less sure by what c may be wrong by.

    `wheels` [rad] of the turn are the wheels', `gyro` [s] of it are multiplied by the gyro's rate.
    """
    dx, dy = after.x - before.x, after.y - before.y
    g = (  # what c does to x, y, yaw: B of the prediction times that of way and turn
        (dx, -0.5 * dy * wheels, 0.5 * dy * gyro),
        (dy, 0.5 * dx * wheels, -0.5 * dx * gyro),
        (0.0, wheels, -gyro),
    )
    _, _, _, p, c = learned
    ac = [c[j] - dy * c[6 + j] for j in AXES] + [c[3 + j] + dx * c[6 + j] for j in AXES]
    ac += c[6:]
    gp = [sum(g[i][k] * p[3 * k + j] for k in AXES) for i, j in product(AXES, AXES)]
    more = [
        sum(
            ac[3 * i + k] * g[j][k] + g[i][k] * ac[3 * j + k] + gp[3 * i + k] * g[j][k]
            for k in AXES
        )
        for i, j in UPPER
    ]
    walk = BIAS_WALK * BIAS_WALK * seconds if p[8] > 0.0 else 0.0
    learned = learned._replace(
        covariance=(*p[:8], p[8] + walk),
        cross=tuple([a + b for a, b in zip(ac, gp, strict=True)]),
    )
    raised = [old + add for old, add in zip(after[3:], more, strict=True)]
    return learned, Belief(after.x, after.y, after.yaw, *raised)


def corrected(learned: Learned, before: Belief, after: Belief) -> Learned:
    """After a measurement that took the pose from one belief to the other."""
    *values, p, c = learned
    j = [_over(before, c[k], c[3 + k], c[6 + k]) for k in AXES]
    dx = (after.x - before.x, after.y - before.y, wrap_angle(after.yaw - before.yaw))
    now = after.covariance
    gone = [was - is_ for was, is_ in zip(before.covariance, now, strict=True)]
    lost = [sum(j[k][a] * gone[3 * a + b] for a in AXES) for k, b in product(AXES, AXES)]
    covariance = [
        p[3 * k + m] - sum(lost[3 * k + b] * j[m][b] for b in AXES) for k, m in product(AXES, AXES)
    ]
    cross = [sum(j[k][a] * now[3 * a + b] for a in AXES) for b, k in product(AXES, AXES)]
    way, turn, bias = (value + sum(j[k][a] * dx[a] for a in AXES) for k, value in enumerate(values))
    return Learned(way, turn, bias, tuple(covariance), tuple(cross))


def _over(belief: Belief, x: float, y: float, yaw: float) -> tuple[float, float, float]:
    """P^-1 v, by P = L D L^T."""
    _, _, _, p00, p01, p02, p11, p12, p22 = belief
    l10, l20 = p01 / p00, p02 / p00
    d1 = p11 - l10 * p01
    l21 = (p12 - l10 * p02) / d1
    d2 = p22 - l20 * p02 - l21 * l21 * d1
    z1 = y - l10 * x
    last = (yaw - l20 * x - l21 * z1) / d2
    middle = z1 / d1 - l21 * last
    return x / p00 - l10 * middle - l20 * last, middle, last
