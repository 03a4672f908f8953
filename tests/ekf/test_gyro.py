"""Claims about what is kept of the gyro: turns between any two moments, whatever the order."""

import math
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lodeline.ekf import Localizer, LocalizerParams
from lodeline.ekf.gyro import CAPACITY, LONG, Gyro
from lodeline.ekf.samples import Spin
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
        assert one.lift(end) == other.lift(end)
    assert one.lift(1_800 * MS).lifted


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
