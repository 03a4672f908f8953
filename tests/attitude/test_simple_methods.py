"""Claims about the methods of the courses: gyro alone, compass alone, complementary."""

from math import degrees, radians, sin

import pytest

from lodeline.attitude import make_attitude
from lodeline.attitude.base import GRAVITY
from lodeline.attitude.complementary import Complementary, ComplementaryParams, gain_of
from lodeline.attitude.complementary import time_constant_of as tau_of
from lodeline.attitude.score import attitude_error
from lodeline.calibration.minmax import flu_from_scuttle, theta, yaw_from_theta
from lodeline.rotation import Vector, conjugate, from_euler, rotate, to_euler, wrap_angle, yaw_of

LEVEL: Vector = (0.0, 0.0, GRAVITY)
EARTH: Vector = (0.0, 20e-6, -40e-6)
STILL: Vector = (0.0, 0.0, 0.0)


def test_gyro_ignores_a_magnet_and_a_push_and_keeps_its_drift() -> None:
    estimator = make_attitude("gyro")
    estimator.update(0.01, STILL, LEVEL, EARTH)
    for _ in range(1000):
        estimator.update(0.01, (0.0, 0.0, radians(1.0)), (5.0, 0.0, GRAVITY), (50e-6, 0.0, 0.0))
    roll, pitch, yaw = to_euler(estimator.orientation)
    assert (degrees(roll), degrees(pitch), degrees(yaw)) == pytest.approx((0, 0, 10.0), abs=0.02)


def test_gyro_keeps_turns_that_do_not_commute_apart() -> None:
    """Coning: two rates out of phase turn the body about the third axis."""
    estimator = make_attitude("gyro")
    fine = make_attitude("gyro")
    for step, each in ((0.01, estimator), (0.0005, fine)):
        for i in range(round(5.0 / step) + 1):
            t = i * step
            each.update(step, (2.0 * sin(20.0 * t), 2.0 * sin(20.0 * t + 1.5), 0.3), LEVEL)
    error = attitude_error(estimator.orientation, fine.orientation)
    assert degrees(error.total) < 0.22  # 0.38 without the cross product


def test_compass_agrees_with_scuttle_on_its_own_axes_and_extremes() -> None:
    raw = (11.5 + 0.42 * 26.5, -1.0 + 0.91 * 21.0, 0.0)  # microtesla, x right and y forward
    forward, left, _ = (1e-6 * value for value in flu_from_scuttle(raw))
    estimator = make_attitude("compass", field_low=(-22e-6, -38e-6), field_high=(20e-6, 15e-6))
    estimator.update(0.01, STILL, LEVEL, (forward, left, 0.0))
    assert yaw_of(estimator.orientation) == pytest.approx(yaw_from_theta(theta(0.42, 0.91)))
    assert degrees(yaw_of(estimator.orientation)) == pytest.approx(115.0, abs=0.5)


def test_compass_extremes_of_an_axis_that_never_turned_are_refused() -> None:
    with pytest.raises(ValueError, match="axis 1 never turned"):
        make_attitude("compass", field_low=(-1e-6, 2e-6), field_high=(1e-6, 2e-6))


def test_flat_compass_errs_on_a_slope_where_the_tilt_compass_does_not() -> None:
    q = from_euler(0.0, radians(20.0), radians(30.0))
    flat, tilted = make_attitude("compass"), make_attitude("tilt_compass")
    for estimator in (flat, tilted):
        estimator.update(0.01, STILL, rotate(conjugate(q), LEVEL), rotate(conjugate(q), EARTH))
    assert degrees(attitude_error(tilted.orientation, q).total) < 0.01
    assert abs(degrees(wrap_angle(yaw_of(flat.orientation)) - radians(30.0))) > 10.0


@pytest.mark.parametrize("method", ["compass", "tilt_compass", "complementary"])
def test_a_field_of_another_strength_is_reported(method: str) -> None:
    estimator = make_attitude(method)
    estimator.update(0.01, STILL, LEVEL, EARTH)
    assert not estimator.disturbed
    estimator.update(0.01, STILL, LEVEL, (0.0, 60e-6, -40e-6))
    assert estimator.disturbed


def test_the_gain_of_the_lecture_is_ten_seconds_at_a_hundred_hertz() -> None:
    assert tau_of(0.999, 0.01) == pytest.approx(9.99)
    assert gain_of(9.99, 0.01) == pytest.approx(0.999)
    assert ComplementaryParams().tau == pytest.approx(tau_of(0.999, 0.01))


@pytest.mark.parametrize("rate", [20.0, 100.0, 400.0])
def test_complementary_settles_alike_at_every_sampling_rate(rate: float) -> None:
    estimator = Complementary(ComplementaryParams(tau=2.0))
    lean = from_euler(radians(20.0), 0.0, 0.0)
    estimator.update(1 / rate, STILL, rotate(conjugate(lean), LEVEL))
    for _ in range(round(2.0 * rate)):
        estimator.update(1 / rate, STILL, LEVEL)
    assert degrees(to_euler(estimator.orientation)[0]) == pytest.approx(20.0 / 2.718, abs=0.2)


def test_complementary_weighs_gyro_and_accelerometer_as_the_lecture_does() -> None:
    estimator = Complementary(ComplementaryParams(tau=tau_of(0.9, 0.01)))
    estimator.update(0.01, STILL, LEVEL)
    estimator.update(0.01, (1.0, 0.0, 0.0), LEVEL)
    estimator.update(0.01, (1.0, 0.0, 0.0), LEVEL)
    first = 0.9 * 0.005  # the rate rises from 0 to 1 over the first step
    assert to_euler(estimator.orientation)[0] == pytest.approx(0.9 * (first + 0.01), abs=1e-6)
