"""Methods `compass` and `tilt_compass`: the heading of the magnetometer alone, without a gyro.

`compass` is SCUTTLE's ("Absolute Orientation and Magnetometer" rev 1.1): the robot stands level and
the two horizontal axes, each scaled between its smallest and largest reading, give the heading.
`tilt_compass` takes roll and pitch from the accelerometer first. Both tremble with every
disturbance; they are here to be compared with.
"""

from dataclasses import dataclass
from math import hypot
from typing import Annotated, Any, ClassVar

from lodeline.attitude.base import AttitudeParams
from lodeline.attitude.fix import FAINTEST_FIELD, north_yaw, tilt_of
from lodeline.attitude.strength import StrengthState, StrengthWatcher
from lodeline.calibration.minmax import MinMax
from lodeline.rotation import IDENTITY, Quaternion, Vector, from_euler, multiply, rotate

COMPASS_STD = 0.06  # [rad] one heading in a calm field

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class TiltCompassParams(AttitudeParams):
    """Nothing but the place."""


@dataclass(frozen=True, slots=True)
class CompassParams(AttitudeParams):
    """Smallest and largest reading of body x and y over a turn; (0, 0) where already calibrated."""

    field_low: Annotated[Pair, "T"] = (0.0, 0.0)
    field_high: Annotated[Pair, "T"] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.scales:
            MinMax(self.field_low, self.field_high)  # raises where an axis never turned

    @property
    def scales(self) -> bool:
        """True when extremes are given."""
        return self.field_low != (0.0, 0.0) or self.field_high != (0.0, 0.0)


@dataclass(slots=True)
class CompassState(StrengthState):
    """Everything between two samples; strength is that of the horizontal part."""

    tilt: Quaternion = IDENTITY
    yaw: float = 0.0


class TiltCompass(StrengthWatcher):
    """Roll and pitch by accelerometer, yaw by the magnetometer in the levelled axes."""

    Params: ClassVar[type[Any]] = TiltCompassParams
    State = CompassState
    params: AttitudeParams
    _state: CompassState

    def _start(self, rate: Vector, force: Vector) -> None:
        self._step(0.0, rate, force)

    def _step(self, dt: float, rate: Vector, force: Vector) -> None:  # noqa: ARG002
        self._state.tilt = tilt_of(force)

    def _horizontal(self, field: Vector) -> Vector | None:
        """The field in level axes, None where it points nowhere."""
        level = rotate(self._state.tilt, field)
        return level if hypot(level[0], level[1]) > FAINTEST_FIELD else None

    def _look(self, field: Vector) -> None:
        level = self._horizontal(field)
        if level is None:
            return
        s = self._state
        s.yaw = north_yaw(level, self.params.declination)
        s.strength = hypot(level[0], level[1])
        s.usual = s.usual or s.strength
        s.field_wait, s.heading_variance = 0.0, COMPASS_STD * COMPASS_STD

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        return multiply(from_euler(0.0, 0.0, self._state.yaw), self._state.tilt)


class Compass(TiltCompass):
    """A flat robot: roll and pitch are zero, yaw comes from body x and y of the field."""

    Params: ClassVar[type[Any]] = CompassParams
    params: CompassParams

    def _step(self, dt: float, rate: Vector, force: Vector) -> None:
        """Nothing to learn from gyro and accelerometer."""

    def _horizontal(self, field: Vector) -> Vector | None:
        p = self.params
        if not p.scales:
            return super()._horizontal(field)
        x, y = MinMax(p.field_low, p.field_high).scaled((field[0], field[1]))
        return (x, y, 0.0) if x != 0.0 or y != 0.0 else None
