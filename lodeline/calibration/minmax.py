"""Compass calibration by the smallest and largest reading of each axis, and the heading from it.

Source: SCUTTLE, "Absolute Orientation and Magnetometer" rev 1.1. Its axes are x right, y forward;
its heading theta is 0 towards north and positive to the left. `yaw_from_theta` and
`flu_from_scuttle` are the only places where these turn into FLU and ENU. One spike in the readings
spoils the result: a fitted ellipse is the better choice where the whole turn was recorded.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import atan2, inf, pi

from lodeline.rotation import Vector, wrap_angle


@dataclass(frozen=True, slots=True)
class MinMax:
    """Smallest and largest reading of each axis, in any unit. ValueError where they coincide."""

    low: tuple[float, ...]
    high: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.low) != len(self.high) or not self.low:
            raise ValueError(f"{len(self.low)} smallest readings, {len(self.high)} largest")
        for axis, (low, high) in enumerate(zip(self.low, self.high, strict=True)):
            if not 0.0 < high - low < inf:
                raise ValueError(f"axis {axis} never turned: from {low} to {high}")

    @classmethod
    def of(cls, readings: Iterable[tuple[float, ...]]) -> "MinMax":
        """The extremes of readings taken over a full turn."""
        axes = list(zip(*readings, strict=True))
        return cls(tuple(map(min, axes)), tuple(map(max, axes)))

    @property
    def offset(self) -> tuple[float, ...]:
        """Hard iron: the middle of each axis, in the unit of the readings."""
        return tuple(0.5 * (low + high) for low, high in zip(self.low, self.high, strict=True))

    def scaled(self, reading: tuple[float, ...]) -> tuple[float, ...]:
        """Each axis brought to -1 at its smallest and 1 at its largest reading."""
        return tuple(
            2.0 * (value - low) / (high - low) - 1.0
            for value, low, high in zip(reading, self.low, self.high, strict=True)
        )


def theta(x_scaled: float, y_scaled: float) -> float:
    """SCUTTLE's heading [rad]: 0 towards north, positive to the left (west)."""
    return atan2(x_scaled, y_scaled)


def yaw_from_theta(angle: float) -> float:
    """Yaw [rad] (0 = east, counter-clockwise) of a SCUTTLE heading [rad]."""
    return wrap_angle(angle + 0.5 * pi)


def flu_from_scuttle(v: Vector) -> Vector:
    """A vector in SCUTTLE axes (right, forward, up) in forward-left-up axes."""
    return (v[1], -v[0], v[2])
