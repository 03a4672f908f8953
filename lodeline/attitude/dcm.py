"""Method `dcm`: the direction cosine matrix with PI correction and a tilt-compensated compass.

Source: Herman et al., "Implementation of Direction Cosine Matrix on a PSoC-5 Microcontroller for
Robot Localization on Inclined Terrains"; equation numbers are that paper's. Gravity as measured
points along +z at rest.

Where the print is wrong, the line follows the mathematics: (7) is a cross product; (9), missing, is
R (I + [w dt]x), and (19) is the same; (13)-(15) are scalar times row; (16) with measured gravity
would be positive feedback, so the error is a x r_z; and the matrix starts from gravity and north,
not from zero. The gains that the paper inherits are Pololu's for the MinIMU-9.
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, sin, sqrt
from typing import Annotated, Literal, NamedTuple

from lodeline.attitude.base import GRAVITY, AttitudeParams
from lodeline.attitude.cosines import tilt_compensated_yaw, turned_matrix
from lodeline.attitude.doubt import HOLE, aged_variance
from lodeline.attitude.fix import FAINTEST_FIELD, tilt_of
from lodeline.attitude.strength import StrengthState, StrengthWatcher
from lodeline.rotation import (
    IDENTITY,
    Matrix,
    Quaternion,
    Vector,
    compose,
    from_matrix,
    matrix_from_euler,
    to_matrix,
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
LARGEST_BIAS = 1.0  # [rad/s] no gyro is as bad; keeps the integral from winding up without end
LARGEST_FORCE = 20.0  # [g] beyond any sensor; clipping lower would bend the mean of shaking
LONGEST_STEP = 0.1  # [s] a P part held over a gap would overshoot


@dataclass(frozen=True, slots=True)
class DcmParams(AttitudeParams):
    """`paper` keeps the published behaviour, `tuned` is for robots that drive and shake."""

    gains: Annotated[Literal["paper", "tuned"], "1"] = "tuned"


@dataclass(slots=True)
class DcmState(StrengthState):
    """Everything between two samples."""

    rows: Matrix | None = None  # R, body to world
    integral: Vector = (0.0, 0.0, 0.0)  # I part of the correction [rad/s], body axes
    force: Vector = (0.0, 0.0, 0.0)  # the last sample of the accelerometer [m/s^2]
    compass: float | None = None  # yaw by compass [rad], held
    field_weight: float = 0.0


class Dcm(StrengthWatcher):
    """The paper's method; see the caption of this module."""

    Params = DcmParams
    State = DcmState
    finds_bias = True
    params: DcmParams
    _state: DcmState

    def _start(self, rate: Vector, force: Vector) -> None:  # noqa: ARG002
        self._state.rows, self._state.force = to_matrix(tilt_of(force)), force

    def _step(self, dt: float, rate: Vector, force: Vector) -> None:
        s, gains = self._state, GAINS[self.params.gains]
        s.heading_variance = aged_variance(s.heading_variance, dt, DRIFT)
        if s.rows is None or dt > HOLE:  # the body may have turned unseen: gravity and north anew
            level = to_matrix(tilt_of(force))
            # Until north is seen again, the yaw from before is the best there is.
            s.rows = level if s.rows is None else compose(_about_z(_yaw(s.rows)), level)
            s.compass = None
        else:
            px, py, pz = _correction(s, s.rows, dt, gains)
            ix, iy, iz = s.integral
            h = min(dt, LONGEST_STEP)
            turn = (  # (8) with the rate of (18)
                (rate[0] + ix) * dt + px * h,
                (rate[1] + iy) * dt + py * h,
                (rate[2] + iz) * dt + pz * h,
            )
            s.rows = turned_matrix(s.rows, turn, gains.largest_turn)
        s.force = force

    def _look(self, field: Vector) -> None:
        """Take a compass heading when one is due; the first one ever turns the matrix at once."""
        s, gains = self._state, GAINS[self.params.gains]
        norm = hypot(*field)
        if norm <= FAINTEST_FIELD or s.rows is None:
            return
        if s.compass is None:
            s.compass = tilt_compensated_yaw(s.rows, field, self.params.declination)
            s.usual = s.strength = norm
            s.field_weight, s.heading_variance = 1.0, COMPASS_STD * COMPASS_STD
            s.rows = compose(_about_z(s.compass - _yaw(s.rows)), s.rows)
        elif s.field_wait < gains.compass_period:
            return
        else:
            s.compass = tilt_compensated_yaw(s.rows, field, self.params.declination)
            s.strength = norm
            off = norm / s.usual - 1.0
            s.field_weight = weight = max(0.0, 1.0 - gains.field_slope * abs(off))
            s.usual += min(1.0, s.field_wait / FIELD_TIME) * (norm - s.usual)
            gain = min(1.0, gains.yaw_p * weight * s.field_wait)
            s.heading_variance += gain * (COMPASS_STD * COMPASS_STD - s.heading_variance)
        s.field_wait = 0.0

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


def _yaw(rows: Matrix) -> float:
    return atan2(rows[1][0], rows[0][0])


def _about_z(angle: float) -> Matrix:
    return matrix_from_euler(0.0, 0.0, angle)


def _correction(s: DcmState, rows: Matrix, dt: float, gains: Gains) -> Vector:
    """P part of the correction [rad/s] by the sample before, body axes; the I part is added up.

    (16) as printed, r_z x g, would turn away from a gravity that is measured (+1 g on z at rest).
    """
    (r11, _, _), (r21, _, _), (rx, ry, rz) = rows
    ax, ay, az = s.force[0] / GRAVITY, s.force[1] / GRAVITY, s.force[2] / GRAVITY
    size = sqrt(ax * ax + ay * ay + az * az)
    weight = max(0.0, 1.0 - gains.force_slope * abs(1.0 - size))
    if size > LARGEST_FORCE:
        weight *= LARGEST_FORCE / size
    ex = weight * (ay * rz - az * ry)  # (16), z up: a x r_z
    ey = weight * (az * rx - ax * rz)
    ez = weight * (ax * ry - ay * rx)
    course = 0.0
    if s.compass is not None:
        course = s.field_weight * (r11 * sin(s.compass) - r21 * cos(s.compass))
    p, y = gains.tilt_p, gains.yaw_p * course
    i, j = gains.tilt_i * dt, gains.yaw_i * dt * course
    ix, iy, iz = s.integral
    ix, iy, iz = ix + i * ex + j * rx, iy + i * ey + j * ry, iz + i * ez + j * rz  # (17)
    size = sqrt(ix * ix + iy * iy + iz * iz)
    k = LARGEST_BIAS / size if size > LARGEST_BIAS else 1.0
    s.integral = (k * ix, k * iy, k * iz)
    return (p * ex + y * rx, p * ey + y * ry, p * ez + y * rz)  # (17)
