"""Orientation from a table of IMU readings, offline, by any method of attitude estimation.

IN is a CSV file, or one packed by gzip, with the columns t_s, gx, gy, gz (rad/s), ax, ay, az
(specific force, m/s^2) and, if there is a magnetometer, mx, my, mz (uT), in body axes: x forward,
y left, z up. Other columns are left alone. OUT has one row for each: t_s, the quaternion qx, qy,
qz, qw (body to a world with x east, y north, z up), roll, pitch and yaw in rad (yaw from east,
counter-clockwise), bias_x, bias_y, bias_z in rad/s where the method looks for a gyro bias, and
heading_std in rad. Exit codes: 0 fine, 1 a file cannot be used, 2 usage, 3 invalid parameters,
4 no such file.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from math import hypot, inf
from pathlib import Path
from typing import Any

from lodeline.attitude import METHODS
from lodeline.attitude.base import Attitude
from lodeline.recording import RecordingError
from lodeline.recording.csv_table import CsvTable
from lodeline.recording.imu_csv import ImuRow, read_imu
from lodeline.rotation import to_euler
from lodeline.terminal.ending import ended

POSE_COLUMNS = "t_s,qx,qy,qz,qw,roll,pitch,yaw"
BIAS_COLUMNS = "bias_x,bias_y,bias_z"
LEAST_GRAVITY, LEAST_FIELD = 3.0, 2e-6  # m/s^2, T: less than this all along is another unit
MOST_RATE, MOST_FIELD = 36.0, 2e-4  # rad/s, T: more than a chip measures, or than the earth has
MOST_STEP = 0.25  # s: gyro rows farther apart, all along, are no recording of turns


def main(argv: list[str]) -> int:
    """Run `lodeline estimate`; the exit code."""
    args = parser().parse_args(argv)
    return ended(lambda: _estimate(args))


def _estimate(args: argparse.Namespace) -> int:
    estimator = METHODS[args.method](read_params(args.params, METHODS[args.method].Params))
    rows, doubts = write_estimates(args.input, estimator, args.output)
    for doubt in doubts:
        print(f"{args.input}: {doubt}", file=sys.stderr)
    print(f"{args.output}: {rows} rows by {args.method}", file=sys.stderr)
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline estimate` takes."""
    parser = argparse.ArgumentParser(
        "lodeline estimate",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("input", type=Path, metavar="IN.csv[.gz]")
    parser.add_argument(
        "--method", choices=list(METHODS), default="soft", help="how (default: soft)"
    )
    parser.add_argument(
        "--params", type=Path, metavar="FILE", help="YAML file with parameters of the method"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="OUT.csv",
        help="where to; replaced if there is one already",
    )
    return parser


def read_params(file: Path | None, cls: type[Any]) -> Any:
    """Parameters from a YAML file, the defaults without one; PipelineError with all its faults."""
    if file is None:
        return cls()
    from lodeline.params import build, shown
    from lodeline.pipeline.document import read_file
    from lodeline.pipeline.faults import Fault, PipelineError

    faults: list[Fault] = []
    top = read_file(file, faults)
    if not isinstance(top.value, dict):
        text = f"parameters are a mapping of names to values, got {shown(top.plain())}"
        raise PipelineError([*faults, top.place.fault(text)])
    made, problems = build(cls, top.plain())
    for problem in problems:
        item = top
        for step in problem.path:
            item = item.value[step]
        faults.append((item.key if problem.at_key else item.place).fault(problem.text))
    if faults:
        raise PipelineError(faults)
    return made


def write_estimates(source: Path, estimator: Attitude, target: Path) -> tuple[int, list[str]]:
    """Run the estimator over a file; (rows written, what looks odd about the readings)."""
    from lodeline.recording.write import whole_file

    rows = 0
    doubts = Doubts()
    with CsvTable(source) as table, whole_file(target, replace=True, source=source) as stream:
        stream.write(f"{header(estimator)}\n".encode())
        for row in estimated(table, estimator):
            stream.write(f"{','.join(cells(row.t, estimator))}\n".encode())
            rows += 1
            doubts.see(row)
        if rows == 0:
            raise RecordingError(f"{source}: no rows below the header")
    return rows, doubts.told


class Doubts:
    """Whether readings look like another unit than the one they are taken for."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._step = self._least_field = inf
        self._rate = self._force = self._most_field = 0.0

    def see(self, row: ImuRow) -> None:
        """Another row: the largest and the smallest of all count."""
        if self._last is not None and row.t > self._last:
            self._step = min(self._step, row.t - self._last)
        self._last = row.t
        self._rate = max(self._rate, hypot(*row.angular_velocity))
        self._force = max(self._force, hypot(*row.linear_acceleration))
        if row.magnetic_field is not None:
            field = hypot(*row.magnetic_field)
            self._least_field = min(self._least_field, field)
            self._most_field = max(self._most_field, field)

    @property
    def told(self) -> list[str]:
        """What looks odd, for people."""
        found = []
        if MOST_STEP < self._step < inf:
            found.append(f"no rows less than {self._step:.3g} s apart: is t_s in ms?")
        if self._rate > MOST_RATE:
            found.append(f"rates of {self._rate:.0f} rad/s: are they in deg/s?")
        if self._force < LEAST_GRAVITY:
            found.append(f"no acceleration above {self._force:.2g} m/s^2: is it in g?")
        if self._least_field < inf and self._most_field < LEAST_FIELD:
            most = 1e6 * self._most_field
            found.append(f"no field above {most:.2g} uT: is it in tesla or gauss?")
        if MOST_FIELD < self._least_field < inf:
            found.append(f"no field below {self._least_field * 1e6:.0f} uT: is it in mG or nT?")
        return found


def estimated(table: CsvTable, estimator: Attitude) -> Iterator[ImuRow]:
    """Each row, once the estimator has taken it in."""
    last = None
    for row in read_imu(table):
        try:
            estimator.update(
                0.0 if last is None else row.t - last,
                row.angular_velocity,
                row.linear_acceleration,
                row.magnetic_field,
            )
        except ValueError as error:
            table.fail(row.line, str(error))
        last = row.t
        yield row


def header(estimator: Attitude) -> str:
    """Names of the columns that this method has."""
    bias = [BIAS_COLUMNS] if estimator.finds_bias else []
    return ",".join([POSE_COLUMNS, *bias, "heading_std"])


def cells(t: float, estimator: Attitude) -> list[str]:
    """One row of the output."""
    q = estimator.orientation
    bias = estimator.gyro_bias if estimator.finds_bias else ()
    numbers = (*q, *to_euler(q), *bias, estimator.heading_std)
    return [repr(t), *(f"{number:.9g}" for number in numbers)]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
