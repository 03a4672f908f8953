"""The belief about the robot's pose: mean and covariance of (x, y, yaw) in `map`."""

import math
from typing import NamedTuple

Covariance3 = tuple[float, float, float, float, float, float, float, float, float]
"""Covariance of (x, y, yaw), row-major."""


class Belief(NamedTuple):
    """Mean [m, m, rad] and the upper triangle of its covariance: symmetric by construction."""

    x: float
    y: float
    yaw: float
    p00: float
    p01: float
    p02: float
    p11: float
    p12: float
    p22: float

    @property
    def covariance(self) -> Covariance3:
        """The whole 3x3 matrix, row-major."""
        p00, p01, p02, p11, p12, p22 = self[3:]
        return p00, p01, p02, p01, p11, p12, p02, p12, p22

    @property
    def position_sigma(self) -> float:
        """Standard deviation [m] along the longest axis of the position's ellipse."""
        middle, half = 0.5 * (self.p00 + self.p11), 0.5 * (self.p00 - self.p11)
        return math.sqrt(max(0.0, middle + math.hypot(half, self.p01)))

    @property
    def finite(self) -> bool:
        """True if no number in it is infinite or NaN."""
        return all(map(math.isfinite, self))

    def widened(self, position: float, heading: float) -> "Belief":
        """Less sure by independent errors of standard deviation [m per axis, rad]."""
        more = position * position
        return self._replace(
            p00=self.p00 + more, p11=self.p11 + more, p22=self.p22 + heading * heading
        )


def certain(x: float, y: float, yaw: float) -> Belief:
    """A pose without any doubt; `widened` adds it."""
    return Belief(x, y, yaw, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
