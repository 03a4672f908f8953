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
    UNKNOWN_HEADING,
    Attitude,
    AttitudeParams,
    aged_variance,
    check_sample,
    norm_and_dip,
    north_yaw,
    turned,
)
from lodeline.rotation import Quaternion, Vector, from_rotation_vector, multiply, rotate

_ZERO: Vector = (0.0, 0.0, 0.0)
COMPASS_STD = 0.035  # [rad] what is left of heading error in a calm field
BIAS_AT_START = 0.0087  # [rad/s] half a degree per second
BIAS_AT_REST = 0.0005  # [rad/s] one look at the bias, averaged over REST_MEAN_TIME
BIAS_WALK = 0.00006  # [rad/s/sqrt(s)]
LARGEST_BIAS = 0.1  # [rad/s] a steadier turn than this is no rest
REST_MEAN_TIME = 0.5  # [s]


@dataclass(frozen=True, slots=True)
class SoftParams(AttitudeParams):
    """Time constants and tolerances; each a physical quantity of the sensor or the place."""

    # What the stamp is late by: the delay of the chip's own low-pass (MPU-9250 at 92 Hz: 3.9 ms).
    latency: Annotated[float, "s"] = 0.004
    tilt_time: Annotated[float, "s"] = 3.0
    heading_time: Annotated[float, "s"] = 7.0
    norm_tolerance: Annotated[float, "1"] = 0.045  # relative to the strength learned
    dip_tolerance: Annotated[float, "rad"] = 0.14
    learn_time: Annotated[float, "s"] = 5.0
    reference_time: Annotated[float, "s"] = 60.0
    rest_rate: Annotated[float, "rad/s"] = 0.035
    rest_acceleration: Annotated[float, "m/s^2"] = 0.5
    rest_time: Annotated[float, "s"] = 1.5


@dataclass(slots=True)
class SoftState:
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
    still: float = 0.0
    field_age: float = -1.0  # of the field reference, negative before the first field
    field_wait: float = 0.0  # since the last magnetometer sample
    field_norm: float = 0.0
    field_dip: float = 0.0
    weight: float = 0.0
    heading_variance: float = UNKNOWN_HEADING * UNKNOWN_HEADING


class Soft(Attitude):
    """The default method; see the caption of this module."""

    Params = SoftParams
    State = SoftState
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
            s.age += dt
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
        s.still += dt
        if s.still >= p.rest_time:
            # one independent look at the bias per REST_MEAN_TIME
            gain = s.bias_variance / (s.bias_variance + BIAS_AT_REST * BIAS_AT_REST)
            gain *= min(1.0, dt / REST_MEAN_TIME)
            bx, by, bz = s.bias
            s.bias = (bx + gain * (mwx - bx), by + gain * (mwy - by), bz + gain * (mwz - bz))
            s.bias_variance *= 1.0 - gain

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
        norm, dip = norm_and_dip(field)
        off = north_yaw(field, p.declination)
        if s.field_age < 0.0:  # first field: point there at once
            s.field_age, s.field_norm, s.field_dip, s.weight = 0.0, norm, dip, 1.0
            s.heading, s.heading_variance = off, COMPASS_STD * COMPASS_STD
            return
        s.field_age += dt
        off = (off - s.heading + pi) % (2.0 * pi) - pi
        a = (norm / s.field_norm - 1.0) / p.norm_tolerance
        b = (dip - s.field_dip) / p.dip_tolerance
        w = 1.0 / (1.0 + a * a + b * b)
        s.weight = w = w * w
        if s.field_age < p.learn_time:  # a running mean
            share = dt / s.field_age if dt > 0.0 else 0.0
        else:
            share = min(1.0, w * dt / p.reference_time)
        s.field_norm += share * (norm - s.field_norm)
        s.field_dip += share * (dip - s.field_dip)
        gain = min(1.0, w * dt / min(p.heading_time, s.field_age + 1e-9))
        s.heading += gain * off
        s.heading_variance += gain * (COMPASS_STD * COMPASS_STD - s.heading_variance)

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        s = self._state
        wx, wy, wz = s.rate
        bx, by, bz = s.bias
        t = self.params.latency
        ahead = from_rotation_vector((t * (wx - bx), t * (wy - by), t * (wz - bz)))
        level = multiply(s.tilt, multiply(s.strapdown, ahead))
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
        """True while the field has less than a quarter of its say."""
        return self._state.field_age >= 0.0 and self._state.weight < 0.25


def _unit(q: Quaternion) -> Quaternion:
    """Pull a nearly unit quaternion back to unit norm, to first order."""
    x, y, z, w = q
    k = 1.5 - 0.5 * (x * x + y * y + z * z + w * w)
    return (k * x, k * y, k * z, k * w)
