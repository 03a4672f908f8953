"""Method `gyro`: the integral of the angular velocity, nothing else.

Starts from gravity and north like every method, then never looks at them again. Smooth and immune
to every disturbance, and it drifts: the gyro's zero-point must be calibrated away beforehand.
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
)

ONE_COMPASS_STD = 0.06  # [rad] a single heading, with the noise of one sample in it


@dataclass(frozen=True, slots=True)
class GyroParams(AttitudeParams):
    """How fast the heading is expected to drift."""

    drift: Annotated[float, "rad/s"] = 0.0005

    def __post_init__(self) -> None:
        positive(drift=self.drift)


@dataclass(slots=True)
class GyroState:
    """Everything between two samples."""

    started: bool = False
    north_known: bool = False
    orientation: Quaternion = IDENTITY
    rate: Vector = (0.0, 0.0, 0.0)
    heading_variance: float = UNKNOWN_HEADING * UNKNOWN_HEADING


class Gyro(Attitude):
    """See the caption of this module."""

    Params = GyroParams
    State = GyroState
    params: GyroParams
    _state: GyroState

    def update(
        self,
        dt: float,
        angular_velocity: Vector,
        linear_acceleration: Vector,
        magnetic_field: Vector | None = None,
    ) -> None:
        """Take in one sample; see `Attitude.update`."""
        check_sample(dt, angular_velocity, linear_acceleration, magnetic_field)
        s = self._state
        if s.started:
            turn = turned(s.rate, angular_velocity, (0.0, 0.0, 0.0), dt)
            s.orientation = normalized(multiply(s.orientation, from_rotation_vector(turn)))
            s.heading_variance = aged_variance(s.heading_variance, dt, self.params.drift)
        else:
            s.started, s.orientation = True, tilt_of(linear_acceleration)
        s.rate = angular_velocity
        if magnetic_field is not None and not s.north_known:
            level = rotate(s.orientation, magnetic_field)
            if hypot(level[0], level[1]) > FAINTEST_FIELD:
                yaw = north_yaw(level, self.params.declination)
                s.orientation = multiply(from_euler(0.0, 0.0, yaw), s.orientation)
                s.north_known, s.heading_variance = True, ONE_COMPASS_STD * ONE_COMPASS_STD

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
        """False: the field is not looked at."""
        return False
