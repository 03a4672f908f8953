"""Claims about the calibrations that a resting sensor gives."""

import csv
import os
from math import degrees, radians
from pathlib import Path
from random import Random

import pytest

from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.calibration.quality import CalibrationRefusedError
from lodeline.calibration.still import GRAVITY, fit_accelerometer, gyro_zero, resting_means
from lodeline.rotation import Vector

DATA = os.environ.get("LODELINE_DATA")
RATE = 100.0
ZERO: Vector = (radians(4.5), radians(0.05), radians(1.1))
SIDES = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
OFFSET: Vector = (0.4, -0.25, 0.6)
SCALE: Vector = (1.02, 0.985, 1.01)


def around(rng: Random, v: Vector, noise: float) -> Vector:
    return (v[0] + rng.gauss(0, noise), v[1] + rng.gauss(0, noise), v[2] + rng.gauss(0, noise))


def at_rest(seconds: float, seed: int = 1) -> list[Vector]:
    rng = Random(seed)
    return [around(rng, ZERO, radians(0.1)) for _ in range(round(seconds * RATE))]


def reading(force: Vector) -> Vector:
    """What the uncalibrated chip makes of a specific force."""
    x, y, z = (f / k + o for f, k, o in zip(force, SCALE, OFFSET, strict=True))
    return (x, y, z)


def on_sides(lean: float = 0.1, seed: int = 1) -> list[Vector]:
    """The six sides, none of them quite level."""
    rng, readings = Random(seed), []
    for side in SIDES:
        x, y, z = around(rng, side, lean)
        k = GRAVITY / (x * x + y * y + z * z) ** 0.5
        readings.append(reading((k * x, k * y, k * z)))
    return readings


def test_zero_point_is_found_within_a_hundredth_of_a_degree_per_second() -> None:
    found = gyro_zero(at_rest(10.0), RATE)
    assert [degrees(v) for v in found.zero] == pytest.approx([degrees(v) for v in ZERO], abs=0.01)
    assert found.duration == pytest.approx(10.0)
    assert degrees(found.error) < 0.01
    assert "4.5" in found.verdict


def test_its_error_bar_holds_the_error_in_most_runs() -> None:
    held = 0
    for seed in range(40):
        found = gyro_zero(at_rest(5.0, seed), RATE)
        errors = (abs(a - b) for a, b in zip(found.zero, ZERO, strict=True))
        held += max(errors) < 2.5 * found.error
    assert held >= 34


@pytest.mark.parametrize(
    ("rates", "reason"),
    [
        (at_rest(1.0), "1.0 s of rest are too short"),
        ([(0.0, 0.0, 0.0)] * 1000, "same number for ever"),
        ([(0.0, 0.0, radians(30) + i * 1e-6) for i in range(1000)], "30 deg/s is no zero-point"),
        ([(0.0, float("inf"), 0.0)] * 1000, "not finite"),
    ],
)
def test_what_is_no_rest_is_refused_with_the_reason(rates: list[Vector], reason: str) -> None:
    with pytest.raises(CalibrationRefusedError, match=reason):
        gyro_zero(rates, RATE)


def test_a_robot_that_drives_on_evenly_is_told_by_its_wheels() -> None:
    """Its gyro reads as at rest, or the same turn all the time."""
    level = [(0.0, 0.0, GRAVITY)] * 500
    rng = Random(5)
    trembling = [(round(rng.gauss(1000, 2)), round(rng.gauss(0, 2))) for i in range(500)]
    assert gyro_zero(at_rest(5.0), RATE, level, trembling) == gyro_zero(at_rest(5.0), RATE)
    turning = [(x, y, z + radians(5.0)) for x, y, z in at_rest(5.0)]
    rolling = [(1000, i // 10) for i in range(250)]
    for rates in (at_rest(5.0), turning):
        with pytest.raises(CalibrationRefusedError, match="the right wheel rolled by 22 counts"):
            gyro_zero(rates, RATE, level, rolling)


def test_a_rest_shorter_than_half_a_second_is_too_short_with_wheels_too() -> None:
    with pytest.raises(CalibrationRefusedError, match=r"0\.3 s of rest are too short"):
        gyro_zero(at_rest(0.3), RATE, counts=[(5, 5)] * 15)


@pytest.mark.parametrize("shape", [[2.0] * 60 + [0.0] * 440, [0.8, -0.8] * 250])
def test_a_push_or_the_shaking_of_a_drive_is_told_by_the_accelerometer(shape: list[float]) -> None:
    forces = [(push, 0.0, GRAVITY) for push in shape]
    with pytest.raises(CalibrationRefusedError, match="pushed or shaken, by"):
        gyro_zero(at_rest(5.0), RATE, forces)


def test_a_nudge_is_refused_with_its_time() -> None:
    rates = at_rest(10.0)
    for i in range(620, 660):
        x, y, z = rates[i]
        rates[i] = (x, y + radians(10.0), z)
    with pytest.raises(CalibrationRefusedError, match=r"moved 6\.0 s after the start"):
        gyro_zero(rates, RATE)


def test_six_sides_give_offset_and_scale_even_if_not_level() -> None:
    fit = fit_accelerometer(on_sides(lean=0.1))
    assert fit.offset == pytest.approx(OFFSET, abs=0.02)
    assert fit.scale == pytest.approx(SCALE, abs=0.002)
    assert "6 positions, which six numbers always fit" in fit.verdict
    seventh = reading((0.6 * GRAVITY, 0.0, 0.8 * GRAVITY))
    assert fit_accelerometer([*on_sides(lean=0.1), seventh]).verdict.startswith("good")
    calibrator = Calibrator(ImuCalibration(accel_offset=fit.offset, accel_scale=fit.scale))
    assert calibrator.linear_acceleration(reading((0.0, 0.0, GRAVITY))) == pytest.approx(
        (0.0, 0.0, GRAVITY), abs=0.03
    )


@pytest.mark.parametrize(
    ("missing", "reason"),
    [(0, "x axis pointing up"), (1, "x axis pointing down"), (5, "z axis pointing down")],
)
def test_a_missing_side_is_named(missing: int, reason: str) -> None:
    readings = on_sides()
    readings[missing] = readings[(missing + 2) % 6]
    with pytest.raises(CalibrationRefusedError, match=reason):
        fit_accelerometer(readings)


def test_a_range_set_wrongly_is_refused() -> None:
    halved = [(0.5 * x, 0.5 * y, 0.5 * z) for x, y, z in on_sides()]
    with pytest.raises(CalibrationRefusedError, match=r"pointing|range is set wrongly"):
        fit_accelerometer(halved)
    raised = [(2 * x, 2 * y, 2 * z) for x, y, z in on_sides()]
    with pytest.raises(CalibrationRefusedError, match="range is set wrongly"):
        fit_accelerometer(raised)


def test_rests_are_found_in_a_recording_of_turning_and_laying_down() -> None:
    rng = Random(3)
    forces: list[Vector] = []
    rates: list[Vector] = []
    for position in on_sides():
        for _ in range(300):
            forces.append(around(rng, position, 0.05))
            rates.append(around(rng, ZERO, 0.002))
        for _ in range(100):
            forces.append(around(rng, (0.0, 0.0, GRAVITY), 4.0))
            rates.append(around(rng, (0.0, 0.0, 1.0), 1.0))
    rests = resting_means(forces, rates, RATE)
    assert len(rests) == 6
    fit = fit_accelerometer(rests)
    assert fit.offset == pytest.approx(OFFSET, abs=0.03)


@pytest.mark.skipif(DATA is None, reason="LODELINE_DATA is not set")
def test_the_real_unmoved_gyro_has_the_zero_point_it_is_known_for() -> None:
    path = Path(DATA or "", "marg_rotations", "unmoved_x_forward_first60s_gyro.csv")
    with path.open() as file:
        rows = list(csv.DictReader(file))
    rates = [(radians(float(r["x"])), radians(float(r["y"])), radians(float(r["z"]))) for r in rows]
    found = gyro_zero(rates, len(rows) / 60.0)
    assert [degrees(v) for v in found.zero] == pytest.approx([4.54, 0.05, 1.12], abs=0.03)
