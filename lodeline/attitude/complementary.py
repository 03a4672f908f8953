"""Method `complementary`: gyro high-passed, accelerometer and compass low-passed, angle by angle.

Source: "Micro Mechatronics (2nd)" lecture on IMU self-localization:
angle = K angle_gyro + (1 - K) angle_accel with K = 0.999. Such a K means another filter at every
sampling rate, so the parameter is the time constant tau = K dt / (1 - K): 9.99 s at 100 Hz.
"""

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Annotated

from lodeline.attitude.base import (
    FAINTEST_FIELD,
    UNKNOWN_HEADING,
    Attitude,
    AttitudeParams,
    aged_variance,
    check_sample,
    north_yaw,
    positive,
    tilt_of,
    turned,
)
from lodeline.rotation import (
    IDENTITY,
    Quaternion,
    Vector,
    from_euler,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    to_euler,
    wrap_angle,
)

COMPASS_STD = 0.05  # [rad] what is left of heading error in a calm field
DRIFT = 0.002  # [rad/s] of a gyro whose bias nobody looks for
DISTURBANCE = 0.15  # relative deviation of the strength that is no longer noise


def gain_of(tau: float, dt: float) -> float:
    """The lecture's K for a time constant `tau` [s] and samples `dt` [s] apart."""
    return tau / (tau + dt)


def time_constant_of(gain: float, dt: float) -> float:
    """The time constant [s] of the lecture's K at samples `dt` [s] apart; K below 1."""
    return gain * dt / (1.0 - gain)


@dataclass(frozen=True, slots=True)
class ComplementaryParams(AttitudeParams):
    """Below this time constant the gyro is believed, above it gravity and north."""

    tau: Annotated[float, "s"] = 9.99

    def __post_init__(self) -> None:
        positive(tau=self.tau)


@dataclass(slots=True)
class ComplementaryState:
    """Everything between two samples."""

    started: bool = False
    orientation: Quaternion = IDENTITY
    rate: Vector = (0.0, 0.0, 0.0)
    field_wait: float = 0.0  # since the last field [s]
    usual: float = 0.0  # strength of the first field [T], 0 before it
    strength: float = 0.0  # of the last one [T]
    heading_variance: float = UNKNOWN_HEADING * UNKNOWN_HEADING


class Complementary(Attitude):
    """See the caption of this module."""

    Params = ComplementaryParams
    State = ComplementaryState
    params: ComplementaryParams
    _state: ComplementaryState

    def update(
        self,
        dt: float,
        angular_velocity: Vector,
        linear_acceleration: Vector,
        magnetic_field: Vector | None = None,
    ) -> None:
        """Take in one sample; see `Attitude.update`."""
        check_sample(dt, angular_velocity, linear_acceleration, magnetic_field)
        s, tau = self._state, self.params.tau
        s.field_wait += dt
        if s.started:
            turn = turned(s.rate, angular_velocity, (0.0, 0.0, 0.0), dt)
            q = normalized(multiply(s.orientation, from_rotation_vector(turn)))
            roll, pitch, yaw = to_euler(q)
            level_roll, level_pitch, _ = to_euler(tilt_of(linear_acceleration))
            k = gain_of(tau, dt)
            roll = level_roll + k * wrap_angle(roll - level_roll)
            pitch = level_pitch + k * (pitch - level_pitch)
            s.heading_variance = aged_variance(s.heading_variance, dt, DRIFT)
        else:
            s.started = True
            roll, pitch, yaw = to_euler(tilt_of(linear_acceleration))
        s.rate = angular_velocity
        if magnetic_field is not None:
            yaw = self._towards_north(yaw, rotate(from_euler(roll, pitch, 0.0), magnetic_field))
        s.orientation = from_euler(roll, pitch, yaw)

    def _towards_north(self, yaw: float, level: Vector) -> float:
        """The yaw drawn towards the compass by as much as is due since the last field."""
        s, tau = self._state, self.params.tau
        if hypot(level[0], level[1]) <= FAINTEST_FIELD:
            return yaw
        north = north_yaw(level, self.params.declination)
        s.strength = hypot(*level)
        if s.usual == 0.0:  # the first field points there at once
            k, s.usual = 0.0, s.strength
            s.heading_variance = COMPASS_STD * COMPASS_STD
        else:
            k = gain_of(tau, s.field_wait)
            s.heading_variance += (1.0 - k) * (COMPASS_STD * COMPASS_STD - s.heading_variance)
        s.field_wait = 0.0
        return wrap_angle(north + k * wrap_angle(yaw - north))

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        return self._state.orientation

    @property
    def gyro_bias(self) -> Vector:
        """Zero: this method knows of none."""
        return (0.0, 0.0, 0.0)

    @property
    def heading_std(self) -> float:
        """Standard deviation of yaw [rad]."""
        return sqrt(self._state.heading_variance)

    @property
    def disturbed(self) -> bool:
        """True while the strength of the field is more than 15 % off the first one."""
        s = self._state
        return abs(s.strength - s.usual) > DISTURBANCE * s.usual
