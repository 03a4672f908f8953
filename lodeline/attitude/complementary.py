"""Method `complementary`: gyro high-passed, accelerometer and compass low-passed, angle by angle.

Source: "Micro Mechatronics (2nd)" lecture on IMU self-localization:
angle = K angle_gyro + (1 - K) angle_accel with K = 0.999. Such a K means another filter at every
sampling rate, so the parameter is the time constant tau = K dt / (1 - K): 9.99 s at 100 Hz.
"""

from dataclasses import dataclass
from math import hypot
from typing import Annotated

from lodeline.attitude.base import AttitudeParams, positive
from lodeline.attitude.doubt import aged_variance
from lodeline.attitude.fix import north_yaw, points_somewhere, tilt_of
from lodeline.attitude.strapdown import turned
from lodeline.attitude.strength import StrengthState, StrengthWatcher
from lodeline.rotation import (
    Quaternion,
    Vector,
    from_euler,
    from_rotation_vector,
    multiply,
    rotate,
    to_euler,
    wrap_angle,
)

COMPASS_STD = 0.05  # [rad] what is left of heading error in a calm field
DRIFT = 0.002  # [rad/s] of a gyro whose bias nobody looks for
NO_BIAS: Vector = (0.0, 0.0, 0.0)


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
class ComplementaryState(StrengthState):
    """Everything between two samples."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


class Complementary(StrengthWatcher):
    """See the caption of this module."""

    Params = ComplementaryParams
    State = ComplementaryState
    params: ComplementaryParams
    _state: ComplementaryState

    def _start(self, rate: Vector, force: Vector) -> None:  # noqa: ARG002
        s = self._state
        s.roll, s.pitch, s.yaw = to_euler(tilt_of(force))

    def _step(self, dt: float, rate: Vector, force: Vector) -> None:
        s = self._state
        turn = from_rotation_vector(turned(s.rate, rate, NO_BIAS, dt))
        roll, pitch, s.yaw = to_euler(multiply(self.orientation, turn))
        level_roll, level_pitch, _ = to_euler(tilt_of(force))
        k = gain_of(self.params.tau, dt)  # angle = K angle_gyro + (1 - K) angle_accel
        s.roll = wrap_angle(level_roll + k * wrap_angle(roll - level_roll))
        s.pitch = level_pitch + k * (pitch - level_pitch)
        s.heading_variance = aged_variance(s.heading_variance, dt, DRIFT)

    def _look(self, field: Vector) -> None:
        """Draw the yaw towards the compass by as much as is due since the last field."""
        s = self._state
        level = rotate(from_euler(s.roll, s.pitch, 0.0), field)
        if not points_somewhere(level):
            return
        s.strength = hypot(*level)
        k = gain_of(self.params.tau, s.field_wait)
        if s.usual == 0.0:  # the first field points there at once
            k, s.usual = 0.0, s.strength
        north = north_yaw(level, self.params.declination)
        s.yaw = wrap_angle(north + k * wrap_angle(s.yaw - north))
        s.heading_variance += (1.0 - k) * (COMPASS_STD * COMPASS_STD - s.heading_variance)
        s.field_wait = 0.0

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        s = self._state
        return from_euler(s.roll, s.pitch, s.yaw)
