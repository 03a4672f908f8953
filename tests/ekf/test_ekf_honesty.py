"""Claims about honesty: over 100 simulated drives the errors are as large as the EKF says."""

from typing import Literal

import pytest

from lodeline.bench.scenes.rides import SIGMA, mean_nees, wheels_with
from lodeline.ekf import LocalizerParams

READINGS = 150


def monte_carlo(
    params: LocalizerParams, way: float, interval_ns: int, first_seed: int = 1000
) -> list[float]:
    return mean_nees(
        params,
        wheels_with(2e-5),
        way,
        interval_ns,
        runs=100,
        readings=READINGS,
        first_seed=first_seed,
    )


@pytest.mark.parametrize(
    ("model", "way", "interval_ns", "first_seed"),
    [
        ("plain", 0.018, 200_000_000, 1000),
        ("edges", 0.012, 200_000_000, 20_000),
        *(("edges", 0.006, 50_000_000, seed) for seed in (0, 1000, 5000, 20_000)),
    ],
)
def test_errors_are_as_large_as_the_covariance_says(
    model: Literal["plain", "edges"], way: float, interval_ns: int, first_seed: int
) -> None:
    """3 degrees of freedom: mean 3; 95 % of means over 100 runs lie between 2.54 and 3.50."""
    params = LocalizerParams(initial_sigma=SIGMA, magnet_model=model)
    means = monte_carlo(params, way, interval_ns, first_seed)
    assert 2.6 <= sum(means) / READINGS <= 3.4
    assert sum(2.54 <= mean <= 3.50 for mean in means) >= 0.80 * READINGS


def test_at_20_hz_the_plain_model_is_too_sure() -> None:
    """Why there is another: three readings of one passage are not three measurements."""
    plain = LocalizerParams(initial_sigma=SIGMA, magnet_model="plain")
    assert sum(monte_carlo(plain, 0.006, 50_000_000)) / READINGS > 4.0
