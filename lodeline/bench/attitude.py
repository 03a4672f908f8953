"""Attitude methods over recordings with known orientation, or their cost: errors in a table.

FOLDER holds CSV files as `lodeline estimate` reads them, with the columns qw, qx, qy, qz (truth,
body to east-north-up; empty where unknown) and moving (1 where it counts). Errors are RMS over
the moving rows in degrees: total, heading and inclination as in the BROAD data set. SIGMA2 is the
share of rows whose heading lies within two of the standard deviations that the method states.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from math import degrees
from pathlib import Path
from statistics import fmean, median
from typing import NamedTuple

from lodeline.attitude import METHODS, make_attitude
from lodeline.attitude.base import Attitude
from lodeline.attitude.score import attitude_error, rms_error
from lodeline.bench.peers import Maker, installed
from lodeline.recording import RecordingError
from lodeline.recording.csv_table import CsvTable
from lodeline.recording.imu_csv import ImuRow, read_imu
from lodeline.rotation import Quaternion
from lodeline.tables import table

TRUTH, MOVING = ("qw", "qx", "qy", "qz"), "moving"
EXIT_FAILED, EXIT_NOTHING = 1, 4


@dataclass(frozen=True, slots=True)
class Result:
    """RMS errors of one method over one file [deg]; `held` is None where no sigma is stated."""

    total: float
    heading: float
    inclination: float
    held: float | None


class Trial(NamedTuple):
    """Rows of a file, and the truth where it counts."""

    name: str
    rows: list[ImuRow]
    truths: list[Quaternion | None]

    @property
    def period(self) -> float:
        """Median time between two rows [s]."""
        times = [row.t for row in self.rows]
        return median(b - a for a, b in pairwise(times))


def main(argv: list[str]) -> int:
    """Run `lodeline bench attitude`; the exit code."""
    arguments = parser().parse_args(argv)
    if arguments.speed:
        from lodeline.bench.attitude_speed import show

        show(ours() | installed(), arguments.json)
        return 0
    if arguments.folder is None:
        parser().error("a FOLDER of recordings, or --speed")
    if not arguments.folder.is_dir():
        print(f"{arguments.folder}: there is no such folder", file=sys.stderr)
        return EXIT_NOTHING
    try:
        trials = read_folder(arguments.folder)
        if not trials:
            print(f"{arguments.folder}: no recording with {', '.join(TRUTH)}", file=sys.stderr)
            return EXIT_NOTHING
        results = {
            name: {trial.name: score(maker, trial) for trial in trials}
            for name, maker in (ours() | installed()).items()
        }
    except RecordingError as error:
        print(error, file=sys.stderr)
        return EXIT_FAILED
    if arguments.json:
        files = {
            name: {trial: asdict(result) for trial, result in each.items()}
            for name, each in results.items()
        }
        print(json.dumps(files, indent=1))
    else:
        print(f"{summary(results)}\n\ntotal, file by file:\n{by_file(results)}")
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench attitude` takes."""
    parser = argparse.ArgumentParser(
        "lodeline bench attitude",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", type=Path, nargs="?", metavar="FOLDER")
    parser.add_argument(
        "--speed", action="store_true", help="cost per update instead, as ratios of one run"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def ours() -> dict[str, Maker]:
    """Makers of our methods; dcm with both of its gains."""

    def maker(method: str, **values: str) -> Maker:
        return lambda _period: make_attitude(method, **values)

    makers: dict[str, Maker] = {}
    for method in METHODS:
        makers[method] = maker(method)
        if method == "dcm":
            makers["dcm (paper)"] = maker(method, gains="paper")
    return makers


def read_folder(folder: Path) -> list[Trial]:
    """The recordings with truth in a folder, by name; a word about those without."""
    trials = []
    files = [*folder.glob("*.csv"), *folder.glob("*.csv.gz")]
    for file in sorted(files, key=lambda file: file.name):
        with CsvTable(file) as source:
            lacking = [name for name in (*TRUTH, MOVING) if name not in source.columns]
            if lacking:
                print(f"{file}: no column {lacking[0]}, left out", file=sys.stderr)
                continue
            rows = list(read_imu(source, (*TRUTH, MOVING)))
        truths = [_truth(row) for row in rows]
        if any(truth is not None for truth in truths):
            trials.append(Trial(file.name.removesuffix(".gz").removesuffix(".csv"), rows, truths))
        else:
            print(f"{file}: no moving row with a truth, left out", file=sys.stderr)
    return trials


def _truth(row: ImuRow) -> Quaternion | None:
    w, x, y, z, moving = row.extra
    if not moving or w is None or x is None or y is None or z is None:
        return None
    return (x, y, z, w)


def score(maker: Maker, trial: Trial) -> Result:
    """Run one method over one recording."""
    contender = maker(trial.period)
    sure = contender if isinstance(contender, Attitude) else None
    pairs: list[tuple[Quaternion, Quaternion]] = []
    held = 0
    last = trial.rows[0].t
    for row, truth in zip(trial.rows, trial.truths, strict=True):
        contender.update(
            row.t - last, row.angular_velocity, row.linear_acceleration, row.magnetic_field
        )
        last = row.t
        if truth is not None:
            pairs.append((contender.orientation, truth))
            if sure is not None:
                held += attitude_error(*pairs[-1]).heading <= 2.0 * sure.heading_std
    total, heading, inclination = (degrees(angle) for angle in rms_error(pairs))
    return Result(total, heading, inclination, held / len(pairs) if sure is not None else None)


def summary(results: Mapping[str, Mapping[str, Result]]) -> str:
    """Means over the files, best first."""
    rows = []
    for name, each in _ranked(results):
        found = each.values()
        shares = [result.held for result in found if result.held is not None]
        rows.append(
            (
                name,
                _two(fmean(result.total for result in found)),
                _two(max(result.total for result in found)),
                _two(fmean(result.heading for result in found)),
                _two(fmean(result.inclination for result in found)),
                f"{100.0 * fmean(shares):.0f} %" if shares else "-",
            )
        )
    headings = ("METHOD", "TOTAL", "WORST", "HEADING", "INCLINATION", "SIGMA2")
    return table(headings, rows, right=headings[1:])


def by_file(results: Mapping[str, Mapping[str, Result]]) -> str:
    """Total error of each method over each file."""
    methods = [name for name, _ in _ranked(results)]
    files = next(iter(results.values()))
    rows = [(file, *(_two(results[name][file].total) for name in methods)) for file in files]
    return table(("FILE", *methods), rows, right=methods)


def _ranked(
    results: Mapping[str, Mapping[str, Result]],
) -> Iterable[tuple[str, Mapping[str, Result]]]:
    return sorted(
        results.items(), key=lambda item: fmean(result.total for result in item[1].values())
    )


def _two(number: float) -> str:
    return f"{number:.2f}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
