"""Method `mekf`: an error-state Kalman filter, in place of the PI loop as the DCM paper proposes.

State: a quaternion and the gyro bias; errors: a small world-frame rotation d and the bias error e,
with R_true = exp(d) R and b_true = b + e. In the world frame gravity and north look the same
whatever the attitude, so every measurement touches one error angle:

    d' = d - R e dt + noise           (gyro)
    up_x = -d_y, up_y = d_x           (specific force over g, levelled)
    off = d_z + d_y tan(dip)          (heading by compass less heading)

The compass corrects heading and bias but not the tilt, so that a magnet cannot topple the robot.
Pushes of the body and errors of the compass last for a while: a measurement that says the same for
`time` seconds counts once in that time, not once per sample.
"""

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Annotated

from lodeline.attitude.base import (
    FAINTEST_FIELD,
    GRAVITY,
    HOLE,
    UNKNOWN_HEADING,
    Attitude,
    ahead,
    check_sample,
    hole_variance,
    north_yaw,
    positive,
    tilt_of,
    turned,
)
from lodeline.attitude.field import HOPELESS, FieldParams, FieldState, weigh
from lodeline.rotation import (
    IDENTITY,
    Matrix,
    Quaternion,
    Vector,
    from_euler,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    to_matrix,
)

Six = tuple[float, float, float, float, float, float]
Covariance = tuple[Six, Six, Six, Six, Six, Six]
NOTHING: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


PERIOD = 0.05  # [s] between corrections; the gyro is integrated at every sample
SCALE_TIME = 1.0  # [s] for which a body turns about the same axis


@dataclass(frozen=True, slots=True)
class MekfParams(FieldParams):
    """Noise of the sensors; densities are per square root of a second."""

    # What the stamp is late by: the delay of the chip's own low-pass (MPU-9250 at 92 Hz: 3.9 ms).
    latency: Annotated[float, "s"] = 0.004
    gyro_noise: Annotated[float, "rad/s/sqrt(Hz)"] = 0.0005
    gyro_scale: Annotated[float, "1"] = 0.005  # error of scale and axes, times the rate
    bias_walk: Annotated[float, "rad/s/sqrt(s)"] = 0.00005
    bias_at_start: Annotated[float, "rad/s"] = 0.0087
    accel_noise: Annotated[float, "m/s^2"] = 0.05  # of one sample
    push: Annotated[float, "m/s^2"] = 0.3  # acceleration of the body, standard deviation
    push_time: Annotated[float, "s"] = 0.5  # for which a push lasts
    compass_noise: Annotated[float, "rad"] = 0.06  # of one heading
    compass_wander: Annotated[float, "rad"] = 0.06  # of the field from place to place
    compass_time: Annotated[float, "s"] = 5.0  # for which a deviation of the field lasts
    compass_offset: Annotated[float, "rad"] = 0.03  # that no averaging takes out

    def __post_init__(self) -> None:
        FieldParams.__post_init__(self)
        positive(
            gyro_noise=self.gyro_noise,
            accel_noise=self.accel_noise,
            push_time=self.push_time,
            compass_noise=self.compass_noise,
            compass_time=self.compass_time,
        )


@dataclass(slots=True)
class MekfState(FieldState):
    """Everything between two samples."""

    started: bool = False
    attitude: Quaternion = IDENTITY  # body to world
    bias: Vector = (0.0, 0.0, 0.0)
    rate: Vector = (0.0, 0.0, 0.0)
    # of d [rad] and e [rad/s]
    covariance: Covariance = (NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING)
    push_variance: float = 0.0  # of the specific force about gravity, as seen lately
    span: float = 0.0  # what is gathered for the next correction: time [s], sums and counts
    samples: int = 0
    fields: int = 0
    force: Vector = (0.0, 0.0, 0.0)  # world axes
    field: Vector = (0.0, 0.0, 0.0)
    field_wait: float = 0.0  # since the last correction by the compass [s]


class Mekf(Attitude):
    """See the caption of this module."""

    Params = MekfParams
    State = MekfState
    finds_bias = True
    params: MekfParams
    _state: MekfState

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
            turn = turned(s.rate, angular_velocity, s.bias, dt)
            s.attitude = normalized(multiply(s.attitude, from_rotation_vector(turn)))
        else:
            self._start(linear_acceleration)
        s.rate = angular_velocity
        if dt > HOLE:  # what was gathered before it belongs to another attitude
            s.samples = s.fields = 0
            s.force = s.field = (0.0, 0.0, 0.0)
        s.span += dt
        s.samples += 1
        s.force = _plus(s.force, rotate(s.attitude, linear_acceleration))
        if magnetic_field is not None:
            s.fields += 1
            s.field = _plus(s.field, rotate(s.attitude, magnetic_field))
        if s.span >= PERIOD or (s.fields > 0 and s.field_age < 0.0):
            self._fuse()

    def _fuse(self) -> None:
        """Let the covariance catch up, and correct by the mean force and field since last time."""
        s = self._state
        self._predict(s.span, to_matrix(s.attitude))
        self._level(s.span, _share(s.force, s.samples))
        s.field_wait += s.span
        if s.fields > 0:
            level = _share(s.field, s.fields)
            if hypot(level[0], level[1]) > FAINTEST_FIELD:
                self._point_north(s.field_wait, level)
                s.field_wait = 0.0
        s.span, s.samples, s.fields = 0.0, 0, 0
        s.force = s.field = (0.0, 0.0, 0.0)

    def _start(self, force: Vector) -> None:
        s, p = self._state, self.params
        s.started, s.attitude = True, tilt_of(force)
        tilt = (p.accel_noise**2 + p.push**2) / GRAVITY**2
        s.covariance = _diagonal(tilt, UNKNOWN_HEADING**2, p.bias_at_start**2)

    def _predict(self, dt: float, r: Matrix) -> None:
        """P = F P F' + Q with F = [[I, -R dt], [0, I]]."""
        s, p = self._state, self.params
        c = s.covariance
        rows = [list(row) for row in c]
        for i in range(3):  # F P: rows of d take up rows of e
            a, b, g = r[i][0] * dt, r[i][1] * dt, r[i][2] * dt
            rows[i] = [
                v - a * x - b * y - g * z for v, x, y, z in zip(c[i], c[3], c[4], c[5], strict=True)
            ]
        wx, wy, wz = s.rate
        scale = 2.0 * SCALE_TIME * p.gyro_scale * p.gyro_scale * (wx * wx + wy * wy + wz * wz)
        noise = (p.gyro_noise * p.gyro_noise + scale) * dt + hole_variance(dt)
        walk = p.bias_walk * p.bias_walk * dt
        for i, row in enumerate(rows):  # (F P) F': columns likewise
            x, y, z = row[3], row[4], row[5]
            for j in range(3):
                row[j] -= dt * (r[j][0] * x + r[j][1] * y + r[j][2] * z)
            row[i] += noise if i < 3 else walk
        s.covariance = _symmetric(rows)

    def _level(self, dt: float, force: Vector) -> None:
        """Correct the tilt by what the specific force (world axes) shows beside straight up."""
        s, p = self._state, self.params
        x, y, z = force
        # what the body does beyond gravity: as told, or as seen of late if that is more
        seen = (x * x + y * y + (z - GRAVITY) * (z - GRAVITY)) / 3.0
        s.push_variance += min(1.0, dt / (4.0 * p.push_time)) * (seen - s.push_variance)
        push = max(p.push * p.push, s.push_variance)
        count = max(1.0, 2.0 * p.push_time / dt) if dt > 0.0 else 1e9
        variance = (p.accel_noise * p.accel_noise + push * count) / (GRAVITY * GRAVITY)
        self._correct((1.0, 0.0, 0.0), y / GRAVITY, variance, (1.0, 1.0, 1.0))
        self._correct((0.0, 1.0, 0.0), -x / GRAVITY, variance, (1.0, 1.0, 1.0))

    def _point_north(self, dt: float, level: Vector) -> None:
        """Correct the heading by the compass, as far as its field can be believed."""
        s, p = self._state, self.params
        first = s.field_age < 0.0
        wx, wy, wz = s.rate
        yaw = north_yaw(level, p.declination)  # what is missing in yaw
        rate = sqrt(wx * wx + wy * wy + wz * wz)
        doubt = weigh(s, p, dt, level, rate, yaw, s.covariance[2][2])
        steep = -level[2] / hypot(level[0], level[1])
        if first:
            s.attitude = multiply(from_euler(0.0, 0.0, yaw), s.attitude)
            rows = [list(row) for row in s.covariance]
            # an error of tilt has gone into this heading: d_z = noise - steep d_y
            rows[2] = [-steep * v for v in rows[1]]
            for row in rows:
                row[2] = -steep * row[1]
            rows[2][2] += p.compass_noise**2 + p.compass_wander**2
            s.covariance = _symmetric(rows)
            return
        if doubt > 0.0:
            rows = [list(row) for row in s.covariance]
            rows[2][2] += doubt
            s.covariance = _symmetric(rows)
        count = max(1.0, 2.0 * p.compass_time / dt) if dt > 0.0 else 1e9
        variance = p.compass_noise * p.compass_noise + p.compass_wander * p.compass_wander * count
        variance /= max(s.weight, 1e-12)
        self._correct((0.0, steep, 1.0), yaw, variance, (0.0, 0.0, 1.0))

    def _correct(self, h: Vector, residual: float, variance: float, share: Vector) -> None:
        """One scalar measurement residual = h d + noise; `share` holds error angles back.

        With a gain other than the optimal one the covariance needs its long form,
        P - K (P h)' - (P h) K' + K S K'.
        """
        s = self._state
        c = s.covariance
        ph = [h[0] * row[0] + h[1] * row[1] + h[2] * row[2] for row in c]
        total = h[0] * ph[0] + h[1] * ph[1] + h[2] * ph[2] + variance
        gain = [v / total for v in ph]
        gain[0], gain[1], gain[2] = gain[0] * share[0], gain[1] * share[1], gain[2] * share[2]
        rows = [
            [v - k * pj - pi * kj + k * total * kj for v, pj, kj in zip(row, ph, gain, strict=True)]
            for row, k, pi in zip(c, gain, ph, strict=True)
        ]
        s.covariance = _symmetric(rows)
        d = from_rotation_vector((gain[0] * residual, gain[1] * residual, gain[2] * residual))
        s.attitude = normalized(multiply(d, s.attitude))
        bx, by, bz = s.bias
        s.bias = (bx + gain[3] * residual, by + gain[4] * residual, bz + gain[5] * residual)

    @property
    def covariance(self) -> Covariance:
        """Of the world-frame rotation error [rad] and the bias error [rad/s], 6x6."""
        return self._state.covariance

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        s = self._state
        return normalized(multiply(s.attitude, ahead(s.rate, s.bias, self.params.latency)))

    @property
    def gyro_bias(self) -> Vector:
        """Gyro bias [rad/s]."""
        return self._state.bias

    @property
    def heading_std(self) -> float:
        """Standard deviation of yaw [rad], with what the compass cannot see of its own offset."""
        s = self._state
        if s.field_age < 0.0:
            return UNKNOWN_HEADING
        total = s.covariance[2][2] + self.params.compass_offset * self.params.compass_offset
        return min(sqrt(total), UNKNOWN_HEADING)

    @property
    def disturbed(self) -> bool:
        """True while strength or dip of the field are those of another place, or of a magnet."""
        return self._state.field_age >= 0.0 and self._state.weight < HOPELESS


def _plus(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _share(v: Vector, n: int) -> Vector:
    return (v[0] / n, v[1] / n, v[2] / n)


def _diagonal(tilt: float, heading: float, bias: float) -> Covariance:
    variances = (tilt, tilt, heading, bias, bias, bias)
    return _symmetric([[v if i == j else 0.0 for j in range(6)] for i, v in enumerate(variances)])


def _symmetric(rows: list[list[float]]) -> Covariance:
    """Equal halves, and no angle less known than not at all (shrunk with its correlations)."""
    for i in range(3):
        if rows[i][i] > UNKNOWN_HEADING * UNKNOWN_HEADING:
            k = UNKNOWN_HEADING / sqrt(rows[i][i])
            for j in range(6):
                rows[i][j] *= k
                rows[j][i] *= k
    for i in range(6):
        for j in range(i):
            rows[i][j] = rows[j][i] = 0.5 * (rows[i][j] + rows[j][i])
    a, b, c, d, e, f = ((r[0], r[1], r[2], r[3], r[4], r[5]) for r in rows)
    return (a, b, c, d, e, f)
