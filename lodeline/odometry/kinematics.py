"""Kinematics of a differential drive: counts to wheel travel, wheel travel to motion, and back.

Source: the magnet lab's "input noise in the lab" (matrix K) and the lecture's "encoder" slide
(gear, counts a turn). There a negative tread says which counter is the left wheel; here sides
and signs are explicit and lengths are positive.
"""

import math
from dataclasses import dataclass
from typing import Annotated

Matrix2 = tuple[float, float, float, float]
"""A 2x2 matrix, row-major."""


@dataclass(frozen=True, slots=True)
class DifferentialDrive:
    """Two driven wheels on one axle, `base_link` in its middle, x forward, y left.

    Raises ValueError when a length, a resolution or a sign makes no sense.
    """

    wheel_radius: Annotated[float, "m"] = 0.0215
    track: Annotated[float, "m"] = 0.112
    ticks_per_turn: Annotated[float, "1"] = 360.0
    gear: Annotated[float, "1"] = 1.0
    left_sign: int = 1
    right_sign: int = 1

    def __post_init__(self) -> None:
        for name in ("wheel_radius", "track", "ticks_per_turn", "gear"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        for name in ("left_sign", "right_sign"):
            if getattr(self, name) not in (-1, 1):
                raise ValueError(f"{name} must be 1 or -1, not {getattr(self, name)}")

    @property
    def metres_per_tick(self) -> float:
        """Way of the rim per encoder count [m]."""
        return 2.0 * math.pi * self.wheel_radius / (self.gear * self.ticks_per_turn)

    def travel(self, left_counts: int, right_counts: int) -> tuple[float, float]:
        """(left, right) way of the wheels [m], forward positive, for counted differences."""
        scale = self.metres_per_tick
        return self.left_sign * left_counts * scale, self.right_sign * right_counts * scale

    def motion(self, left: float, right: float) -> tuple[float, float]:
        """(ds [m], dtheta [rad]) of `base_link` for the ways of the two wheels [m]."""
        return 0.5 * (right + left), (right - left) / self.track

    def wheels(self, ds: float, dtheta: float) -> tuple[float, float]:
        """(left, right) ways [m] that make the motion (ds [m], dtheta [rad])."""
        half = 0.5 * self.track * dtheta
        return ds - half, ds + half

    @property
    def k_matrix(self) -> Matrix2:
        """K of the lab: (v, w) = K (right wheel rate, left wheel rate), rates in rad/s."""
        r, e = self.wheel_radius, self.track
        return 0.5 * r, 0.5 * r, r / e, -r / e

    def twist_covariance(self, left_variance: float, right_variance: float) -> Matrix2:
        """K Qq K^T: covariance of (v [m/s], w [rad/s]) for wheel rate variances [rad^2/s^2]."""
        k00, k01, k10, k11 = self.k_matrix
        vv = k00 * k00 * right_variance + k01 * k01 * left_variance
        vw = k00 * k10 * right_variance + k01 * k11 * left_variance
        ww = k10 * k10 * right_variance + k11 * k11 * left_variance
        return vv, vw, vw, ww
