"""What all attitude methods share: their face to the outside, the honest start, the field check.

A method is fed one inertial sample after another, each with the time since the one before, and with
the magnetic field where a new magnetometer sample came along. It answers with a body to world
quaternion in ENU/FLU. Nothing here reads a clock: `dt` is an argument.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from math import atan2, hypot, pi, sqrt
from typing import Annotated, Any, ClassVar, Self

from lodeline.rotation import (
    Quaternion,
    Vector,
    from_euler,
    from_rotation_vector,
    multiply,
    rotate,
    wrap_angle,
)

GRAVITY = 9.80665
# Standard deviation of a heading about which nothing is known: uniform over the circle.
UNKNOWN_HEADING = pi / sqrt(3.0)
# Samples further apart than this [s] leave a hole, in which a body may turn at about this [rad/s].
HOLE = 0.25
UNSEEN_RATE = 0.6
# A level field weaker than this [T] points nowhere.
FAINTEST_FIELD = 1e-6
# No robot sensor measures more than this in SI units; it also keeps every product finite.
_LARGEST_SQUARE = 1e12


@dataclass(frozen=True, slots=True)
class AttitudeParams:
    """What every method knows about the place: the magnetic declination, added once."""

    declination: Annotated[float, "rad"] = 0.0  # magnetic north lies this far east of true north


class Attitude(ABC):
    """One method of finding the orientation of a body from gyro, accelerometer and magnetometer."""

    Params: ClassVar[type[Any]]
    State: ClassVar[type[Any]]
    finds_bias: ClassVar[bool] = False  # whether gyro_bias is ever anything but zero

    def __init__(self, params: Any = None, state: Any = None) -> None:
        """Start with the given parameters (else the defaults), from a saved state if given."""
        self.params = self.Params() if params is None else params
        self._state = self.State() if state is None else replace(state)

    @property
    def state(self) -> Any:
        """A copy of everything remembered between two updates, to be saved or handed over."""
        return replace(self._state)

    def resume(self, state: Any) -> Self:
        """Go on from a state handed over by an instance with the same parameters."""
        self._state = replace(state)
        return self

    @abstractmethod
    def update(
        self,
        dt: float,
        angular_velocity: Vector,
        linear_acceleration: Vector,
        magnetic_field: Vector | None = None,
    ) -> None:
        """Take in one sample.

        `dt` [s] since the sample before (of no account in the first), body rates [rad/s], specific
        force [m/s^2] (+9.81 on z at rest) and the field [T], None without a new magnetometer
        sample. Raises ValueError, with the state untouched, when dt is negative or a number is not
        finite or absurdly large.
        """

    @property
    @abstractmethod
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w); the identity before the first sample."""

    @property
    @abstractmethod
    def gyro_bias(self) -> Vector:
        """What the gyro is believed to read at rest [rad/s], body axes."""

    def unbiased(self, angular_velocity: Vector) -> Vector:
        """Body rates [rad/s] less the bias believed now."""
        (wx, wy, wz), (bx, by, bz) = angular_velocity, self.gyro_bias
        return (wx - bx, wy - by, wz - bz)

    @property
    @abstractmethod
    def heading_std(self) -> float:
        """Standard deviation of the yaw [rad]; pi / sqrt(3) as long as north was never seen."""

    @property
    @abstractmethod
    def disturbed(self) -> bool:
        """True while the magnetic field is not the earth's, as far as the method can tell."""


def positive(**values: float) -> None:
    """Raise ValueError, naming the parameter, unless all values are above zero."""
    for name, value in values.items():
        if not value > 0.0:
            raise ValueError(f"{name} must be above zero, got {value}")


def check_sample(dt: float, w: Vector, a: Vector, m: Vector | None) -> None:
    """Raise ValueError unless dt >= 0 and all numbers are finite and below 1e6 (SI)."""
    wx, wy, wz = w
    ax, ay, az = a
    total = dt * dt + wx * wx + wy * wy + wz * wz + ax * ax + ay * ay + az * az
    if m is not None:
        mx, my, mz = m
        total += mx * mx + my * my + mz * mz
    if not (dt >= 0.0 and total < _LARGEST_SQUARE):  # also false for NaN
        raise ValueError(
            f"not a measurement: dt {dt}, angular velocity {w}, acceleration {a}, field {m}"
        )


def turned(before: Vector, now: Vector, bias: Vector, dt: float) -> Vector:
    """Rotation vector [rad] over `dt` [s] between two gyro samples [rad/s], the rate being linear.

    Taking the later sample alone would run half a sample ahead. The cross product is the coning
    term (Magnus expansion to fourth order in dt).
    """
    bx, by, bz = bias
    ax, ay, az = before[0] - bx, before[1] - by, before[2] - bz
    cx, cy, cz = now[0] - bx, now[1] - by, now[2] - bz
    h, k = 0.5 * dt, dt * dt / 12.0
    return (
        h * (ax + cx) + k * (ay * cz - az * cy),
        h * (ay + cy) + k * (az * cx - ax * cz),
        h * (az + cz) + k * (ax * cy - ay * cx),
    )


def ahead(rate: Vector, bias: Vector, latency: float) -> Quaternion:
    """The turn that a sensor late by `latency` [s] has not seen yet, at a rate [rad/s] kept up."""
    return from_rotation_vector(
        (
            latency * (rate[0] - bias[0]),
            latency * (rate[1] - bias[1]),
            latency * (rate[2] - bias[2]),
        )
    )


def tilt_of(a: Vector) -> Quaternion:
    """Roll and pitch under which specific force `a` points straight up; yaw 0. Identity for 0."""
    ax, ay, az = a
    return from_euler(atan2(ay, az), atan2(-ax, hypot(ay, az)), 0.0)


def north_yaw(field: Vector, declination: float) -> float:
    """Yaw [rad] by which level axes must turn so that the field in them points to magnetic north.

    Magnetic north lies at azimuth 90 deg - declination, counter-clockwise from true east.
    """
    return wrap_angle(0.5 * pi - declination - atan2(field[1], field[0]))


def first_fix(a: Vector, m: Vector | None, declination: float) -> Quaternion:
    """Orientation from gravity and north at once; yaw 0 without a magnetic field."""
    tilt = tilt_of(a)
    if m is None:
        return tilt
    yaw = north_yaw(rotate(tilt, m), declination)
    return multiply(from_euler(0.0, 0.0, yaw), tilt)


def aged_variance(variance: float, dt: float, drift: float) -> float:
    """Heading variance [rad^2] after `dt` [s] in which the heading may drift at `drift` [rad/s].

    The drift is a constant rate of unknown sign, so the deviation grows in proportion to time.
    Over a hole in the samples the body may have turned unseen.
    """
    std = sqrt(variance) + drift * dt
    return min(std * std + hole_variance(dt), UNKNOWN_HEADING * UNKNOWN_HEADING)


def hole_variance(dt: float) -> float:
    """Variance [rad^2] of the turn between two samples `dt` [s] apart that neither of them saw."""
    return (UNSEEN_RATE * dt) ** 2 if dt > HOLE else 0.0
