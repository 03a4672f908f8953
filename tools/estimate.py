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
from math import sqrt
from pathlib import Path
from typing import Any

from lodeline.attitude import METHODS
from lodeline.attitude.base import Attitude
from lodeline.recording import RecordingError
from lodeline.recording.imu_csv import CsvTable, ImuRow, read_imu
from lodeline.rotation import Vector, to_euler
from lodeline.terminal.ending import ended

POSE_COLUMNS = "t_s,qx,qy,qz,qw,roll,pitch,yaw"
BIAS_COLUMNS = "bias_x,bias_y,bias_z"
LEAST_GRAVITY, LEAST_FIELD = 3.0, 2e-6  # m/s^2, T: less than this all along is another unit


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

    if target.exists() and source.exists() and target.samefile(source):
        raise RecordingError(f"{target} is the input: give another name")
    rows = 0
    strongest: list[float] = [0.0, 0.0]
    fields = 0
    with CsvTable(source) as table, whole_file(target, replace=True) as stream:
        stream.write(f"{header(estimator)}\n".encode())
        for row in estimated(table, estimator):
            stream.write(f"{','.join(cells(row.t, estimator))}\n".encode())
            rows += 1
            strongest[0] = max(strongest[0], _length(row.linear_acceleration))
            if row.magnetic_field is not None:
                fields += 1
                strongest[1] = max(strongest[1], _length(row.magnetic_field))
        if rows == 0:
            raise RecordingError(f"{source}: no rows below the header")
    doubts = []
    if strongest[0] < LEAST_GRAVITY:
        doubts.append(f"no acceleration above {strongest[0]:.2g} m/s^2: is it in g?")
    if fields and strongest[1] < LEAST_FIELD:
        doubts.append(f"no field above {strongest[1] * 1e6:.2g} uT: is it in tesla or gauss?")
    return rows, doubts


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


def _length(v: Vector) -> float:
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
