"""Claims about other people's robots: landmarks by camera, ranges by radio, with known truth.

The recordings are not here: LODELINE_DATA names the folder that holds them.
"""

import gzip
import math
import os
from bisect import bisect_right
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from lodeline.ekf import Localizer, LocalizerParams, Sighting

DATA = Path(os.environ.get("LODELINE_DATA", "/nowhere"))
Event = tuple[float, int, tuple[float, ...]]  # time [s], 0 odometry (ds, dtheta, dt) or 1 sighting


def folder(name: str) -> Path:
    if not (DATA / name).is_dir():
        pytest.skip(f"LODELINE_DATA names no folder with {name}")
    return DATA / name


def table(file: Path) -> list[list[float]]:
    """Numbers of a text table; '#' and headings are passed over."""
    data = gzip.decompress(file.read_bytes()) if file.suffix == ".gz" else file.read_bytes()
    rows = []
    for line in data.decode().splitlines():
        words = line.replace(",", " ").split()
        if words and words[0][0] not in "#" and not words[0][0].isalpha():
            rows.append([float(word) for word in words])
    return rows


class Truth:
    def __init__(self, rows: list[list[float]]) -> None:
        self._rows = rows
        self._times = [row[0] for row in rows]

    def at(self, t: float) -> tuple[float, float] | None:
        """Position at `t`; None outside, and where the truth itself has a hole of 1 s."""
        i = bisect_right(self._times, t)
        if not 0 < i < len(self._rows):
            return None
        a, b = self._rows[i - 1], self._rows[i]
        if b[0] - a[0] > 1.0:
            return None
        share = (t - a[0]) / (b[0] - a[0])
        return a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


def rms(
    events: list[Event],
    truth: Truth,
    params: LocalizerParams,
    noise: tuple[float, float],
    range_sigma: float,
    bearing_sigma: float,
) -> tuple[float, float, int]:
    """(RMS, worst) distance from the truth [m] and sightings refused; `noise` per root second."""
    localizer = Localizer(params)
    x = y = yaw = 0.0
    start = events[0][0]
    errors = []
    for t, kind, values in sorted(events):
        stamp = round((t - start) * 1e9)
        if kind == 0:
            ds, dtheta, dt = values
            x, y = x + ds * math.cos(yaw + dtheta / 2), y + ds * math.sin(yaw + dtheta / 2)
            yaw = math.remainder(yaw + dtheta, 2 * math.pi)
            spread = (noise[0] ** 2 / dt, 0.0, 0.0, noise[1] ** 2 / dt)
            estimate = localizer.odometry(stamp, x, y, yaw, spread, dt, 0)
            true = truth.at(t)
            if estimate is not None and true is not None:
                errors.append(math.hypot(estimate.x - true[0], estimate.y - true[1]))
        else:
            mark_x, mark_y, distance, *bearing = values
            localizer.landmarks(
                stamp,
                (
                    Sighting(
                        mark_x,
                        mark_y,
                        distance,
                        range_sigma,
                        bearing[0] if bearing else None,
                        bearing_sigma,
                    ),
                ),
            )
    last = localizer.estimate
    assert last is not None
    assert len(errors) > 0.8 * sum(kind == 0 for _, kind, _ in events)
    return math.sqrt(sum(e * e for e in errors) / len(errors)), max(errors), last.rejected


def mrclam(robot: int) -> tuple[list[Event], Truth, tuple[float, float, float]]:
    place = folder("mrclam7")
    truth = table(place / f"Robot{robot}_Groundtruth.dat.gz")
    odometry = table(place / f"Robot{robot}_Odometry.dat.gz")
    subjects = {int(code): int(subject) for subject, code in table(place / "Barcodes.dat")}
    marks = {int(row[0]): row[1:3] for row in table(place / "Landmark_Groundtruth.dat")}
    events: list[Event] = []
    for a, b in pairwise(odometry):
        dt = b[0] - a[0]
        if dt > 0.0:
            events.append((b[0], 0, (a[1] * dt, a[2] * dt, dt)))
    seen: dict[float, float] = {}
    for t, code, distance, bearing in table(place / f"Robot{robot}_Measurement.dat.gz"):
        mark = marks.get(subjects.get(int(code), 0))
        if mark is not None and t > odometry[0][0]:
            # several in one picture: each a nanosecond after the other
            seen[t] = seen.get(t, -1e-6) + 1e-6
            events.append((t + seen[t], 1, (*mark, distance, bearing)))
    return events, Truth(truth), _pose_at(truth, odometry[0][0])


def _pose_at(truth: list[list[float]], t: float) -> tuple[float, float, float]:
    row = min(truth, key=lambda each: abs(each[0] - t))
    return row[1], row[2], row[3]


@pytest.mark.parametrize(("robot", "limit"), [(1, 0.20), (3, 0.26)])
def test_a_robot_among_landmarks_that_a_camera_sees(robot: int, limit: float) -> None:
    """50 m in 15 min; odometry alone ends 4 to 5 m off."""
    events, truth, pose = mrclam(robot)
    params = LocalizerParams(initial_pose=pose, initial_sigma=(0.05, 0.05), magnet_model="none")
    figure, worst, refused = rms(events, truth, params, (0.03, 0.05), 0.2, math.radians(6))
    print(f"robot {robot}: rms {figure:.3f} m, worst {worst:.2f} m, {refused} refused")
    assert figure <= limit


def straightened(pairs: Iterator[tuple[float, float]]) -> tuple[float, float]:
    """(offset, slope) of measured over true ranges, by least squares without the worst tenth."""
    points = list(pairs)
    for _ in range(3):
        n = len(points)
        mx, my = sum(p[0] for p in points) / n, sum(p[1] for p in points) / n
        slope = sum((a - mx) * (b - my) for a, b in points) / sum((a - mx) ** 2 for a, _ in points)
        offset = my - slope * mx
        points.sort(key=lambda p: abs(p[1] - offset - slope * p[0]))
        points = points[: round(0.97 * n)]
    return offset, slope


def test_a_lawn_mower_among_four_beacons() -> None:
    """1.9 km by ranges alone, corrected by a straight line: as they come they are 6.6 % long."""
    place = folder("plaza1_range_odometry")
    rows = table(place / "truth.csv")
    truth = Truth(rows)
    beacons = {int(b): (x, y) for b, x, y in table(place / "beacons.csv")}
    events: list[Event] = []
    before = rows[0][0]
    for t, ds, dtheta in table(place / "odometry.csv"):
        events.append((t, 0, (ds, dtheta, t - before)))
        before = t
    ranges = [(t, beacons[int(b)], r) for t, _, b, r in table(place / "ranges.csv")]

    def pairs() -> Iterator[tuple[float, float]]:
        for t, mark, distance in ranges:
            at = truth.at(t)
            if at is not None:
                yield math.dist(at, mark), distance

    offset, slope = straightened(pairs())
    events += [(t, 1, (*mark, (r - offset) / slope)) for t, mark, r in ranges]
    params = LocalizerParams(
        initial_pose=(rows[0][1], rows[0][2], rows[0][3]),
        initial_sigma=(0.1, 0.02),
        magnet_model="none",
    )
    figure, worst, refused = rms(events, truth, params, (0.05, 0.005), 0.5, 1.0)
    print(f"rms {figure:.3f} m, worst {worst:.2f} m, {refused} of {len(ranges)} refused")
    assert figure <= 0.32


def test_a_small_robot_among_radio_anchors() -> None:
    """9.2 m in 30 s; the first speed is the left wheel's, the track 0.157 m.

    From the true start its wheels alone do no worse (63 mm): ranges keep it there, no more.
    """
    place = folder("labyrinth_uwb_diffdrive")
    lines = [line.split() for line in (place / "Indoor_UWB_Input.txt").read_text().splitlines()]
    points = [
        [float(word) for word in line.split()[1:4]]
        for line in (place / "Indoor_UWB_GT.txt").read_text().splitlines()
        if line.strip()
    ]
    truth = Truth(points)
    events: list[Event] = []
    before = 0.0
    for kind, *words in (line for line in lines if line):
        t, *values = (float(word) for word in words)
        if kind == "odom2diff":
            left, right = values[0], values[1]
            dt, before = t - before, t
            events.append((t, 0, (0.5 * (left + right) * dt, (right - left) / 0.157 * dt, dt)))
        else:
            events.append((t, 1, (values[2], values[3], values[0] - 0.12)))
    params = LocalizerParams(
        initial_pose=(points[0][1], points[0][2], 3.002),
        initial_sigma=(0.05, 0.1),
        magnet_model="none",
    )
    figure, worst, refused = rms(events, truth, params, (0.02, 0.05), 0.10, 1.0)
    print(f"rms {figure:.3f} m, worst {worst:.2f} m, {refused} refused")
    assert figure <= 0.08
