"""Rest, noticed from calm sensors, and what the gyro then says about its own bias."""

from dataclasses import dataclass
from math import atan2, hypot, sqrt
from typing import Annotated

from lodeline.attitude.base import positive
from lodeline.attitude.field import FieldParams
from lodeline.attitude.iron import IronState
from lodeline.rotation import Vector

BIAS_AT_REST = 0.0005  # [rad/s] one look at the bias, averaged over REST_MEAN_TIME
REST_MEAN_TIME = 0.5  # [s]
LARGEST_BIAS = 0.1  # [rad/s] a steadier turn than this is no rest
FRESH = 1.0  # [s] an older field tells nothing about now
CLEAR_TURN = 0.3  # [rad] that a compass tells from standing still


@dataclass(frozen=True, slots=True)
class RestParams(FieldParams):
    """How calm a sensor at rest is, and how late its stamps are."""

    # What the stamp is late by: the delay of the chip's own low-pass (MPU-9250 at 92 Hz: 3.9 ms).
    latency: Annotated[float, "s"] = 0.004
    rest_rate: Annotated[float, "rad/s"] = 0.035
    rest_acceleration: Annotated[float, "m/s^2"] = 0.5
    rest_time: Annotated[float, "s"] = 1.5

    def __post_init__(self) -> None:
        FieldParams.__post_init__(self)
        positive(rest_rate=self.rest_rate, rest_acceleration=self.rest_acceleration)


@dataclass(slots=True)
class RestState(IronState):
    """Short means of the sensors, and since when they have been calm."""

    mean_rate: Vector = (0.0, 0.0, 0.0)
    mean_force: Vector = (0.0, 0.0, 0.0)
    still: float = 0.0  # how long it has rested [s]
    seen: Vector = (0.0, 0.0, 0.0)  # the last field, body axes [T]
    still_seen: Vector = (0.0, 0.0, 0.0)  # the field when rest began, and how far since then a
    still_turn: float = 0.0  # rate turned that is either bias or a slow turn [rad]


def resting(s: RestState, p: RestParams, dt: float, w: Vector, a: Vector) -> bool:
    """True once a sample and those before it have been calm for `rest_time`."""
    wx, wy, wz = w
    ax, ay, az = a
    mwx, mwy, mwz = s.mean_rate
    fx, fy, fz = s.mean_force
    share = dt / (REST_MEAN_TIME + dt)
    dwx, dwy, dwz = wx - mwx, wy - mwy, wz - mwz
    dax, day, daz = ax - fx, ay - fy, az - fz
    s.mean_rate = mwx, mwy, mwz = mwx + share * dwx, mwy + share * dwy, mwz + share * dwz
    s.mean_force = (fx + share * dax, fy + share * day, fz + share * daz)
    if (
        dwx * dwx + dwy * dwy + dwz * dwz > p.rest_rate * p.rest_rate
        or dax * dax + day * day + daz * daz > p.rest_acceleration * p.rest_acceleration
        or mwx * mwx + mwy * mwy + mwz * mwz > LARGEST_BIAS * LARGEST_BIAS
    ):
        s.still = 0.0
        return False
    if s.still == 0.0:
        s.still_seen, s.still_turn = s.seen, 0.0
    s.still += dt
    return s.still >= p.rest_time


def surprise(s: RestState, dt: float, bias: Vector, variance: float) -> float | None:
    """Variance [(rad/s)^2] by which the rate at rest exceeds a bias of `variance`; None: no rest.

    What looks like rest may be a smooth arc driven at a steady rate: only about the vertical can a
    body turn for long without the accelerometer noticing. A rate there that the bias known so far
    does not explain is believed to be bias only when the field stood still in the body meanwhile.
    """
    (wx, wy, wz), (bx, by, bz), (fx, fy, fz) = s.mean_rate, bias, s.mean_force
    force = sqrt(fx * fx + fy * fy + fz * fz)
    if force == 0.0:
        return None
    rate = ((wx - bx) * fx + (wy - by) * fy + (wz - bz) * fz) / force
    if rate * rate < 16.0 * (variance + BIAS_AT_REST * BIAS_AT_REST):
        return 0.0
    s.still_turn += rate * dt
    unseen = s.field_age < 0.0 or s.field_wait > FRESH
    if unseen or abs(s.still_turn) < CLEAR_TURN:
        return None
    turned = _angle_about(s.mean_force, s.still_seen, s.seen)
    s.still_seen, s.still_turn = s.seen, 0.0
    return rate * rate if abs(turned) < 0.5 * CLEAR_TURN else None


def _angle_about(axis: Vector, a: Vector, b: Vector) -> float:
    """Angle [rad] from a to b about an axis of any length but zero; 0 where they lie on it."""
    (x, y, z), (ax, ay, az), (bx, by, bz) = axis, a, b
    norm = hypot(x, y, z)
    x, y, z = x / norm, y / norm, z / norm
    along = (ax * x + ay * y + az * z) * (bx * x + by * y + bz * z)
    cross = x * (ay * bz - az * by) + y * (az * bx - ax * bz) + z * (ax * by - ay * bx)
    return atan2(cross, ax * bx + ay * by + az * bz - along)
