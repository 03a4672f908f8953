"""Method `dcm`: the direction cosine matrix with PI correction and a tilt-compensated compass.

Source: Herman et al., "Implementation of Direction Cosine Matrix on a PSoC-5 Microcontroller for
Robot Localization on Inclined Terrains"; equation numbers below are that paper's. It works in FRD
axes with a heading clockwise from north. Here everything is FLU and ENU, where gravity as measured
points along +z at rest; see `yaw_from_heading` for the only place where headings are turned over.

Where the print is wrong, the line follows the mathematics: (7) is a cross product; (9), missing, is
R (I + [w dt]x), and (19) is the same; (13)-(15) are scalar times row; (16) with measured gravity
would be positive feedback, so the error is a x r_z; and the matrix starts from gravity and north,
not from zero. The gains that the paper inherits are Pololu's for the MinIMU-9.
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin, sqrt
from typing import Annotated, Literal, NamedTuple

from lodeline.attitude.base import (
    FAINTEST_FIELD,
    GRAVITY,
    HOLE,
    UNKNOWN_HEADING,
    Attitude,
    AttitudeParams,
    aged_variance,
    check_sample,
    tilt_of,
)
from lodeline.rotation import (
    IDENTITY,
    Matrix,
    Quaternion,
    Vector,
    compose,
    from_matrix,
    from_rotation_vector,
    matrix_from_euler,
    to_matrix,
    wrap_angle,
)


class Gains(NamedTuple):
    """PI gains per axis group, and how sensors lose their say."""

    tilt_p: float  # [rad/s] per g of error
    tilt_i: float  # [rad/s^2] per g of error
    yaw_p: float  # [rad/s] per unit (sine) of heading error
    yaw_i: float  # [rad/s^2]
    force_slope: float  # weight lost per g of deviation from 1 g
    field_slope: float  # weight lost per unit of relative deviation from the usual field
    compass_period: float  # [s] a heading is worked out this often and held in between
    largest_turn: float  # [rad] per step; (19) is of first order, a larger turn is done exactly


GAINS = {
    "paper": Gains(5.12, 0.256, 1.2, 0.001, 2.0, 0.0, 0.12, 0.2),
    "tuned": Gains(0.3, 0.001, 0.2, 0.0003, 0.0, 6.0, 0.0, 0.02),
}
FIELD_TIME = 60.0  # [s] over which the usual field strength is learned
COMPASS_STD = 0.05  # [rad] error of a compass heading in a calm field
DRIFT = 0.002  # [rad/s] heading drift that the integral part has not found yet
DISTURBANCE = 0.15  # relative deviation of the field that is no longer noise or tilt
LARGEST_BIAS = 1.0  # [rad/s] no gyro is as bad; keeps the integral from winding up without end
LARGEST_FORCE = 20.0  # [g] beyond any sensor; clipping lower would bend the mean of shaking
LONGEST_STEP = 0.1  # [s]


@dataclass(frozen=True, slots=True)
class DcmParams(AttitudeParams):
    """`paper` keeps the published behaviour, `tuned` is for robots that drive and shake."""

    gains: Annotated[Literal["paper", "tuned"], "1"] = "tuned"


@dataclass(slots=True)
class DcmState:
    """Everything between two samples."""

    rows: tuple[Vector, Vector, Vector] | None = None  # R, body to world
    integral: Vector = (0.0, 0.0, 0.0)  # I part of the correction [rad/s], body axes
    proportional: Vector = (0.0, 0.0, 0.0)  # P part of the correction [rad/s], body axes
    compass: float | None = None  # yaw by compass [rad], held
    field_norm: float = 0.0  # usual strength [T]
    field_wait: float = 0.0  # since the last compass heading [s]
    field_weight: float = 0.0
    disturbed: bool = False
    heading_variance: float = UNKNOWN_HEADING * UNKNOWN_HEADING


def yaw_from_heading(heading: float) -> float:
    """Yaw [rad] (from east, counter-clockwise) of a heading [rad] (from north, clockwise)."""
    return wrap_angle(0.5 * pi - heading)


def flu_from_frd(v: Vector) -> Vector:
    """A vector given in forward-right-down axes, in forward-left-up axes (and the reverse)."""
    return (v[0], -v[1], -v[2])


def tilt_compensated_yaw(rows: Matrix, field: Vector, declination: float) -> float:
    """Yaw [rad] by compass on a slope, from roll and pitch of the matrix and the field in FLU."""
    r31, r32, r33 = rows[2]  # (5): sin pitch = -r31, tan roll = r32 / r33
    cos_pitch = sqrt(r32 * r32 + r33 * r33)
    if cos_pitch > 0.0:
        sin_roll, cos_roll = r32 / cos_pitch, r33 / cos_pitch
    else:
        sin_roll, cos_roll = 0.0, 1.0
    mx, my, mz = field
    # Both lines read the same in FRD and FLU: m.y, m.z and pitch change sign together.
    mag_x = mx * cos_pitch - my * sin_roll * r31 - mz * cos_roll * r31  # (20)
    mag_y = my * cos_roll - mz * sin_roll  # (21)
    return wrap_angle(0.5 * pi - declination - atan2(mag_y, mag_x))


class Dcm(Attitude):
    """The paper's method; see the caption of this module."""

    Params = DcmParams
    State = DcmState
    finds_bias = True
    params: DcmParams
    _state: DcmState

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
        gains = GAINS[self.params.gains]
        s.field_wait += dt
        if dt > HOLE:  # the body may have turned unseen: gravity and north anew
            s.rows = s.compass = None
            s.heading_variance = aged_variance(s.heading_variance, dt, DRIFT)
        if s.rows is None:
            rows = to_matrix(tilt_of(linear_acceleration))
        else:
            rows = _turned(s, s.rows, angular_velocity, dt, gains.largest_turn)
            s.heading_variance = aged_variance(s.heading_variance, dt, DRIFT)
        if magnetic_field is not None and hypot(*magnetic_field) > FAINTEST_FIELD:
            rows = self._look_north(rows, magnetic_field, gains)
        s.rows = rows
        self._correct(dt, rows, linear_acceleration, gains)

    def _look_north(self, rows: Matrix, field: Vector, gains: Gains) -> Matrix:
        """Take a compass heading when one is due; the first one ever turns the matrix at once."""
        s = self._state
        mx, my, mz = field
        norm = sqrt(mx * mx + my * my + mz * mz)
        if s.compass is None:
            s.compass = tilt_compensated_yaw(rows, field, self.params.declination)
            s.field_norm, s.field_weight, s.field_wait = norm, 1.0, 0.0
            s.heading_variance = COMPASS_STD * COMPASS_STD
            turn = matrix_from_euler(0.0, 0.0, s.compass - atan2(rows[1][0], rows[0][0]))
            return compose(turn, rows)
        if s.field_wait < gains.compass_period:
            return rows
        s.compass = tilt_compensated_yaw(rows, field, self.params.declination)
        off = norm / s.field_norm - 1.0
        s.disturbed = abs(off) > DISTURBANCE
        s.field_weight = weight = max(0.0, 1.0 - gains.field_slope * abs(off))
        s.field_norm += min(1.0, s.field_wait / FIELD_TIME) * (norm - s.field_norm)
        gain = min(1.0, gains.yaw_p * weight * s.field_wait)
        s.heading_variance += gain * (COMPASS_STD * COMPASS_STD - s.heading_variance)
        s.field_wait = 0.0
        return rows

    def _correct(self, dt: float, rows: Matrix, force: Vector, gains: Gains) -> None:
        """Work out the PI correction of the angular velocity for the next step."""
        s = self._state
        (r11, _, _), (r21, _, _), (rx, ry, rz) = rows
        ax, ay, az = force[0] / GRAVITY, force[1] / GRAVITY, force[2] / GRAVITY
        size = sqrt(ax * ax + ay * ay + az * az)
        weight = max(0.0, 1.0 - gains.force_slope * abs(1.0 - size)) / max(
            1.0, size / LARGEST_FORCE
        )
        ex = weight * (ay * rz - az * ry)  # (16), z up: a x r_z
        ey = weight * (az * rx - ax * rz)
        ez = weight * (ax * ry - ay * rx)
        course = 0.0
        if s.compass is not None:
            course = s.field_weight * (r11 * sin(s.compass) - r21 * cos(s.compass))
        p, y = gains.tilt_p, gains.yaw_p * course
        s.proportional = (p * ex + y * rx, p * ey + y * ry, p * ez + y * rz)  # (17)
        i, j = gains.tilt_i * dt, gains.yaw_i * dt * course
        ix, iy, iz = s.integral
        ix, iy, iz = ix + i * ex + j * rx, iy + i * ey + j * ry, iz + i * ez + j * rz  # (17)
        size = sqrt(ix * ix + iy * iy + iz * iz)
        k = LARGEST_BIAS / size if size > LARGEST_BIAS else 1.0
        s.integral = (k * ix, k * iy, k * iz)

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        rows = self._state.rows
        return IDENTITY if rows is None else from_matrix(rows)

    @property
    def gyro_bias(self) -> Vector:
        """Gyro bias [rad/s]: what the integral part takes away."""
        ix, iy, iz = self._state.integral
        return (-ix, -iy, -iz)

    @property
    def heading_std(self) -> float:
        """Standard deviation of yaw [rad]."""
        return sqrt(self._state.heading_variance)

    @property
    def disturbed(self) -> bool:
        """True while the strength of the field is more than 15 % off what is usual here."""
        return self._state.disturbed


def _turned(s: DcmState, rows: Matrix, rate: Vector, dt: float, largest: float) -> Matrix:
    """One step of the gyro with the correction of the step before, orthonormal again."""
    (px, py, pz), (ix, iy, iz) = s.proportional, s.integral
    h = dt if dt < LONGEST_STEP else LONGEST_STEP  # a P part held over a gap would overshoot
    tx = (rate[0] + ix) * dt + px * h  # (18), (8)
    ty = (rate[1] + iy) * dt + py * h
    tz = (rate[2] + iz) * dt + pz * h
    (a, b, c), (d, e, f), _ = rows
    if tx * tx + ty * ty + tz * tz > largest * largest:
        rows = compose(rows, to_matrix(from_rotation_vector((tx, ty, tz))))
        (a, b, c), (d, e, f), _ = rows
    else:  # (9) and (19): R (I + [w dt]x), exact to first order; the third row follows from (12)
        a, b, c = a + b * tz - c * ty, b + c * tx - a * tz, c + a * ty - b * tx
        d, e, f = d + e * tz - f * ty, e + f * tx - d * tz, f + d * ty - e * tx
    half = 0.5 * (a * d + b * e + c * f)  # (10)
    a, b, c, d, e, f = (  # (11)
        a - half * d,
        b - half * e,
        c - half * f,
        d - half * a,
        e - half * b,
        f - half * c,
    )
    g, h, i = b * f - c * e, c * d - a * f, a * e - b * d  # (12)
    k = 0.5 * (3.0 - (a * a + b * b + c * c))  # (13)
    m = 0.5 * (3.0 - (d * d + e * e + f * f))  # (14)
    n = 0.5 * (3.0 - (g * g + h * h + i * i))  # (15)
    return ((k * a, k * b, k * c), (m * d, m * e, m * f), (n * g, n * h, n * i))
