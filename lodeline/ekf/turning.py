"""The turn of a step by gyro and wheels together."""

from math import cos, sin

from lodeline.ekf.belief import made
from lodeline.ekf.engine import Noise
from lodeline.ekf.gyro import Turn
from lodeline.ekf.motion import Delta


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
