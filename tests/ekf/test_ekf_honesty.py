"""Claims about honesty: over 100 simulated drives the errors are as large as the EKF says."""

import math
from random import Random
from typing import Literal

import pytest

from lodeline.bench.scenes.drive import Drive
from lodeline.ekf import Belief, Localizer, LocalizerParams
from lodeline.odometry import Odometry, OdometryParams

RUNS, READINGS = 100, 150
WHEELS = OdometryParams(ticks_per_turn=3.6e6, distance_noise=2e-5)
SIGMA = (0.002, 0.02)  # of the start pose [m, rad]


def nees(drive: Drive, belief: Belief) -> float:
    """e^T P^-1 e of (x, y, yaw), by Cholesky's decomposition."""
    e = (
        belief.x - drive.x,
        belief.y - drive.y,
        math.remainder(belief.yaw - drive.yaw, 2 * math.pi),
    )
    _, _, _, p00, p01, p02, p11, p12, p22 = belief
    l00 = math.sqrt(p00)
    l10, l20 = p01 / l00, p02 / l00
    l11 = math.sqrt(p11 - l10 * l10)
    l21 = (p12 - l10 * l20) / l11
    l22 = math.sqrt(p22 - l20 * l20 - l21 * l21)
    z0 = e[0] / l00
    z1 = (e[1] - l10 * z0) / l11
    z2 = (e[2] - l20 * z0 - l21 * z1) / l22
    return z0 * z0 + z1 * z1 + z2 * z2


def monte_carlo(params: LocalizerParams, way: float, interval_ns: int) -> list[float]:
    """Mean NEES over the runs, at each reading."""
    sums = [0.0] * READINGS
    for run in range(RUNS):
        rng = Random(1000 + run)
        drive, bend = Drive(rng, params, WHEELS), rng.uniform(0.2, 0.6)
        odometry, localizer = Odometry(WHEELS), Localizer(params)
        for i in range(READINGS):
            if i > 0:
                drive.go(way, way * 2.0 * math.sin(bend * i * way * 10))
            out = odometry.update(i * interval_ns, *drive.counts())
            assert out is not None
            pose = (out.x, out.y, out.yaw)
            localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
            estimate = localizer.magnets(out.stamp_ns, drive.laterals())
            assert estimate is not None
            p = estimate.covariance
            belief = Belief(
                estimate.x, estimate.y, estimate.yaw, p[0], p[1], p[2], p[4], p[5], p[8]
            )
            sums[i] += nees(drive, belief)
    return [total / RUNS for total in sums]


@pytest.mark.parametrize(
    ("model", "way", "interval_ns"),
    [("plain", 0.018, 200_000_000), ("edges", 0.012, 200_000_000), ("edges", 0.006, 50_000_000)],
)
def test_errors_are_as_large_as_the_covariance_says(
    model: Literal["plain", "edges"], way: float, interval_ns: int
) -> None:
    """3 degrees of freedom: mean 3; 95 % of means over 100 runs lie between 2.54 and 3.50."""
    params = LocalizerParams(initial_sigma=SIGMA, magnet_model=model)
    means = monte_carlo(params, way, interval_ns)
    assert 2.6 <= sum(means) / READINGS <= 3.4
    assert sum(2.54 <= mean <= 3.50 for mean in means) >= 0.80 * READINGS


def test_at_20_hz_the_plain_model_is_too_sure() -> None:
    """Why there is another: three readings of one passage are not three measurements."""
    plain = LocalizerParams(initial_sigma=SIGMA, magnet_model="plain")
    assert sum(monte_carlo(plain, 0.006, 50_000_000)) / READINGS > 4.0
