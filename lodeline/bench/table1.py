"""Table 1 of the DCM paper, measured anew on a simulated turntable, beside what is printed there.

CW and CCW are the headings at either end of the arc, relative to its middle as the paper has them
for the compass; ARC is how far the plate turned between them: 90 degrees. Means and standard
deviations over a hundred turns each way, in degrees. `gyro z` integrates the z rate alone, as the
paper did; `gyro` turns in three dimensions. BUZZ is the servo's shaking in m/s^2.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from itertools import pairwise
from math import degrees, radians
from statistics import fmean, stdev
from typing import NamedTuple

from lodeline.attitude import make_attitude
from lodeline.bench.turntable import ARC, START, TURNS, Reading, Setup, readings
from lodeline.rotation import wrap_angle, yaw_of
from lodeline.tables import table

PITCHES = (0, 10, 20, 30, 40)
BUZZES = (0.0, 5.0)
MIDDLE = START + 0.5 * ARC


class Figures(NamedTuple):
    """Mean and standard deviation [deg] of the clockwise end, the other end, and the arc."""

    cw: tuple[float, float]
    ccw: tuple[float, float]
    arc: tuple[float, float]


# As printed; the signs are its own, the gyro's from the clockwise end.
PAPER: dict[str, dict[int, Figures]] = {
    "Mag": {
        0: Figures((-49.86, 2.84), (51.45, 3.44), (101.33, 4.26)),
        10: Figures((-51.53, 2.12), (52.04, 3.16), (103.57, 3.63)),
        20: Figures((-50.46, 2.67), (47.08, 3.45), (97.54, 4.37)),
        30: Figures((-45.69, 2.55), (42.63, 2.85), (88.32, 3.71)),
        40: Figures((-45.25, 2.39), (35.51, 2.28), (80.76, 3.5)),
    },
    "Gyro": {
        0: Figures((0.26, 0.54), (89.2, 0.45), (88.95, 0.56)),
        10: Figures((0.7, 1.13), (89.92, 1.03), (89.22, 1.69)),
        20: Figures((0.28, 0.82), (86.84, 0.73), (86.57, 1.03)),
        30: Figures((0.4, 0.62), (79.17, 0.36), (78.77, 0.68)),
        40: Figures((-0.19, 0.84), (70.82, 0.74), (71.01, 1.17)),
    },
    "DCM": {
        0: Figures((-42.8, 0.92), (47.71, 0.92), (90.51, 0.45)),
        10: Figures((-44.66, 1.4), (47.77, 1.27), (92.43, 0.86)),
        20: Figures((-42.16, 5.61), (48.59, 6.15), (90.74, 4.93)),
        30: Figures((-42.8, 3.2), (47.42, 1.52), (90.23, 3.23)),
        40: Figures((-39.71, 4.28), (49.86, 2.26), (89.57, 5.82)),
    },
}
OURS = ("compass", "tilt_compass", "gyro z", "gyro", "dcm (paper)", "dcm", "mekf", "soft")


@dataclass(frozen=True, slots=True)
class Row:
    """One method at one pitch."""

    method: str
    pitch: int
    buzz: float
    figures: Figures


def main(argv: list[str]) -> int:
    """Run `lodeline bench table1`; the exit code."""
    arguments = parser().parse_args(argv)
    rows = measure(arguments.turns)
    if arguments.json:
        print(json.dumps([asdict(row) for row in rows], indent=1))
    else:
        print(shown(rows))
    return 0


def parser() -> argparse.ArgumentParser:
    """What `lodeline bench table1` takes."""
    parser = argparse.ArgumentParser(
        "lodeline bench table1",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--turns", type=_turns, default=TURNS, metavar="N", help=f"each way (default: {TURNS})"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _turns(text: str) -> int:
    if (turns := int(text)) < 2:
        raise argparse.ArgumentTypeError(f"{text} turns have no standard deviation")
    return turns


def measure(turns: int = TURNS, methods: Iterable[str] = OURS) -> list[Row]:
    """Every method over the same readings, pitch by pitch, quiet and buzzing."""
    rows = []
    for buzz in BUZZES:
        for pitch in PITCHES:
            seen = list(readings(Setup(radians(pitch), buzz, turns)))
            rows += [Row(name, pitch, buzz, figures(headings(name, seen))) for name in methods]
    return rows


def headings(method: str, seen: Iterable[Reading]) -> list[float]:
    """Heading [rad] at each stop, as the method has it, from the middle of the arc."""
    look = _integrated() if method == "gyro z" else _estimated(method)
    found: list[float] = []
    for reading in seen:
        yaw = look(reading)
        if reading.stop is not None:
            found.append(wrap_angle(yaw - MIDDLE))
    return found


def _estimated(method: str) -> Callable[[Reading], float]:
    name, _, gains = method.partition(" ")
    estimator = make_attitude(name, **({"gains": gains.strip("()")} if gains else {}))

    def look(reading: Reading) -> float:
        estimator.update(reading.dt, reading.rate, reading.force, reading.field)
        return yaw_of(estimator.orientation)

    return look


def _integrated() -> Callable[[Reading], float]:
    yaw = START

    def look(reading: Reading) -> float:
        nonlocal yaw
        yaw += reading.rate[2] * reading.dt
        return yaw

    return look


def figures(stops: list[float]) -> Figures:
    """Means and deviations of the ends and of the arcs between one stop and the next."""
    ends = [degrees(stop) for stop in stops]
    arcs = [abs(degrees(wrap_angle(b - a))) for a, b in pairwise(stops)]
    return Figures(_spread(ends[::2]), _spread(ends[1::2]), _spread(arcs))


def _spread(values: list[float]) -> tuple[float, float]:
    return fmean(values), stdev(values)


def shown(rows: list[Row]) -> str:
    """The paper's table and ours, in one form."""
    cells = [
        (f"paper: {name}", str(pitch), "", *_cells(found))
        for name, pitches in PAPER.items()
        for pitch, found in pitches.items()
    ]
    ranked = sorted(rows, key=lambda row: (OURS.index(row.method), row.buzz, row.pitch))
    cells += [(row.method, str(row.pitch), f"{row.buzz:g}", *_cells(row.figures)) for row in ranked]
    titles = ("METHOD", "PITCH", "BUZZ", "CW", "SD", "CCW", "SD", "ARC", "SD")
    return table(titles, cells, right=titles[1:])


def _cells(found: Figures) -> list[str]:
    return [f"{number:.2f}" for pair in found for number in pair]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
