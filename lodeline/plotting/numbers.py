"""Small sums behind the plots: values in between, angles without jumps, bands of chi-square."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from lodeline.ekf.belief import Covariance3
from lodeline.rotation import wrap_angle

CHI_95 = 5.991
"""95 % of chi-square, 2 degrees of freedom."""


def unwrapped(angles: Sequence[float], near: float = 0.0) -> list[float]:
    """Angles [rad] that never jump by more than pi; the first one within pi of `near`."""
    found: list[float] = []
    last = near
    for angle in angles:
        last += wrap_angle(angle - last)
        found.append(last)
    return found


def at(stamps: Sequence[int], values: Sequence[float], stamp: int) -> float | None:
    """The value at a stamp, on the straight line between its neighbours; None outside of them."""
    i = bisect_right(stamps, stamp)
    if i == 0 or (i == len(stamps) and stamp > stamps[-1]):
        return None
    if stamps[i - 1] == stamp:
        return values[i - 1]
    part = (stamp - stamps[i - 1]) / (stamps[i] - stamps[i - 1])
    return values[i - 1] + part * (values[i] - values[i - 1])


def rms(values: Sequence[float]) -> float:
    """Root of the mean of the squares."""
    return math.sqrt(math.fsum(value * value for value in values) / len(values))


def running_mean(values: Sequence[float], count: int) -> list[float]:
    """Mean of each value and those before it, `count` together; the first `count` - 1 have none."""
    total = math.fsum(values[:count])
    means = [total / count]
    for i in range(count, len(values)):
        total += values[i] - values[i - count]
        means.append(total / count)
    return means


def chi_square_band(freedom: int, count: int = 1, part: float = 0.95) -> tuple[float, float]:
    """Between these two lies the mean of `count` independent chi-squares with probability `part`.

    `freedom` degrees each. For one value of few degrees the band begins close to zero.
    """
    from scipy.special import gammaincinv  # slow to load

    shape = 0.5 * freedom * count
    low, high = (2.0 * float(gammaincinv(shape, 0.5 + side * 0.5 * part)) for side in (-1, 1))
    return low / count, high / count


def ellipse_axes(covariance: Covariance3) -> tuple[float, float, float]:
    """Half axes [m] of the 95 % ellipse of x and y, and the direction of the longer one [rad]."""
    xx, xy, _, _, yy, *_ = covariance
    middle, spread = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    a, b = (math.sqrt(CHI_95 * max(0.0, middle + side * spread)) for side in (1, -1))
    return a, b, 0.5 * math.atan2(2.0 * xy, xx - yy)
