"""The belief about the robot's pose: mean and covariance of (x, y, yaw) in `map`."""

import math
from typing import NamedTuple

Covariance3 = tuple[float, float, float, float, float, float, float, float, float]
"""Covariance of (x, y, yaw), row-major."""

made = tuple.__new__
"""Makes a named tuple of its parts at half the cost of a call of its class: for what each step
makes.
"""

SINGULAR = 1e-13  # of a variance: what rounding may take from it
FLOOR = 1e-18  # m^2, rad^2: a variance that means nothing, for one that rounding made zero


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

    def nees(self, x: float, y: float, yaw: float) -> float:
        """e^T P^-1 e of an error (x, y, yaw) [m, m, rad]: 3 on average for an honest belief."""
        _, _, _, p00, p01, p02, p11, p12, p22 = self
        # P = L D L^T, as in `_definite`
        l10, l20 = p01 / p00, p02 / p00
        d1 = p11 - l10 * p01
        l21 = (p12 - l10 * p02) / d1
        d2 = p22 - l20 * p02 - l21 * l21 * d1
        z1 = y - l10 * x
        z2 = yaw - l20 * x - l21 * z1
        return x * x / p00 + z1 * z1 / d1 + z2 * z2 / d2

    def widened(self, position: float, heading: float) -> "Belief":
        """Less sure by independent errors of standard deviation [m per axis, rad]."""
        more = position * position
        return self._replace(
            p00=self.p00 + more, p11=self.p11 + more, p22=self.p22 + heading * heading
        )

    def positive(self) -> "Belief":
        """Itself if its covariance is positive definite, else with the diagonal raised till it is.

        Joseph's form keeps it so in exact arithmetic; with a detection very much surer than the
        belief, rounding may not.
        """
        if self._definite:
            return self
        p00, p11, p22 = (max(abs(p), FLOOR) for p in (self.p00, self.p11, self.p22))
        for power in range(16):
            raised = 1.0 + SINGULAR * 10.0**power
            belief = self._replace(p00=raised * p00, p11=raised * p11, p22=raised * p22)
            if belief._definite:
                return belief
        return self._replace(p00=p00, p01=0.0, p02=0.0, p11=p11, p12=0.0, p22=p22)

    @property
    def _definite(self) -> bool:
        """True if the pivots of L D L^T are positive by more than rounding."""
        _, _, _, p00, p01, p02, p11, p12, p22 = self
        if not p00 > 0.0:
            return False
        second = p11 - p01 * p01 / p00
        if not second > SINGULAR * p11:
            return False
        cross = p12 - p01 * p02 / p00
        return p22 - p02 * p02 / p00 - cross * cross / second > SINGULAR * p22


def certain(x: float, y: float, yaw: float) -> Belief:
    """A pose without any doubt; `widened` adds it."""
    return Belief(x, y, yaw, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
