"""Methods `compass` and `tilt_compass`: the heading of the magnetometer alone, without a gyro.

`compass` is SCUTTLE's ("Absolute Orientation and Magnetometer" rev 1.1): the robot stands level and
the two horizontal axes, each scaled between its smallest and largest reading, give the heading.
`tilt_compass` takes roll and pitch from the accelerometer first. Both tremble with every
disturbance; they are here to be compared with.
"""

from dataclasses import dataclass
from math import hypot
from typing import Annotated, Any, ClassVar

from lodeline.attitude.base import (
    FAINTEST_FIELD,
    UNKNOWN_HEADING,
    Attitude,
    AttitudeParams,
    check_sample,
    north_yaw,
    tilt_of,
)
from lodeline.calibration.minmax import MinMax
from lodeline.rotation import IDENTITY, Quaternion, Vector, from_euler, multiply, rotate

COMPASS_STD = 0.06  # [rad] one heading in a calm field
DISTURBANCE = 0.15  # relative deviation of the horizontal strength that is no longer noise

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
class CompassState:
    """Everything between two samples."""

    tilt: Quaternion = IDENTITY
    yaw: float = 0.0
    usual: float = 0.0  # horizontal strength of the first field, 0 before it
    strength: float = 0.0  # of the last one


class TiltCompass(Attitude):
    """Roll and pitch by accelerometer, yaw by the magnetometer in the levelled axes."""

    Params: ClassVar[type[Any]] = TiltCompassParams
    flat: ClassVar[bool] = False
    State = CompassState
    params: AttitudeParams
    _state: CompassState

    def update(
        self,
        dt: float,
        angular_velocity: Vector,
        linear_acceleration: Vector,
        magnetic_field: Vector | None = None,
    ) -> None:
        """Take in one sample; see `Attitude.update`."""
        check_sample(dt, angular_velocity, linear_acceleration, magnetic_field)
        if not self.flat:
            self._state.tilt = tilt_of(linear_acceleration)
        if magnetic_field is not None:
            self._look(self._horizontal(magnetic_field))

    def _horizontal(self, field: Vector) -> Vector | None:
        level = rotate(self._state.tilt, field)
        return level if hypot(level[0], level[1]) > FAINTEST_FIELD else None

    def _look(self, level: Vector | None) -> None:
        if level is None:
            return
        s = self._state
        s.yaw = north_yaw(level, self.params.declination)
        s.strength = hypot(level[0], level[1])
        s.usual = s.usual or s.strength

    @property
    def orientation(self) -> Quaternion:
        """Body to world (x, y, z, w)."""
        return multiply(from_euler(0.0, 0.0, self._state.yaw), self._state.tilt)

    @property
    def gyro_bias(self) -> Vector:
        """Zero: the gyro is not looked at."""
        return (0.0, 0.0, 0.0)

    @property
    def heading_std(self) -> float:
        """Standard deviation of yaw [rad] in a calm field."""
        return COMPASS_STD if self._state.usual > 0.0 else UNKNOWN_HEADING

    @property
    def disturbed(self) -> bool:
        """True while the horizontal strength is more than 15 % off the first one."""
        s = self._state
        return abs(s.strength - s.usual) > DISTURBANCE * s.usual


class Compass(TiltCompass):
    """A flat robot: roll and pitch are zero, yaw comes from body x and y of the field."""

    Params: ClassVar[type[Any]] = CompassParams
    flat = True
    params: CompassParams

    def _horizontal(self, field: Vector) -> Vector | None:
        p = self.params
        if not p.scales:
            return super()._horizontal(field)
        x, y = MinMax(p.field_low, p.field_high).scaled((field[0], field[1]))
        return (x, y, 0.0) if x != 0.0 or y != 0.0 else None
