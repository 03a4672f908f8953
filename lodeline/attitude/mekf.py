"""Method `mekf`: an error-state Kalman filter, in place of the PI loop as the DCM paper proposes.

State: a quaternion and the gyro bias; errors: a small world-frame rotation d and the bias error e,
with R_true = exp(d) R and b_true = b + e. In the world frame gravity and north look the same
whatever the attitude, so every measurement touches one error angle:

    d' = d - R e dt + noise           (gyro)
    up_x = -d_y, up_y = d_x           (specific force over g, levelled)
    off = d_z + d_y tan(dip)          (heading by compass less heading)
    rate = e                          (at rest)

The compass corrects heading and bias but not the tilt, so that a magnet cannot topple the robot.
Pushes of the body and errors of the compass last for a while: a measurement that says the same for
`time` seconds counts once in that time, not once per sample.
"""

from math import hypot, pi, sqrt

from lodeline.attitude.base import GRAVITY, Attitude
from lodeline.attitude.covariance import Covariance, diagonal, predicted, symmetric, widened
from lodeline.attitude.doubt import HOLE, NO_IDEA, UNKNOWN_HEADING, hole_variance
from lodeline.attitude.error_state import ZERO, MekfParams, MekfState, correct, plus, share
from lodeline.attitude.field import disturbed, weigh
from lodeline.attitude.fix import north_yaw, points_somewhere, tilt_of
from lodeline.attitude.iron import without_iron
from lodeline.attitude.rest import BIAS_AT_REST, REST_MEAN_TIME, resting, surprise
from lodeline.attitude.strapdown import ahead, turned
from lodeline.rotation import (
    Quaternion,
    Vector,
    from_euler,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    to_matrix,
)

PERIOD = 0.05  # [s] between corrections; the gyro is integrated at every sample
SCALE_TIME = 1.0  # [s] for which a body turns about the same axis


class Mekf(Attitude):
    """See the caption of this module."""

    Params = MekfParams
    State = MekfState
    finds_bias = True
    params: MekfParams
    _state: MekfState

    def _start(self, rate: Vector, force: Vector) -> None:
        s, p = self._state, self.params
        s.attitude, s.mean_rate, s.mean_force = tilt_of(force), rate, force
        tilt = (p.accel_noise**2 + p.push**2) / GRAVITY**2
        s.covariance = diagonal(tilt, NO_IDEA, p.bias_at_start**2)
        s.samples, s.force = 1, rotate(s.attitude, force)

    def _step(self, dt: float, rate: Vector, force: Vector) -> None:
        s = self._state
        turn = turned(s.rate, rate, s.bias, dt)
        s.attitude = normalized(multiply(s.attitude, from_rotation_vector(turn)))
        still = resting(s, self.params, dt, rate, force)
        if dt > HOLE:  # what was gathered before it belongs to another attitude
            s.samples = s.fields = 0
            s.force = s.field = ZERO
        s.span += dt
        s.samples += 1
        s.force = plus(s.force, rotate(s.attitude, force))
        if s.span >= PERIOD:
            self._fuse(still)

    def _look(self, field: Vector) -> None:
        s = self._state
        s.seen = field
        s.fields += 1
        s.field = plus(s.field, rotate(s.attitude, field))
        if s.field_age < 0.0 or s.field_wait > HOLE:  # the first one points there at once
            self._fuse(still=False)

    def _fuse(self, still: bool) -> None:
        """Let the covariance catch up, and correct by the mean force and field since last time."""
        s, p = self._state, self.params
        wx, wy, wz = s.rate
        scale = 2.0 * SCALE_TIME * p.gyro_scale * p.gyro_scale * (wx * wx + wy * wy + wz * wz)
        noise = (p.gyro_noise * p.gyro_noise + scale) * s.span + hole_variance(s.span)
        walk = p.bias_walk * p.bias_walk * s.span
        s.covariance = predicted(s.covariance, s.span, to_matrix(s.attitude), noise, walk)
        if s.samples > 0:
            self._level(s.span, share(s.force, s.samples))
        if still:
            self._learn_bias(s.span)
        if s.fields > 0:
            self._point_north(share(s.field, s.fields))
        s.span, s.samples, s.fields = 0.0, 0, 0
        s.force = s.field = ZERO

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
        correct(s, ((0, 1.0),), y / GRAVITY, variance)
        correct(s, ((1, 1.0),), -x / GRAVITY, variance)

    def _learn_bias(self, dt: float) -> None:
        """At rest the gyro shows its bias: one independent look per REST_MEAN_TIME."""
        s = self._state
        more = surprise(s, dt, s.bias, s.covariance[5][5])
        if more is None:
            return
        variance = BIAS_AT_REST * BIAS_AT_REST * max(1.0, REST_MEAN_TIME / dt)
        for axis in range(3):
            if more > 0.0:
                s.covariance = widened(s.covariance, 3 + axis, more)
            correct(s, ((3 + axis, 1.0),), s.mean_rate[axis] - s.bias[axis], variance)

    def _point_north(self, field: Vector) -> None:
        """Correct the heading by the compass, as far as its field (world axes) can be believed."""
        s, p = self._state, self.params
        field = without_iron(s, p, field, s.attitude, 0.5 * pi - p.declination)
        if not points_somewhere(field):
            return
        dt, first = s.field_wait, s.field_age < 0.0
        yaw = north_yaw(field, p.declination)  # what is missing in yaw
        doubt = weigh(s, p, field, 0.0 if first else yaw, s.covariance[2][2])
        steep = -field[2] / hypot(field[0], field[1])
        s.field_wait = 0.0
        if first:
            s.attitude = multiply(from_euler(0.0, 0.0, yaw), s.attitude)
            rows = [list(row) for row in s.covariance]
            # an error of tilt has gone into this heading: d_z = noise - steep d_y
            rows[2] = [-steep * v for v in rows[1]]
            for row in rows:
                row[2] = -steep * row[1]
            rows[2][2] += p.compass_noise**2 + p.compass_wander**2
            s.covariance = symmetric(rows)
            return
        if doubt > 0.0:
            s.covariance = widened(s.covariance, 2, doubt)
        count = max(1.0, 2.0 * p.compass_time / dt) if dt > 0.0 else 1e9
        variance = p.compass_noise * p.compass_noise + p.compass_wander * p.compass_wander * count
        correct(s, ((1, steep), (2, 1.0)), yaw, variance / max(s.weight, 1e-12), held=(0, 1))

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
        return disturbed(self._state)
