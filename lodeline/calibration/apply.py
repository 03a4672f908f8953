"""Applying an IMU calibration: raw chip readings in, body readings out.

All corrections are in the axes of the chip, as measured on it; the mounting comes last and turns
chip axes into body axes (FLU). A magnetometer die that sits turned on the chip is put right by the
driver, before any of this.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Annotated

from lodeline.rotation import (
    Matrix,
    Vector,
    compose,
    determinant,
    matrix_from_euler,
)

# Relative to the lengths of its rows; a matrix below this loses a direction to noise.
SMALLEST_DETERMINANT = 1e-3

_Nine = tuple[float, float, float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class ImuCalibration:
    """What is known about one IMU on one robot; the defaults change nothing.

    Raises ValueError when a length is wrong, a number is not finite, an accelerometer scale is not
    positive or the soft iron matrix (rows one after the other) is singular.
    """

    gyro_zero: Annotated[Vector, "rad/s"] = (0.0, 0.0, 0.0)  # reading at rest
    accel_offset: Annotated[Vector, "m/s^2"] = (0.0, 0.0, 0.0)
    accel_scale: Annotated[Vector, "1"] = (1.0, 1.0, 1.0)
    mag_offset: Annotated[Vector, "T"] = (0.0, 0.0, 0.0)  # hard iron
    mag_matrix: Annotated[_Nine, "1"] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)  # soft iron
    mounting: Annotated[Vector, "rad"] = (0.0, 0.0, 0.0)  # roll, pitch, yaw of the chip in the body

    def __post_init__(self) -> None:
        for name, length in (
            ("gyro_zero", 3),
            ("accel_offset", 3),
            ("accel_scale", 3),
            ("mag_offset", 3),
            ("mag_matrix", 9),
            ("mounting", 3),
        ):
            values = getattr(self, name)
            if len(values) != length:
                raise ValueError(f"{name} must have {length} numbers, got {len(values)}")
            if not all(map(isfinite, values)):
                raise ValueError(f"{name} must be finite, got {values}")
        if min(self.accel_scale) <= 0.0:
            raise ValueError(f"accel_scale must be positive, got {self.accel_scale}")
        rows = _rows(self.mag_matrix)
        volume = 1.0
        for x, y, z in rows:
            volume *= (x * x + y * y + z * z) ** 0.5
        if not abs(determinant(rows)) > SMALLEST_DETERMINANT * volume:
            raise ValueError(f"mag_matrix is singular: {self.mag_matrix}")


class Calibrator:
    """Applies one calibration, sample by sample."""

    def __init__(self, calibration: ImuCalibration) -> None:
        self.calibration = calibration
        mounting = matrix_from_euler(*calibration.mounting)
        sx, sy, sz = calibration.accel_scale
        self._mounting = mounting
        self._gyro_zero, self._accel_offset = calibration.gyro_zero, calibration.accel_offset
        self._mag_offset = calibration.mag_offset
        self._accel = compose(mounting, ((sx, 0.0, 0.0), (0.0, sy, 0.0), (0.0, 0.0, sz)))
        self._mag = compose(mounting, _rows(calibration.mag_matrix))

    def angular_velocity(self, raw: Vector) -> Vector:
        """Body rates [rad/s] from chip rates [rad/s]."""
        return _corrected(self._mounting, raw, self._gyro_zero)

    def linear_acceleration(self, raw: Vector) -> Vector:
        """Specific force [m/s^2] in body axes from chip readings [m/s^2]."""
        return _corrected(self._accel, raw, self._accel_offset)

    def magnetic_field(self, raw: Vector) -> Vector:
        """Field [T] in body axes from chip readings [T], hard and soft iron taken out."""
        return _corrected(self._mag, raw, self._mag_offset)


def _rows(m: _Nine) -> Matrix:
    return ((m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[6], m[7], m[8]))


def _corrected(m: Matrix, raw: Vector, offset: Vector) -> Vector:
    """m (raw - offset)."""
    (a, b, c), (d, e, f), (g, h, i) = m
    (x, y, z), (x0, y0, z0) = raw, offset
    x, y, z = x - x0, y - y0, z - z0
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)
