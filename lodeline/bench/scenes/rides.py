"""Simulated rides of a whole localiser: how far off it is, and whether it says so."""

import math
from collections.abc import Iterator
from random import Random
from typing import NamedTuple

from lodeline.bench.scenes.drive import Drive
from lodeline.ekf import Belief, Estimate, Localizer, LocalizerParams
from lodeline.odometry import Odometry, OdometryParams

SIGMA = (0.002, 0.02)  # of the start pose [m, rad]
MS = 1_000_000
STEP, STEP_NS = 0.006, 50 * MS  # 0.12 m/s, 20 readings a second


class Reading(NamedTuple):
    """One moment of a ride: way driven [m], error of the position [m], what was estimated."""

    way: float
    error: float
    estimate: Estimate


def wheels_with(noise: float) -> OdometryParams:
    """Fine encoders, and wheels whose way has a variance of `noise` [m] per metre."""
    return OdometryParams(ticks_per_turn=3.6e6, distance_noise=noise)


def ride(
    seed: int,
    params: LocalizerParams,
    wheels: OdometryParams,
    way: float,
    *,
    hidden: tuple[float, float] = (0.0, 0.0),
    delay: int = 0,
    restamped: bool = False,
    reach: float | None = None,
) -> Iterator[Reading]:
    """Bends over `way` [m]; magnets between the ways `hidden` [m] are not seen.

    Readings of the bar arrive `delay` steps late; `restamped` says that they then carry the stamp
    of their arrival, as they would without one of the sensor's. `reach`: see `Drive`.
    """
    rng = Random(seed)
    drive, bend = Drive(rng, params, wheels, reach=reach), rng.uniform(0.2, 0.6)
    odometry, localizer = Odometry(wheels), Localizer(params)
    under_way: list[tuple[float, ...]] = []
    for i in range(round(way / STEP)):
        if i > 0:
            drive.go(STEP, STEP * 2.0 * math.sin(bend * i * STEP * 10))
        out = odometry.update(i * STEP_NS, *drive.counts())
        assert out is not None
        pose = (out.x, out.y, out.yaw)
        localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
        under_way.append(() if hidden[0] <= i * STEP < hidden[1] else drive.laterals())
        if i >= delay:
            stamp_ns = (i if restamped else i - delay) * STEP_NS
            localizer.magnets(stamp_ns, under_way.pop(0))
        estimate = localizer.estimate
        assert estimate is not None
        error = math.hypot(estimate.x - drive.x, estimate.y - drive.y)
        yield Reading(i * STEP, error, estimate)


def mean_nees(
    params: LocalizerParams,
    wheels: OdometryParams,
    way: float,
    interval_ns: int,
    *,
    runs: int,
    readings: int,
    first_seed: int = 1000,
) -> list[float]:
    """Mean NEES of (x, y, yaw) over the runs, at each reading; `way` [m] from one to the next."""
    sums = [0.0] * readings
    for run in range(runs):
        rng = Random(first_seed + run)
        drive, bend = Drive(rng, params, wheels), rng.uniform(0.2, 0.6)
        odometry, localizer = Odometry(wheels), Localizer(params)
        for i in range(readings):
            if i > 0:
                drive.go(way, way * 2.0 * math.sin(bend * i * way * 10))
            out = odometry.update(i * interval_ns, *drive.counts())
            assert out is not None
            pose = (out.x, out.y, out.yaw)
            localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
            localizer.magnets(out.stamp_ns, drive.laterals())
            estimate = localizer.estimate
            assert estimate is not None
            p = estimate.covariance
            mean = (estimate.x, estimate.y, estimate.yaw)
            sums[i] += nees(drive, Belief(*mean, p[0], p[1], p[2], p[4], p[5], p[8]))
    return [total / runs for total in sums]


def nees(drive: Drive, belief: Belief) -> float:
    """NEES of (x, y, yaw) where the robot really is."""
    turn = math.remainder(belief.yaw - drive.yaw, 2 * math.pi)
    return belief.nees(belief.x - drive.x, belief.y - drive.y, turn)
