"""Where the robot went and how: path, heading, speed, rate of turn, attitude."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from lodeline.magnets import Lattice
from lodeline.plotting import NothingToPlotError
from lodeline.plotting.figure import Colour, Curve, Ellipse, Figure, Floor, Panel
from lodeline.plotting.numbers import at, ellipse_axes, unwrapped
from lodeline.plotting.run import Run
from lodeline.rotation import to_euler
from lodeline_msgs import (
    AttitudeEstimate,
    MagnetDetection,
    Message,
    Odometry,
    PoseEstimate,
)

ELLIPSES = 16
MOST_MAGNETS = 6000
COLOURS: tuple[Colour, ...] = ("odom", "hit", "ink-2", "bad")
Posed = PoseEstimate | Odometry


def poses(run: Run) -> list[tuple[str, Colour, Sequence[Posed], bool]]:
    """All that has a pose: name, colour, samples, and whether it is the truth."""
    found: list[tuple[str, Colour, Sequence[Posed], bool]] = []
    if truth := told(run):
        found.append(("truth", "truth", truth, True))
    for i, (key, odometry) in enumerate(run.of(Odometry).items()):
        found.append((key, COLOURS[i % len(COLOURS)], odometry, False))
    for i, (key, estimates) in enumerate(run.of(PoseEstimate).items()):
        name = f"{key} (EKF)" if key == "pose" else key
        found.append((name, ("ekf", *COLOURS[1:])[i % len(COLOURS)], estimates, False))
    if not found:
        raise NothingToPlotError("no PoseEstimate, no Odometry and no truth in it")
    return found


def told(run: Run) -> Sequence[Odometry]:
    """The truth, or nothing."""
    try:
        return run.truth
    except NothingToPlotError:
        return ()


def path(run: Run) -> Figure:
    """Trails on the floor, with the magnets, where they were seen, and 95 % ellipses."""
    posed = bool(run.of(PoseEstimate))
    trails = tuple(
        Curve(
            name,
            colour,
            [each.x for each in samples],
            [each.y for each in samples],
            dashed=posed and isinstance(samples[0], Odometry) and not true,
            faint=true,
            t=run.times(samples),
        )
        for name, colour, samples, true in poses(run)
    )
    hits = _hits(run)
    lattice = Lattice(run.params.lattice_pitch, *run.params.lattice_origin)
    floor = Floor(
        trails,
        _ellipses(run),
        _magnets(lattice, trails, hits) if hits else (),
        tuple(sorted({lattice.nearest(*hit) for hit in hits})),
        tuple(hits),
    )
    note = "95 % ellipses along the way" if floor.ellipses else "seen from above"
    return Figure("path", "Path", note, floor=floor)


def _hits(run: Run) -> list[tuple[float, float]]:
    """Where the best pose at the time puts each magnet that was seen [m]."""
    detections = next(iter(run.of(MagnetDetection).values()), [])
    samples = next(iter(run.of(PoseEstimate).values()), [])
    stamps = [each.stamp for each in samples]
    xs, ys = [each.x for each in samples], [each.y for each in samples]
    yaws = unwrapped([each.yaw for each in samples])
    hits = []
    for detection in detections:
        if not detection.lateral:
            continue
        x, y, yaw = (at(stamps, values, detection.stamp) for values in (xs, ys, yaws))
        if x is None or y is None or yaw is None:
            continue
        c, s, ahead = math.cos(yaw), math.sin(yaw), run.params.bar_x
        hits += [(x + c * ahead - s * left, y + s * ahead + c * left) for left in detection.lateral]
    return hits


def _magnets(
    lattice: Lattice, trails: Sequence[Curve], hits: Sequence[tuple[float, float]]
) -> tuple[tuple[float, float], ...]:
    xs = [x for trail in trails for x in trail.x] + [x for x, _ in hits]
    ys = [y for trail in trails for y in trail.y if y is not None] + [y for _, y in hits]
    margin = 3.0 * lattice.pitch
    west, east = min(xs) - margin, max(xs) + margin
    south, north = min(ys) - margin, max(ys) + margin
    if (east - west) * (north - south) > MOST_MAGNETS * lattice.pitch**2:
        return ()
    middle = 0.5 * (west + east), 0.5 * (south + north)
    around = lattice.around(*middle, 0.5 * math.hypot(east - west, north - south))
    return tuple((x, y) for x, y in around if west <= x <= east and south <= y <= north)


def _ellipses(run: Run) -> tuple[Ellipse, ...]:
    """Of the filter's pose, as many as the eye can take, at even distances of way."""
    samples: Sequence[PoseEstimate] = next(iter(run.of(PoseEstimate).values()), [])
    if not samples:
        return ()
    ways = [0.0]
    for i in range(1, len(samples)):
        step = math.hypot(samples[i].x - samples[i - 1].x, samples[i].y - samples[i - 1].y)
        ways.append(ways[-1] + step)
    found, due = [], 0.0
    for sample, way in zip(samples, ways, strict=True):
        if way >= due:
            due += max(ways[-1] / ELLIPSES, 1e-9)
            found.append(Ellipse(sample.x, sample.y, *ellipse_axes(sample.covariance)))
    return tuple(found)


def yaw(run: Run) -> Figure:
    """(t, yaw), without jumps at half a turn."""
    curves: list[Curve] = []
    posed = bool(run.of(PoseEstimate))
    for name, colour, samples, true in poses(run):
        angles = unwrapped([each.yaw for each in samples])
        curve = _over_time(run, name, colour, samples, _degrees(angles), true)
        curves.append(replace(curve, dashed=colour != "ekf" and not true and posed))
    for key, attitudes in run.of(AttitudeEstimate).items():
        angles = unwrapped([to_euler(each.orientation)[2] for each in attitudes])
        curves.append(_over_time(run, key, "ink-3", attitudes, _degrees(angles), False))
    return Figure("yaw", "Heading", "from east, counter-clockwise", (_panel("yaw", "°", curves),))


def speed(run: Run) -> Figure:
    """(t, v)."""
    return _twist(run, "speed", "Speed", "v", "m/s")


def yaw_rate(run: Run) -> Figure:
    """(t, w)."""
    return _twist(run, "yaw_rate", "Rate of turn", "w", "°/s")


def _twist(run: Run, kind: str, title: str, field: str, unit: str) -> Figure:
    curves = []
    for name, colour, samples, true in poses(run):
        if isinstance(samples[0], Odometry):
            values: list[float] = [getattr(each, field) for each in samples]
            shown = _degrees(values) if field == "w" else values
            curves.append(_over_time(run, name, colour, samples, shown, true))
    if field == "w":
        for key, attitudes in run.of(AttitudeEstimate).items():
            rates = _degrees([each.angular_velocity[2] for each in attitudes])
            curves.insert(0, _over_time(run, f"{key} (gyro)", "ink-3", attitudes, rates, False))
    if not curves:
        raise NothingToPlotError("no Odometry in it")
    note = "forward, mean over each step" if field == "v" else "counter-clockwise"
    return Figure(kind, title, note, (_panel(field, unit, curves),))


def attitude(run: Run) -> Figure:
    """Roll, pitch and yaw of each attitude."""
    run.first(AttitudeEstimate)
    parts: dict[str, list[Curve]] = {"roll": [], "pitch": [], "yaw": []}
    for i, (key, samples) in enumerate(run.of(AttitudeEstimate).items()):
        angles = [to_euler(each.orientation) for each in samples]
        for place, curves in enumerate(parts.values()):
            values = _degrees(unwrapped([each[place] for each in angles]))
            colour: Colour = ("ekf", *COLOURS)[i % 5]
            curves.append(_over_time(run, key, colour, samples, values, False))
    panels = tuple(_panel(name, "°", curves) for name, curves in parts.items())
    return Figure("attitude", "Attitude", "R = Rz(yaw) Ry(pitch) Rx(roll), body to world", panels)


def _panel(label: str, unit: str, curves: Sequence[Curve]) -> Panel:
    return Panel(label, unit, tuple(curves))


def _over_time(
    run: Run,
    name: str,
    colour: Colour,
    samples: Sequence[Message],
    values: Sequence[float],
    true: bool,
) -> Curve:
    return Curve(name, colour, run.times(samples), values, faint=true)


def _degrees(angles: Sequence[float]) -> list[float]:
    return [math.degrees(angle) for angle in angles]
