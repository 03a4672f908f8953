"""Claims about faults of sensors and samples: what each may cost, and that it is told."""

import math
from random import Random

import pytest

from lodeline.bench.scenes.drive import Drive
from lodeline.ekf import Belief, Estimate, Localizer, LocalizerParams
from lodeline.odometry import Odometry, OdometryParams

MS = 1_000_000
NOISE = (1e-4, 0.0, 0.0, 1e-3)
WHEELS = OdometryParams(ticks_per_turn=3.6e6, distance_noise=2e-5)
PARAMS = LocalizerParams(initial_sigma=(0.002, 0.02))


class Robot:
    """A simulated robot that drives bends at 0.12 m/s, 20 readings a second."""

    def __init__(self, seed: int, *, missing: float = 0.0, moved: float = 0.0) -> None:
        rng = Random(seed)
        self.drive = Drive(rng, PARAMS, WHEELS, missing=missing, moved=moved)
        self.odometry, self.localizer, self.i = Odometry(WHEELS), Localizer(PARAMS), 0
        self._bend = rng.uniform(0.2, 0.6)
        self.stuck: float | None = None  # lateral of a reed that stays closed [m]

    def go(self, step: float = 0.006, dt_ms: int = 50) -> Estimate:
        self.drive.go(step, step * 2.0 * math.sin(self._bend * self.i * 0.06))
        out = self.odometry.update(self.i * dt_ms * MS, *self.drive.counts())
        assert out is not None
        self.localizer.odometry(
            out.stamp_ns, out.x, out.y, out.yaw, out.twist_covariance, out.interval, out.resets
        )
        laterals = set(self.drive.laterals())
        if self.stuck is not None:
            laterals = {each for each in laterals if abs(each - self.stuck) > 0.012} | {self.stuck}
        self.localizer.magnets(out.stamp_ns, tuple(sorted(laterals)))
        self.i += 1
        estimate = self.localizer.estimate
        assert estimate is not None
        return estimate

    def error(self) -> float:
        estimate = self.localizer.estimate
        assert estimate is not None
        return math.hypot(estimate.x - self.drive.x, estimate.y - self.drive.y)


def sigma(estimate: Estimate) -> float:
    p = estimate.covariance
    return Belief(0, 0, 0, p[0], p[1], p[2], p[4], p[5], p[8]).position_sigma


def test_missing_and_displaced_magnets_cost_next_to_nothing() -> None:
    """S16: 5 % are not there, 2 % lie 10 mm aside; 99 of 100 poses stay within 10 mm."""
    rms = []
    for missing, moved in ((0.0, 0.0), (0.05, 0.02)):
        errors = []
        for seed in range(8):
            robot = Robot(seed, missing=missing, moved=moved)
            for _ in range(600):
                assert robot.go().alarms == 0
                errors.append(robot.error())
        errors.sort()
        rms.append(math.sqrt(sum(e * e for e in errors) / len(errors)))
        print(f"{missing} missing: rms {1e3 * rms[-1]:.2f} mm, worst {1e3 * errors[-1]:.1f} mm")
        assert errors[int(0.99 * len(errors))] < 0.010
    assert rms[1] < 1.2 * rms[0]


@pytest.mark.parametrize("lateral", [-0.035, -0.015, 0.005, 0.035])
def test_a_stuck_reed_is_not_believed_and_is_told(lateral: float) -> None:
    """S15: from one moment on it stays closed; told after 3 pitches, forgotten when it opens."""
    robot = Robot(2)
    for _ in range(200):
        robot.go()
    robot.stuck = lateral
    told = None
    for i in range(400):
        estimate = robot.go()
        assert robot.error() < 0.015
        if estimate.stuck_reed and told is None:
            told = 0.006 * i
            assert estimate.trouble.startswith("REED_STUCK")
    assert told is not None
    print(f"told after {told:.3f} m, error at the end {1e3 * robot.error():.1f} mm")
    assert told <= 0.2
    robot.stuck = None
    assert not [robot.go().stuck_reed for _ in range(20)][-1]


def test_two_reeds_far_apart_are_two_magnets_and_all_closed_is_one_place() -> None:
    localizer = Localizer(PARAMS)
    localizer.odometry(0, 0.0, 0.0, 0.0, NOISE, 0.05, 0)
    assert localizer.magnets(0, (-0.03, 0.025)) is not None
    assert len(localizer.state.track.bar.contacts) == 2


def test_of_random_kidnaps_two_in_three_are_noticed_by_the_magnets_and_never_forgotten() -> None:
    """S18: put down anywhere within half a metre, turned at will; 15 s to notice it."""
    rng, noticed, runs = Random(9), 0, 24
    for seed in range(runs):
        robot = Robot(seed)
        for _ in range(200):
            robot.go()
        assert robot.error() < 0.01
        by = (rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5))
        robot.drive.slide(*by, rng.uniform(-math.pi, math.pi))
        told = [robot.go().alarms > 0 for _ in range(300)]
        noticed += told[-1]
        last = robot.localizer.estimate
        assert last is not None
        if told[-1]:
            assert last.ambiguous
            assert last.trouble.startswith("KIDNAPPED")
            assert sigma(last) >= 1.0
    print(f"{noticed} of {runs} kidnaps noticed")
    assert noticed >= 0.65 * runs


def test_a_shift_by_whole_pitches_cannot_be_noticed() -> None:
    """What is not promised: the lattice looks the same from there."""
    robot = Robot(1)
    for _ in range(200):
        robot.go()
    robot.drive.x += 0.055
    assert all(robot.go().alarms == 0 for _ in range(300))
    assert robot.error() == pytest.approx(0.055, abs=0.01)


def test_an_hour_of_driving_raises_no_alarm() -> None:
    """S18: 3600 s at 10 readings a second, 0.4 km."""
    robot = Robot(8)
    estimate = robot.go()
    for _ in range(36_000):
        estimate = robot.go(0.012, 100)
    assert estimate.alarms == 0
    assert robot.error() < 0.01


@pytest.mark.parametrize("hole", [0.1, 1.0, 10.0])
def test_over_a_hole_in_the_samples_the_doubt_covers_the_error(hole: float) -> None:
    """T2, T7: the counts come back with the way in them, however long the hole."""
    for seed in range(10):
        robot = Robot(seed)
        for _ in range(100):
            robot.go()
        for _ in range(round(hole / 0.05)):
            robot.drive.go(0.006, 0.001)
            robot.i += 1
        estimate = robot.go()
        error = robot.error()
        assert error < 3.5 * sigma(estimate) + 0.001


def poses(robot: Localizer, count: int, bad: dict[int, int] | None = None) -> Estimate:
    """Straight on at 0.1 m/s; `bad` moves the stamps of some samples by so many ms."""
    for i in range(count):
        stamp = (i * 50 + (bad or {}).get(i, 0)) * MS
        robot.odometry(stamp, 0.005 * i, 0.0, 0.0, NOISE, 0.05, 0)
        robot.magnets(i * 50 * MS, (0.0,) if i % 11 < 3 else ())
    estimate = robot.estimate
    assert estimate is not None
    return estimate


@pytest.mark.parametrize("back", [-1_500, -60_000, -3_600_000])
def test_stamps_from_the_past_change_nothing_and_are_counted(back: int) -> None:
    """T1: what is older than the history is dropped; the run equals one without these samples."""
    good, bad = Localizer(PARAMS), Localizer(PARAMS)
    for i in range(100):
        stamp = i * 50 * MS
        for localizer in (good, bad):
            localizer.odometry(stamp, 0.005 * i, 0.0, 0.0, NOISE, 0.05, 0)
            localizer.magnets(stamp, (0.0,) if i % 11 < 3 else ())
        if i in (50, 70):
            assert bad.odometry(stamp + back * MS, 7.0, 7.0, 1.0, NOISE, 0.05, 0) is None
    assert bad.estimate == good.estimate
    assert bad.late == 2


def test_a_stamp_a_little_back_costs_less_than_a_millimetre() -> None:
    """T1: within the history its place is taken at its word."""
    a, b = poses(Localizer(PARAMS), 60), poses(Localizer(PARAMS), 60, {30: -40, 45: -70})
    assert math.hypot(a.x - b.x, a.y - b.y) < 0.001


@pytest.mark.parametrize("ahead", [20, 600])
def test_a_stamp_ahead_costs_little(ahead: int) -> None:
    """T2: the samples after it are put before it, and it is the newest until they pass it."""
    a, b = poses(Localizer(PARAMS), 80), poses(Localizer(PARAMS), 80, {30: ahead})
    assert math.hypot(a.x - b.x, a.y - b.y) < 0.005


def test_a_stamp_far_ahead_shuts_nothing_out_for_longer_than_the_history() -> None:
    """T2: a second later the pose is back with the odometry, and owns up to what it missed."""
    localizer = Localizer(PARAMS)
    poses(localizer, 100, {30: 3_600_000})
    estimate = localizer.estimate
    assert estimate is not None
    assert estimate.stamp_ns == 99 * 50 * MS
    assert localizer.late >= 20


def test_every_sample_twice_gives_the_same_state() -> None:
    """T5, bit for bit."""
    once, twice = Localizer(PARAMS), Localizer(PARAMS)
    for i in range(60):
        stamp = i * 50 * MS
        for localizer in (once, twice, twice):
            localizer.odometry(stamp, 0.005 * i, 0.0, 0.0, NOISE, 0.05, 0)
            localizer.attitude(stamp, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.01), 0.02, disturbed=False)
            localizer.magnets(stamp, (0.0,) if i % 11 < 3 else ())
    assert twice.estimate == once.estimate
    assert twice.duplicates == 180


def test_samples_shuffled_within_50_ms_give_the_same_state() -> None:
    """T6: to 1e-12, nothing late."""
    rng = Random(4)
    samples = [(i * 10 * MS, i) for i in range(300)]
    shuffled = sorted(samples, key=lambda each: each[0] + rng.uniform(0, 50 * MS))
    localizers = []
    for order in (samples, shuffled):
        localizer = Localizer(PARAMS)
        for stamp, i in order:
            if i % 2 == 0:
                localizer.odometry(stamp, 0.001 * i, 0.0, 0.0, NOISE, 0.02, 0)
            else:
                localizer.magnets(stamp, (0.0,) if i % 55 < 15 else ())
        localizers.append(localizer)
    a, b = (each.estimate for each in localizers)
    assert a is not None
    assert b is not None
    assert (a.x, a.y, a.yaw, *a.covariance) == pytest.approx(
        (b.x, b.y, b.yaw, *b.covariance), abs=1e-12
    )
    assert localizers[1].late == 0


def test_encoder_jumps_move_the_pose_by_less_than_an_interval_at_full_speed() -> None:
    """S14: 60 jumps of up to a million counts, the pose stays within 3 sigma."""
    rng, robot = Random(3), Robot(3)
    limit = WHEELS.max_wheel_speed * 0.05
    offset = [0, 0]
    for i in range(600):
        before = robot.localizer.estimate
        if i % 10 == 9:
            offset[rng.randrange(2)] += rng.choice([-1, 1]) * rng.randrange(10**7, 10**9)
        robot.drive.go(0.006, 0.0)
        left, right = robot.drive.counts()
        out = robot.odometry.update(i * 50 * MS, left + offset[0], right + offset[1])
        assert out is not None
        robot.localizer.odometry(
            out.stamp_ns, out.x, out.y, out.yaw, out.twist_covariance, out.interval, out.resets
        )
        robot.localizer.magnets(out.stamp_ns, robot.drive.laterals())
        after = robot.localizer.estimate
        assert after is not None
        if before is not None:
            moved = math.hypot(after.x - before.x, after.y - before.y)
            assert moved < limit
            assert robot.error() < max(0.02, 3.0 * sigma(after))
    assert robot.odometry.state.resets == 60
