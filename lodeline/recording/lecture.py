"""Import of the lecture's text files: motor counts, or IMU readings, one row per sample.

Wheels: time [s], counter 1, counter 2, and what comes after (PWM) is left alone. Counts are
differences from row to row unless told to be cumulative; counter 1 is the left wheel. IMU: time,
angular velocity x y z [rad/s], acceleration x y z [g], and what comes after is left alone. Columns
stand apart by blanks or commas, `#` begins a comment.

The lecture counts acceleration as (0, 0, -g) at rest where the wire has +9.81 on z: a sign of -1
turns it over.
"""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from math import hypot, isfinite
from pathlib import Path

from lodeline.recording import RecordingError
from lodeline.recording.rows import rows
from lodeline_msgs import Imu, WheelTicks

G = 9.80665
LARGEST_COUNT = 1 << 53
LATEST = 9e9  # s
LEAN_ROWS = 100  # of the beginning, by which the sign of gravity is told
GRAVITY = (0.3, 3.0)  # g, what they read on the mean if the columns are what they should be


def wheels(file: Path, *, cumulative: bool = False) -> list[WheelTicks]:
    """Samples of the motor file; RecordingError with `file:line:` for a malformed row."""
    samples: list[WheelTicks] = []
    left = right = 0
    for line, stamp, cells in _rows(file, 3, "time, counter 1, counter 2"):
        first, second = (_whole(file, line, cell) for cell in cells[1:3])
        if cumulative:
            left, right = first, second
        else:
            left, right = left + first, right + second
        samples.append(WheelTicks(stamp, left, right, seq=len(samples)))
    return samples


def imu(file: Path, gravity_sign: int | None = None) -> tuple[list[Imu], int]:
    """Samples of the IMU file, and the sign taken: the one given, else that which makes the mean
    of the first rows point up. RecordingError with `file:line:` for a malformed row, and where
    the first rows hold nothing like gravity.
    """
    readings = [
        (stamp, [_number(file, line, cell) for cell in cells[1:7]])
        for line, stamp, cells in _rows(file, 7, "time, 3 angular velocities, 3 accelerations")
    ]
    beginning = [numbers[3:] for _, numbers in readings[:LEAN_ROWS]]
    force = sum(hypot(*each) for each in beginning) / len(beginning)
    if not GRAVITY[0] < force < GRAVITY[1]:
        raise RecordingError(
            f"{file}: columns 5 to 7 read {force:.3g} at the beginning, expected about 1 g"
            " (a file in m/s^2 comes in by --format csv and a map)"
        )
    sign = gravity_sign
    if sign is None:
        sign = 1 if sum(az for _, _, az in beginning) >= 0.0 else -1
    k = sign * G
    samples = [
        Imu(stamp, (wx, wy, wz), (k * ax, k * ay, k * az), seq=seq)
        for seq, (stamp, (wx, wy, wz, ax, ay, az)) in enumerate(readings)
    ]
    return samples, sign


def _rows(file: Path, least: int, what: str) -> Iterator[tuple[int, int, list[str]]]:
    """(line, stamp [ns], cells) of each row; at least one."""
    last = None
    for line, cells in rows(file, f"columns {what}"):
        if len(cells) < least:
            raise RecordingError(f"{file}:{line}: {len(cells)} columns, expected {what}")
        if not 0.0 <= _number(file, line, cells[0]) < LATEST:
            raise RecordingError(f"{file}:{line}: time {cells[0][:40]}, expected 0 s or more")
        # exact: a float would move stamps by fractions of a microsecond
        stamp = int((Decimal(cells[0]) * 1_000_000_000).to_integral_value())
        if last is not None and stamp < last:
            raise RecordingError(f"{file}:{line}: time {cells[0]} goes back")
        last = stamp
        yield line, stamp, cells


def _number(file: Path, line: int, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = float("inf")
    if not isfinite(number):
        raise RecordingError(f"{file}:{line}: {cell[:40]!r}, expected a number")
    return number


def _whole(file: Path, line: int, cell: str) -> int:
    number = _number(file, line, cell)
    if number != int(number) or abs(number) > LARGEST_COUNT:
        raise RecordingError(f"{file}:{line}: {cell[:40]!r}, expected a whole number of counts")
    return int(number)
