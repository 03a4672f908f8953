"""Claims about wheel odometry: geometry, roll-over, lost samples, restarts, covariances."""

import math
from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lodeline.odometry import (
    DifferentialDrive,
    Odometry,
    OdometryEstimate,
    OdometryParams,
    count_difference,
)

LAB = OdometryParams()  # 360 counts a turn, radius 21.5 mm, track 112 mm
TREMBLE = [(0, 0), (6, -5), (-4, 3), (0, 0), (-7, -7), (0, 0), (9, 0)]
MS = 1_000_000


def driven(
    params: OdometryParams, samples: list[tuple[int, int, int]]
) -> tuple[Odometry, list[OdometryEstimate]]:
    odometry = Odometry(params)
    estimates = [odometry.update(*sample) for sample in samples]
    return odometry, [estimate for estimate in estimates if estimate is not None]


@pytest.mark.parametrize("bits", [8, 14, 16, 32])
def test_a_turn_over_the_end_of_the_counter_is_a_small_step(bits: int) -> None:
    top = (1 << bits) - 1
    assert count_difference(2, top - 2, bits) == 5
    assert count_difference(top - 2, 2, bits) == -5


@given(
    bits=st.sampled_from([8, 14, 16, 32]),
    steps=st.lists(st.floats(-0.49, 0.49), min_size=1, max_size=50),
)
def test_no_count_is_lost_for_steps_below_half_the_range(bits: int, steps: list[float]) -> None:
    true = measured = 0
    for share in steps:
        step = int(share * (1 << bits))
        new = true + step
        measured += count_difference(new % (1 << bits), true % (1 << bits), bits)
        true = new
    assert measured == true


def test_a_counter_needs_two_bits() -> None:
    with pytest.raises(ValueError, match="at least 2 bits"):
        count_difference(0, 1, 1)


def test_one_turn_of_both_wheels_goes_one_circumference_ahead() -> None:
    _, (_, last) = driven(LAB, [(0, 0, 0), (1000 * MS, 360, 360)])
    assert last.x == pytest.approx(2 * math.pi * 0.0215, abs=1e-12)
    assert (last.y, last.yaw) == (0.0, 0.0)
    assert last.v == pytest.approx(2 * math.pi * 0.0215, abs=1e-12)


def test_gear_and_sign_of_a_mounted_motor_count() -> None:
    # the lecture's larger robot: 400 counts a motor turn, 150 motor turns a wheel turn
    drive = DifferentialDrive(0.14457758, 0.3045, 400.0, 150.0, left_sign=1, right_sign=-1)
    left, right = drive.travel(60_000, -60_000)
    assert left == right == pytest.approx(2 * math.pi * 0.14457758)
    ds, dtheta = drive.motion(left, right)
    assert ds == pytest.approx(0.9084, abs=1e-4)
    assert dtheta == 0.0


@given(left=st.floats(-1, 1), right=st.floats(-1, 1))
def test_wheels_of_a_motion_make_that_motion(left: float, right: float) -> None:
    drive = DifferentialDrive()
    assert drive.wheels(*drive.motion(left, right)) == pytest.approx((left, right), abs=1e-12)


def test_turning_left_is_positive_and_k_matrix_agrees() -> None:
    drive = DifferentialDrive()
    k00, k01, k10, k11 = drive.k_matrix
    right_rate, left_rate = 3.0, 1.0  # rad/s
    ds, dtheta = drive.motion(left_rate * 0.0215, right_rate * 0.0215)
    assert dtheta > 0.0
    assert k00 * right_rate + k01 * left_rate == pytest.approx(ds)
    assert k10 * right_rate + k11 * left_rate == pytest.approx(dtheta)


def test_midpoint_closes_a_coarse_circle_ten_times_better_than_euler() -> None:
    # 12 steps of 30 degrees; the exact way ends where it began
    drive = DifferentialDrive(ticks_per_turn=360_000.0)
    errors = {}
    for method in ("midpoint", "euler"):
        params = replace(LAB, ticks_per_turn=360_000.0, method=method)
        odometry = Odometry(params)
        odometry.update(0, 0, 0)
        left, right = drive.wheels(0.5 * 2 * math.pi / 12, 2 * math.pi / 12)
        for i in range(1, 7):  # half the circle: 1.0 m away from the start
            counts = (round(i * way / drive.metres_per_tick) for way in (left, right))
            odometry.update(i * 1000 * MS, *counts)
        errors[method] = math.hypot(odometry.state.x, odometry.state.y - 1.0)
    assert errors["midpoint"] < 0.012
    assert errors["euler"] > 0.2


def test_a_lost_sample_costs_resolution_not_way() -> None:
    samples = [(i * 50 * MS, 7 * i, 9 * i) for i in range(41)]
    whole, _ = driven(LAB, samples)
    gappy, _ = driven(LAB, samples[:10] + samples[14:20] + samples[21:])
    assert gappy.state.x == pytest.approx(whole.state.x, abs=2e-5)
    assert gappy.state.y == pytest.approx(whole.state.y, abs=2e-5)
    assert gappy.state.yaw == pytest.approx(whole.state.yaw, abs=1e-12)
    assert gappy.state.resets == 0


def test_the_first_reading_is_only_the_reference() -> None:
    odometry = Odometry(LAB)
    first = odometry.update(5, 123_456, -77)
    assert first is not None
    assert (first.x, first.y, first.yaw, first.interval, first.resets) == (0, 0, 0, 0, 0)
    assert first.covariance == (0.0,) * 9


def test_time_that_stands_still_is_refused() -> None:
    odometry, _ = driven(LAB, [(0, 0, 0), (50 * MS, 5, 5)])
    before = odometry.state
    assert odometry.update(50 * MS, 6, 6) is None
    assert odometry.update(20 * MS, 6, 6) is None
    assert odometry.state == replace(before, refused=2)


@pytest.mark.parametrize(("left", "right"), [(900, 20), (20, -700), (10_000_000, 10_000_000)])
def test_a_jump_faster_than_the_wheels_never_moves_the_pose(left: int, right: int) -> None:
    odometry, estimates = driven(LAB, [(0, 0, 0), (50 * MS, 10, 10)])
    jumped = odometry.update(100 * MS, left, right)
    assert jumped is not None
    assert (jumped.x, jumped.y, jumped.yaw) == (
        estimates[-1].x,
        estimates[-1].y,
        estimates[-1].yaw,
    )
    assert (jumped.resets, jumped.interval) == (1, 0.0)
    after = odometry.update(150 * MS, left + 10, right + 10)
    assert after is not None
    assert after.x - jumped.x == pytest.approx(10 / 360 * 2 * math.pi * 0.0215, abs=1e-9)


@given(st.lists(st.tuples(st.integers(-(10**9), 10**9), st.integers(-(10**9), 10**9)), max_size=30))
def test_no_step_is_longer_than_full_speed_allows(counts: list[tuple[int, int]]) -> None:
    odometry = Odometry(LAB)
    x = y = 0.0
    for i, (left, right) in enumerate(counts):
        estimate = odometry.update(i * 50 * MS, left, right)
        assert estimate is not None
        two_counts = 2 * LAB.drive.metres_per_tick
        assert math.hypot(estimate.x - x, estimate.y - y) <= 2.0 * 0.05 + two_counts + 1e-9
        x, y = estimate.x, estimate.y


@pytest.mark.parametrize("ahead", [1, -1])
@pytest.mark.parametrize("samples", [3, 5])
def test_an_encoder_that_restarts_at_zero_slowly_is_still_noticed(ahead: int, samples: int) -> None:
    # 10 or 20 counts back within 50 ms are a possible speed, but not for wheels going ahead
    odometry, _ = driven(LAB, [(i * 50 * MS, ahead * 5 * i, ahead * 5 * i) for i in range(samples)])
    x = odometry.state.x
    restarted = odometry.update(250 * MS, 0, 0)
    assert restarted is not None
    assert (restarted.x, restarted.resets) == (x, 1)


def test_a_robot_that_drives_back_over_zero_is_not_taken_for_a_restart() -> None:
    odometry, estimates = driven(LAB, [(i * 50 * MS, 50 - 5 * i, 50 - 5 * i) for i in range(20)])
    assert odometry.state.resets == 0
    way = 5 * 19 / 360 * 2 * math.pi * 0.0215
    assert estimates[-1].x == pytest.approx(-way, abs=1e-9)


def test_a_fine_encoder_that_trembles_about_zero_is_not_taken_for_a_restart() -> None:
    fine = OdometryParams(ticks_per_turn=16384.0)
    tremble = [(i * 10 * MS, left, right) for i, (left, right) in enumerate(TREMBLE * 20)]
    odometry, estimates = driven(fine, tremble)
    assert odometry.state.resets == 0
    assert abs(estimates[-1].x) < 1e-4


def test_a_parked_robot_gets_no_less_sure() -> None:
    odometry, _ = driven(LAB, [(0, 0, 0), (1000 * MS, 300, 400)])
    parked = odometry.state.covariance
    for i in range(2, 100):
        odometry.update(i * 1000 * MS, 300, 400)
    assert odometry.state.covariance == parked


def test_5_hz_and_20_hz_grow_the_same_doubt() -> None:
    samples = [(i * 50 * MS, 8 * i, 10 * i) for i in range(81)]
    fast, _ = driven(LAB, samples)
    slow, _ = driven(LAB, samples[::4])
    assert slow.state.covariance == pytest.approx(fast.state.covariance, rel=0.02, abs=1e-9)


def test_the_lab_form_has_the_same_twist_covariance_at_any_speed() -> None:
    params = replace(LAB, wheel_noise="rate", rate_noise=0.1)
    _, estimates = driven(params, [(0, 0, 0), (50 * MS, 10, 0), (100 * MS, 10, 0)])
    r, e = 0.0215, 0.112
    expected = (2 * (r / 2 * 0.1) ** 2, 0.0, 0.0, 2 * (r / e * 0.1) ** 2)
    assert estimates[1].twist_covariance == pytest.approx(expected, abs=1e-18)
    assert estimates[2].twist_covariance == pytest.approx(expected, abs=1e-18)


def test_the_pose_covariance_is_that_of_noisy_wheels() -> None:
    """Monte Carlo: 1000 noisy runs of a bent way scatter as the covariance says, within 12 %."""
    rng, params = Random(1), replace(LAB, ticks_per_turn=3.6e6, distance_noise=1e-5)
    tick = params.drive.metres_per_tick
    left_way, right_way, steps = 0.010, 0.012, 40
    ends = []
    for _ in range(1000):
        odometry = Odometry(params)
        odometry.update(0, 0, 0)
        left = right = 0.0
        for i in range(1, steps + 1):
            left += left_way + rng.gauss(0.0, math.sqrt(1e-5 * left_way))
            right += right_way + rng.gauss(0.0, math.sqrt(1e-5 * right_way))
            odometry.update(i * 100 * MS, round(left / tick), round(right / tick))
        ends.append((odometry.state.x, odometry.state.y, odometry.state.yaw))
    said = odometry.state.covariance
    means = [sum(end[k] for end in ends) / len(ends) for k in range(3)]
    for k in range(3):
        scatter = sum((end[k] - means[k]) ** 2 for end in ends) / (len(ends) - 1)
        assert math.sqrt(said[4 * k]) == pytest.approx(math.sqrt(scatter), rel=0.12)


def test_a_restored_odometry_goes_on_without_a_jump() -> None:
    samples = [(i * 50 * MS, 7 * i, 9 * i) for i in range(20)]
    whole, _ = driven(LAB, samples)
    first, _ = driven(LAB, samples[:10])
    second = Odometry(LAB)
    second.resume(first.state)
    for sample in samples[10:]:
        second.update(*sample)
    assert second.state == whole.state


@pytest.mark.parametrize(
    "wrong",
    [
        {"track": 0.0},
        {"wheel_radius": -0.02},
        {"left_sign": 2},
        {"distance_noise": -1.0},
        {"max_wheel_speed": 0.0},
        {"counter_bits": 1},
    ],
)
def test_parameters_that_make_no_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must|at least"):
        replace(LAB, **wrong)  # type: ignore[arg-type]
