"""Claims about what is kept of the gyro: turns between any two moments, whatever the order."""

import math
from collections.abc import Iterable
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lodeline.ekf import Estimate, Localizer, LocalizerParams
from lodeline.ekf.gyro import CAPACITY, LONG, Gyro
from lodeline.ekf.lift import Lift
from lodeline.ekf.samples import Spin
from lodeline.odometry import Odometry, OdometryParams
from lodeline.rotation import from_euler

MS = 1_000_000
NOISE, WANDER = 4e-6, 1.0  # rad^2/s, rad^2/s^3


def swinging(count: int, tilt: float = 0.0) -> list[Spin]:
    """Every 5 ms a rate [rad/s] that swings slowly."""
    return [Spin(1_000 * MS + i * 5 * MS, math.sin(0.05 * i), tilt) for i in range(count)]


def told(spins: list[Spin]) -> Gyro:
    gyro = Gyro(NOISE, WANDER)
    for spin in spins:
        assert gyro.add(spin)
    return gyro


def driven(
    localizer: Localizer,
    wheels: Iterable[int],
    gyro: Iterable[int],
    rate: float = 0.0,
    tilted: range = range(0),
) -> Estimate:
    """A robot at rest by its wheels, by stamps [ms]; what is told at the end."""
    arrivals = sorted([(at, 0) for at in wheels] + [(at, 1) for at in gyro])
    for at, kind in arrivals:
        if kind == 0:
            yaw = rate * at * 1e-3
            localizer.odometry(at * MS, 0.0, 0.0, yaw, (1e-5, 0.0, 0.0, 1e-2), 0.01, 0)
        else:
            orientation = from_euler(0.6 if at in tilted else 0.0, 0.0, 0.0)
            localizer.attitude(at * MS, orientation, (0.0, 0.0, rate), 0.1, disturbed=False)
    estimate = localizer.estimate
    assert estimate is not None
    return estimate


def test_a_turn_is_the_sum_of_rates_over_the_times_for_which_each_is_the_last() -> None:
    gyro = told([Spin(0, 1.0, 0.0), Spin(10 * MS, 1.2, 0.0), Spin(20 * MS, 0.9, 0.0)])
    turn = gyro.over(5 * MS, 26 * MS)
    assert turn is not None
    assert turn.angle == pytest.approx(0.005 * 1.0 + 0.010 * 1.2 + 0.006 * 0.9, abs=1e-15)
    unseen = (0.010**3 - 0.005**3) + 0.010**3 + 0.006**3
    assert turn.variance == pytest.approx(NOISE * 0.021 + WANDER * unseen / 3.0, rel=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.randoms(use_true_random=False))
def test_readings_in_any_order_give_the_same_turns_and_the_same_lift(rng: Random) -> None:
    spins = swinging(60) + [each._replace(stamp_ns=each.stamp_ns + 301 * MS, tilt=0.5)
                            for each in swinging(90)]  # fmt: skip
    spins[20] = spins[20]._replace(rate=30.0)  # a spike
    shuffled = spins[:]
    rng.shuffle(shuffled)
    one, other = told(spins), told(shuffled)
    for _ in range(20):
        begin, end = sorted(rng.randrange(1_000 * MS, 1_800 * MS) for _ in range(2))
        assert one.over(begin, end) == other.over(begin, end)
        assert one.lifted(begin, end) == other.lifted(begin, end)
    assert one.lifted(1_000 * MS, 1_800 * MS) == (Lift(1_301 * MS, lifted=True), True)


def test_a_lone_spike_turns_nothing() -> None:
    spins = swinging(40)
    calm = told(spins).over(spins[0].stamp_ns, spins[39].stamp_ns)
    spins[20] = spins[20]._replace(rate=30.0)
    spiked = told(spins).over(spins[0].stamp_ns, spins[39].stamp_ns)
    assert calm is not None and spiked is not None
    assert spiked.angle == pytest.approx(calm.angle, abs=0.3 * 0.005)  # rad: the rate before it


def test_it_knows_nothing_before_the_first_reading_nor_50_ms_after_the_last() -> None:
    spins = swinging(3)
    gyro, first, last = told(spins), spins[0].stamp_ns, spins[2].stamp_ns
    assert gyro.over(first - MS, last) is None
    assert gyro.seam(first - MS, last) == first
    assert gyro.over(last + 50 * MS, last + 60 * MS) is not None
    assert gyro.over(last + 51 * MS, last + 60 * MS) is None
    assert gyro.seam(last + 51 * MS, last + 60 * MS) is None


def test_a_duplicate_is_told() -> None:
    gyro = told(swinging(3))
    assert not gyro.add(swinging(2)[1])


def test_what_is_forgotten_changes_no_later_turn() -> None:
    spins = swinging(1000)
    gyro = told(spins)
    begin, end = spins[700].stamp_ns + MS, spins[900].stamp_ns + MS
    before = gyro.over(begin, end)
    gyro.forget(begin)
    assert gyro.over(begin, end) == before
    assert len(gyro._stamps) < 310


def test_an_hour_without_readings_spoils_no_digits() -> None:
    """The turn of 5 ms, good to a millionth of it, and its variance to a percent."""
    hour = 3_600_000 * MS
    spins = swinging(2) + [each._replace(stamp_ns=each.stamp_ns + hour) for each in swinging(3)]
    turn = told(spins).over(spins[2].stamp_ns, spins[3].stamp_ns)
    fresh = told(spins[2:]).over(spins[2].stamp_ns, spins[3].stamp_ns)
    assert turn is not None and fresh is not None
    assert turn.angle == pytest.approx(fresh.angle, abs=1e-9)
    assert turn.variance == pytest.approx(fresh.variance, rel=0.01)
    assert LONG < 3600.0


def test_a_gyro_without_wheels_fills_no_memory() -> None:
    localizer = Localizer(LocalizerParams())
    for i in range(3 * CAPACITY):
        localizer.attitude(i * 5 * MS, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.1), 0.1, disturbed=False)
    assert len(localizer._gyro._stamps) <= CAPACITY
    assert localizer.estimate is None


@pytest.mark.parametrize("late_by_ns", [7 * MS, 400 * MS])
def test_a_gyro_that_comes_late_counts_as_if_it_had_been_in_time(late_by_ns: int) -> None:
    """Wheels at 100 Hz that see half of the turn, the gyro at 200 Hz the whole of it."""
    arrivals: list[tuple[int, int, int]] = []
    for i in range(200):
        arrivals.append((i * 5 * MS + late_by_ns, 1, i * 5 * MS))
        if i % 2 == 0:
            arrivals.append((i * 5 * MS, 0, i * 5 * MS))
    in_time, late = Localizer(LocalizerParams()), Localizer(LocalizerParams())
    for localizer, order in ((in_time, sorted(arrivals, key=lambda each: (each[2], -each[1]))),
                             (late, sorted(arrivals))):  # fmt: skip
        for _, kind, stamp_ns in order:
            angle = 0.4 * stamp_ns * 1e-9  # rad
            if kind == 0:
                yaw = 0.5 * angle
                localizer.odometry(stamp_ns, 0.1 * angle, 0.0, yaw, (1e-5, 0, 0, 1e-2), 0.01, 0)
            else:
                rates = (0.0, 0.0, 0.4)
                localizer.attitude(stamp_ns, from_euler(0, 0, angle), rates, 0.1, disturbed=False)
    a, b = in_time.estimate, late.estimate
    assert a is not None and b is not None
    assert late.late == 0
    assert a.yaw == pytest.approx(0.4 * 0.99, rel=0.02)  # rad
    assert (b.x, b.y, b.yaw) == pytest.approx((a.x, a.y, a.yaw), abs=1e-12)
    assert b.covariance == pytest.approx(a.covariance, rel=1e-9)


@pytest.mark.parametrize("hz", [1, 3, 10, 100])
def test_a_lift_is_noticed_however_seldom_the_wheels_are_read(hz: int) -> None:
    """In a hand for 0.44 s, which may begin and end between two readings of the wheels."""
    wheels = [i * 1000 // hz for i in range(5 * hz + 1)]
    told = driven(Localizer(LocalizerParams()), wheels, range(0, 5000, 5), 0.0, range(2040, 2480))
    assert told.alarms == 1


def test_a_robot_carried_while_no_wheels_were_read_was_moved() -> None:
    wheels = [*range(0, 2000, 10), *range(5000, 5200, 10)]
    told = driven(Localizer(LocalizerParams()), wheels, range(0, 5200, 5), 0.0, range(2500, 4500))
    assert told.alarms == 1


def test_tilted_before_it_knows_any_wheels_it_was_not_moved() -> None:
    wheels, gyro = range(1000, 1200, 10), range(0, 1000, 5)
    assert driven(Localizer(LocalizerParams()), wheels, gyro, 0.0, range(1000)).alarms == 0


def test_what_ties_the_constants_to_the_pose_ends_with_a_lift() -> None:
    localizer = Localizer(LocalizerParams(wheel_sigma=(0.01, 0.01)))
    driven(localizer, range(0, 2000, 10), range(0, 2000, 5), 0.2)
    before = localizer.state.track.learned
    assert before is not None and max(map(abs, before.cross)) > 1e-9
    told = driven(localizer, range(2000, 2400, 10), range(2000, 2400, 5), 0.2, range(2000, 2330))
    after = localizer.state.track.learned
    assert told.alarms == 1
    assert after is not None and max(map(abs, after.cross)) < 0.3 * max(map(abs, before.cross))


@pytest.mark.parametrize("hours", [1, 720, 470_000])
def test_a_clock_that_jumps_ahead_costs_metres_and_no_more(hours: int) -> None:
    """As on a board without a clock of its own, which learns the time once it has a network.

    The robot stands, and its gyro is off by 0.1 deg/s: so it would have turned, by its readings.
    """
    localizer, jump = Localizer(LocalizerParams()), hours * 3_600_000
    for at in [*range(0, 2000, 10), *range(jump, jump + 2000, 10)]:
        rates = (0.0, 0.0, 0.002)
        localizer.attitude(at * MS, (0.0, 0.0, 0.0, 1.0), rates, 0.1, disturbed=False)
        localizer.odometry(at * MS, 0.0, 0.0, 0.0, (1e-6, 0.0, 0.0, 1e-6), 0.01, 0)
    told = localizer.estimate
    assert told is not None
    assert not told.slipping
    assert math.sqrt(told.covariance[0]) < 10.0  # m


@pytest.mark.parametrize("wheels_first", [False, True])
def test_a_gyro_whose_clock_was_ahead_is_used_again_and_costs_no_more(wheels_first: bool) -> None:
    """30 s by a clock an hour ahead, then right: the gyro sees 0.4 rad/s, the wheels half of it."""
    localizer, ahead = Localizer(LocalizerParams()), range(3_600_000, 3_630_000, 5)
    if wheels_first:
        driven(localizer, range(0, 1000, 10), [])
    for at in ahead:
        localizer.attitude(at * MS, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.1, disturbed=False)
    for i in range(800):
        at = (1000 + 5 * i) * MS
        if i % 2 == 0:
            localizer.odometry(at, 0.0, 0.0, 0.001 * i, (1e-5, 0.0, 0.0, 1e-2), 0.01, 0)
        localizer.attitude(at, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.4), 0.1, disturbed=False)
    told = localizer.estimate
    assert told is not None
    # of 4 s the first is the wheels', for so long the gyro's stamps may be mere latecomers
    assert told.yaw == pytest.approx(0.2 * 1.0 + 0.4 * 3.0, abs=0.05)  # rad
    assert 190 < localizer.late < 210


def test_headings_that_wait_in_vain_are_counted() -> None:
    localizer = Localizer(LocalizerParams(heading="on"))
    driven(localizer, [0], range(5, 15_000, 5))
    assert localizer.refused == 2999 - 2048


def gap_score(hole_s: float, runs: int) -> tuple[float, float]:
    """NEES of (x, y), 2 for honest ones, and rms error [m] after a hole in the encoders' samples.

    Wheels at 100 Hz but for it, a gyro that goes on, a turn that wanders, no magnets.
    """
    drive, step = OdometryParams().drive, 0.005
    nees = squares = 0.0
    for seed in range(runs):
        rng, params = Random(seed), LocalizerParams(initial_sigma=(1e-4, 1e-4))
        localizer, wheels = Localizer(params), Odometry(OdometryParams())
        x = y = yaw = rate = left = right = 0.0
        for i in range(500):
            if i % 2 == 0 and not 200 < i < 200 + hole_s / step:
                ticks = (round(way / drive.metres_per_tick) for way in (left, right))
                out = wheels.update(i * 5 * MS, *ticks)
                assert out is not None
                pose, covariance = (out.x, out.y, out.yaw), out.twist_covariance
                localizer.odometry(i * 5 * MS, *pose, covariance, out.interval, out.resets)
                at = x, y
            rates = (0.0, 0.0, rate)
            localizer.attitude(i * 5 * MS, (0.0, 0.0, 0.0, 1.0), rates, 0.1, disturbed=False)
            course = yaw + 0.5 * rate * step
            x, y = x + 0.3 * step * math.cos(course), y + 0.3 * step * math.sin(course)
            yaw += rate * step
            ways = drive.wheels(0.3 * step, rate * step)
            left, right = left + ways[0], right + ways[1]
            rate += rng.gauss(0.0, math.sqrt(step)) - rate * step
        told = localizer.estimate
        assert told is not None
        dx, dy, p = told.x - at[0], told.y - at[1], told.covariance
        nees += (p[4] * dx * dx - 2 * p[1] * dx * dy + p[0] * dy * dy) / (p[0] * p[4] - p[1] ** 2)
        squares += dx * dx + dy * dy
    return nees / runs, math.sqrt(squares / runs)


@pytest.mark.parametrize("hole_s", [0.5, 1.0])
def test_a_way_whose_wheels_nobody_read_bends_as_the_gyro_saw_it(hole_s: float) -> None:
    nees, error = gap_score(hole_s, 40)
    assert nees < 4.0
    assert error < 0.012  # m
