"""What the reed bar met: which reeds closed when, and how far off the magnets were."""

from __future__ import annotations

import math
from itertools import pairwise

from lodeline.ekf.distances import Distance, Distances
from lodeline.ekf.samples import Hits, Motion
from lodeline.plotting import NothingToPlotError
from lodeline.plotting.figure import Curve, Figure, Limit, Panel
from lodeline.plotting.honesty import belief_of, flat, inside, scatter
from lodeline.plotting.numbers import chi_square_band, running_mean
from lodeline.plotting.run import Run
from lodeline_msgs import MagnetDetection, Odometry, PoseEstimate, ReedBar

LEAST_REEDS = 8
AVERAGED = 20
"""Innovations to a running mean: enough for a narrow band, few enough to see when it leaves."""


def reeds(run: Run) -> Figure:
    """One row for each reed, dark while it is closed; a state lasts until the next reading."""
    samples = run.first(ReedBar)
    times = run.times(samples)
    count = max(LEAST_REEDS, *(each.closed.bit_length() for each in samples))
    spans: list[tuple[int, float, float]] = []
    for reed in range(count):
        begun: float | None = None
        for (sample, time), (_, after) in pairwise(
            [*zip(samples, times, strict=True), (samples[-1], times[-1])]
        ):
            closed = bool(sample.closed >> reed & 1)
            if closed and begun is None:
                begun = time
            if begun is not None and not closed:
                spans.append((reed + 1, begun, time))
                begun = None
            elif begun is not None and after == times[-1]:
                spans.append((reed + 1, begun, after))
                break
    names = [f"{n}" for n in range(1, count + 1)]
    names[0], names[-1] = f"right {names[0]}", f"left {names[-1]}"
    panel = Panel("reed", "", rows=tuple(names), spans=tuple(sorted(spans)))
    return Figure("reeds", "Reed switches", "a bar while the reed is closed", (panel,))


def mahalanobis(run: Run) -> Figure:
    """How far each magnet met was from the nearest of the lattice and from its neighbours."""
    found = distances(run)
    if not found:
        raise NothingToPlotError("no magnet was met")
    near = [(each.stamp_ns - run.start) * 1e-9 for each in found]
    other = [time for time, each in zip(near, found, strict=True) for _ in each.neighbours]
    nearest = [math.sqrt(each.nearest) for each in found]
    neighbours = [math.sqrt(value) for each in found for value in each.neighbours]
    gate = math.sqrt(run.params.gate)
    panel = Panel(
        "distance",
        "σ",
        (
            Curve("neighbours", "odom", other, neighbours, style="dots", faint=True),
            Curve("nearest magnet", "ekf", near, nearest, style="dots"),
        ),
        limits=(Limit("gate", gate),),
        log=True,
    )
    inside = sum(value <= gate for value in nearest)
    torn = sum(
        each.nearest <= run.params.gate and min(each.neighbours) <= run.params.gate
        for each in found
    )
    note = (
        f"gate √{run.params.gate:g} = {gate:.2f}; nearest inside {inside} of {len(found)}, "
        f"a neighbour too {torn} times"
    )
    return Figure("mahalanobis", "Mahalanobis distance of the magnets", note, (panel,))


def nis(run: Run) -> Figure:
    """Innovations in units of their covariance: of each magnet met, and their running mean.

    What the filter said of each reading is paler: by `edges` the readings of one magnet share what
    it tells, so theirs are small by design.
    """
    said = _said(run)
    try:
        found = distances(run)
    except NothingToPlotError:
        found = []
    if not found and not said:
        raise NothingToPlotError("no innovation in it: no magnet was met")
    times, values = [time for time, _ in said], [value for _, value in said]
    curves = [Curve("each reading", "odom", times, values, style="dots", faint=True)]
    if found:
        times = [(each.stamp_ns - run.start) * 1e-9 for each in found]
        values = [each.nearest for each in found]
        curves.append(Curve("each magnet met", "ekf", times, values, style="dots"))
    gate = Limit("gate", run.params.gate)
    panels = [scatter("NIS", curves, chi_square_band(2), (gate,))]
    if len(values) >= 2 * AVERAGED:
        means, later = running_mean(values, AVERAGED), times[AVERAGED - 1 :]
        band = flat("95 % band", later, *chi_square_band(2, AVERAGED))
        curve = Curve(f"mean of {AVERAGED}", "ekf", later, means)
        expected = (Limit("expected", 2.0),)
        panels.append(Panel(f"mean of {AVERAGED}", "1", (curve,), (band,), expected))
    note = inside(values, *chi_square_band(2), 2)
    return Figure("nis", "Consistency: NIS of the magnets", note, tuple(panels))


def _said(run: Run) -> list[tuple[float, float]]:
    """(time, NIS) of each innovation that the filter told: it repeats the last one."""
    samples = run.first(PoseEstimate)
    return [
        (time, each.nis)
        for before, each, time in zip([None, *samples], samples, run.times(samples), strict=False)
        if each.nis > 0.0 and (before is None or each.nis != before.nis)
    ]


def distances(run: Run) -> list[Distance]:
    """By the filter's own prediction and innovation; see `lodeline.ekf.distances`."""
    posed, detections = run.first(PoseEstimate), run.first(MagnetDetection)
    odometry = run.first(Odometry)
    samples: list[tuple[int, int, Motion | Hits | PoseEstimate]] = [
        (
            each.stamp,
            0,
            Motion(
                each.stamp,
                each.x,
                each.y,
                each.yaw,
                each.twist_covariance,
                each.interval,
                each.resets,
            ),
        )
        for each in odometry
    ]
    samples += [(each.stamp, 1, Hits(each.stamp, each.lateral)) for each in detections]
    samples += [(each.stamp, 2, each) for each in posed]
    told = Distances(run.params)
    for stamp, _, sample in sorted(samples, key=lambda each: each[:2]):
        if isinstance(sample, PoseEstimate):
            told.pose(stamp, belief_of(sample))
        else:
            told.take(sample)
    return told.found
