"""How sure the filter is, and whether it may be: sigmas, innovations, errors against the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lodeline.ekf.belief import Belief
from lodeline.plotting import NothingToPlotError
from lodeline.plotting.figure import Band, Colour, Curve, Figure, Limit, Panel
from lodeline.plotting.numbers import at, chi_square_band, unwrapped
from lodeline.plotting.run import Run
from lodeline.rotation import wrap_angle
from lodeline_msgs import AttitudeEstimate, Odometry, PoseEstimate

FAR = 10.0
"""Beyond so many times the band's upper end, only a logarithmic axis shows both."""
AXES: tuple[Colour, ...] = ("ekf", "odom", "truth")


def belief_of(sample: PoseEstimate | Odometry) -> Belief:
    """Pose and covariance as the filter holds them."""
    p = sample.covariance if isinstance(sample, PoseEstimate) else sample.pose_covariance
    return Belief(sample.x, sample.y, sample.yaw, p[0], p[1], p[2], p[4], p[5], p[8])


def sigmas(run: Run) -> Figure:
    """Standard deviations of the best pose."""
    key, samples = run.estimate
    times, beliefs = run.times(samples), [belief_of(each) for each in samples]
    x, y = ([1e3 * _root(each[place]) for each in beliefs] for place in (3, 6))
    yaw = [math.degrees(_root(each.p22)) for each in beliefs]
    panels = (
        Panel("σ of x, y", "mm", (Curve("σ x", "ekf", times, x), Curve("σ y", "odom", times, y))),
        Panel("σ of yaw", "°", (Curve("σ yaw", "ekf", times, yaw),)),
    )
    return Figure("sigmas", "Standard deviations", f"of {key}, by its own covariance", panels)


def heading_std(run: Run) -> Figure:
    """How sure the heading is: of the attitude, and of the pose where there is one."""
    run.first(AttitudeEstimate)
    curves = [
        Curve(
            key, AXES[1], run.times(samples), [math.degrees(each.heading_std) for each in samples]
        )
        for key, samples in run.of(AttitudeEstimate).items()
    ]
    for key, poses in run.of(PoseEstimate).items():
        values = [math.degrees(_root(each.covariance[8])) for each in poses]
        curves.append(Curve(key, "ekf", run.times(poses), values))
    values = [value for each in curves for value in each.y if value]
    log = bool(values) and max(values) > FAR * min(values)
    panel = Panel("σ of heading", "°", tuple(curves), log=log)
    return Figure("heading_std", "Heading: standard deviation", "one sigma", (panel,))


def gyro_bias(run: Run) -> Figure:
    """What the attitude filter took for the gyro's zero offset."""
    samples = run.first(AttitudeEstimate)
    if not any(any(each.gyro_bias) for each in samples):
        raise NothingToPlotError("the attitude filter found none")
    times = run.times(samples)
    curves = tuple(
        Curve(f"b{axis}", AXES[i], times, [math.degrees(each.gyro_bias[i]) for each in samples])
        for i, axis in enumerate("xyz")
    )
    panel = Panel("gyro bias", "°/s", curves)
    return Figure("gyro_bias", "Gyro bias", "as the attitude filter estimates it", (panel,))


def errors(run: Run) -> Figure:
    """Best pose less truth, with three sigmas to either side."""
    key, times, beliefs, off = _against_truth(run)
    scales = ((1e3, "mm"), (1e3, "mm"), (math.degrees(1.0), "°"))
    panels = []
    for i, ((scale, unit), name, place) in enumerate(
        zip(scales, ("x", "y", "yaw"), (3, 6, 8), strict=True)
    ):
        reach = [3.0 * scale * _root(each[place]) for each in beliefs]
        band = Band("± 3 σ", "ekf", times, [-each for each in reach], reach)
        curve = Curve("error", "ekf", times, [scale * each[i] for each in off])
        panels.append(Panel(f"{name} error", unit, (curve,), (band,)))
    within = sum(
        all(abs(e) <= 3.0 * _root(p) for e, p in zip(each, (b.p00, b.p11, b.p22), strict=True))
        for each, b in zip(off, beliefs, strict=True)
    )
    note = f"{key} less truth; {_percent(within, len(off))} with all three inside 3 σ"
    return Figure("errors", "Errors against the truth", note, tuple(panels))


def nees(run: Run) -> Figure:
    """Errors against the truth in units of the covariance that the filter states."""
    key, times, beliefs, off = _against_truth(run)
    values = [each.nees(*error) for each, error in zip(beliefs, off, strict=True)]
    low, high = chi_square_band(3)
    panel = scatter("NEES", [Curve("NEES", "ekf", times, values)], (low, high))
    note = f"{key} against truth: {inside(values, low, high, 3)}"
    return Figure("nees", "Consistency: NEES", note, (panel,))


def _against_truth(
    run: Run,
) -> tuple[str, list[float], list[Belief], list[tuple[float, float, float]]]:
    """Key, times, beliefs and errors (x, y, yaw) of the best pose, where there is a truth."""
    truth = run.truth
    key, samples = run.estimate
    stamps = [each.stamp for each in truth]
    columns = (
        [each.x for each in truth],
        [each.y for each in truth],
        unwrapped([each.yaw for each in truth]),
    )
    kept, off = [], []
    for sample in samples:
        x, y, yaw = (at(stamps, values, sample.stamp) for values in columns)
        belief = belief_of(sample)
        if x is None or y is None or yaw is None or not min(belief.p00, belief.p11, belief.p22) > 0:
            continue
        kept.append(sample)
        off.append((sample.x - x, sample.y - y, wrap_angle(sample.yaw - yaw)))
    if not kept:
        raise NothingToPlotError(f"{key} and the truth have no time in common")
    return key, run.times(kept), [belief_of(each).positive() for each in kept], off


def scatter(
    name: str,
    curves: Sequence[Curve],
    band: tuple[float, float],
    limits: tuple[Limit, ...] = (),
) -> Panel:
    """Values against their band, the same all the way along."""
    ends = [time for each in curves for time in (each.x[0], each.x[-1])]
    highest = max(value for each in curves for value in each.y if value is not None)
    bands = (flat("95 % band", [min(ends), max(ends)], *band),)
    return Panel(name, "1", tuple(curves), bands, limits, log=highest > FAR * band[1])


def flat(name: str, times: Sequence[float], low: float, high: float) -> Band:
    """A band between two values."""
    ends = [times[0], times[-1]]
    return Band(name, "truth", ends, [low, low], [high, high])


def inside(values: Sequence[float], low: float, high: float, freedom: int) -> str:
    """How many of the values are in the band, and how many above it, in words."""
    count = sum(low <= value <= high for value in values)
    above = sum(value > high for value in values)
    mean = math.fsum(values) / len(values)
    return (
        f"{_percent(count, len(values))} of {len(values)} inside the 95 % band, "
        f"{_percent(above, len(values))} above, mean {mean:.2f} (expected {freedom})"
    )


def _percent(count: int, of: int) -> str:
    return f"{100.0 * count / of:.1f} %"


def _root(variance: float) -> float:
    return math.sqrt(max(0.0, variance))
