"""Claims about the gyro beside the wheels: a wheel may slip, and the robot still knows its way."""

import math
from random import Random

import pytest

from lodeline.bench.scenes.drive import Drive
from lodeline.ekf import Belief, Estimate, Localizer, LocalizerParams
from lodeline.ekf.engine import Noise
from lodeline.ekf.engines import make_engine
from lodeline.ekf.gyro import Turn
from lodeline.ekf.motion import Delta
from lodeline.ekf.turning import fused
from lodeline.odometry import Odometry, OdometryParams

MS = 1_000_000
STILL = (0.0, 0.0, 0.0, 0.0)
NOISE = (1e-4, 0.0, 0.0, 1e-2)
WHEELS = OdometryParams(ticks_per_turn=16384, distance_noise=2e-5)
PARAMS = LocalizerParams(initial_sigma=(0.002, 0.02))
GYRO = 0.0017  # rad/s, noise of a sample


def level(yaw: float) -> tuple[float, float, float, float]:
    return 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)


def of(localizer: Localizer) -> Estimate:
    estimate = localizer.estimate
    assert estimate is not None
    return estimate


class Robot:
    """Odometry at 100 Hz and a gyro at 200 Hz, no magnets unless asked for."""

    def __init__(
        self, seed: int, *, magnets: bool = False, params: LocalizerParams = PARAMS
    ) -> None:
        self.rng, self.magnets, self.i = Random(seed), magnets, 0
        self.drive, self.odometry = Drive(self.rng, params, WHEELS), Odometry(WHEELS)
        self.localizer = Localizer(params)
        self.frozen: tuple[int, int] | None = None  # left count that stays, and what it was
        self.scale = 1.0
        self.bias = 0.0

    def go(self, way: float, turn: float, spike: float = 0.0) -> Estimate:
        """10 ms: wheels meaning to go so, readings of all sensors."""
        before = self.drive.yaw
        self.drive.go(way, turn)
        stamp = self.i * 10 * MS
        rate = (self.drive.yaw - before) / 0.010 + self.bias
        for k in (0, 1):  # the rate that the coming step will have
            self.localizer.attitude(
                stamp - 10 * MS + 5 * k * MS,
                level(self.drive.yaw),
                (0.0, 0.0, rate + self.rng.gauss(0, GYRO) + spike * k),
                0.02,
                disturbed=False,
            )
        left, right = self.drive.counts()
        if self.frozen is not None:
            left = self.frozen[0]
        out = self.odometry.update(stamp, round(left * self.scale), right)
        assert out is not None
        pose = (out.x, out.y, out.yaw)
        self.localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
        self.localizer.magnets(stamp, self.drive.laterals() if self.magnets else ())
        self.i += 1
        return of(self.localizer)

    def error(self) -> tuple[float, float]:
        """Of position [m] and heading [rad]."""
        estimate, drive = of(self.localizer), self.drive
        return (
            math.hypot(estimate.x - drive.x, estimate.y - drive.y),
            abs(math.remainder(estimate.yaw - drive.yaw, 2 * math.pi)),
        )


def test_wheels_and_gyro_are_weighed_as_two_measurements_of_one_turn() -> None:
    delta, noise = fused(Delta(0.01, 0.0, 0.1), Noise(4e-6, 1e-4, 4e-3), Turn(0.2, 1e-3))
    assert delta.turn == pytest.approx(0.1 + 0.8 * 0.1)
    assert math.hypot(delta.ahead, delta.left) == pytest.approx(0.01 + 0.02 * 0.1)
    assert noise.tt == pytest.approx(1.0 / (1 / 4e-3 + 1 / 1e-3))
    assert noise.st == pytest.approx(1e-4 * 0.2)
    assert noise.ss == pytest.approx(4e-6 - 1e-4**2 / 5e-3)
    assert noise.ss * noise.tt >= noise.st**2


def test_the_gyro_carries_the_heading_further_than_the_wheels() -> None:
    """10 s of turns without a magnet."""
    with_gyro, wheels = [], []
    for seed in range(6):
        robot, blind = Robot(seed), Robot(seed)
        blind.localizer.attitude = lambda *_, **__: None  # type: ignore[method-assign]
        for i in range(1000):
            for each in (robot, blind):
                each.go(0.0012, 0.006 * math.sin(0.01 * i))
        with_gyro.append(robot.error()[1])
        wheels.append(blind.error()[1])
    rms = [math.sqrt(sum(e * e for e in errors) / len(errors)) for errors in (with_gyro, wheels)]
    print(f"heading after 10 s: {math.degrees(rms[0]):.2f} deg, wheels {math.degrees(rms[1]):.2f}")
    assert rms[0] < 0.03
    assert rms[1] > 2.0 * rms[0]


def test_a_silent_encoder_is_noticed_within_half_a_second_and_the_doubt_covers_the_error() -> None:
    robot = Robot(3)
    for _ in range(300):
        assert not robot.go(0.0012, 0.0).slipping
    robot.frozen = robot.drive.counts()
    noticed = None
    for i in range(1000):
        estimate = robot.go(0.0012, 0.002 * math.sin(0.01 * i))
        if estimate.slipping and noticed is None:
            noticed = 0.010 * (i + 1)
            assert "INCONSISTENT" in estimate.trouble
        if i > 50:
            p = Belief(0, 0, 0, *(estimate.covariance[k] for k in (0, 1, 2, 4, 5, 8)))
            assert robot.error()[0] < 3.0 * p.position_sigma + 0.005
            assert robot.error()[1] < 0.1
    assert noticed is not None
    print(f"noticed after {noticed:.2f} s")
    assert noticed <= 0.5


def test_a_wheel_that_is_a_fifth_too_large_is_noticed_within_ten_seconds_of_driving() -> None:
    robot = Robot(4)
    robot.scale = 1.2
    noticed = next((i for i in range(1000) if robot.go(0.0012, 0.006).slipping), None)
    assert noticed is not None
    print(f"noticed after {0.010 * noticed:.2f} s")


def test_good_wheels_are_never_doubted() -> None:
    """90 s of driving and standing with turns and noise as told."""
    robot, alarms = Robot(5), 0
    for i in range(9_000):
        moving = i // 1000 % 3 != 0
        turn = 0.006 * math.sin(0.01 * i) if moving else 0.0
        alarms += robot.go(0.0012 if moving else 0.0, turn).slipping
    assert alarms == 0


def test_a_robot_turned_by_hand_on_blocked_wheels_turns_in_its_estimate_too() -> None:
    """Parked wheels claim no noise at all; half a turn later nearly all of it is known."""
    localizer = Localizer(PARAMS)
    for i in range(400):
        turning = 100 <= i < 300
        localizer.odometry(i * 10 * MS, 0.0, 0.0, 0.0, STILL, 0.01, 0)
        rate = (0.0, 0.0, 1.5 if turning else 0.0)
        localizer.attitude(i * 10 * MS, level(0.0), rate, 0.02, disturbed=False)
        if i == 110:
            assert of(localizer).slipping
    yaw, sigma = of(localizer).yaw, math.sqrt(of(localizer).covariance[8])
    assert yaw == pytest.approx(3.0, abs=0.1)
    assert abs(yaw - 3.0) < 3.0 * sigma


def test_one_spike_of_the_gyro_turns_nothing() -> None:
    """+3 rad/s in one sample: less than 0.2 deg."""
    calm, spiked = Robot(7), Robot(7)
    for i in range(300):
        a, b = calm.go(0.0012, 0.0), spiked.go(0.0012, 0.0, spike=3.0 if i == 150 else 0.0)
        assert abs(math.remainder(a.yaw - b.yaw, 2 * math.pi)) < math.radians(0.2)
    assert not b.slipping


def test_over_a_gap_of_the_encoders_the_gyro_knows_the_turn() -> None:
    localizer = Localizer(PARAMS)
    for i in range(21):
        localizer.odometry(i * 10 * MS, i * 0.0012, 0.0, 0.0, NOISE, 0.01, 0)
        localizer.attitude(i * 10 * MS, level(0.0), (0.0, 0.0, 0.0), 0.02, disturbed=False)
    for i in range(21, 71):
        localizer.attitude(i * 10 * MS, level(0.0), (0.0, 0.0, 1.0), 0.02, disturbed=False)
    localizer.odometry(700 * MS, 0.0, 0.0, 0.0, NOISE, 0.0, 1)
    assert of(localizer).yaw == pytest.approx(0.49, abs=0.02)
    assert math.sqrt(of(localizer).covariance[8]) < 0.05


def test_over_four_seconds_without_encoders_the_gyro_knows_a_turn_that_changed() -> None:
    """Gyro at 200 Hz, bar at 100; the robot turns back after three of them."""
    localizer = Localizer(PARAMS)
    for i in range(21):
        localizer.odometry(i * 10 * MS, i * 0.0012, 0.0, 0.0, NOISE, 0.01, 0)
        localizer.attitude(i * 10 * MS, level(0.0), (0.0, 0.0, 0.0), 0.02, disturbed=False)
    for i in range(801):
        turn = 0.4 if i < 600 else -0.4
        stamp = 200 * MS + (i + 1) * 5 * MS
        localizer.attitude(stamp, level(0.0), (0.0, 0.0, turn), 0.02, disturbed=False)
        if i % 2:
            localizer.magnets(stamp, ())
    localizer.odometry(4200 * MS, 0.0, 0.0, 0.0, NOISE, 0.0, 1)
    assert of(localizer).yaw == pytest.approx(0.4 * 3.0 - 0.4 * 1.0, abs=0.03)
    assert math.sqrt(of(localizer).covariance[8]) < 0.1


def test_a_tilted_robot_was_lifted() -> None:
    """15 degrees for longer than 0.3 s: nobody knows where it will be put down."""
    localizer = Localizer(PARAMS)
    tilted = (math.sin(0.13), 0.0, 0.0, math.cos(0.13))
    for i in range(200):
        localizer.odometry(i * 10 * MS, 0.0, 0.0, 0.0, STILL, 0.01, 0)
        lifted = 50 <= i < 90
        orientation = tilted if lifted or i == 20 else level(0.0)  # and one bump
        localizer.attitude(i * 10 * MS, orientation, (0.0, 0.0, 0.0), 0.02, disturbed=False)
        if i == 79:
            assert of(localizer).alarms == 0
    assert of(localizer).alarms == 1
    assert of(localizer).ambiguous
    assert of(localizer).trouble.startswith("KIDNAPPED")


@pytest.mark.parametrize("disturbed", [False, True])
def test_the_compass_turns_the_robot_only_where_it_is_asked_for_and_undisturbed(
    disturbed: bool,
) -> None:
    for heading in ("off", "on"):
        params = LocalizerParams(initial_sigma=(0.002, 0.3), heading=heading, heading_interval=1.0)
        localizer = Localizer(params)
        for i in range(60):
            localizer.odometry(i * 50 * MS, 0.0, 0.0, 0.0, STILL, 0.05, 0)
            localizer.attitude(i * 50 * MS, level(0.3), (0.0, 0.0, 0.0), 0.02, disturbed=disturbed)
        used = heading == "on" and not disturbed
        assert of(localizer).yaw == pytest.approx(0.3 if used else 0.0, abs=0.02)
        # three readings of one lasting error, not sixty: no surer than a few of them make it
        if used:
            assert 0.02 < math.sqrt(of(localizer).covariance[8]) < 0.06


def test_a_heading_far_beyond_its_doubt_is_not_believed() -> None:
    params = LocalizerParams(initial_sigma=(0.002, 0.05), heading="on")
    localizer = Localizer(params)
    for i in range(10):
        localizer.odometry(i * 50 * MS, 0.0, 0.0, 0.0, STILL, 0.05, 0)
        localizer.attitude(i * 50 * MS, level(1.0), (0.0, 0.0, 0.0), 0.02, disturbed=False)
    assert of(localizer).yaw == 0.0


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e9])
def test_an_attitude_that_makes_no_sense_is_refused(bad: float) -> None:
    localizer = Localizer(PARAMS)
    localizer.odometry(0, 0.0, 0.0, 0.0, STILL, 0.05, 0)
    for orientation, rate, std in (
        ((bad, 0.0, 0.0, 1.0), 0.0, 0.1),
        (level(0.0), bad, 0.1),
        (level(0.0), 0.0, bad),
        ((0.0, 0.0, 0.0, 0.5), 0.0, 0.1),
    ):
        localizer.attitude(0, orientation, (0.0, 0.0, rate), std, disturbed=False)
    assert localizer.refused == 4


@pytest.mark.parametrize("seed", range(20))
def test_readings_of_the_gyro_in_any_order_give_the_same_state(seed: int) -> None:
    rng = Random(seed)
    samples: list[tuple[int, int, float]] = []
    for i in range(20):
        samples.append((0, i * 40 * MS, 0.004 * i))
        samples.append((1, i * 40 * MS + rng.randrange(-30, 30) * MS, rng.gauss(0, 0.5)))
        if rng.random() < 0.5:
            samples.append((2, i * 40 * MS + rng.randrange(-30, 30) * MS, rng.gauss(0, 0.01)))
    samples = list({(kind, stamp): (kind, stamp, v) for kind, stamp, v in samples}.values())

    def fed(order: list[tuple[int, int, float]]) -> Localizer:
        localizer = Localizer(PARAMS)
        for kind, stamp, value in order:
            if kind == 0:
                localizer.odometry(stamp, value, 0.0, 0.0, NOISE, 0.04, 0)
            elif kind == 1:
                localizer.attitude(stamp, level(0.0), (0.0, 0.0, value), 0.02, disturbed=False)
            else:
                localizer.magnets(stamp, (value,))
        return localizer

    in_order = fed(sorted(samples, key=lambda each: (each[1], each[0])))
    rng.shuffle(samples)
    shuffled = fed(samples)
    a, b = of(shuffled), of(in_order)
    assert (a.x, a.y, a.yaw, *a.covariance) == pytest.approx(
        (b.x, b.y, b.yaw, *b.covariance), abs=1e-12
    )


def test_one_number_corrects_both_engines_alike() -> None:
    rng, scalar, filterpy = Random(2), make_engine("scalar"), make_engine("filterpy")
    for _ in range(200):
        belief = Belief(0.1, 0.2, 3.1, 1e-4, 1e-5, 1e-4, 2e-4, -1e-4, 1e-2)
        row = (rng.gauss(0, 1), rng.gauss(0, 1), rng.gauss(0, 1))
        args = (row, rng.gauss(0, 0.1), 10 ** rng.uniform(-6, 0))
        assert scalar.correct_scalar(belief, *args) == pytest.approx(
            filterpy.correct_scalar(belief, *args), abs=1e-9
        )
