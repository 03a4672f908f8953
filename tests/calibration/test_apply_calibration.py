"""Claims about applying a calibration."""

from dataclasses import fields
from math import inf, nan, pi
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline.calibration import Calibrator, ImuCalibration
from lodeline.params import build
from lodeline.rotation import Vector, from_euler, rotate

vectors = st.tuples(*[st.floats(-50, 50)] * 3)
angles = st.tuples(*[st.floats(-3, 3)] * 3)


@given(vectors)
def test_without_a_calibration_nothing_changes(raw: Vector) -> None:
    same = Calibrator(ImuCalibration())
    assert same.angular_velocity(raw) == same.linear_acceleration(raw) == raw
    assert same.magnetic_field(raw) == raw


def test_gyro_lying_still_reads_zero() -> None:
    zero = (0.079, 0.001, 0.020)
    assert Calibrator(ImuCalibration(gyro_zero=zero)).angular_velocity(zero) == (0.0, 0.0, 0.0)


def test_accelerometer_offset_goes_before_scale() -> None:
    calibration = ImuCalibration(accel_offset=(1.0, 0.0, 0.2), accel_scale=(2.0, 1.0, 0.5))
    assert Calibrator(calibration).linear_acceleration((3.0, 4.0, 1.2)) == pytest.approx(
        (4.0, 4.0, 0.5)
    )


def test_hard_iron_goes_before_soft_iron() -> None:
    calibration = ImuCalibration(
        mag_offset=(1e-6, 2e-6, 3e-6), mag_matrix=(1, 0.5, 0, 0, 2, 0, 0, 0, 3)
    )
    assert Calibrator(calibration).magnetic_field((2e-6, 4e-6, 4e-6)) == pytest.approx(
        (2e-6, 4e-6, 3e-6)
    )


def test_soft_iron_is_in_chip_axes_also_when_the_chip_is_turned() -> None:
    turned = ImuCalibration(mag_matrix=(2, 0, 0, 0, 1, 0, 0, 0, 1), mounting=(0.0, 0.0, pi / 2))
    assert Calibrator(turned).magnetic_field((1e-6, 0.0, 0.0)) == pytest.approx((0.0, 2e-6, 0.0))


def test_accelerometer_scale_is_in_chip_axes_also_when_the_chip_is_turned() -> None:
    turned = ImuCalibration(accel_scale=(2.0, 1.0, 1.0), mounting=(0.0, 0.0, pi / 2))
    assert Calibrator(turned).linear_acceleration((1.0, 0.0, 0.0)) == pytest.approx((0, 2.0, 0))


def test_a_chip_mounted_upside_down_still_feels_gravity_upwards() -> None:
    calibrator = Calibrator(ImuCalibration(mounting=(pi, 0.0, 0.0)))
    assert calibrator.linear_acceleration((0.0, 0.0, -9.81)) == pytest.approx((0.0, 0.0, 9.81))


def test_a_chip_whose_x_points_left_reports_its_x_on_body_y() -> None:
    calibrator = Calibrator(ImuCalibration(mounting=(0.0, 0.0, pi / 2)))
    assert calibrator.angular_velocity((1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))
    assert calibrator.magnetic_field((0.0, 1.0, 0.0)) == pytest.approx((-1.0, 0.0, 0.0))


@given(angles, vectors, vectors)
def test_corrections_are_in_chip_axes_and_the_mounting_comes_last(
    mounting: Vector, zero: Vector, raw: Vector
) -> None:
    calibrator = Calibrator(ImuCalibration(gyro_zero=zero, mounting=mounting))
    chip = (raw[0] - zero[0], raw[1] - zero[1], raw[2] - zero[2])
    expected = rotate(from_euler(*mounting), chip)
    assert calibrator.angular_velocity(raw) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("name", [item.name for item in fields(ImuCalibration)])
def test_wrong_lengths_and_non_finite_numbers_are_refused_by_name(name: str) -> None:
    length = 9 if name == "mag_matrix" else 3
    wrong: dict[str, Any] = {name: (1.0,) * (length - 1)}
    with pytest.raises(ValueError, match=f"{name} must have {length} numbers, got {length - 1}"):
        ImuCalibration(**wrong)
    for bad in (nan, inf):
        wrong[name] = (bad,) * length
        with pytest.raises(ValueError, match=f"{name} must be finite"):
            ImuCalibration(**wrong)


@pytest.mark.parametrize(
    "matrix", [(0.0,) * 9, (1, 0, 0, 2, 0, 0, 0, 0, 1), (1, 2, 3, 4, 5, 6, 7, 8, 9)]
)
def test_singular_soft_iron_is_refused(matrix: Any) -> None:
    with pytest.raises(ValueError, match="mag_matrix is singular"):
        ImuCalibration(mag_matrix=matrix)


def test_tiny_but_regular_soft_iron_is_accepted() -> None:
    tiny = ImuCalibration(mag_matrix=(1e-6, 0, 0, 0, 1e-6, 0, 0, 0, 1e-6))
    assert Calibrator(tiny).magnetic_field((40.0, 0.0, 0.0)) == pytest.approx((4e-5, 0.0, 0.0))


def test_accelerometer_scale_must_be_positive() -> None:
    with pytest.raises(ValueError, match="accel_scale must be positive"):
        ImuCalibration(accel_scale=(1.0, -1.0, 1.0))


def test_a_pipeline_file_can_carry_it() -> None:
    made, problems = build(ImuCalibration, {"gyro_zero": [0.1, 0, 0.2], "mounting": [0, 0, 1]})
    assert not problems
    assert made == ImuCalibration(gyro_zero=(0.1, 0.0, 0.2), mounting=(0.0, 0.0, 1.0))
    _, problems = build(ImuCalibration, {"gyro_zero": [0.1, 0.2]})
    assert [p.text for p in problems] == ["gyro_zero must be a list of 3 [rad/s], got a list of 2"]
