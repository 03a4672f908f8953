"""Claims about the default method: gyro bias at rest, magnets, gaps in time, and its cost."""

from collections.abc import Callable
from math import cos, degrees, pi, radians, sin
from random import Random
from time import process_time

import pytest

from lodeline.attitude.base import GRAVITY
from lodeline.attitude.dcm import Dcm
from lodeline.attitude.score import attitude_error
from lodeline.attitude.soft import Soft, SoftParams
from lodeline.rotation import Vector, conjugate, from_euler, rotate, wrap_angle, yaw_of

DT = 0.01
EARTH: Vector = (0.0, 20e-6, -40e-6)
AT_DOOR: Vector = (15e-6, 25e-6, -55e-6)  # beside a magnet: 62 uT, north turned by 31 deg

Rate = Callable[[float], float]


def noisy(rng: Random, v: Vector, std: float) -> Vector:
    return (v[0] + rng.gauss(0.0, std), v[1] + rng.gauss(0.0, std), v[2] + rng.gauss(0.0, std))


class Robot:
    """A flat robot that turns about z as told, with the noise of an MPU-9250."""

    def __init__(self, bias: Vector = (0.0, 0.0, 0.0), yaw: float = 0.0) -> None:
        self.estimator = Soft(SoftParams(latency=0.0))
        self.bias, self.yaw, self.rng = bias, yaw, Random(5)

    def drive(self, seconds: float, rate: Rate | float = 0.0, field: Vector | None = EARTH) -> None:
        for i in range(round(seconds / DT)):
            before = self.yaw
            self.yaw += DT * (rate(i * DT) if callable(rate) else rate)
            gyro = (self.bias[0], self.bias[1], self.bias[2] + (self.yaw - before) / DT)
            seen = None
            if field is not None:
                seen = noisy(self.rng, rotate(from_euler(0, 0, -self.yaw), field), 4e-7)
            self.estimator.update(
                DT,
                noisy(self.rng, gyro, 0.002),
                noisy(self.rng, (0.0, 0.0, GRAVITY), 0.03),
                seen,
            )

    @property
    def heading_error(self) -> float:
        """In degrees."""
        return abs(degrees(wrap_angle(yaw_of(self.estimator.orientation) - self.yaw)))


def test_gyro_bias_is_learned_while_the_robot_rests() -> None:
    robot = Robot(bias=(radians(0.6), radians(-0.4), radians(0.5)))
    robot.drive(10.0)
    found = [degrees(b) for b in robot.estimator.gyro_bias]
    assert found == pytest.approx([0.6, -0.4, 0.5], abs=0.02)


def test_a_gross_bias_is_learned_once_the_compass_stands_still_with_the_robot() -> None:
    robot = Robot(bias=(0.0, 0.0, radians(4.5)))
    robot.drive(40.0)
    assert degrees(robot.estimator.gyro_bias[2]) == pytest.approx(4.5, abs=0.05)
    assert robot.heading_error < 2.0


@pytest.mark.parametrize("field", [EARTH, None])
def test_a_long_smooth_arc_is_not_mistaken_for_rest(field: Vector | None) -> None:
    """0.3 m/s on a radius of 6 m, more than a full circle: rate 2.9 deg/s, all sensors quiet."""
    robot = Robot(bias=(0.0, 0.0, radians(0.3)))
    robot.drive(20.0)
    robot.drive(150.0, lambda t: radians(2.9) * min(1.0, t), field)
    assert degrees(robot.estimator.gyro_bias[2]) == pytest.approx(0.3, abs=0.05)
    assert robot.heading_error < 3.0


def test_slow_turns_to_and_fro_are_not_learned_as_bias() -> None:
    robot = Robot()
    robot.drive(30.0)
    robot.drive(300.0, lambda t: 0.05 * sin(t))
    assert abs(degrees(robot.estimator.gyro_bias[2])) < 0.1
    assert robot.heading_error < 2.0


def test_a_field_five_times_too_strong_for_six_seconds_costs_less_than_two_degrees() -> None:
    robot = Robot()
    robot.drive(30.0, lambda t: 0.5 * sin(t))
    before = robot.heading_error
    shaken: Vector = (100e-6, 100e-6, -200e-6)
    robot.drive(6.0, lambda t: 0.5 * cos(t), shaken)
    assert robot.estimator.disturbed
    assert robot.heading_error - before < 2.0
    robot.drive(2.0)
    assert not robot.estimator.disturbed


def turned_north(angle: float) -> Vector:
    """The earth's field in strength and dip, but pointing elsewhere [deg, to the west]."""
    return rotate(from_euler(0.0, 0.0, radians(angle)), EARTH)


def test_a_magnet_to_the_side_of_north_is_noticed_by_its_jump() -> None:
    """Strength and dip stay as they were; only the gyro knows that the robot did not turn.

    Without that, two and a half time constants would take the heading 37 degrees along.
    """
    robot = Robot()
    robot.drive(30.0, lambda t: 0.5 * sin(t))
    robot.drive(15.0, lambda t: 0.5 * sin(t), turned_north(40.0))
    assert robot.heading_error < 9.0
    robot.drive(15.0, lambda t: 0.5 * sin(t))
    assert robot.heading_error < 2.0


def test_a_north_that_stays_elsewhere_is_believed_in_the_end_and_doubted_until_then() -> None:
    """Turned unseen by 60 degrees: the gyro missed it, so the compass must win within minutes."""
    robot = Robot()
    robot.drive(30.0)
    robot.yaw += radians(60.0)
    for _ in range(24):
        robot.drive(10.0, lambda t: 0.05 * sin(t))
    assert robot.heading_error < 3.0
    assert degrees(robot.estimator.heading_std) < 10.0


def test_a_start_beside_a_magnet_is_put_right_after_driving_off() -> None:
    robot = Robot()
    robot.drive(10.0, 0.0, AT_DOOR)
    assert robot.heading_error > 25.0  # nothing can be known yet
    robot.drive(60.0, lambda t: 0.6 * sin(0.3 * t))
    assert robot.heading_error < 3.0
    assert not robot.estimator.disturbed


def test_doubt_about_a_bad_start_shows_in_the_heading_std() -> None:
    robot = Robot()
    robot.drive(10.0, 0.0, AT_DOOR)
    doubt = 0.0
    for _ in range(60):
        robot.drive(1.0, 0.6)
        doubt = max(doubt, degrees(robot.estimator.heading_std))
    assert doubt > 20.0
    assert robot.heading_error < 2.0 * degrees(robot.estimator.heading_std)


def test_a_robot_parked_beside_a_switched_on_magnet_keeps_its_north() -> None:
    robot = Robot()
    robot.drive(20.0, lambda t: 0.5 * sin(t))
    robot.drive(120.0, 0.0, AT_DOOR)
    assert robot.heading_error < 3.0
    assert robot.estimator.disturbed


def test_without_north_the_heading_std_grows_faster_than_the_error() -> None:
    robot = Robot(bias=(0.0, 0.0, radians(0.1)))
    robot.drive(10.0)
    for _ in range(60):
        robot.drive(10.0, lambda t: 0.5 * sin(t), None)
        assert robot.heading_error < 2.0 * degrees(robot.estimator.heading_std)


def test_a_gap_of_a_second_in_a_steady_turn_is_bridged() -> None:
    robot = Robot()
    robot.drive(10.0)
    robot.drive(2.0, 0.5)
    robot.yaw += 0.5 * 1.0
    field = rotate(from_euler(0, 0, -robot.yaw), EARTH)
    robot.estimator.update(1.0, (0.0, 0.0, 0.5), (0.0, 0.0, GRAVITY), field)
    assert robot.heading_error < 2.0


def test_shaking_does_not_tilt_it() -> None:
    """Ten seconds of 5 m/s^2 to and fro at 3 Hz tilt a plain accelerometer by 27 degrees."""
    estimator = Soft()
    level = from_euler(0.0, 0.0, 0.0)
    worst = 0.0
    for i in range(2000):
        push = 5.0 * sin(2 * pi * 3.0 * i * DT) if i > 1000 else 0.0
        estimator.update(DT, (0, 0, 0), (push, 0.0, GRAVITY), rotate(conjugate(level), EARTH))
        worst = max(worst, degrees(attitude_error(estimator.orientation, level).inclination))
    assert worst < 0.7


@pytest.mark.parametrize("name", ["tilt_time", "heading_time", "norm_tolerance", "learn_time"])
def test_a_time_or_tolerance_of_zero_is_refused_by_name(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be above zero"):
        SoftParams(**{name: 0.0})


def test_it_costs_at_most_three_and_a_half_times_the_dcm() -> None:
    def cost(estimator: Soft | Dcm) -> float:
        best = 1.0
        for _ in range(7):
            start = process_time()
            for _ in range(2000):
                estimator.update(DT, (0.1, 0.2, 0.3), (0.1, 0.2, 9.8), EARTH)
                _ = estimator.orientation
            best = min(best, (process_time() - start) / 2000)
        return best

    soft, dcm = cost(Soft()), cost(Dcm())
    print(f"soft {soft * 1e6:.1f} us, dcm {dcm * 1e6:.1f} us")
    assert soft <= 3.5 * dcm
