"""Two runs laid over each other: how far they are apart where both have something to say."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lodeline.plotting import NothingToPlotError
from lodeline.plotting.figure import Colour, Curve, Figure, Floor, Panel
from lodeline.plotting.motion import Posed
from lodeline.plotting.numbers import at, rms, unwrapped
from lodeline.plotting.run import Run
from lodeline.rotation import wrap_angle
from lodeline_msgs import Odometry

LEAST = 2  # samples


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two: what it is called, its poses, its odometry, and when it begins [ns]."""

    name: str
    key: str
    poses: Sequence[Posed]
    odometry: Sequence[Odometry]
    start: int

    def stamps(self, samples: Sequence[Posed]) -> list[int]:
        """Stamps as they are compared [ns]."""
        return [each.stamp - self.start for each in samples]


@dataclass(frozen=True, slots=True)
class Difference:
    """B less A over time [s] in `unit`: values, their RMS, the largest of them and when."""

    name: str
    unit: str
    times: list[float]
    values: list[float]

    @property
    def rms(self) -> float:
        """Root of the mean of the squares."""
        return rms(self.values)

    @property
    def largest(self) -> tuple[float, float]:
        """Largest size, and its time [s]."""
        return max((abs(value), time) for value, time in zip(self.values, self.times, strict=True))


@dataclass(frozen=True, slots=True)
class Comparison:
    """Both sides, how long they overlap [s], and the differences; why others are not there."""

    a: Side
    b: Side
    seconds: float
    differences: tuple[Difference, ...]
    left_out: dict[str, str]


def side(run: Run, key: str | None, *, from_start: bool) -> Side:
    """What of a run is compared: the key given, else its best pose.

    NothingToPlotError for a key that has no pose.
    """
    if key is None and not run.poses:
        truths = f", but a truth: --key {next(iter(run.truths))}" if run.truths else ""
        raise NothingToPlotError(f"{run.path} has no PoseEstimate and no Odometry{truths}")
    if key is None:
        key, poses = run.estimate
    else:
        known: dict[str, Sequence[Posed]] = {**run.poses, **run.truths}
        if key not in known:
            raise NothingToPlotError(
                f"{run.path} has no pose on {key!r}, but on {', '.join(known)}"
            )
        poses = known[key]
    own = [each for each in poses if isinstance(each, Odometry)]
    odometry = own or next(iter(run.of(Odometry).values()), [])
    return Side(run.name, key, poses, odometry, poses[0].stamp if from_start else 0)


def compare(a: Side, b: Side) -> Comparison:
    """B is interpolated at the stamps of A; NothingToPlotError if they have no time in common."""
    theirs = b.stamps(b.poses)
    xs, ys = [each.x for each in b.poses], [each.y for each in b.poses]
    yaws = unwrapped([each.yaw for each in b.poses])
    stamps: list[int] = []
    apart: list[float] = []
    turned: list[float] = []
    for pose, stamp in zip(a.poses, a.stamps(a.poses), strict=True):
        x, y, yaw = (at(theirs, values, stamp) for values in (xs, ys, yaws))
        if x is None or y is None or yaw is None:
            continue
        stamps.append(stamp)
        apart.append(math.hypot(x - pose.x, y - pose.y))
        turned.append(wrap_angle(yaw - pose.yaw))
    if len(stamps) < LEAST:
        raise NothingToPlotError(
            f"{a.name} and {b.name} have no time in common: --from-start counts each from its own "
            "beginning"
        )
    start = stamps[0]
    times = [(stamp - start) * 1e-9 for stamp in stamps]
    differences = [
        Difference("position", "m", times, apart),
        Difference("yaw", "rad", times, turned),
    ]
    left_out = {}
    speed = _speed(a, b, start)
    if speed is None:
        left_out["speed"] = "not both have odometry over a common time"
    else:
        differences.append(speed)
    return Comparison(a, b, times[-1], tuple(differences), left_out)


def _speed(a: Side, b: Side, start: int) -> Difference | None:
    theirs, speeds = b.stamps(b.odometry), [each.v for each in b.odometry]
    pairs = [
        ((stamp - start) * 1e-9, other - each.v)
        for each, stamp in zip(a.odometry, a.stamps(a.odometry), strict=True)
        if (other := at(theirs, speeds, stamp)) is not None
    ]
    if len(pairs) < LEAST:
        return None
    return Difference("speed", "m/s", [time for time, _ in pairs], [value for _, value in pairs])


def figures(found: Comparison) -> list[Figure]:
    """Both paths, headings and speeds over each other, and their differences over time."""
    sides: tuple[tuple[Side, str, Colour], ...] = (
        (found.a, f"A {_called(found.a)}", "ekf"),
        (found.b, f"B {_called(found.b)}", "odom"),
    )
    start = max(found.a.stamps(found.a.poses)[0], found.b.stamps(found.b.poses)[0])

    def curve(
        each: Side, name: str, colour: Colour, samples: Sequence[Posed], values: list[float]
    ) -> Curve:
        times = [(stamp - start) * 1e-9 for stamp in each.stamps(samples)]
        return Curve(name, colour, times, values, dashed=colour == "odom")

    trails, yaws, speeds = [], [], []
    for each, name, colour in sides:
        times = [(stamp - start) * 1e-9 for stamp in each.stamps(each.poses)]
        x, y = [pose.x for pose in each.poses], [pose.y for pose in each.poses]
        trails.append(Curve(name, colour, x, y, dashed=colour == "odom", t=times))
        turns = [math.degrees(turn) for turn in unwrapped([pose.yaw for pose in each.poses])]
        yaws.append(curve(each, name, colour, each.poses, turns))
        speeds.append(curve(each, name, colour, each.odometry, [odom.v for odom in each.odometry]))
    shown = {"m": (1e3, "mm"), "rad": (math.degrees(1.0), "°"), "m/s": (1e3, "mm/s")}
    panels = []
    for off in found.differences:
        scale, unit = shown[off.unit]
        values = [scale * value for value in off.values]
        panels.append(Panel(off.name, unit, (Curve(off.name, "hit", off.times, values),)))
    note = ", ".join(
        f"{off.name} {shown[off.unit][0] * off.rms:.3g} {shown[off.unit][1]}"
        for off in found.differences
    )
    made = [
        Figure("path", "Paths", "", floor=Floor(tuple(trails))),
        Figure("yaw", "Heading", "from east", (Panel("yaw", "°", tuple(yaws)),)),
        Figure("differences", "B less A", f"RMS: {note}", tuple(panels)),
    ]
    if not found.left_out:
        speed = Panel("v", "m/s", tuple(speeds))
        made.insert(2, Figure("speed", "Speed", "by the wheels", (speed,)))
    return made


def _called(each: Side) -> str:
    return f"{each.name}: {each.key}"
