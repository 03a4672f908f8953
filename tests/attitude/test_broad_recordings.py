"""Claims about orientation on recordings with optical truth (BROAD, 95 Hz), if at hand."""

import gzip
import os
from collections.abc import Iterator
from functools import cache
from math import degrees
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from lodeline.attitude import make_attitude
from lodeline.attitude.score import AttitudeError, rms_error
from lodeline.rotation import Quaternion, Vector

DATA = os.environ.get("LODELINE_DATA")
pytestmark = pytest.mark.skipif(DATA is None, reason="LODELINE_DATA is not set")
MICROTESLA = 1e-6


class Row(NamedTuple):
    dt: float
    gyro: Vector
    force: Vector
    field: Vector
    truth: Quaternion | None  # None where it is unknown or not to be scored


def read(path: Path) -> Iterator[Row]:
    last = None
    with gzip.open(path, "rt") as lines:
        next(lines)
        for line in lines:
            t, *sensors, w, x, y, z, moving = line.split(",")
            gx, gy, gz, ax, ay, az, mx, my, mz = map(float, sensors)
            scored = w != "" and int(moving) == 1
            yield Row(
                0.0 if last is None else float(t) - last,
                (gx, gy, gz),
                (ax, ay, az),
                (mx * MICROTESLA, my * MICROTESLA, mz * MICROTESLA),
                (float(x), float(y), float(z), float(w)) if scored else None,
            )
            last = float(t)


@cache
def trials() -> dict[str, list[Row]]:
    files = sorted(Path(DATA or "", "broad_95hz").glob("*.csv.gz"))
    return {path.name[:2]: list(read(path)) for path in files}


def run(method: str, **params: Any) -> dict[str, AttitudeError]:
    """RMS errors in degrees per trial."""
    results = {}
    for trial, rows in trials().items():
        estimator = make_attitude(method, **params)
        pairs = []
        for dt, gyro, force, field, truth in rows:
            estimator.update(dt, gyro, force, field)
            if truth is not None:
                pairs.append((estimator.orientation, truth))
        results[trial] = AttitudeError(*map(degrees, rms_error(pairs)))
        print(method, params, trial, " / ".join(f"{angle:.2f}" for angle in results[trial]))
    return results


def mean(results: dict[str, AttitudeError], angle: str) -> float:
    index = AttitudeError._fields.index(angle)
    return sum(error[index] for error in results.values()) / len(results)


def test_soft_stays_within_its_figures_also_beside_magnets() -> None:
    results = run("soft")
    assert len(results) >= 9
    assert mean(results, "total") <= 1.6
    assert max(error.total for error in results.values()) <= 3.2
    assert mean(results, "inclination") <= 0.70


def test_dcm_with_the_published_gains_errs_as_published_gains_do() -> None:
    assert mean(run("dcm", gains="paper"), "total") == pytest.approx(23.0, abs=2.0)


def test_dcm_with_tuned_gains_holds_four_and_a_half_degrees() -> None:
    assert mean(run("dcm", gains="tuned"), "total") <= 4.5


def test_mekf_holds_two_degrees_on_average() -> None:
    results = run("mekf")
    assert mean(results, "total") <= 2.0
    assert max(error.total for error in results.values()) <= 4.0


def test_heading_std_of_soft_covers_the_error() -> None:
    """Two sigma hold the heading error in 95 % of all scored rows."""
    held = scored = 0
    for rows in trials().values():
        estimator = make_attitude("soft")
        for dt, gyro, force, field, truth in rows:
            estimator.update(dt, gyro, force, field)
            if truth is not None:
                error = rms_error([(estimator.orientation, truth)])
                held += error.heading <= 2.0 * estimator.heading_std
                scored += 1
    assert held >= 0.95 * scored
