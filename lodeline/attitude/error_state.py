"""What method `mekf` is told of the sensors, what it remembers, and how one number corrects it."""

from dataclasses import dataclass
from typing import Annotated

from lodeline.attitude.base import positive
from lodeline.attitude.covariance import CERTAIN, Covariance, Row, corrected
from lodeline.attitude.rest import RestParams, RestState
from lodeline.rotation import (
    IDENTITY,
    Quaternion,
    Vector,
    from_rotation_vector,
    multiply,
    normalized,
)

ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class MekfParams(RestParams):
    """Noise of the sensors; densities are per square root of a second."""

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
        RestParams.__post_init__(self)
        positive(
            gyro_noise=self.gyro_noise,
            accel_noise=self.accel_noise,
            push_time=self.push_time,
            compass_noise=self.compass_noise,
            compass_time=self.compass_time,
        )


@dataclass(slots=True)
class MekfState(RestState):
    """Everything between two samples."""

    attitude: Quaternion = IDENTITY  # body to world
    bias: Vector = ZERO
    covariance: Covariance = CERTAIN  # of d [rad] and e [rad/s]
    push_variance: float = 0.0  # of the specific force about gravity, as seen lately
    span: float = 0.0  # what is gathered for the next correction: time [s], sums and counts
    samples: int = 0
    fields: int = 0
    force: Vector = ZERO  # world axes
    field: Vector = ZERO


def correct(
    s: MekfState, row: Row, residual: float, variance: float, held: tuple[int, ...] = ()
) -> None:
    """Move attitude and bias by one scalar measurement of the errors d and e.

    `row` says of which of them (index, weight), `held` which ones it must not move.
    """
    s.covariance, (a, b, c, d, e, f) = corrected(s.covariance, row, variance, held)
    turn = from_rotation_vector((a * residual, b * residual, c * residual))
    s.attitude = normalized(multiply(turn, s.attitude))
    s.bias = plus(s.bias, (d * residual, e * residual, f * residual))


def plus(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def share(v: Vector, n: int) -> Vector:
    """The n-th part of a vector."""
    return (v[0] / n, v[1] / n, v[2] / n)
