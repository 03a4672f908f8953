"""Claims on a hand-held recording that ends lying as it began (x-io), where it is at hand."""

import csv
import os
from functools import cache
from math import degrees, radians
from pathlib import Path

import pytest

from lodeline.attitude import make_attitude
from lodeline.attitude.base import GRAVITY
from lodeline.rotation import Vector, to_euler, wrap_angle

DATA = os.environ.get("LODELINE_DATA")
pytestmark = pytest.mark.skipif(DATA is None, reason="LODELINE_DATA is not set")


@cache
def samples() -> list[tuple[float, Vector, Vector, Vector]]:
    rows = []
    with Path(DATA or "", "xio_return_to_start", "sensor_data.csv").open() as file:
        reader = csv.reader(file)
        next(reader)
        for line in reader:
            t, gx, gy, gz, ax, ay, az, mx, my, mz = map(float, line)
            rows.append(
                (
                    t,
                    (radians(gx), radians(gy), radians(gz)),
                    (ax * GRAVITY, ay * GRAVITY, az * GRAVITY),
                    (mx * 1e-6, my * 1e-6, mz * 1e-6),
                )
            )
    return rows


@pytest.mark.parametrize("method", ["soft", "mekf", "dcm"])
def test_the_end_lies_as_the_start_did(method: str) -> None:
    estimator = make_attitude(method)
    poses: list[tuple[float, Vector]] = []
    last = 0.0
    for t, gyro, force, field in samples():
        estimator.update(t - last, gyro, force, field)
        poses.append((t, to_euler(estimator.orientation)))
        last = t
    start = [pose for t, pose in poses if 2.0 < t < 4.0]
    end = [pose for t, pose in poses if t > poses[-1][0] - 2.0]
    roll, pitch, yaw = (
        degrees(
            wrap_angle(sum(p[i] for p in end) / len(end) - sum(p[i] for p in start) / len(start))
        )
        for i in range(3)
    )
    print(f"{method}: roll {roll:.2f} pitch {pitch:.2f} yaw {yaw:.2f} deg")
    assert abs(roll) < 1.0
    assert abs(pitch) < 1.0
    assert abs(yaw) < 3.0
