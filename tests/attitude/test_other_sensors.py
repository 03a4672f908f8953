"""Claims on recordings of other sensors at other rates, whose truth is how they were moved.

An MPU-6050 with an HMC5883L (100 and 77 Hz, uneven, gyro off by 4.5 deg/s) that was laid down and
turned by hand, and a skid-steer robot's IMU (50 Hz, no magnetometer).
"""

from __future__ import annotations

import csv
import os
from bisect import bisect_right
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from math import cos, degrees, hypot, pi, radians, sin
from pathlib import Path

import pytest

from lodeline.attitude import Attitude, make_attitude
from lodeline.attitude.base import GRAVITY
from lodeline.attitude.score import rms_error
from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.calibration.compass import fit_ellipsoid
from lodeline.calibration.still import gyro_zero
from lodeline.rotation import Quaternion, Vector, to_euler, wrap_angle, yaw_of

DATA = os.environ.get("LODELINE_DATA")
pytestmark = pytest.mark.skipif(DATA is None, reason="LODELINE_DATA is not set")
STILL, TURNS, SPHERE = "unmoved_x_forward_first60s", "rotate_z_ccw_2turns", "full_sphere"
# Chip to body axes, from what turns together in SPHERE; the accelerometer shows where down is.
AXES: dict[str, Vector] = {
    "gyro": (-radians(1.0), -radians(1.0), radians(1.0)),
    "accel": (-GRAVITY, -GRAVITY, -GRAVITY),
    "mag": (1e-4, 1e-4, 1e-4),
}

both = pytest.mark.parametrize("method", ["soft", "mekf"])


def rows(*path: str) -> list[list[float]]:
    with Path(DATA or "", *path).open() as file:
        return [[float(cell) for cell in row] for row in list(csv.reader(file))[1:]]


@cache
def sensor(movement: str, kind: str) -> list[tuple[float, Vector]]:
    """(time, reading in SI and body axes)."""
    (i, j, k), table = AXES[kind], rows("marg_rotations", f"{movement}_{kind}.csv")
    return [(t, (i * x, j * y, k * z)) for t, x, y, z in table]


@cache
def calibration() -> ImuCalibration:
    """Of this sensor, from what lay still and what was turned through all directions."""
    compass = fit_ellipsoid([m for _, m in sensor(SPHERE, "mag")])
    zero = gyro_zero([w for _, w in sensor(STILL, "gyro")], rate_hz=100.0).zero
    return ImuCalibration(gyro_zero=zero, mag_offset=compass.offset, mag_matrix=compass.matrix)


def played(
    movement: str, estimator: Attitude, correct: Calibrator
) -> Iterator[tuple[float, Vector]]:
    """(time, roll, pitch and yaw) at each gyro sample; other sensors say what they said last."""
    force, field = sensor(movement, "accel"), sensor(movement, "mag")
    force_times, field_times = [t for t, _ in force], [t for t, _ in field]
    last, used = 0.0, 0
    for t, rate in sensor(movement, "gyro"):
        _, a = force[max(0, bisect_right(force_times, t) - 1)]
        seen = bisect_right(field_times, t)
        m = correct.magnetic_field(field[seen - 1][1]) if seen > used else None
        estimator.update(t - last, correct.angular_velocity(rate), a, m)
        last, used = t, seen
        yield t, to_euler(estimator.orientation)


def deviation(poses: list[Vector], axis: int) -> float:
    """Largest difference to the last one [deg]."""
    return max(degrees(abs(wrap_angle(pose[axis] - poses[-1][axis]))) for pose in poses)


@both
def test_what_lies_still_stays_where_it_is_and_shows_the_gyros_zero(method: str) -> None:
    estimator = make_attitude(method)
    uncalibrated = Calibrator(
        ImuCalibration(mag_offset=calibration().mag_offset, mag_matrix=calibration().mag_matrix)
    )
    poses = [pose for t, pose in played(STILL, estimator, uncalibrated) if t > 20.0]
    found = [deviation(poses, axis) for axis in range(3)]
    bias = [degrees(v) for v in estimator.gyro_bias]
    print(f"{method}: roll, pitch, yaw within {found} deg, bias {bias} deg/s")
    assert bias == pytest.approx([-4.54, -0.05, 1.12], abs=0.05)
    assert max(found[:2]) < 0.5
    assert found[2] < 1.5
    assert hypot(poses[-1][0], poses[-1][1]) < radians(5.0)  # level by eye
    assert degrees(abs(wrap_angle(poses[-1][2] - 0.5 * pi))) < 25.0  # north by eye


@both
def test_two_turns_by_hand_are_two_turns_and_end_where_they_began(method: str) -> None:
    poses = [
        pose
        for t, pose in played(TURNS, make_attitude(method), Calibrator(calibration()))
        if t > 1.0
    ]
    turned = sum(wrap_angle(b[2] - a[2]) for a, b in pairwise(poses))
    tilt = [degrees(poses[-1][axis] - poses[0][axis]) for axis in (0, 1)]
    print(f"{method}: turned {degrees(turned):.1f} deg, tilt at the end differs by {tilt} deg")
    assert degrees(turned) == pytest.approx(720.0, abs=12.0)
    assert tilt == pytest.approx([0.0, 0.0], abs=3.0)


@both
def test_a_skid_steer_is_where_its_imu_turns_it_and_not_its_wheels(method: str) -> None:
    """The sensor's own filter is no truth, but it agrees; wheels alone end 20 m aside."""
    estimator = make_attitude(method)
    pairs: list[tuple[Quaternion, Quaternion]] = []
    yaws: list[float] = []
    last = 0.0
    imu = rows("jackal_odom_imu", "imu.csv")
    for t, qw, qx, qy, qz, *readings in imu:
        gx, gy, gz, ax, ay, az = readings
        estimator.update(t - last, (gx, gy, gz), (ax, ay, az))
        last = t
        # yaw is from wherever it began: only the tilt can be compared
        pairs.append((estimator.orientation, (qx, qy, qz, qw)))
        yaws.append(yaw_of(estimator.orientation))
    tilt = degrees(rms_error(pairs).inclination)
    turned = degrees(sum(wrap_angle(b - a) for a, b in pairwise(yaws)))
    x = y = before = 0.0
    times = [row[0] for row in imu]
    for t, _, _, _, v, _ in rows("jackal_odom_imu", "odom.csv"):
        yaw = yaws[max(0, bisect_right(times, t) - 1)] - yaws[0]
        x, y, before = x + v * (t - before) * cos(yaw), y + v * (t - before) * sin(yaw), t
    print(f"{method}: turned {turned:.1f} deg, tilt {tilt:.2f} deg RMS, ends at ({x:.2f}, {y:.2f})")
    assert turned == pytest.approx(273.6, abs=6.0)
    assert tilt < 1.5
    assert hypot(x - 1.02, y - 3.43) < 2.0
