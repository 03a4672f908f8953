"""Method `soft`: strapdown gyro, slow gravity, a compass trusted as far as its field looks right.

The gyro alone carries the fast motion. The accelerometer is rotated into the frame that the gyro
integrates, where gravity stands still while shaking averages out, and low-passed there; the
filtered vector corrects the tilt (the idea of VQF: Laidig and Seel, Information Fusion 91, 2023).
The magnetometer corrects heading only, with a weight that falls off smoothly as strength and dip of
the field leave what was learned. The gyro bias is measured whenever the sensor rests.
"""

from dataclasses import dataclass
from math import cos, hypot, pi, sin, sqrt
from typing import Annotated

from lodeline.attitude.base import (
    FAINTEST_FIELD,
    HOLE,
    UNKNOWN_HEADING,
    Attitude,
    aged_variance,
    ahead,
    check_sample,
    north_yaw,
    positive,
    turned,
)
from lodeline.attitude.field import HOPELESS, FieldParams, FieldState, weigh
from lodeline.rotation import Quaternion, Vector, from_rotation_vector, multiply, rotate, wrap_angle

_ZERO: Vector = (0.0, 0.0, 0.0)
COMPASS_STD = 0.035  # [rad] what is left of heading error in a calm field
BIAS_AT_START = 0.0087  # [rad/s] half a degree per second
BIAS_AT_REST = 0.0005  # [rad/s] one look at the bias, averaged over REST_MEAN_TIME
BIAS_WALK = 0.00006  # [rad/s/sqrt(s)]
LARGEST_BIAS = 0.1  # [rad/s] a steadier turn than this is no rest
CLEAR_TURN = 0.3  # [rad] that a compass tells from standing still
REST_MEAN_TIME = 0.5  # [s]


@dataclass(frozen=True, slots=True)
class SoftParams(FieldParams):
    """Time constants and tolerances; each a physical quantity of the sensor or the place."""

    # What the stamp is late by: the delay of the chip's own low-pass (MPU-9250 at 92 Hz: 3.9 ms).
    latency: Annotated[float, "s"] = 0.004
    tilt_time: Annotated[float, "s"] = 3.0
    heading_time: Annotated[float, "s"] = 6.0
    rest_rate: Annotated[float, "rad/s"] = 0.035
    rest_acceleration: Annotated[float, "m/s^2"] = 0.5
    rest_time: Annotated[float, "s"] = 1.5

    def __post_init__(self) -> None:
        FieldParams.__post_init__(self)
        positive(tilt_time=self.tilt_time, heading_time=self.heading_time)


@dataclass(slots=True)
class SoftState(FieldState):
    """Everything between two samples. I is the frame the gyro integrates in, E is level."""

    started: bool = False
    age: float = 0.0
    strapdown: Quaternion = (0.0, 0.0, 0.0, 1.0)  # body to I
    tilt: Quaternion = (0.0, 0.0, 0.0, 1.0)  # I to E
    heading: float = 0.0  # E to world, about z
    gravity: Vector = _ZERO  # filtered specific force in I, and its rate
    gravity_rate: Vector = _ZERO
    bias: Vector = _ZERO
    bias_variance: float = 0.0
    rate: Vector = _ZERO  # the last sample of the gyro
    mean_rate: Vector = _ZERO
    mean_force: Vector = _ZERO
    still: float = 0.0  # how long it has rested [s]
    still_north: float = 0.0  # where north was in E [rad], and how far since then a rate turned
    still_turn: float = 0.0  # that is either bias or a slow turn [rad]
    field_wait: float = 0.0  # since the last magnetometer sample
    north: float = 0.0  # heading by the last field [rad]
    heading_variance: float = UNKNOWN_HEADING * UNKNOWN_HEADING


class Soft(Attitude):
    """The default method; see the caption of this module."""

    Params = SoftParams
    State = SoftState
    finds_bias = True
    params: SoftParams
    _state: SoftState

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
            s.age = s.age + dt if dt <= HOLE else 0.0  # after a hole, find gravity and north anew
            self._rest(dt, angular_velocity, linear_acceleration)
            turn = from_rotation_vector(turned(s.rate, angular_velocity, s.bias, dt))
            s.strapdown = _unit(multiply(s.strapdown, turn))
            s.heading_variance = aged_variance(s.heading_variance, dt, sqrt(s.bias_variance))
        else:
            s.started = True
            s.mean_rate, s.mean_force = angular_velocity, linear_acceleration
            s.gravity = linear_acceleration
            s.bias_variance = BIAS_AT_START * BIAS_AT_START
        s.rate = angular_velocity
        self._level(dt, linear_acceleration)
        s.field_wait += dt
        if magnetic_field is not None:
            field = rotate(s.tilt, rotate(s.strapdown, magnetic_field))
            if hypot(field[0], field[1]) > FAINTEST_FIELD:
                self._point_north(s.field_wait, field)
                s.field_wait = 0.0

    def _rest(self, dt: float, w: Vector, a: Vector) -> None:
        """Notice rest, and learn the gyro bias there (scalar Kalman filter)."""
        s, p = self._state, self.params
        wx, wy, wz = w
        ax, ay, az = a
        mwx, mwy, mwz = s.mean_rate
        fx, fy, fz = s.mean_force
        share = dt / (REST_MEAN_TIME + dt)
        dwx, dwy, dwz = wx - mwx, wy - mwy, wz - mwz
        dax, day, daz = ax - fx, ay - fy, az - fz
        s.mean_rate = mwx, mwy, mwz = mwx + share * dwx, mwy + share * dwy, mwz + share * dwz
        s.mean_force = (fx + share * dax, fy + share * day, fz + share * daz)
        s.bias_variance += BIAS_WALK * BIAS_WALK * dt
        if (
            dwx * dwx + dwy * dwy + dwz * dwz > p.rest_rate * p.rest_rate
            or dax * dax + day * day + daz * daz > p.rest_acceleration * p.rest_acceleration
            or mwx * mwx + mwy * mwy + mwz * mwz > LARGEST_BIAS * LARGEST_BIAS
        ):
            s.still = 0.0
            return
        if s.still == 0.0:
            s.still_north, s.still_turn = s.north, 0.0
        s.still += dt
        if s.still >= p.rest_time and not self._turning_steadily(dt):
            # one independent look at the bias per REST_MEAN_TIME
            gain = s.bias_variance / (s.bias_variance + BIAS_AT_REST * BIAS_AT_REST)
            gain *= min(1.0, dt / REST_MEAN_TIME)
            bx, by, bz = s.bias
            s.bias = (bx + gain * (mwx - bx), by + gain * (mwy - by), bz + gain * (mwz - bz))
            s.bias_variance *= 1.0 - gain

    def _turning_steadily(self, dt: float) -> bool:
        """True while what looks like rest may be a smooth arc driven at a steady rate.

        Only about the vertical can a body turn for long without the accelerometer noticing. A rate
        there that the bias known so far does not explain is believed to be bias only when the
        compass stood still meanwhile: then north has turned away in the frame of the gyro.
        """
        s = self._state
        (wx, wy, wz), (bx, by, bz), (fx, fy, fz) = s.mean_rate, s.bias, s.mean_force
        force = sqrt(fx * fx + fy * fy + fz * fz)
        if force == 0.0:
            return True
        rate = ((wx - bx) * fx + (wy - by) * fy + (wz - bz) * fz) / force
        expected = s.bias_variance + BIAS_AT_REST * BIAS_AT_REST
        if rate * rate < 16.0 * expected:
            return False
        s.still_turn += rate * dt
        if s.field_age < 0.0 or abs(s.still_turn) < CLEAR_TURN:
            return True
        away = s.still_north - s.north - s.still_turn
        s.still_north, s.still_turn = s.north, 0.0
        if abs(wrap_angle(away)) > 0.5 * CLEAR_TURN:
            return True
        s.bias_variance = rate * rate
        return False

    def _level(self, dt: float, force: Vector) -> None:
        """Low-pass the specific force in I and stand the result upright in E."""
        s, p = self._state, self.params
        ux, uy, uz = rotate(s.strapdown, force)
        x, y, z = s.gravity
        if s.age < p.tilt_time:  # a running mean until the filter has something to stand on
            share = dt / (s.age + dt) if dt > 0.0 else 0.0
            s.gravity = x, y, z = x + share * (ux - x), y + share * (uy - y), z + share * (uz - z)
        else:  # Butterworth of second order, semi-implicit Euler: any dt, no coefficients to keep
            h = min(dt, 0.2 * p.tilt_time)
            vx, vy, vz = s.gravity_rate
            corner = sqrt(2.0) / p.tilt_time
            spring, damping = h * corner * corner, 1.0 - h * sqrt(2.0) * corner
            vx = damping * vx + spring * (ux - x)
            vy = damping * vy + spring * (uy - y)
            vz = damping * vz + spring * (uz - z)
            s.gravity_rate = (vx, vy, vz)
            s.gravity = x, y, z = x + h * vx, y + h * vy, z + h * vz
        ex, ey, ez = rotate(s.tilt, (x, y, z))
        norm = sqrt(ex * ex + ey * ey + ez * ez)
        if norm > 0.0:
            # the shortest turn from the filtered vector to straight up
            half = sqrt(max(0.5 * (ez / norm + 1.0), 1e-12))
            turn = (0.5 * ey / (norm * half), -0.5 * ex / (norm * half), 0.0, half)
            s.tilt = _unit(multiply(turn, s.tilt))

    def _point_north(self, dt: float, field: Vector) -> None:
        """Turn the heading towards north as far as the field (level axes) can be believed."""
        s, p = self._state, self.params
        s.north = north = north_yaw(field, p.declination)
        first = s.field_age < 0.0
        wx, wy, wz = s.rate
        off = 0.0 if first else (north - s.heading + pi) % (2.0 * pi) - pi
        rate = sqrt(wx * wx + wy * wy + wz * wz)
        doubt = weigh(s, p, dt, field, rate, off, s.heading_variance)
        if first:  # point there at once
            s.heading, s.heading_variance = north, COMPASS_STD * COMPASS_STD
            return
        s.heading_variance = aged_variance(s.heading_variance + doubt, 0.0, 0.0)
        memory = min(p.heading_time, s.age, s.field_age)
        gain = s.weight * (dt / memory if memory > dt else 1.0)
        s.heading += gain * off
        s.heading_variance += gain * (COMPASS_STD * COMPASS_STD - s.heading_variance)

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        s = self._state
        now = multiply(s.strapdown, ahead(s.rate, s.bias, self.params.latency))
        level = multiply(s.tilt, now)
        return _unit(multiply((0.0, 0.0, sin(0.5 * s.heading), cos(0.5 * s.heading)), level))

    @property
    def gyro_bias(self) -> Vector:
        """Gyro bias [rad/s] as last seen at rest."""
        return self._state.bias

    @property
    def heading_std(self) -> float:
        """Standard deviation of yaw [rad]."""
        return sqrt(self._state.heading_variance)

    @property
    def disturbed(self) -> bool:
        """True while strength or dip of the field are those of another place, or of a magnet."""
        return self._state.field_age >= 0.0 and self._state.weight < HOPELESS


def _unit(q: Quaternion) -> Quaternion:
    """Pull a nearly unit quaternion back to unit norm, to first order."""
    x, y, z, w = q
    k = 1.5 - 0.5 * (x * x + y * y + z * z + w * w)
    return (k * x, k * y, k * z, k * w)
