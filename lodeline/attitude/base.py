"""What all attitude methods share: their face to the outside, and the order of things in a sample.

A method is fed one inertial sample after another, each with the time since the one before, and with
the magnetic field where a new magnetometer sample came along. It answers with a body to world
quaternion in ENU/FLU. Nothing here reads a clock: `dt` is an argument.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from math import sqrt
from typing import Annotated, Any, ClassVar, Self

from lodeline.attitude.doubt import NO_IDEA
from lodeline.rotation import Quaternion, Vector

GRAVITY = 9.80665
# No robot sensor measures more than this in SI units; it also keeps every product finite.
_LARGEST_SQUARE = 1e12


@dataclass(frozen=True, slots=True)
class AttitudeParams:
    """What every method knows about the place: the magnetic declination, added once."""

    declination: Annotated[float, "rad"] = 0.0  # magnetic north lies this far east of true north


@dataclass(slots=True)
class AttitudeState:
    """What every method remembers between two samples; flat, so that any file can hold it."""

    started: bool = False
    rate: Vector = (0.0, 0.0, 0.0)  # the last sample of the gyro
    field_wait: float = 0.0  # since the last field that was of use [s]
    heading_variance: float = NO_IDEA


class Attitude(ABC):
    """One method of finding the orientation of a body from gyro, accelerometer and magnetometer.

    A method supplies `_start`, `_step`, `_look` and `orientation`, and overrides what else it can
    tell.
    """

    Params: ClassVar[type[Any]]
    State: ClassVar[type[Any]]
    finds_bias: ClassVar[bool] = False  # whether gyro_bias is ever anything but zero

    def __init__(self, params: Any = None, state: Any = None) -> None:
        """Start with the given parameters (else the defaults), from a saved state if given."""
        self.params = self.Params() if params is None else params
        self._state = self.State() if state is None else replace(state)

    @property
    def state(self) -> Any:
        """A copy of everything remembered between two updates, to be saved or handed over."""
        return replace(self._state)

    def resume(self, state: Any) -> Self:
        """Go on from a state handed over by an instance with the same parameters."""
        self._state = replace(state)
        return self

    def update(
        self,
        dt: float,
        angular_velocity: Vector,
        linear_acceleration: Vector,
        magnetic_field: Vector | None = None,
    ) -> None:
        """Take in one sample.

        `dt` [s] since the sample before (of no account in the first), body rates [rad/s], specific
        force [m/s^2] (+9.81 on z at rest) and the field [T], None without a new magnetometer
        sample. Raises ValueError, with the state untouched, when dt is negative or a number is not
        finite or absurdly large.
        """
        check_sample(dt, angular_velocity, linear_acceleration, magnetic_field)
        state: AttitudeState = self._state
        if state.started:
            self._step(dt, angular_velocity, linear_acceleration)
        else:
            state.started = True
            self._start(angular_velocity, linear_acceleration)
        state.rate = angular_velocity
        state.field_wait += dt
        if magnetic_field is not None:
            self._look(magnetic_field)

    @abstractmethod
    def _start(self, rate: Vector, force: Vector) -> None:
        """The first sample."""

    @abstractmethod
    def _step(self, dt: float, rate: Vector, force: Vector) -> None:
        """Every later one; the gyro sample before it is still in the state."""

    @abstractmethod
    def _look(self, field: Vector) -> None:
        """A magnetic field [T], right after the sample it came with; of use: `field_wait` ends."""

    @property
    @abstractmethod
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w); the identity before the first sample."""

    @property
    def gyro_bias(self) -> Vector:
        """What the gyro is believed to read at rest [rad/s], body axes; zero if nobody looks."""
        return (0.0, 0.0, 0.0)

    def unbiased(self, angular_velocity: Vector) -> Vector:
        """Body rates [rad/s] less the bias believed now."""
        (wx, wy, wz), (bx, by, bz) = angular_velocity, self.gyro_bias
        return (wx - bx, wy - by, wz - bz)

    @property
    def heading_std(self) -> float:
        """Standard deviation of the yaw [rad]; pi / sqrt(3) as long as north was never seen."""
        variance: float = self._state.heading_variance
        return sqrt(variance)

    @property
    def disturbed(self) -> bool:
        """True while the magnetic field is not the earth's, as far as the method can tell."""
        return False


def positive(**values: float) -> None:
    """Raise ValueError, naming the parameter, unless all values are above zero."""
    for name, value in values.items():
        if not value > 0.0:
            raise ValueError(f"{name} must be above zero, got {value}")


def check_sample(dt: float, w: Vector, a: Vector, m: Vector | None) -> None:
    """Raise ValueError unless dt >= 0 and all numbers are finite and below 1e6 (SI)."""
    wx, wy, wz = w
    ax, ay, az = a
    total = dt * dt + wx * wx + wy * wy + wz * wz + ax * ax + ay * ay + az * az
    if m is not None:
        mx, my, mz = m
        total += mx * mx + my * my + mz * mz
    if not (dt >= 0.0 and total < _LARGEST_SQUARE):  # also false for NaN
        raise ValueError(
            f"not a measurement: dt {dt}, angular velocity {w}, acceleration {a}, field {m}"
        )
