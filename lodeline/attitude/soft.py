"""Method `soft`: strapdown gyro, slow gravity, a compass trusted as far as its field looks right.

The gyro alone carries the fast motion. Gravity, low-passed in the frame that the gyro integrates,
corrects the tilt. The magnetometer corrects heading only, less what rides on the body, and with a
weight that falls off smoothly as strength and dip of the field leave what was learned. The gyro
bias is measured whenever the sensor rests.
"""

from dataclasses import dataclass
from math import pi, sqrt, tau
from typing import Annotated

from lodeline.attitude.base import Attitude, positive
from lodeline.attitude.doubt import HOLE, aged_variance
from lodeline.attitude.field import disturbed, weigh
from lodeline.attitude.fix import north_yaw, points_somewhere
from lodeline.attitude.gravity import GravityState, level
from lodeline.attitude.iron import without_iron
from lodeline.attitude.rest import BIAS_AT_REST, REST_MEAN_TIME, RestParams, resting, surprise
from lodeline.attitude.strapdown import ahead, turned, unit
from lodeline.rotation import (
    Quaternion,
    Vector,
    from_rotation_vector,
    multiply,
    rotate,
    turned_about_z,
)

COMPASS_STD = 0.035  # [rad] what is left of heading error in a calm field
BIAS_AT_START = 0.0087  # [rad/s] half a degree per second
BIAS_WALK = 0.00006  # [rad/s/sqrt(s)]


@dataclass(frozen=True, slots=True)
class SoftParams(RestParams):
    """Time constants over which gravity and north are averaged."""

    tilt_time: Annotated[float, "s"] = 3.0
    heading_time: Annotated[float, "s"] = 6.0

    def __post_init__(self) -> None:
        RestParams.__post_init__(self)
        positive(tilt_time=self.tilt_time, heading_time=self.heading_time)


@dataclass(slots=True)
class SoftState(GravityState):
    """Everything between two samples."""

    heading: float = 0.0  # from level axes to the world, about z [rad]
    bias: Vector = (0.0, 0.0, 0.0)
    bias_variance: float = BIAS_AT_START * BIAS_AT_START


class Soft(Attitude):
    """The default method; see the caption of this module."""

    Params = SoftParams
    State = SoftState
    finds_bias = True
    params: SoftParams
    _state: SoftState

    def _start(self, rate: Vector, force: Vector) -> None:
        s = self._state
        s.mean_rate, s.mean_force, s.gravity = rate, force, force
        level(s, self.params.tilt_time, 0.0, force)

    def _step(self, dt: float, rate: Vector, force: Vector) -> None:
        s, p = self._state, self.params
        s.age = s.age + dt if dt <= HOLE else 0.0  # after a hole, find gravity and north anew
        s.bias_variance += BIAS_WALK * BIAS_WALK * dt
        if resting(s, p, dt, rate, force):
            self._learn_bias(dt)
        turn = from_rotation_vector(turned(s.rate, rate, s.bias, dt))
        s.strapdown = unit(multiply(s.strapdown, turn))
        s.heading_variance = aged_variance(s.heading_variance, dt, sqrt(s.bias_variance))
        level(s, p.tilt_time, dt, force)

    def _learn_bias(self, dt: float) -> None:
        """Scalar Kalman filter, one independent look per REST_MEAN_TIME."""
        s = self._state
        more = surprise(s, dt, s.bias, s.bias_variance)
        if more is None:
            return
        s.bias_variance += more
        gain = s.bias_variance / (s.bias_variance + BIAS_AT_REST * BIAS_AT_REST)
        gain *= min(1.0, dt / REST_MEAN_TIME)
        (bx, by, bz), (wx, wy, wz) = s.bias, s.mean_rate
        s.bias = (bx + gain * (wx - bx), by + gain * (wy - by), bz + gain * (wz - bz))
        s.bias_variance *= 1.0 - gain

    def _look(self, field: Vector) -> None:
        """Turn the heading towards north as far as the field can be believed."""
        s, p = self._state, self.params
        s.seen = field
        upright = multiply(s.tilt, s.strapdown)
        azimuth = 0.5 * pi - p.declination - s.heading
        level_field = without_iron(s, p, rotate(upright, field), upright, azimuth)
        if not points_somewhere(level_field):
            return
        north = north_yaw(level_field, p.declination)
        if s.field_age < 0.0:  # point there at once
            weigh(s, p, level_field, 0.0, s.heading_variance)
            s.heading, s.heading_variance = north, COMPASS_STD * COMPASS_STD
        else:
            off = (north - s.heading + pi) % tau - pi
            doubt = weigh(s, p, level_field, off, s.heading_variance)
            s.heading_variance = aged_variance(s.heading_variance + doubt, 0.0, 0.0)
            dt, memory = s.field_wait, min(p.heading_time, s.age, s.field_age)
            gain = s.weight * (dt / memory if memory > dt else 1.0)
            s.heading += gain * off
            s.heading_variance += gain * (COMPASS_STD * COMPASS_STD - s.heading_variance)
        s.field_wait = 0.0

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        s = self._state
        now = multiply(s.strapdown, ahead(s.rate, s.bias, self.params.latency))
        return unit(turned_about_z(multiply(s.tilt, now), s.heading))

    @property
    def gyro_bias(self) -> Vector:
        """Gyro bias [rad/s] as last seen at rest."""
        return self._state.bias

    @property
    def disturbed(self) -> bool:
        """True while strength or dip of the field are those of another place, or of a magnet."""
        return disturbed(self._state)
