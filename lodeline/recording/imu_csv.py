"""Tables of inertial readings: CSV files with the columns that `estimate` and `calibrate` take.

`t_s` [s], `gx gy gz` [rad/s], `ax ay az` [m/s^2, specific force], `mx my mz` [uT]; the order is
free, other columns are left alone. Microtesla become tesla here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lodeline.recording.csv_table import Cells, CsvTable
from lodeline.rotation import Vector

TIME = "t_s"
GYRO, ACCEL, MAG = ("gx", "gy", "gz"), ("ax", "ay", "az"), ("mx", "my", "mz")
MICROTESLA = 1e-6


class ImuRow(NamedTuple):
    """One row in SI; the field is None where its cells are empty, so are single extra cells."""

    line: int
    t: float
    angular_velocity: Vector
    linear_acceleration: Vector
    magnetic_field: Vector | None
    extra: Cells


def read_imu(table: CsvTable, extra: Sequence[str] = ()) -> Iterator[ImuRow]:
    """Rows of inertial and, if there, magnetic readings; time may stand still but not go back."""
    missing = [name for name in MAG if name not in table.columns]
    if 0 < len(missing) < len(MAG):
        table.fail(1, f"no column {missing[0]}, but others of {', '.join(MAG)}")
    last = None
    for line, numbers in table.rows((TIME, *GYRO, *ACCEL), (*MAG, *extra)):
        t, gx, gy, gz, ax, ay, az, *others = numbers
        mx, my, mz, *rest = others
        assert t is not None  # needed columns are never None
        assert gx is not None and gy is not None and gz is not None
        assert ax is not None and ay is not None and az is not None
        if last is not None and t < last:
            table.fail(line, f"time goes back: {TIME} is {t:g} after {last:g}")
        last = t
        field = None
        if mx is not None and my is not None and mz is not None:
            field = (mx * MICROTESLA, my * MICROTESLA, mz * MICROTESLA)
        yield ImuRow(line, t, (gx, gy, gz), (ax, ay, az), field, tuple(rest))
