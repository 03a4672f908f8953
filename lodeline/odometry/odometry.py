"""Wheel odometry: cumulative counts of two wheels to a pose in `odom`, with covariances."""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Literal, NamedTuple

from lodeline.odometry.counter import count_difference
from lodeline.odometry.kinematics import DifferentialDrive, Matrix2
from lodeline.rotation import wrap_angle

Covariance3 = tuple[float, float, float, float, float, float, float, float, float]
"""Covariance of (x, y, yaw), row-major."""

STILL: Matrix2 = (0.0, 0.0, 0.0, 0.0)
CERTAIN: Covariance3 = (0.0,) * 9
RESTART_TICKS = 2  # a robot that really comes back to (0, 0) gets there by fewer counts than this
RESTART_WAY = 0.002  # m: a robot at its start trembles about zero


@dataclass(frozen=True, slots=True)
class OdometryParams:
    """The drive (see `DifferentialDrive`), the integration and the one noise parameter.

    `wheel_noise: distance` lets the variance of a wheel's way grow with the way itself
    (`distance_noise` * |d|), so a parked robot gets no less sure and any rate gives the same
    growth. `rate` is the lab's form: each wheel rate has the variance `rate_noise`^2 per step.
    Raises ValueError for a parameter that makes no sense.
    """

    wheel_radius: Annotated[float, "m"] = 0.0215
    track: Annotated[float, "m"] = 0.112
    ticks_per_turn: Annotated[float, "1"] = 360.0
    gear: Annotated[float, "1"] = 1.0
    left_sign: Annotated[int, "1"] = 1
    right_sign: Annotated[int, "1"] = 1
    counter_bits: Annotated[int | None, "bit"] = None
    method: Literal["midpoint", "euler"] = "midpoint"
    wheel_noise: Literal["distance", "rate"] = "distance"
    distance_noise: Annotated[float, "m"] = 3e-4
    rate_noise: Annotated[float, "rad/s"] = 0.1
    max_wheel_speed: Annotated[float, "m/s"] = 2.0

    def __post_init__(self) -> None:
        if not self.max_wheel_speed > 0.0:
            raise ValueError(f"max_wheel_speed must be positive, not {self.max_wheel_speed} m/s")
        if min(self.distance_noise, self.rate_noise) < 0.0:
            raise ValueError("distance_noise and rate_noise must not be negative")
        count_difference(0, 0, self.counter_bits)
        _ = self.drive

    @property
    def drive(self) -> DifferentialDrive:
        """The drive these parameters describe. Raises ValueError if it makes no sense."""
        return DifferentialDrive(
            self.wheel_radius,
            self.track,
            self.ticks_per_turn,
            self.gear,
            self.left_sign,
            self.right_sign,
        )


@dataclass(slots=True)
class OdometryState:
    """All that odometry remembers; never changed once it is made: a frozen one costs seven times
    as much to make. `stamp_ns` None: no reference reading yet.
    """

    stamp_ns: int | None = None
    left: int = 0
    right: int = 0
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    v: float = 0.0
    w: float = 0.0
    covariance: Covariance3 = CERTAIN
    resets: int = 0
    refused: int = 0


class OdometryEstimate(NamedTuple):
    """Pose in `odom` [m, rad] and mean twist [m/s, rad/s] over `interval` [s].

    `interval` is 0 where no way was measured: at the first reading and at a new reference,
    which `resets` counts (the way in between is unknown; the pose is kept).
    """

    stamp_ns: int
    x: float
    y: float
    yaw: float
    covariance: Covariance3
    v: float
    w: float
    twist_covariance: Matrix2
    interval: float
    resets: int


class Odometry:
    """Integrates cumulative counts; a lost sample costs resolution, not way."""

    def __init__(self, params: OdometryParams) -> None:
        self._params = params
        self._drive = params.drive
        self.state = OdometryState()

    def resume(self, state: OdometryState) -> None:
        """Goes on from a saved state: the way since then is in the next counts."""
        self.state = state

    def update(self, stamp_ns: int, left: int, right: int) -> OdometryEstimate | None:
        """Takes the counts (cumulative) read at `stamp_ns`; None if time does not advance."""
        state = self.state
        if state.stamp_ns is None:
            return self._reference(stamp_ns, left, right, state.resets)
        if stamp_ns <= state.stamp_ns:
            self.state = replace(state, refused=state.refused + 1)
            return None
        dt = (stamp_ns - state.stamp_ns) * 1e-9
        bits = self._params.counter_bits
        counts = (
            count_difference(left, state.left, bits),
            count_difference(right, state.right, bits),
        )
        ways = self._drive.travel(*counts)
        if self._jumped(ways, dt) or (left == right == 0 and self._restarted(counts, ways, dt)):
            return self._reference(stamp_ns, left, right, state.resets + 1)
        return self._integrate(stamp_ns, left, right, ways, dt)

    def _jumped(self, ways: tuple[float, float], dt: float) -> bool:
        # two counts of slack: at a high sample rate one count is already faster than any wheel
        limit = self._params.max_wheel_speed * dt + 2.0 * self._drive.metres_per_tick
        return max(abs(ways[0]), abs(ways[1])) > limit

    def _restarted(self, counts: tuple[int, int], ways: tuple[float, float], dt: float) -> bool:
        """Both counters read exactly zero: a restart, unless the wheels were on their way there."""
        speeds = self._drive.wheels(self.state.v, self.state.w)
        return any(
            abs(count) > RESTART_TICKS
            and abs(way) > RESTART_WAY
            and (way * speed <= 0.0 or abs(way) > 2.0 * abs(speed) * dt)
            for count, way, speed in zip(counts, ways, speeds, strict=True)
        )

    def _reference(self, stamp_ns: int, left: int, right: int, resets: int) -> OdometryEstimate:
        self.state = replace(
            self.state, stamp_ns=stamp_ns, left=left, right=right, v=0.0, w=0.0, resets=resets
        )
        return self._estimate(STILL, 0.0)

    def _integrate(
        self, stamp_ns: int, left: int, right: int, ways: tuple[float, float], dt: float
    ) -> OdometryEstimate:
        state = self.state
        ds, dtheta = self._drive.motion(*ways)
        midpoint = self._params.method == "midpoint"
        course = state.yaw + 0.5 * dtheta if midpoint else state.yaw
        dx, dy = ds * math.cos(course), ds * math.sin(course)
        twist_covariance = self._twist_covariance(ways, dt)
        self.state = OdometryState(
            stamp_ns,
            left,
            right,
            state.x + dx,
            state.y + dy,
            wrap_angle(state.yaw + dtheta),
            ds / dt,
            dtheta / dt,
            propagate(state.covariance, dx, dy, course, twist_covariance, dt, turning=midpoint),
            state.resets,
            state.refused,
        )
        return self._estimate(twist_covariance, dt)

    def _twist_covariance(self, ways: tuple[float, float], dt: float) -> Matrix2:
        if self._params.wheel_noise == "rate":
            variance = self._params.rate_noise**2
            return self._drive.twist_covariance(variance, variance)
        # variance of a way, over (r dt)^2: variance of the wheel's mean rate
        scale = self._params.distance_noise / (self._drive.wheel_radius * dt) ** 2
        return self._drive.twist_covariance(scale * abs(ways[0]), scale * abs(ways[1]))

    def _estimate(self, twist_covariance: Matrix2, interval: float) -> OdometryEstimate:
        state = self.state
        assert state.stamp_ns is not None
        return OdometryEstimate(
            state.stamp_ns,
            state.x,
            state.y,
            state.yaw,
            state.covariance,
            state.v,
            state.w,
            twist_covariance,
            interval,
            state.resets,
        )


def propagate(
    p: Covariance3,
    dx: float,
    dy: float,
    course: float,
    twist_covariance: Matrix2,
    dt: float,
    *,
    turning: bool,
) -> Covariance3:
    """A P A^T + B Q B^T for a step (dx, dy) [m] in the world along `course` [rad].

    Q is `twist_covariance` over `dt` [s]; `turning` says that the course has half the turn in
    it (midpoint), so that a turning error bends the step too.
    """
    p00, p01, p02, _, p11, p12, _, _, p22 = p
    # A = [[1, 0, -dy], [0, 1, dx], [0, 0, 1]]
    a00 = p00 - 2.0 * dy * p02 + dy * dy * p22
    a01 = p01 + dx * p02 - dy * p12 - dx * dy * p22
    a11 = p11 + 2.0 * dx * p12 + dx * dx * p22
    a02, a12 = p02 - dy * p22, p12 + dx * p22
    vv, _, vw, ww = twist_covariance
    q00, q01, q11 = vv * dt * dt, vw * dt * dt, ww * dt * dt
    # B = [[c, bx], [s, by], [0, 1]]
    c, s = math.cos(course), math.sin(course)
    bx, by = (-0.5 * dy, 0.5 * dx) if turning else (0.0, 0.0)
    a00 += c * c * q00 + 2.0 * c * bx * q01 + bx * bx * q11
    a01 += c * s * q00 + (c * by + s * bx) * q01 + bx * by * q11
    a11 += s * s * q00 + 2.0 * s * by * q01 + by * by * q11
    a02 += c * q01 + bx * q11
    a12 += s * q01 + by * q11
    a22 = p22 + q11
    return a00, a01, a02, a01, a11, a12, a02, a12, a22
