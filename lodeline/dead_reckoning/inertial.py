"""Where a body went, by its gyro and accelerometer alone: gravity taken out, the rest integrated.

Source: "Micro Mechatronics (2nd)", lecture on self-localization by IMU, in its order: zero point
of the gyro at rest, roll/pitch/yaw by the complementary filter, acceleration turned into the world,
gravity compensated, integrated twice. Errors grow with the square of time: 0.05 m/s^2 is 2.5 m
after ten seconds. Zero-velocity updates set the speed back whenever the body seems to rest, which
helps whatever stops now and then; a body that glides on smoothly seems to rest as well.
"""

from dataclasses import asdict, dataclass, fields, replace
from math import cos, hypot, sin
from typing import Annotated

from lodeline.attitude.base import GRAVITY, check_sample, positive
from lodeline.attitude.complementary import Complementary, ComplementaryParams, ComplementaryState
from lodeline.attitude.doubt import HOLE, UNSEEN_RATE
from lodeline.rotation import Quaternion, Vector, rotate, yaw_of

LARGEST_ZERO = 0.35  # [rad/s] no gyro reads more at rest
YAW_DRIFT = 0.002  # [rad/s] that a zero point leaves
UNSEEN_PUSH = 0.5  # [m/s^2] that a robot may do meanwhile
TREMBLE = 0.05  # [m/s] of a speed known to be zero
MEAN_TIME = 0.1  # [s] of the mean that readings at rest stay close to
_ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class DeadReckoningParams:
    """The complementary filter, the rest at the start, and what counts as rest later."""

    tau: Annotated[float, "s"] = 9.99  # K = 0.999 at 100 Hz
    zero_time: Annotated[float, "s"] = 1.0  # rest at the start, for the zero point; 0: none
    zero_velocity: Annotated[bool, "1"] = True
    rest_rate: Annotated[float, "rad/s"] = 0.05
    rest_acceleration: Annotated[float, "m/s^2"] = 0.2
    rest_time: Annotated[float, "s"] = 0.5
    acceleration_error: Annotated[float, "m/s^2"] = 0.05  # that no calibration took out

    def __post_init__(self) -> None:
        positive(
            tau=self.tau,
            rest_rate=self.rest_rate,
            rest_acceleration=self.rest_acceleration,
            rest_time=self.rest_time,
            acceleration_error=self.acceleration_error,
        )
        if self.zero_time < 0.0:
            raise ValueError(f"zero_time must not be negative, got {self.zero_time}")


@dataclass(slots=True)
class DeadReckoningState(ComplementaryState):
    """Everything between two samples; `zeroing` [s] is what is left of the rest at the start."""

    zeroing: float | None = None
    samples: int = 0
    sum_rate: Vector = _ZERO
    sum_force: Vector = _ZERO
    zero: Vector = _ZERO  # of the gyro [rad/s]
    gravity: float = GRAVITY  # as this accelerometer reads it [m/s^2]
    position: Vector = _ZERO
    velocity: Vector = _ZERO  # world
    acceleration: Vector = _ZERO  # world, without gravity
    yaw_rate: float = 0.0
    mean_force: Vector = _ZERO
    still: float = 0.0  # how long it has rested [s]
    position_std: float = 0.0
    velocity_std: float = 0.0
    yaw_std: float = 0.0


@dataclass(frozen=True, slots=True)
class DeadReckoningEstimate:
    """Pose [m, rad] and twist [m/s, rad/s] of the body, and their standard deviations."""

    x: float
    y: float
    yaw: float
    v: float
    w: float
    pose_covariance: tuple[float, float, float, float, float, float, float, float, float]
    twist_covariance: tuple[float, float, float, float]
    orientation: Quaternion


class DeadReckoning:
    """See the caption of this module."""

    def __init__(self, params: DeadReckoningParams) -> None:
        self.params = params
        self._state = DeadReckoningState()
        self._attitude = Complementary(ComplementaryParams(tau=params.tau))

    @property
    def state(self) -> DeadReckoningState:
        """A copy of everything remembered between two updates."""
        return replace(self._state, **asdict(self._attitude.state))

    def resume(self, state: DeadReckoningState) -> None:
        """Go on from a saved state."""
        self._state = replace(state)
        inner = {item.name: getattr(state, item.name) for item in fields(ComplementaryState)}
        self._attitude.resume(ComplementaryState(**inner))

    def update(self, dt: float, angular_velocity: Vector, linear_acceleration: Vector) -> None:
        """Take in one sample: `dt` [s] since the one before, body rates [rad/s] and specific
        force [m/s^2]. ValueError, with nothing changed, where a number is no measurement.
        """
        check_sample(dt, angular_velocity, linear_acceleration, None)
        s = self._state
        if s.zeroing is None:
            s.zeroing = self.params.zero_time
            s.mean_force = linear_acceleration
        self._notice_rest(dt, angular_velocity, linear_acceleration)
        if s.zeroing > 0.0:
            self._zero(dt, angular_velocity, linear_acceleration)
        else:
            self._integrate(dt, angular_velocity, linear_acceleration)

    def _zero(self, dt: float, w: Vector, a: Vector) -> None:
        """Gather the zero point; it ends with its time, or at once when the body moves."""
        s = self._state
        assert s.zeroing is not None
        moved = s.samples > 0 and s.still == 0.0
        s.zeroing = 0.0 if moved else max(0.0, s.zeroing - dt)
        if not moved:
            s.samples += 1
            s.sum_rate, s.sum_force = _sum(s.sum_rate, w), _sum(s.sum_force, a)
        force = _share(s.sum_force, s.samples)
        mean = _share(s.sum_rate, s.samples)
        if hypot(*mean) < LARGEST_ZERO:
            s.zero, s.gravity = mean, hypot(*force) or GRAVITY
        self._attitude = Complementary(self._attitude.params)
        self._attitude.update(0.0, _less(mean, s.zero), force)

    def _notice_rest(self, dt: float, w: Vector, a: Vector) -> None:
        s, p = self._state, self.params
        zero = s.zero if s.zeroing == 0.0 else _share(s.sum_rate, s.samples) if s.samples else w
        share = dt / (MEAN_TIME + dt)
        off = _less(a, s.mean_force)
        x, y, z = off
        s.mean_force = _sum(s.mean_force, (share * x, share * y, share * z))
        resting = hypot(*_less(w, zero)) < p.rest_rate and hypot(*off) < p.rest_acceleration
        if s.zeroing == 0.0:  # nor may it be on its way with a steady push
            x, y, z = rotate(self._attitude.orientation, s.mean_force)
            resting = resting and hypot(x, y, z - s.gravity) < p.rest_acceleration
        s.still = s.still + (dt or 1e-9) if resting else 0.0

    def _integrate(self, dt: float, w: Vector, a: Vector) -> None:
        s, p = self._state, self.params
        rate = _less(w, s.zero)
        self._attitude.update(dt, rate, a)
        if dt > HOLE:
            self._lose(dt)
            return
        q = self._attitude.orientation
        x, y, z = rotate(q, a)
        before, now = s.acceleration, (x, y, z - s.gravity)
        s.acceleration, s.yaw_rate = now, rotate(q, rate)[2]
        vx, vy, vz = s.velocity
        h = 0.5 * dt
        s.velocity = (
            vx + h * (before[0] + now[0]),
            vy + h * (before[1] + now[1]),
            vz + h * (before[2] + now[2]),
        )
        s.velocity_std += p.acceleration_error * dt
        s.yaw_std += YAW_DRIFT * dt
        if p.zero_velocity and s.still >= p.rest_time:
            s.velocity, s.velocity_std = _ZERO, TREMBLE
            return
        x, y, z = s.position
        s.position = (
            x + h * (vx + s.velocity[0]),
            y + h * (vy + s.velocity[1]),
            z + h * (vz + s.velocity[2]),
        )
        s.position_std += (s.velocity_std + hypot(*s.velocity) * s.yaw_std) * dt

    def _lose(self, dt: float) -> None:
        """Nobody knows what the body did in a hole of the samples: stay, and say how unsure."""
        s = self._state
        s.velocity_std += UNSEEN_PUSH * dt
        s.position_std += (s.velocity_std + hypot(*s.velocity)) * dt
        s.yaw_std += UNSEEN_RATE * dt
        s.acceleration = _ZERO

    @property
    def estimate(self) -> DeadReckoningEstimate:
        """Where the body is by now."""
        s = self._state
        yaw = yaw_of(self._attitude.orientation)
        (x, y, _), (vx, vy, _) = s.position, s.velocity
        place, turn, speed = s.position_std**2, s.yaw_std**2, s.velocity_std**2
        return DeadReckoningEstimate(
            x,
            y,
            yaw,
            vx * cos(yaw) + vy * sin(yaw),
            s.yaw_rate,
            (place, 0.0, 0.0, 0.0, place, 0.0, 0.0, 0.0, turn),
            (speed, 0.0, 0.0, YAW_DRIFT * YAW_DRIFT),
            self._attitude.orientation,
        )


def _sum(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _less(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _share(v: Vector, n: int) -> Vector:
    return (v[0] / n, v[1] / n, v[2] / n)
