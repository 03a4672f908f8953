"""Method `gyro`: the integral of the angular velocity, nothing else.

Starts from gravity and north like every method, then never looks at them again. Smooth and immune
to every disturbance, and it drifts: the gyro's zero-point must be calibrated away beforehand.
"""

from dataclasses import dataclass
from typing import Annotated

from lodeline.attitude.base import Attitude, AttitudeParams, AttitudeState, positive
from lodeline.attitude.doubt import aged_variance
from lodeline.attitude.fix import north_yaw, points_somewhere, tilt_of
from lodeline.attitude.strapdown import turned
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
NO_BIAS: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class GyroParams(AttitudeParams):
    """How fast the heading is expected to drift."""

    drift: Annotated[float, "rad/s"] = 0.0005

    def __post_init__(self) -> None:
        positive(drift=self.drift)


@dataclass(slots=True)
class GyroState(AttitudeState):
    """Everything between two samples."""

    north_known: bool = False
    orientation: Quaternion = IDENTITY


class Gyro(Attitude):
    """See the caption of this module."""

    Params = GyroParams
    State = GyroState
    params: GyroParams
    _state: GyroState

    def _start(self, rate: Vector, force: Vector) -> None:  # noqa: ARG002
        self._state.orientation = tilt_of(force)

    def _step(self, dt: float, rate: Vector, force: Vector) -> None:  # noqa: ARG002
        s = self._state
        turn = from_rotation_vector(turned(s.rate, rate, NO_BIAS, dt))
        s.orientation = normalized(multiply(s.orientation, turn))
        s.heading_variance = aged_variance(s.heading_variance, dt, self.params.drift)

    def _look(self, field: Vector) -> None:
        s = self._state
        if s.north_known:
            return
        level = rotate(s.orientation, field)
        if points_somewhere(level):
            turn = from_euler(0.0, 0.0, north_yaw(level, self.params.declination))
            s.orientation = multiply(turn, s.orientation)
            s.north_known, s.heading_variance = True, ONE_COMPASS_STD * ONE_COMPASS_STD

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        return self._state.orientation
