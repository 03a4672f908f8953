"""Claims about constants learned on the way: wheels, track and gyro that are not as told."""

import dataclasses
import json
import math
from dataclasses import replace
from random import Random

import pytest

from lodeline.bench.scenes.drive import Drive
from lodeline.bench.scenes.rides import SIGMA, nees, wheels_with
from lodeline.ekf import Belief, Localizer, LocalizerParams, LocalizerState
from lodeline.ekf.learned import Learned
from lodeline.keepsake import rebuilt
from lodeline.odometry import Odometry

MS = 1_000_000
KNOWN = LocalizerParams(initial_sigma=SIGMA)
LEARNING = replace(KNOWN, wheel_sigma=(0.03, 0.03), gyro_bias_sigma=0.01)
WHEELS = wheels_with(2e-5)


class Robot:
    """Drives bends over magnets, 20 readings a second; its true wheels, track and gyro err."""

    def __init__(
        self,
        seed: int,
        params: LocalizerParams,
        *,
        way: float = 0.0,
        turn: float = 0.0,
        bias: float | None = None,
    ) -> None:
        self._rng = Random(seed)
        radius = WHEELS.wheel_radius * (1.0 + way)
        track = WHEELS.track * (1.0 + way) / (1.0 + turn)
        true = replace(WHEELS, wheel_radius=radius, track=track)
        self.drive, self._odometry = Drive(self._rng, params, true), Odometry(WHEELS)
        self.localizer, self._bias, self.i = Localizer(params), bias, 0
        self._bend = self._rng.uniform(0.3, 0.5)

    def go(self) -> float:
        """Error of the position [m] after 50 ms."""
        before, stamp = self.drive.yaw, self.i * 50 * MS
        if self.i > 0:
            self.drive.go(0.006, 0.006 * (2.0 * math.sin(self._bend * self.i * 0.06) + 2.0))
        if self._bias is not None:
            rate = (self.drive.yaw - before) / 0.05 + self._bias
            for k in range(5):
                rates = (0.0, 0.0, rate + self._rng.gauss(0, 0.002))
                self.localizer.attitude(
                    stamp - 50 * MS + k * 10 * MS,
                    (0.0, 0.0, 0.0, 1.0),
                    rates,
                    1.0,
                    disturbed=True,
                )
        out = self._odometry.update(stamp, *self.drive.counts())
        assert out is not None
        pose = (out.x, out.y, out.yaw)
        self.localizer.odometry(out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets)
        self.localizer.magnets(out.stamp_ns, self.drive.laterals())
        self.i += 1
        estimate = self.localizer.estimate
        assert estimate is not None
        return math.hypot(estimate.x - self.drive.x, estimate.y - self.drive.y)

    @property
    def learned(self) -> Learned:
        found = self.localizer.state.track.learned
        assert found is not None
        return found


def rms(robots: list[Robot], readings: int) -> float:
    errors = [robot.go() for robot in robots for _ in range(readings)]
    return math.sqrt(sum(error * error for error in errors) / len(errors))


@pytest.mark.parametrize(("way", "turn"), [(0.03, -0.04), (-0.04, 0.03)])
def test_wheels_and_track_that_are_percents_off_are_learned_in_a_minute(
    way: float, turn: float
) -> None:
    figures = []
    for params in (KNOWN, LEARNING):
        robots = [Robot(seed, params, way=way, turn=turn) for seed in range(3)]
        rms(robots, 1000)
        figures.append(rms(robots, 400))
    for robot in robots:
        found, sigmas = robot.learned, robot.learned.sigmas
        print(f"way {found.way:+.4f} of {way:+}, turn {found.turn:+.4f} of {turn:+}, {sigmas}")
        assert abs(found.way - way) < 0.006
        assert abs(found.turn - turn) < 3.0 * sigmas[1]
        assert sigmas[0] < 0.002
        assert sigmas[1] < 0.01
    print(f"rms {1e3 * figures[0]:.2f} mm as told, {1e3 * figures[1]:.2f} mm learning")
    assert figures[1] < 0.9 * figures[0]


def test_a_gyro_s_bias_is_learned_in_a_minute() -> None:
    for seed in range(3):
        robot = Robot(seed, LEARNING, bias=0.01)
        rms([robot], 1200)
        print(f"bias {robot.learned.bias:.4f}, sigma {robot.learned.sigmas[2]:.4f}")
        assert robot.learned.bias == pytest.approx(0.01, abs=0.003)
        assert robot.learned.sigmas[2] < 0.002


def test_wheels_as_told_lose_next_to_nothing_by_it() -> None:
    figures = [rms([Robot(s, p) for s in range(6)], 600) for p in (KNOWN, LEARNING)]
    print(figures)
    assert figures[1] < 1.05 * figures[0]
    assert Localizer(KNOWN).state.track.learned is None


def test_pose_and_constants_err_as_much_as_they_say() -> None:
    """Wheels drawn as far off as it is told: NEES of the pose, and errors in sigmas."""
    total, count, squares = 0.0, 0, [0.0, 0.0]
    runs = 30
    for seed in range(runs):
        rng = Random(1000 + seed)
        way, turn = rng.gauss(0, 0.03), rng.gauss(0, 0.03)
        robot = Robot(seed, LEARNING, way=way, turn=turn)
        for i in range(300):
            robot.go()
            if i % 10 == 0:
                estimate = robot.localizer.estimate
                assert estimate is not None
                p = estimate.covariance
                at = (estimate.x, estimate.y, estimate.yaw)
                total += nees(robot.drive, Belief(*at, p[0], p[1], p[2], p[4], p[5], p[8]))
                count += 1
        found, sigmas = robot.learned, robot.learned.sigmas
        squares[0] += ((found.way - way) / sigmas[0]) ** 2 / runs
        squares[1] += ((found.turn - turn) / sigmas[1]) ** 2 / runs
    print(total / count, squares)
    assert 2.5 <= total / count <= 3.5
    assert all(0.6 <= each <= 1.6 for each in squares)  # 95 % of chi-square with 30 degrees


def test_late_magnets_and_a_restart_change_nothing() -> None:
    rng = Random(5)
    samples: list[tuple[int, int, tuple[float, ...]]] = []
    for i in range(300):
        samples.append((i * 50 * MS, 0, (0.0062 * i,)))
        samples.append((i * 50 * MS + 20 * MS, 1, (rng.uniform(-0.01, 0.01),) if i % 9 < 3 else ()))
    shuffled = sorted(samples, key=lambda each: each[0] + rng.uniform(0, 400 * MS))
    whole, late = Localizer(LEARNING), Localizer(LEARNING)
    for localizer, order in ((whole, samples), (late, shuffled)):
        for stamp, kind, values in order:
            if kind == 0:
                localizer.odometry(stamp, values[0], 0.0, 0.0, (1e-4, 0.0, 0.0, 1e-3), 0.05, 0)
            else:
                localizer.magnets(stamp, values)
    one, other = whole.state.track, late.state.track
    assert one.learned is not None
    assert other.learned is not None
    assert abs(one.learned.way) > 0.001
    assert [*one.belief, *one.learned[:3], *one.learned.cross] == pytest.approx(
        [*other.belief, *other.learned[:3], *other.learned.cross], abs=1e-12
    )
    saved = rebuilt(json.loads(json.dumps(dataclasses.asdict(whole.state))), LocalizerState)
    again = Localizer(LEARNING)
    again.resume(saved)
    assert again.state == whole.state


def test_without_the_option_a_saved_constant_is_left_alone() -> None:
    learned, plain = Localizer(LEARNING), Localizer(KNOWN)
    learned.odometry(0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), 0.0, 0)
    plain.resume(learned.state)
    assert plain.state.track.learned is None
    learned.resume(plain.state)
    assert learned.state.track.learned is not None


def test_a_doubt_that_no_calibration_leaves_is_refused() -> None:
    with pytest.raises(ValueError, match="calibrate first"):
        LocalizerParams(wheel_sigma=(0.5, 0.0))
    with pytest.raises(ValueError, match="wheel_sigma must not be negative"):
        LocalizerParams(wheel_sigma=(-0.1, 0.0))
