"""Claims about the error-state filter: its covariance is honest, and a magnet cannot topple it."""

from collections.abc import Iterator
from math import cos, degrees, exp, radians, sin, sqrt
from random import Random

import numpy as np
import pytest

from lodeline.attitude.base import GRAVITY
from lodeline.attitude.error_state import MekfParams
from lodeline.attitude.mekf import Mekf
from lodeline.attitude.score import attitude_error
from lodeline.rotation import (
    Quaternion,
    Vector,
    conjugate,
    from_euler,
    from_rotation_vector,
    multiply,
    rotate,
    to_euler,
    to_rotation_vector,
    wrap_angle,
    yaw_of,
)

DT = 0.02
EARTH: Vector = (0.0, 20e-6, -40e-6)
LEVEL: Vector = (0.0, 0.0, GRAVITY)
STILL: Vector = (0.0, 0.0, 0.0)
# Of the scale error and the compass offset no sample tells, so the simulation leaves them out.
MATCHED = MekfParams(latency=0.0, gyro_scale=0.0, compass_wander=0.03, compass_noise=0.03)


def gauss(rng: Random, std: float) -> Vector:
    return (rng.gauss(0.0, std), rng.gauss(0.0, std), rng.gauss(0.0, std))


def plus(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def lasting(rng: Random, before: float, std: float, time: float) -> float:
    """One step of a deviation that lasts about `time` seconds (Gauss-Markov)."""
    keep = exp(-DT / time)
    return keep * before + rng.gauss(0.0, std * sqrt(1.0 - keep * keep))


def normalised_errors(seed: int, seconds: float) -> Iterator[tuple[float, float]]:
    """(time, squared error in units of the covariance) of one run with the noise as told."""
    p, rng = MATCHED, Random(seed)
    estimator = Mekf(p)
    truth = from_euler(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-3, 3))
    bias, push, wander = gauss(rng, p.bias_at_start), gauss(rng, p.push), 0.0
    rate: Vector = STILL
    for i in range(round(seconds / DT)):
        t = i * DT
        after = (0.3 * sin(0.9 * t + seed), 0.3 * cos(0.7 * t), 0.6 * sin(0.2 * t + seed))
        if i > 0:
            mean = plus(rate, after)
            turn = (mean[0] * 0.5 * DT, mean[1] * 0.5 * DT, mean[2] * 0.5 * DT)
            truth = multiply(truth, from_rotation_vector(turn))
        rate = after
        bias = plus(bias, gauss(rng, p.bias_walk * sqrt(DT)))
        x, y, z = (lasting(rng, v, p.push, p.push_time) for v in push)
        push = (x, y, z)
        wander = lasting(rng, wander, p.compass_wander, p.compass_time)
        there = conjugate(truth)
        force = plus(rotate(there, plus(LEVEL, push)), gauss(rng, p.accel_noise))
        off = wander + rng.gauss(0.0, p.compass_noise)
        field = rotate(there, rotate(from_euler(0.0, 0.0, off), EARTH))
        gyro = plus(plus(rate, bias), gauss(rng, p.gyro_noise / sqrt(DT)))
        estimator.update(DT, gyro, force, field)
        if i % 50 == 49:
            d = to_rotation_vector(multiply(truth, conjugate(estimator.orientation)))
            e = [b - c for b, c in zip(bias, estimator.gyro_bias, strict=True)]
            error = np.array([*d, *e])
            yield t, float(error @ np.linalg.solve(np.array(estimator.covariance), error))


def test_errors_are_as_large_as_the_covariance_says() -> None:
    """NEES over 16 runs: 6 on average for six errors, within what the model leaves out."""
    seen = [nees for seed in range(16) for t, nees in normalised_errors(seed, 60.0) if t > 10]
    print(f"NEES {np.mean(seen):.2f} of 6 over {len(seen)} looks")
    assert 4.5 < np.mean(seen) < 7.5
    # 95 % band of a chi-square with 6 degrees of freedom: 1.24 to 14.45
    inside = np.mean([1.24 < nees < 14.45 for nees in seen])
    assert inside > 0.8


def test_covariance_stays_positive_definite() -> None:
    rng = Random(2)
    estimator = Mekf()
    for i in range(4000):
        field = gauss(rng, 40e-6) if i % 3 == 0 else None
        dt = rng.choice((0.001, 0.01, 0.1, 3.0))
        estimator.update(dt, gauss(rng, 2.0), gauss(rng, 10.0), field)
        if i % 20 == 0:
            p = np.array(estimator.covariance)
            assert np.array_equal(p, p.T)
            assert np.linalg.eigvalsh(p).min() > 0.0


def test_a_magnet_turns_the_heading_at_most_and_never_the_tilt() -> None:
    estimator = Mekf()
    for _ in range(500):
        estimator.update(DT, STILL, LEVEL, EARTH)
    for _ in range(1500):
        estimator.update(DT, STILL, LEVEL, (60e-6, -10e-6, 30e-6))
    roll, pitch, yaw = to_euler(estimator.orientation)
    assert estimator.disturbed
    assert abs(degrees(roll)) < 0.05
    assert abs(degrees(pitch)) < 0.05
    assert abs(degrees(yaw)) < 2.0


def test_a_compass_that_errs_turns_the_heading_and_hardly_the_tilt() -> None:
    """North that turns by 15 degrees at once, with the right strength and dip, is believed in the
    end: half of it within 20 s, all but a tenth in two minutes.
    """
    estimator = Mekf()
    for _ in range(250):
        estimator.update(DT, STILL, LEVEL, EARTH)
    aside = rotate(from_euler(0.0, 0.0, radians(15.0)), EARTH)
    for _ in range(3):  # as many as one correction takes
        estimator.update(DT, STILL, LEVEL, aside)
    roll, pitch, yaw = to_euler(estimator.orientation)
    assert abs(degrees(yaw)) > 0.03
    assert abs(degrees(roll)) < 1e-4
    assert abs(degrees(pitch)) < 1e-4
    yaws, tilt = [], 0.0
    for _ in range(round(120.0 / DT)):
        estimator.update(DT, STILL, LEVEL, aside)
        roll, pitch, yaw = to_euler(estimator.orientation)
        tilt = max(tilt, abs(roll), abs(pitch))  # only through the bias of the gyro
        yaws.append(degrees(yaw))
    assert yaws[round(20.0 / DT)] < -7.5
    assert yaws[-1] == pytest.approx(-15.0, abs=1.5)
    assert degrees(tilt) < 0.01


def test_samples_from_before_a_hole_are_not_mixed_with_those_after() -> None:
    estimator = Mekf()
    for _ in range(501):  # leaves samples gathered, waiting for the next correction
        estimator.update(DT, STILL, LEVEL, EARTH)
    turned = from_euler(0.0, 0.0, 1.3)
    estimator.update(1.3, STILL, LEVEL, rotate(conjugate(turned), EARTH))
    assert degrees(attitude_error(estimator.orientation, turned).total) < 8.0


def test_gyro_bias_is_found_within_its_own_standard_deviation() -> None:
    rng, bias = Random(4), (radians(0.5), radians(-0.4), radians(0.3))
    estimator = Mekf()
    for _ in range(round(180 / DT)):
        gyro = plus(bias, gauss(rng, 0.002))
        force = plus(LEVEL, gauss(rng, 0.05))
        estimator.update(DT, gyro, force, plus(EARTH, gauss(rng, 4e-7)))
    for axis, (found, true) in enumerate(zip(estimator.gyro_bias, bias, strict=True)):
        std = sqrt(estimator.covariance[3 + axis][3 + axis])
        assert std < radians(0.1)
        assert abs(found - true) < 3.0 * std


def test_without_a_compass_the_heading_std_grows_and_holds_the_error() -> None:
    estimator = Mekf()
    estimator.update(DT, STILL, LEVEL, EARTH)
    first = estimator.heading_std
    for i in range(round(60 / DT)):  # swaying, so that the bias cannot be learned at rest
        sway = 0.3 * sin(2.0 * i * DT)
        estimator.update(DT, (0.0, 0.0, sway + radians(0.3)), LEVEL)
    assert estimator.heading_std > 2.0 * first
    swayed = 0.15 * (1.0 - cos(2.0 * 60.0))
    assert abs(wrap_angle(yaw_of(estimator.orientation) - swayed)) < 2.0 * estimator.heading_std


@pytest.mark.parametrize("start", [from_euler(0.4, -0.3, 1.0), from_euler(3.0, 0.2, -2.0)])
def test_settles_from_a_push_at_the_start(start: Quaternion) -> None:
    estimator = Mekf()
    force, field = rotate(conjugate(start), LEVEL), rotate(conjugate(start), EARTH)
    estimator.update(DT, STILL, plus(force, (2.0, -1.0, 0.5)), field)
    for _ in range(round(60 / DT)):
        estimator.update(DT, STILL, force, field)
    assert degrees(attitude_error(estimator.orientation, start).total) < 2.0
