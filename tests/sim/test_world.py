"""The simulated world: the same for everybody, drifting for wheels, true to physics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import cos, hypot, pi, sin, sqrt

import pytest

from lodeline import devices
from lodeline.devices import Encoders
from lodeline.ekf import Localizer, LocalizerParams
from lodeline.i2c import open_model
from lodeline.magnets import ReedBar, ReedBarParams
from lodeline.odometry import Odometry, OdometryParams
from lodeline.rotation import from_euler, from_rotation_vector, multiply, to_euler
from lodeline.sim.course import Course
from lodeline.sim.noise import Noise
from lodeline.sim.params import RobotParams
from lodeline.sim.robot import SimulatedRobot
from lodeline.sim.sensors import Sensors
from lodeline.sim.world import STEP, Motion, World, WorldState

G = 9.80665


def motions(world: World, seconds: float, period: float) -> Iterator[Motion]:
    for i in range(1, int(seconds / period) + 1):
        yield world.at(i * period)


def odometry_errors(params: RobotParams, seconds: float) -> list[float]:
    """Distances [m] between the truth and the integral of the wheels' turning."""
    x = y = yaw = left = right = 0.0
    errors = []
    for motion in motions(World(params), seconds, 0.02):
        dl = (motion.left_angle - left) * params.wheel_radius
        dr = (motion.right_angle - right) * params.wheel_radius
        left, right = motion.left_angle, motion.right_angle
        turn = (dr - dl) / params.track
        x += 0.5 * (dl + dr) * cos(yaw + 0.5 * turn)
        y += 0.5 * (dl + dr) * sin(yaw + 0.5 * turn)
        yaw += turn
        errors.append(hypot(x - motion.x, y - motion.y))
    return errors


def test_the_trajectory_does_not_depend_on_when_it_is_looked_at() -> None:
    often, seldom = World(RobotParams()), World(RobotParams())
    for i in range(1, 4001):
        often.at(0.00123 * i)
    often.advance(7.0)
    seldom.advance(7.0)
    assert often.state == seldom.state


def test_another_seed_is_another_trajectory() -> None:
    one, other = World(RobotParams(seed=1)), World(RobotParams(seed=2))
    one.advance(5.0)
    other.advance(5.0)
    assert hypot(one.state.x - other.state.x, one.state.y - other.state.y) > 1e-5


def test_a_saved_world_goes_on_as_if_nothing_had_happened() -> None:
    whole = World(RobotParams())
    whole.advance(4.0)
    saved = asdict(whole.state)
    assert all(isinstance(value, float | int | bool) for value in saved.values())
    resumed = World(RobotParams(), WorldState(**saved))
    whole.advance(9.0)
    resumed.advance(9.0)
    assert resumed.state == whole.state


def test_sensors_read_the_same_however_often_they_are_asked() -> None:
    params = RobotParams()
    sensors, again = (Sensors(params, World(params)) for _ in range(2))
    asked = [sensors.angular_velocity(0.005 * i) for i in range(100)]
    for i in range(100):
        again.magnetic_field(0.005 * i)
        for _ in range(3):
            assert again.angular_velocity(0.005 * i) == asked[i]


def test_the_course_is_two_closed_loops_with_turns_both_ways() -> None:
    course = Course(0.35, 0.2)
    assert course.length == pytest.approx(4 * 0.35 + 4 * pi * 0.2)
    ends = (0.0, 0.5 * course.length, course.length - 1e-12)
    for s in ends:
        x, y, yaw, _ = course.at(s)
        assert (x, y, sin(yaw), cos(yaw)) == pytest.approx((0.0, 0.0, 0.0, 1.0), abs=1e-9)
    curvatures = {course.at(0.01 * i)[3] for i in range(int(course.length / 0.01))}
    assert curvatures == {0.0, 5.0, -5.0}


def test_the_robot_keeps_to_its_course_at_its_speed() -> None:
    params = RobotParams()
    course = Course(params.course_straight, params.course_radius)
    points = [course.at(0.002 * i) for i in range(int(course.length / 0.002))]
    speeds, ways = [], []
    for motion in motions(World(params), 80.0, 0.1):
        ways.append(min(hypot(x - motion.x, y - motion.y) for x, y, _, _ in points[::5]))
        speeds.append(motion.v)
    assert max(ways) < 0.02
    assert sum(speeds[20:]) / len(speeds[20:]) == pytest.approx(0.12, rel=0.02)


@pytest.mark.parametrize("seed", range(1, 7))
def test_plain_odometry_drifts_by_5_to_16_cm_within_a_minute(seed: int) -> None:
    assert 0.05 < max(odometry_errors(RobotParams(seed=seed), 60.0)) < 0.16


def test_magnets_hold_an_ekf_within_10_mm_where_odometry_drifts() -> None:
    now = 0.0
    robot = SimulatedRobot(RobotParams(), lambda: now)
    bus = open_model(robot.bus)
    encoders, bar = Encoders(bus), devices.ReedBar(bus)
    odometry = Odometry(OdometryParams(ticks_per_turn=16384))
    localizer, reeds = Localizer(LocalizerParams()), ReedBar(ReedBarParams())
    squares, drift = [], 0.0
    for i in range(1, 60 * 50):
        now = i / 50
        counts, closed, stamp = encoders.read(now), bar.read(now), round(now * 1e9)
        assert counts is not None
        assert closed is not None
        o = odometry.update(stamp, *counts)
        assert o is not None
        localizer.odometry(stamp, o.x, o.y, o.yaw, o.twist_covariance, o.interval, o.resets)
        localizer.magnets(stamp, reeds.laterals(closed))
        estimate, truth = localizer.estimate, robot.truth()
        assert estimate is not None
        squares.append((estimate.x - truth.x) ** 2 + (estimate.y - truth.y) ** 2)
        drift = max(drift, hypot(o.x - truth.x, o.y - truth.y))
    bus.close()
    assert sqrt(sum(squares) / len(squares)) < 0.005
    assert drift > 0.05


def test_without_slip_and_scale_errors_wheels_tell_the_way() -> None:
    perfect = RobotParams(slip=0.0, left_scale_error=0.0, right_scale_error=0.0)
    assert max(odometry_errors(perfect, 60.0)) < 1e-4


def test_a_command_drives_the_robot_for_half_a_second_and_then_it_returns_to_its_course() -> None:
    world = World(RobotParams(slip=0.0))
    world.command(0.0, 0.0, 1.5)
    world.advance(0.45)
    assert world.state.w == pytest.approx(1.5, rel=0.02)
    assert abs(world.state.v) < 0.01
    world.command(0.45, 0.2, 0.0)
    world.advance(0.9)
    assert world.state.v == pytest.approx(0.2, rel=0.02)
    for i in range(100):  # away from the course, for ten seconds
        world.command(0.9 + 0.1 * i, 0.2, 0.3)
    world.advance(60.0)
    course = Course(0.35, 0.2)
    off = min(
        hypot(x - world.state.x, y - world.state.y)
        for x, y, _, _ in (course.at(0.005 * i) for i in range(int(course.length / 0.005)))
    )
    assert off < 0.02
    assert world.state.v == pytest.approx(0.12, rel=0.03)
    sides = [world.at(60.0 + 0.5 * i).y for i in range(80)]
    assert max(sides) > 0.35, "and it drives the whole of it,"
    assert min(sides) < -0.35, "to both sides"


@pytest.mark.parametrize("v", [float("nan"), float("inf")])
def test_a_command_that_is_no_number_is_refused(v: float) -> None:
    world = World(RobotParams())
    with pytest.raises(ValueError, match="no robot drives"):
        world.command(0.0, v, 0.0)
    world.command(0.0, 1e300, -1e300)
    world.advance(1.0)
    assert hypot(world.state.x, world.state.y) < 0.5, "motors saturate"


def test_rates_integrate_to_the_heading_and_forces_to_the_speed() -> None:
    world = World(RobotParams(bump_height=0.0))
    yaw = forward = 0.0
    for motion in motions(world, 20.0, STEP):
        yaw += motion.angular_velocity[2] * STEP
        forward += motion.specific_force[0] * STEP
        assert motion.specific_force[2] == pytest.approx(G)
        assert motion.specific_force[1] == pytest.approx(motion.v * motion.w)
    assert yaw == pytest.approx(world.state.yaw, abs=1e-9)
    assert forward == pytest.approx(world.state.v, abs=1e-9)


def test_bumps_tilt_the_robot_shortly_and_by_some_degrees() -> None:
    tilts = [max(abs(m.roll), abs(m.pitch)) for m in motions(World(RobotParams()), 60.0, 0.01)]
    assert 0.01 < max(tilts) < 0.1
    assert 0.02 < sum(tilt > 0.005 for tilt in tilts) / len(tilts) < 0.2


def test_tilt_rates_integrate_to_the_tilt() -> None:
    world = World(RobotParams(slip=0.0))
    pitch = 0.0
    for motion in motions(world, 2.0, STEP):  # straight over the bump: hardly any roll
        pitch += motion.angular_velocity[1] * STEP
        assert pitch == pytest.approx(motion.pitch, abs=2e-3)


def test_body_rates_integrate_to_the_attitude_across_a_bump_taken_aslant() -> None:
    params = RobotParams(bump_height=0.01, slip=0.0)
    world = World(params, WorldState(x=0.1, yaw=0.8))
    q, tilted = from_euler(0.0, 0.0, 0.8), 0.0
    for i in range(1, 1001):
        if i % 200 == 1:
            world.command(i * STEP, 0.15, -0.3)
        motion = world.at(i * STEP)
        p, q_, r = motion.angular_velocity
        q = multiply(q, from_rotation_vector((p * STEP, q_ * STEP, r * STEP)))
        tilted = max(tilted, min(abs(motion.roll), abs(motion.pitch)))
        assert to_euler(q) == pytest.approx((motion.roll, motion.pitch, motion.yaw), abs=3e-3)
    assert tilted > 0.03, "it rolled and pitched at once"


def test_a_tilted_robot_at_rest_feels_gravity_in_its_own_axes() -> None:
    params = RobotParams(speed=0.0)
    world = World(params, WorldState(x=params.bump_x))  # the castor is still before the bump
    motion = world.at(1.0)
    assert motion.pitch < -0.02, "nose up"
    assert motion.specific_force == pytest.approx(
        (-G * sin(motion.pitch), 0.0, G * cos(motion.pitch)), abs=1e-6
    )


def test_a_left_wheel_on_a_bump_rolls_the_robot_to_its_right() -> None:
    params = RobotParams(speed=0.0)
    beside = params.bump_x + 0.5 * params.track
    motion = World(params, WorldState(x=beside, yaw=0.5 * pi)).at(1.0)  # its left is to the west
    assert motion.roll == pytest.approx(params.bump_height / params.track, rel=0.01)
    assert motion.pitch == pytest.approx(-0.5 * params.bump_height / params.castor, rel=0.01)
    assert motion.specific_force[1] == pytest.approx(G * sin(motion.roll), rel=1e-3)


@pytest.mark.parametrize(("aside", "yaw"), [(0.0, 0.0), (0.0, pi), (0.056, 0.5 * pi), (0.05, 1.0)])
def test_tilt_turns_gravity_and_field_alike(aside: float, yaw: float) -> None:
    params = RobotParams(
        speed=0.0,
        bump_height=0.01,
        mag_noise=0.0,
        accel_noise=0.0,
        hard_iron=(0.0, 0.0, 0.0),
        soft_iron=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    )
    world = World(params, WorldState(x=params.bump_x + aside, yaw=yaw))
    sensors = Sensors(params, world)
    motion, force, field = world.at(1.0), sensors.specific_force(1.0), sensors.magnetic_field(1.0)
    assert max(abs(motion.roll), abs(motion.pitch)) > 0.03
    down = -sum(f * b for f, b in zip(force, field, strict=True)) / (G * 47e-6)
    assert down == pytest.approx(sin(1.1), abs=1e-9)
    up = [f / G for f in force]
    level = field[0] + 47e-6 * sin(1.1) * up[0]  # of the field, along the robot's nose
    assert level == pytest.approx(47e-6 * cos(1.1) * cos(motion.pitch) * sin(yaw), abs=1e-12)


def sensors_at(x: float, y: float, yaw: float, magnet_pitch: float = 0.055) -> Sensors:
    params = RobotParams(speed=0.0, bump_height=0.0, magnet_pitch=magnet_pitch)
    return Sensors(params, World(params, WorldState(x=x, y=y, yaw=yaw)))


def test_a_magnet_closes_a_reed_over_16_to_17_mm_of_straight_way() -> None:
    closed = [
        sensors_at(0.0001 * i - 0.08, 0.005, 0.0).closed_reeds(0.0) >> 3 & 1
        for i in range(-275, 275)
    ]
    assert 160 <= sum(closed) <= 170, "reed 4 lies at -5 mm: on the row of magnets now"


def test_reeds_are_numbered_from_the_right() -> None:
    for reed in range(1, 9):
        lateral = 0.01 * (reed - 4.5)
        closed = sensors_at(-0.08, -lateral, 0.0, magnet_pitch=1.0).closed_reeds(0.0)
        assert closed == 1 << (reed - 1)
    turned = sensors_at(0.015, -0.08, 0.5 * pi, magnet_pitch=1.0).closed_reeds(0.0)
    assert turned == 1 << 5, "heading north and 15 mm east of a magnet: it is on the left, reed 6"


def test_two_reeds_close_in_about_a_third_of_the_detections() -> None:
    params = RobotParams()
    sensors = Sensors(params, World(params))
    words = [f"{sensors.closed_reeds(0.02 * i):08b}" for i in range(3000)]
    groups = [len(group) for word in words for group in word.split("0") if group]
    assert set(groups) == {1, 2}
    assert 0.25 < groups.count(2) / len(groups) < 0.5
    assert sum("1" in word for word in words) / len(words) > 0.3


def test_the_magnetometer_of_a_robot_facing_east_sees_north_on_its_left() -> None:
    params = RobotParams(
        speed=0.0,
        mag_noise=0.0,
        field_dip=1.0,
        field_strength=50e-6,
        hard_iron=(0.0, 0.0, 0.0),
        soft_iron=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    )
    for yaw in (0.0, 0.5 * pi, -2.0):
        field = Sensors(params, World(params, WorldState(yaw=yaw))).magnetic_field(0.0)
        level = 50e-6 * cos(1.0)
        assert field == pytest.approx(
            (level * sin(yaw), level * cos(yaw), -50e-6 * sin(1.0)), abs=1e-12
        )


def test_noise_has_the_promised_deviation_and_the_bias_the_promised_mean() -> None:
    params = RobotParams(speed=0.0)
    sensors = Sensors(params, World(params))
    rates = [sensors.angular_velocity(0.001 * i)[1] for i in range(4000)]
    mean = sum(rates) / len(rates)
    deviation = sqrt(sum((rate - mean) ** 2 for rate in rates) / len(rates))
    assert mean == pytest.approx(-0.008, abs=4 * 0.0017 / sqrt(4000))
    assert deviation == pytest.approx(0.0017, rel=0.05)


def test_noise_streams_are_normal_and_do_not_repeat_each_other() -> None:
    one, other = Noise(1, 1), Noise(1, 2)
    pairs = [one.pair(i) for i in range(5000)]
    values = [value for pair in pairs for value in pair]
    assert sum(values) / len(values) == pytest.approx(0.0, abs=0.04)
    assert sum(v * v for v in values) / len(values) == pytest.approx(1.0, abs=0.06)
    assert sum(v**4 for v in values) / len(values) == pytest.approx(3.0, abs=0.4)
    assert sum(a * b for a, b in pairs) / len(pairs) == pytest.approx(0.0, abs=0.06)
    across = [one.pair(i)[0] * other.pair(i)[0] for i in range(5000)]
    along = [one.pair(i)[0] * one.pair(i + 1)[0] for i in range(5000)]
    assert sum(across) / 5000 == pytest.approx(0.0, abs=0.06)
    assert sum(along) / 5000 == pytest.approx(0.0, abs=0.06)


def test_parameters_without_sense_are_named() -> None:
    with pytest.raises(ValueError, match="track must be positive"):
        RobotParams(track=0.0)
    with pytest.raises(ValueError, match="course_straight"):
        RobotParams(course_straight=-1.0)
    with pytest.raises(ValueError, match="slip_time"):
        RobotParams(slip_time=float("nan"))


def test_a_robot_drives_on_while_its_simulator_is_away() -> None:
    now = 1000.0
    robot = SimulatedRobot(RobotParams(), lambda: now)
    now = 1012.0
    state = robot.state
    now = 1012.7
    again = SimulatedRobot(RobotParams(), lambda: now, state)
    assert again.truth() == robot.truth()
    assert again.truth() == SimulatedRobot(RobotParams(), lambda: now, robot.state).truth()
    assert state.step == round(12.0 / STEP), "a state once taken stays what it was"


def test_time_stands_still_until_it_is_let_go_and_the_robot_a_little_longer() -> None:
    now = 100.0
    robot = SimulatedRobot(RobotParams(standing=2.0), lambda: now, waiting=True)
    now = 130.0
    assert robot.now() == 0.0
    assert robot.truth() == (0.0, 0.0, 0.0, 0.0, 0.0)
    robot.begin()
    now = 131.9
    assert robot.truth() == (0.0, 0.0, 0.0, 0.0, 0.0)
    robot.begin()
    now = 133.0
    assert robot.now() == pytest.approx(3.0)
    assert robot.truth().x > 0.08
    assert SimulatedRobot(RobotParams(), lambda: now, robot.state).truth() == robot.truth()


def test_the_robot_takes_commands_between_reads() -> None:
    now = 0.0
    robot = SimulatedRobot(RobotParams(), lambda: now)
    robot.command(0.0, -1.0)
    now = 0.4
    truth = robot.truth()
    assert truth.w == pytest.approx(-1.0, rel=0.05)
    assert truth.yaw == pytest.approx(-0.35, abs=0.03)
