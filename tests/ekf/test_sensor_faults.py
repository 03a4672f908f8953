"""Claims about faults of IMU and clock, through attitude and EKF together: what they may cost."""

import math
from random import Random

import pytest

from lodeline.attitude.base import GRAVITY
from lodeline.attitude.soft import Soft
from lodeline.ekf import Localizer, LocalizerParams
from lodeline.odometry import Odometry, OdometryParams

MS = 1_000_000
WHEELS = OdometryParams(ticks_per_turn=16384, distance_noise=2e-5)
PARAMS = LocalizerParams(
    initial_pose=(0.0, 0.0, 0.0),
    initial_sigma=(0.002, 0.05),
    magnet_model="none",
    heading="on",
    heading_interval=1.0,
)
NORTH, DOWN = 20e-6, -45e-6  # T
GYRO_NOISE, FORCE_NOISE, FIELD_NOISE = 0.002, 0.03, 0.3e-6  # of one sample


class Robot:
    """Turns on the spot at given rates: wheels at 50 Hz, IMU at 200 Hz, field at 100 Hz."""

    def __init__(self, seed: int, gyro_range: float = math.inf) -> None:
        self._rng, self._range = Random(seed), gyro_range
        self.attitude, self.localizer = Soft(), Localizer(PARAMS)
        self._odometry, self._ways, self.yaw, self.i = Odometry(WHEELS), [0.0, 0.0], 0.0, 0
        self._last_s = self._rate = 0.0
        self.strength = 1.0

    def go(self, rate: float) -> None:
        """5 ms at a rate [rad/s]; a gyro at its end gives no sample, as its driver drops it."""
        rng, now_s = self._rng, 0.005 * self.i
        gauss = rng.gauss
        if abs(rate) < self._range:
            c, s = math.cos(self.yaw), math.sin(self.yaw)
            k = self.strength * NORTH
            field = (k * s, k * c, self.strength * DOWN)
            self.attitude.update(
                now_s - self._last_s,
                (gauss(0, GYRO_NOISE), gauss(0, GYRO_NOISE), rate + gauss(0, GYRO_NOISE)),
                (gauss(0, FORCE_NOISE), gauss(0, FORCE_NOISE), GRAVITY + gauss(0, FORCE_NOISE)),
                tuple(each + gauss(0, FIELD_NOISE) for each in field) if self.i % 2 == 0 else None,  # type: ignore[arg-type]
            )
            self._last_s = now_s
            stamp = round(now_s * 1e9)
            a = self.attitude
            rates = a.unbiased(a.state.rate)
            self.localizer.attitude(
                stamp, a.orientation, rates, a.heading_std, disturbed=a.disturbed
            )
        if self.i % 4 == 0:
            tick = WHEELS.drive.metres_per_tick
            left, right = (round(way / tick) for way in self._ways)
            out = self._odometry.update(self.i * 5 * MS, left, right)
            assert out is not None
            pose = (out.x, out.y, out.yaw)
            self.localizer.odometry(
                out.stamp_ns, *pose, out.twist_covariance, out.interval, out.resets
            )
        self._rate = rate
        self.yaw += 0.005 * rate
        for side, sign in enumerate((-1.0, 1.0)):
            self._ways[side] += sign * 0.5 * WHEELS.drive.track * 0.005 * rate
        self.i += 1

    def error(self) -> tuple[float, float]:
        """Error of the yaw at the last odometry and its standard deviation [rad]."""
        estimate = self.localizer.estimate
        assert estimate is not None
        behind = self.i - estimate.stamp_ns / (5 * MS)
        true = self.yaw - 0.005 * behind * self._rate
        off = abs(math.remainder(estimate.yaw - true, 2 * math.pi))
        return off, math.sqrt(estimate.covariance[8])


def test_a_field_five_times_too_strong_for_6_s_costs_less_than_2_degrees() -> None:
    """S6: and two seconds after it the compass corrects again."""
    robot = Robot(1)
    worst = {"before": 0.0, "during": 0.0}
    for i in range(6_000):
        during = 3_000 <= i < 4_200
        robot.strength = 5.0 if during else 1.0
        robot.go(0.6 * math.sin(0.002 * i))
        if i > 400:
            part = "before" if i < 3_000 else "during"
            worst[part] = max(worst[part], robot.error()[0])
        if 3_020 <= i < 4_200:
            assert robot.attitude.disturbed
            assert robot.localizer.state.track.compass_ns < 3_020 * 5 * MS  # type: ignore[operator]
        if i == 4_200 + 400:
            assert not robot.attitude.disturbed
            assert robot.localizer.state.track.compass_ns > 4_200 * 5 * MS  # type: ignore[operator]
    print({part: round(math.degrees(error), 2) for part, error in worst.items()})
    assert worst["during"] - worst["before"] < math.radians(2.0)


@pytest.mark.parametrize("top", [5.0, 8.0])
def test_in_a_spin_beyond_the_gyro_s_range_the_doubt_covers_the_error(top: float) -> None:
    """S9: 250 deg/s are 4.36 rad/s; the samples at its end are missing."""
    robot = Robot(2, gyro_range=4.36)
    for i in range(2_400):
        t = 0.005 * i
        robot.go(top * max(0.0, min(1.0, 4.0 * (t - 3.0), 4.0 * (5.0 - t))))
        if i > 400 and i % 4 == 1:
            off, sigma = robot.error()
            assert off < 3.0 * sigma + 0.005, (t, off, sigma)


@pytest.mark.parametrize("step_s", [-600, 600, 1_700_000_000])
def test_whatever_the_wall_clock_says_the_pose_is_the_same(step_s: int) -> None:
    """T3: stamps count from another day, nothing else changes, to 1e-9."""

    def driven(origin_ns: int) -> tuple[float, ...]:
        rng, localizer = Random(3), Localizer(LocalizerParams())
        for i in range(400):
            stamp = origin_ns + i * 50 * MS
            x, yaw = 0.006 * i, 0.3 * math.sin(0.02 * i)
            localizer.odometry(stamp, x, 0.1 * yaw, yaw, (1e-4, 0.0, 0.0, 1e-3), 0.05, 0)
            level = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
            rates = (0.0, 0.0, 0.12 * math.cos(0.02 * i))
            localizer.attitude(stamp + 7 * MS, level, rates, 0.02, disturbed=False)
            localizer.magnets(stamp - 9 * MS, (rng.uniform(-0.03, 0.03),) if i % 9 < 3 else ())
        estimate = localizer.estimate
        assert estimate is not None
        return (estimate.x, estimate.y, estimate.yaw, *estimate.covariance)

    day = 1_000_000_000 * 1_000_000_000
    assert driven(day + step_s * 1_000_000_000) == pytest.approx(driven(day), abs=1e-9)
